"""A picture of a mesh to judge a bake by: at rest, in a pose with its own UVs and with redirected ones, and the strain
of what is rigid."""

import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio

from vrtm.bake import image_file, rows, sheet_figures, warped
from vrtm.bake.frames import Frame
from vrtm.bake.image_file import Target
from vrtm.bake.mesh_work import FrameResult, MeshWork
from vrtm.bake.part import TileWork
from vrtm.bake.raster import Camera, cover
from vrtm.bake.scene.images import read_colours
from vrtm.bake.scene.topology import fans
from vrtm.bake.settings import Settings
from vrtm.bake.sheet_figures import GOLD, QUIET, mix, strain_colour
from vrtm.rigidity import blurred, brightness

VERSION = 2
"""Of the way of drawing: a sheet that was drawn in another way is not up to date."""

_WIDTH, _GAP, _BAR, _LABEL = 560, 16, 44, 30
_SAMPLES = 2
"""Per pixel, along each axis."""
_SIDE = 1024
"""Texels per side at most, of what is looked up in a tile."""
_SQUARE = 22
"""Pixels of a square of the checkerboard, about."""
_PAPER = (0.80, 0.80, 0.78)
_SKIN, _STUD = ((0.115, 0.042, 0.030), (0.19, 0.08, 0.058)), (GOLD, (0.74, 0.47, 0.15))
_OVER = 2
"""Texels over which strain is measured, to either side."""


def path(settings: Settings, mesh: str, several: bool) -> str:
    return os.path.join(settings.out, f"{mesh}.sheet.png" if several else "sheet.png")


def worst(results: Sequence[FrameResult]) -> FrameResult:
    """The frame in which the most strain is left, or the most energy where strain was not measured in all of them."""
    known = [(own.after, own.before) for result in results if (own := result.strain) and math.isfinite(own.after)]
    if len(known) == len(results):
        return results[known.index(max(known))]
    return max(results, key=lambda result: sum(tile.get("energy", 0.0) for tile in result.tiles))


def write(mesh: MeshWork, frame: Frame, positions: np.ndarray, file: str, stop: Callable[[], None]) -> bool:
    """Draws a frame of a mesh, which is solved again, by itself, unless its sheet is up to date; whether it was drawn.
    Raises Failure."""
    settings = mesh.settings
    inputs = mesh.common.copy().text(VERSION, frame).array(positions)
    for texture in filter(None, map(_texture, mesh.every_tile)):
        inputs.text(warped.read(texture).inputs)
    facts: dict[str, str | int] = {"vrtm:kind": "sheet", "vrtm:mesh": mesh.shape.name, "vrtm:inputs": inputs.hex()}
    target = Target(file, 0, 0, ("R", "G", "B"), "uint8", facts, format="png")
    if image_file.up_to_date(target, settings.overwrite) is not None:
        return False
    for part in mesh.parts:
        part.solve(frame, positions, part.tiles, True, mesh.releases, False, stop)
    pixels = _drawn(_Surface(mesh, positions), f"{mesh.shape.path}, frame {frame}", stop)
    image_file.write(dataclasses.replace(target, width=pixels.shape[1], height=pixels.shape[0]), pixels)
    return True


def _drawn(surface: "_Surface", title: str, stop: Callable[[], None]) -> np.ndarray:
    camera = surface.camera()
    height = int(_WIDTH * np.clip(camera.aspect, 0.6, 1.15))
    sheet = np.empty((_BAR + 2 * (_LABEL + height) + _GAP, 3 * _WIDTH + 4 * _GAP, 3), np.float32)
    sheet[:] = _PAPER
    texts = [(_GAP, 30, 22, f"{title}: {surface.figures()}")]
    what = "strain of what is rigid"
    rest, pose = (surface.view(camera, positions, height) for positions in surface.poses)
    for number, (label, view, redirected, strain) in enumerate(
        (
            ("rest", rest, False, False),
            ("original UVs", pose, False, False),
            ("vrtm", pose, True, False),
            (f"{what}: original UVs", pose, False, True),
            (f"{what}: vrtm", pose, True, True),
        )
    ):
        stop()
        x = _GAP + (_WIDTH + _GAP) * (number if number < 3 else number - 2)
        y = _BAR + _LABEL + (number > 2) * (_LABEL + height)
        sheet[y : y + height, x : x + _WIDTH] = surface.picture(view, redirected, strain)
        texts.append((x, y - 9, 18, label))
    y = _BAR + 2 * _LABEL + height
    texts.append((_GAP, y - 9, 18, "figures"))
    box = (_GAP, y, _WIDTH - _GAP, height)
    texts += sheet_figures.draw(sheet, box, surface.strains(), surface.textures(pose.scale))
    buffer = oiio.ImageBuf(np.where(sheet <= 0.0031308, 12.92 * sheet, 1.055 * sheet ** (1 / 2.4) - 0.055))
    for x, y, size, text in texts:
        # Without fonts the pictures speak for themselves.
        oiio.ImageBufAlgo.render_text(buffer, x, y, text, size, "DroidSans", (0.1, 0.1, 0.12))
    return np.rint(255 * buffer.get_pixels(oiio.FLOAT).clip(0, 1)).astype(np.uint8)


