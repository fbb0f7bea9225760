"""The exact redirection, in f64, from the warp that bake writes: the truth that renders are compared with.

The warp W is known at the nodes of the grid. Between them it is affine on two triangles per cell, into which the diagonal
from the lower left to the upper right corner splits it (docs/method.md, section 9). A texture is looked up at the
redirection of a UV, which is W's inverse there. This file shares no code with the library.
"""

import numpy as np
import OpenImageIO as oiio


def read(path):
    """The pixels of an image file as f64, shape (height, width, channels), first row at the top."""
    image = oiio.ImageBuf(str(path))
    if image.has_error:
        raise OSError(f"{path}: {image.geterror()}")
    return image.get_pixels(oiio.FLOAT).astype(np.float64)


def write(path, pixels, names=None, half=False, attributes=()):
    """Writes pixels of shape (height, width, channels); 8 bits into a PNG, f32 or f16 into an EXR."""
    height, width, channels = pixels.shape
    eight = str(path).endswith(".png")
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT8 if eight else oiio.HALF if half else oiio.FLOAT)
    spec.channelnames = names or ["R", "G", "B", "A"][:channels]
    for key, value in dict(attributes).items():
        spec.attribute(key, value)
    data = np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8) if eight else pixels.astype(np.float32)
    out = oiio.ImageOutput.create(str(path))
    if out is None or not out.open(str(path), spec) or not out.write_image(np.ascontiguousarray(data)):
        raise OSError(f"{path}: {out.geterror() if out else oiio.geterror()}")
    out.close()


def bilinear(image, uv, repeat=False):
    """Bilinear lookups with v up, in f64; clamped at the edges unless `repeat`."""
    height, width = image.shape[:2]
    x = uv[..., 0] * width - 0.5
    y = (1.0 - uv[..., 1]) * height - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]

    def fold(i, n):
        i = i.astype(np.int64)
        return i % n if repeat else np.clip(i, 0, n - 1)

    xs, ys = (fold(x0, width), fold(x0 + 1, width)), (fold(y0, height), fold(y0 + 1, height))
    top = image[ys[0], xs[0]] * (1 - fx) + image[ys[0], xs[1]] * fx
    return top * (1 - fy) + (image[ys[1], xs[0]] * (1 - fx) + image[ys[1], xs[1]] * fx) * fy