def _texture(tile: TileWork) -> str:
    """The file of the tile's first texture; empty without one."""
    files = (paths[tile.udim] for copy, paths in tile.part.textures if not copy.is_normal and tile.udim in paths)
    return next(files, "")


@dataclass(eq=False)
class _Looked:
    """Images of a tile, whose first row is at the top."""

    rigidity: np.ndarray
    delta: np.ndarray
    strains: list[np.ndarray]
    """(height, width, 2), with original and with redirected UVs: how much what is rigid is stretched, and squeezed."""
    texture: np.ndarray | None


@dataclass(eq=False)
class _View:
    """The visible part of a pose."""

    seen: np.ndarray
    """(height, width) of samples: where the mesh is. All others are of these samples."""
    owner: np.ndarray
    uv: np.ndarray
    normal: np.ndarray
    inside: np.ndarray
    scale: float
    """Pixels per unit of length."""


class _Surface:
    """A mesh's triangles at rest and in a pose, and its tiles, which are solved."""

    def __init__(self, mesh: MeshWork, positions: np.ndarray) -> None:
        shape = self.shape = mesh.shape
        self.poses = [shape.rest.astype(np.float64), positions.astype(np.float64)]
        corners = fans(shape.face_counts)
        face = np.repeat(np.arange(len(shape.face_counts)), np.maximum(shape.face_counts - 2, 0))
        self.vertices, numbers = shape.indices[corners], shape.uv_indices[corners]
        uvs = shape.uvs[np.maximum(numbers, 0)].astype(np.float64)
        place = np.floor(uvs.mean(1))
        udim = np.where((numbers >= 0).all(1), 1001 + place[:, 0] + 10 * place[:, 1], 0)
        self.uvs = uvs - place[:, None]
        self.metrics = [_metrics(self.uvs, points[self.vertices]) for points in self.poses]
        self.tiles = mesh.every_tile
        self.owner = np.full(len(face), -1)
        self.looked = []
        for number, tile in enumerate(mesh.every_tile):
            own = (udim == tile.udim) & (tile.part.asset.face_layers()[face] == tile.layer)
            if tile.part.faces is not None:
                own &= np.isin(face, tile.part.faces)
            self.owner[own] = number
            self.looked.append(self._look(tile, np.flatnonzero(own)))

    def _look(self, tile: TileWork, own: np.ndarray) -> _Looked:
        texels = tile.size if tile.size[0] else tile.cells
        size = width, height = min(texels[0], _SIDE), min(texels[1], _SIDE)
        corners = np.concatenate([self.uvs[own] * [width, -height] + [0, height], np.zeros((len(own), 3, 1))], -1)
        found, weights = cover(corners, size)
        triangle = np.where(found >= 0, np.append(own, -1)[found], -1)
        painted, values = tile.part.maps["rigidity"].get(tile.udim), self.shape.vertex_rigidity
        if painted is not None:
            rigidity = brightness(read_colours(painted))
        elif values is not None:
            rigidity = np.where(triangle >= 0, (values[self.vertices[triangle]] * weights).sum(-1), 0)
        else:
            rigidity = np.zeros((height, width))
        file = _texture(tile)
        # Textures of 8 or 16 bits are taken for sRGB, as most are.
        encoded = bool(file) and warped.read(file).pixels.dtype.kind == "u"
        texture = read_colours(file) ** np.float32(2.2 if encoded else 1) if file else None
        delta, jacobian = (tile.tile.fetch(kind, size) for kind in ("redirection_delta", "jacobian"))
        # Paint at the redirected UV moves along the surface by the inverse Jacobian.
        at = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), -1) + delta * [width, -height]
        column, row = at.astype(np.int64).clip(0, [width - 1, height - 1]).transpose(2, 0, 1)
        target = np.where(triangle[row, column] >= 0, triangle[row, column], triangle)
        (rest, pose), uv = self.metrics, np.stack([at[..., 0] / width, 1 - at[..., 1] / height], -1)
        rigid = [_at(rigidity[..., None], of.reshape(-1, 2)).reshape(height, width) for of in (uv - delta, uv)]
        strains = [
            _strain(rest[triangle], pose[triangle], rigid[0] * (triangle >= 0)),
            _strain(rest[target], _moved(pose[triangle], jacobian), rigid[1] * (triangle >= 0)),
        ]
        return _Looked(rigidity[..., None], delta, strains, texture)

    def figures(self) -> str:
        """The strain as the solve has measured it."""
        found = rows.mean(rows.Strain.of(rows.strain(tile)) for tile in self.tiles)
        figures = f"strain {found.before:.3f} with the original UVs, {found.after:.3f} with vrtm (RMS)"
        return figures if found.segments else rows.UNMEASURED if found.unmeasured else "nothing is rigid"

    def strains(self) -> list[sheet_figures.Tile]:
        """Each tile with its name and its strain."""
        return [(rows.tile_name(rows.place(tile)), rows.strain(tile)) for tile in self.tiles]

    def textures(self, scale: float) -> Callable[[int], Sequence[np.ndarray]] | None:
        """The only tile's texture as painted and as looked up, in squares; several tiles' would be too small."""
        if len(self.tiles) != 1 or (self.owner < 0).all():
            return None

        def drawn(side: int) -> list[np.ndarray]:
            n = side * _SAMPLES
            u, v = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
            uv = np.stack([u.ravel(), v.ravel()], -1)
            both = (self._painted(0, target, scale) for target in (uv, uv + _at(self.looked[0].delta, uv)))
            return [colours.reshape(side, _SAMPLES, side, _SAMPLES, 3).mean((1, 3)) for colours in both]

        return drawn

    def camera(self) -> Camera:
        """From the side, of eight, where most of the original strain is seen; of a flat mesh, from its front."""
        size = np.ptp(self.poses[0], axis=0)
        if size.min() < 0.02 * size.max():
            return Camera(self.poses, *((90, 0), (0, 90), (0, 0))[int(size.argmin())])
        middle, amount = self.uvs.mean(1), np.zeros(len(self.uvs))
        for number, looked in enumerate(self.looked):
            own = np.flatnonzero(self.owner == number)
            rigid = _at(looked.rigidity, middle[own])[:, 0]
            amount[own] = _at(looked.strains[0], middle[own]).sum(1).clip(0, 1) * rigid
        sides = [Camera(self.poses, yaw, 14) for yaw in (25, -25, 70, -70, 115, -115, 155, -155)]
        normals = self._normals(self.poses[1])
        # From the front unless another side shows clearly more.
        seen = [
            (amount * (normals @ side.axes[2]).clip(0)).sum() * (1.25 if k < 2 else 1) for k, side in enumerate(sides)
        ]
        return sides[int(np.argmax(seen))]

    def _normals(self, positions: np.ndarray) -> np.ndarray:
        """Of the triangles, as long as twice their area, and outward if the mesh is closed."""
        a, b, c = (positions[self.vertices[:, k]] - positions.mean(0) for k in range(3))
        normals = np.cross(b - a, c - a)
        return normals if (normals * a).sum() >= 0 else -normals

    def view(self, camera: Camera, positions: np.ndarray, height: int) -> _View:
        size = (_SAMPLES * _WIDTH, _SAMPLES * height)
        found, weights = cover(camera.project(positions, size)[self.vertices], size)
        seen = found >= 0
        triangle, weights = found[seen], weights[seen][..., None]
        smooth = np.zeros_like(positions)
        for k in range(3):
            np.add.at(smooth, self.vertices[:, k], self._normals(positions))
        normal = (smooth[self.vertices[triangle]] * weights).sum(1) @ camera.axes.T
        inside = normal[:, 2:] < 0
        normal *= np.where(inside, -1, 1) / np.linalg.norm(normal, axis=1, keepdims=True).clip(1e-30)
        uv = (self.uvs[triangle] * weights).sum(1)
        return _View(seen, self.owner[triangle], uv, normal, inside, camera.scale((_WIDTH, height)))

    def picture(self, view: _View, redirected: bool, strain: bool) -> np.ndarray:
        """(height, width, 3), in linear colours."""
        colours = np.full((len(view.uv), 3), QUIET)
        for number, looked in enumerate(self.looked):
            own = np.flatnonzero(view.owner == number)
            uv = view.uv[own]
            target = uv + _at(looked.delta, uv) if redirected else uv
            if strain:
                rigid = _step(0.25, 0.4, _at(looked.rigidity, target))
                colours[own] = mix(QUIET, strain_colour(*_at(looked.strains[redirected], uv).T), rigid)
            elif len(own):
                colours[own] = self._painted(number, target, view.scale)
        key = (view.normal @ [-0.45, 0.55, 0.70])[:, None].clip(0)
        light = 0.68 + 0.32 * key if strain else 0.2 + 0.8 * key + 0.1 * view.normal[:, 1:2]
        picture = np.empty((*view.seen.shape, 3), np.float32)
        picture[:] = _PAPER
        picture[view.seen] = colours * light * np.where(view.inside, 0.5, 1)
        return picture.reshape(-1, _SAMPLES, _WIDTH, _SAMPLES, 3).mean((1, 3))

    def _painted(self, number: int, uv: np.ndarray, scale: float) -> np.ndarray:
        """(points, 3): the colours of a tile's texture, or of a checkerboard where it has none."""
        looked = self.looked[number]
        if looked.texture is not None:
            return _at(looked.texture, uv)
        # The side of the tile in the picture, about, and squares of one size on all meshes.
        uu, uv_, vv = self.metrics[0][self.owner == number].T
        side = scale * np.median(np.sqrt((uu * vv - uv_ * uv_).clip(0))) ** 0.5
        squares = np.floor(uv * 2 ** max(round(np.log2(max(side / _SQUARE, 1))), 2)).sum(1)[:, None] % 2
        return mix(mix(*_SKIN, squares), mix(*_STUD, squares), _step(0.25, 0.4, _at(looked.rigidity, uv)))