def centres(width, height):
    """UVs of the texel centres of an image, first row at the top."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    return np.stack([u, v], -1)


class Warp:
    """W of one tile, within the tile's unit square."""

    def __init__(self, path):
        self.at_nodes = read(path)[::-1, :, :2]  # from here on the first row is v = 0
        self.cells = np.array([self.at_nodes.shape[1] - 1, self.at_nodes.shape[0] - 1])

    def _affine(self, x):
        """The affine map of the triangle that holds x, given in cells: W(x) = corner + (x - cell) @ matrix."""
        cell = np.clip(np.floor(x).astype(np.int64), 0, self.cells - 1)
        f = x - cell
        i, j = cell[:, 0], cell[:, 1]
        w = self.at_nodes
        c00, c10, c01, c11 = w[j, i], w[j, i + 1], w[j + 1, i], w[j + 1, i + 1]
        lower = (f[:, 0] >= f[:, 1])[:, None]
        return cell, c00, np.where(lower, c10 - c00, c11 - c01), np.where(lower, c11 - c10, c01 - c00)

    def forward(self, uv):
        x = uv * self.cells
        cell, corner, du, dv = self._affine(x)
        f = x - cell
        return corner + f[:, :1] * du + f[:, 1:] * dv

    def inverse(self, uv, jacobian=False):
        """The redirection of UVs of shape (n, 2); with `jacobian` also d u'/du, d u'/dv, d v'/du, d v'/dv.

        Newton's method on the piecewise affine function: it has found the exact inverse as soon as the solution of a
        triangle's affine map lies in that triangle. The residual of every point is checked.
        """
        x = np.array(uv, np.float64) * self.cells
        rate = np.full(len(x), 1.0)
        best, error = x.copy(), np.full(len(x), np.inf)
        todo = np.arange(len(x))
        for step in range(80):
            at = x[todo]
            cell, corner, du, dv = self._affine(at)
            f = at - cell
            missing = uv[todo] - (corner + f[:, :1] * du + f[:, 1:] * dv)
            size = np.abs(missing).max(1)
            better = size < error[todo]
            best[todo[better]], error[todo[better]] = at[better], size[better]
            left = size > 1e-13
            # Between triangles the plain step can go to and fro for ever; a shorter one ends that.
            rate[todo] = np.where(better | (step < 20), rate[todo], rate[todo] * 0.7)
            todo, missing, du, dv, at = todo[left], missing[left], du[left], dv[left], at[left]
            if not len(todo):
                break
            det = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
            a = (missing[:, 0] * dv[:, 1] - missing[:, 1] * dv[:, 0]) / det
            b = (du[:, 0] * missing[:, 1] - du[:, 1] * missing[:, 0]) / det
            move = np.stack([a, b], -1) * rate[todo, None]
            length = np.abs(move).max(1, keepdims=True)
            move *= np.minimum(1, 8 / np.maximum(length, 1e-30))
            x[todo] = np.clip(at + move, 0, self.cells)
        # A few points in a million lie where Newton's method goes round in circles.
        for k in np.flatnonzero(error > 1e-9):
            best[k] = self._search(uv[k])
            error[k] = np.abs(self.forward(best[k : k + 1] / self.cells) - uv[k]).max()
        if error.max(initial=0) > 1e-9:
            raise ArithmeticError(f"{(error > 1e-9).sum()} of {len(x)} UVs not inverted, worst residual {error.max()}")
        out = best / self.cells
        if not jacobian:
            return out
        _, _, du, dv = self._affine(best)
        du, dv = du * self.cells[0], dv * self.cells[1]
        det = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
        return out, np.stack([dv[:, 1], -dv[:, 0], -du[:, 1], du[:, 0]], -1) / det[:, None]

    def _search(self, uv):
        """The same for one UV, in cells, by a look at all triangles."""
        w = self.at_nodes
        c00, c10, c01, c11 = w[:-1, :-1], w[:-1, 1:], w[1:, :-1], w[1:, 1:]
        for du, dv, sign in (c10 - c00, c11 - c10, 1), (c11 - c01, c01 - c00, -1):
            missing = uv - c00
            det = du[..., 0] * dv[..., 1] - du[..., 1] * dv[..., 0]
            a = (missing[..., 0] * dv[..., 1] - missing[..., 1] * dv[..., 0]) / det
            b = (du[..., 0] * missing[..., 1] - du[..., 1] * missing[..., 0]) / det
            inside = np.minimum(np.minimum(a, b), 1 - np.maximum(a, b))
            inside = np.minimum(inside, sign * (a - b))
            j, i = np.unravel_index(np.argmax(inside), inside.shape)
            if inside[j, i] > -1e-9:
                return np.array([i + a[j, i], j + b[j, i]])
        return np.full(2, np.nan)

    def map(self, size, jacobian=False):
        """The redirection at the texel centres of a map, as vrtm fetches it."""
        uv = centres(size, size)
        if jacobian:
            return self.inverse(uv.reshape(-1, 2), True)[1].reshape(size, size, 4)
        return self.inverse(uv.reshape(-1, 2)).reshape(uv.shape)

    def texture(self, image, factor=2):
        """The texture as it has to look under the original UVs, at `factor` times the resolution so that the
        resampling shows less than what is tested."""
        uv = centres(image.shape[1] * factor, image.shape[0] * factor)
        return bilinear(image, self.inverse(uv.reshape(-1, 2)).reshape(uv.shape))