def _metrics(uvs: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(triangles, 3): products of the surface's derivatives by u and v: uu, uv, vv."""
    (du, dv), (eu, ev) = (uvs[:, k].T - uvs[:, 0].T for k in (1, 2))
    d, e = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    area = (du * ev - dv * eu)[:, None]
    area[area == 0] = np.inf
    along, up = (d * ev[:, None] - e * dv[:, None]) / area, (e * du[:, None] - d * eu[:, None]) / area
    return np.stack([(along * along).sum(1), (along * up).sum(1), (up * up).sum(1)], 1)


def _moved(metrics: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    """The metrics by other coordinates, of which the Jacobian is given."""
    (a, b, c, d), (xx, xy, yy) = np.moveaxis(jacobian.astype(np.float64), -1, 0), np.moveaxis(metrics, -1, 0)
    moved = (
        d * d * xx - 2 * c * d * xy + c * c * yy,
        (a * d + b * c) * xy - b * d * xx - a * c * yy,
        b * b * xx - 2 * a * b * xy + a * a * yy,
    )
    return np.stack(moved, -1) / ((a * d - b * c) ** 2).clip(1e-12)[..., None]


def _strain(rest: np.ndarray, pose: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """(height, width, 2): stretch and squeeze between images of metrics, by their means over what is rigid of some
    texels: the metrics of triangles differ, so that along edges there are bands of strain wherever something moves."""
    share = blurred(rigid, _OVER)
    r, p = ([blurred(metrics[..., k] * rigid, _OVER) / share.clip(1e-6) for k in range(3)] for metrics in (rest, pose))
    # The squares of the largest and the least ratio of lengths solve det(pose - x rest) = 0.
    det = (r[0] * r[2] - r[1] * r[1]).clip(1e-30)
    half = (r[2] * p[0] - 2 * r[1] * p[1] + r[0] * p[2]) / (2 * det)
    root = np.sqrt((half * half - (p[0] * p[2] - p[1] * p[1]) / det).clip(0))
    found = np.stack([np.sqrt((half + root).clip(0)) - 1, 1 - np.sqrt((half - root).clip(0))], -1).clip(0)
    return np.where(share[..., None] > 1e-3, found, 0)


def _at(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(points, channels) of an image, interpolated."""
    height, width = image.shape[:2]
    x, y = (uv[:, 0] * width - 0.5).clip(0, width - 1), ((1 - uv[:, 1]) * height - 0.5).clip(0, height - 1)
    column, row = x.astype(np.int64), y.astype(np.int64)
    right, below = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
    across, down = (x - column)[:, None], (y - row)[:, None]
    upper, lower = (mix(image[of, column], image[of, right], across) for of in (row, below))
    return mix(upper, lower, down)


def _step(low: float, high: float, x: np.ndarray) -> np.ndarray:
    t = ((x - low) / (high - low)).clip(0, 1)
    return t * t * (3 - 2 * t)
