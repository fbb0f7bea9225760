"""Texture-space linear blend skinning, a baseline: each rigid feature is a bone that moves rigidly in UV, and a texel
follows a few of them.

After Koniaris's thesis (2015), and Le and Deng's smooth skinning decomposition (2012) with its bones given: weights are
not negative, add up to 1, and no more than four are kept per texel, one of which may be that of a bone that does not
move. Our own implementation."""

import numpy as np

BONES = 4
LEAST = 12
"""Texels of the smallest feature that is a bone."""
STEPS = 200


class Skin:
    """Bones and weights, fitted to `deltas` (frames, texels, 2) over texels at `at` (texels, 2), in UV."""

    def __init__(self, deltas: np.ndarray, at: np.ndarray, feature: np.ndarray) -> None:
        """`feature`: (texels,), the number of the rigid feature that covers each, -1 for none."""
        numbers, count = np.unique(feature[feature >= 0], return_counts=True)
        self.texels = [np.flatnonzero(feature == number) for number in numbers[count >= LEAST]]
        self.centres = np.array([at[some].mean(axis=0) for some in self.texels])
        self.at = at
        self.poses = np.array([self._rigid(delta) for delta in deltas])
        """(frames, bones, 3): angle, and the motion of the centre."""
        # The nearest features, by their centres; the last bone stands still.
        near = np.empty((len(at), BONES - 1), int)
        for start in range(0, len(at), 1 << 14):
            away = np.linalg.norm(at[start : start + (1 << 14), None] - self.centres, axis=-1)
            near[start : start + (1 << 14)] = np.argsort(away, axis=1)[:, : BONES - 1]
        self.bones = near
        self.weights = self._fitted(deltas)

    @property
    def bytes(self) -> int:
        """Of a texel an index and a weight per bone, in 8 bits each; of a frame three floats per bone."""
        return 2 * BONES * len(self.at) + self.poses.size * 4

    def sum(self, pose: np.ndarray) -> np.ndarray:
        """(texels, 2): the delta for a pose (bones, 3)."""
        moved = self._moved(pose)
        return (self.weights[:, :-1, None] * moved).sum(axis=1)

    def _rigid(self, delta: np.ndarray) -> np.ndarray:
        found = []
        for texels, centre in zip(self.texels, self.centres):
            before, after = self.at[texels] - centre, self.at[texels] + delta[texels] - centre
            shift = after.mean(axis=0)
            a, b = before, after - shift
            angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
            found.append([angle, *shift])
        return np.array(found)

    def _moved(self, pose: np.ndarray) -> np.ndarray:
        """(texels, bones, 2): what each bone of a texel would add to it."""
        angle, shift = pose[self.bones, 0], pose[self.bones, 1:]
        from_centre = self.at[:, None] - self.centres[self.bones]
        cosine, sine = np.cos(angle) - 1, np.sin(angle)
        x, y = from_centre[..., 0], from_centre[..., 1]
        return np.stack([cosine * x - sine * y, sine * x + cosine * y], -1) + shift

    def _fitted(self, deltas: np.ndarray) -> np.ndarray:
        """(texels, BONES): the weights with the least squared error, by projected gradients."""
        count = self.bones.shape[1]
        products, mixed = np.zeros((len(self.at), count, count)), np.zeros((len(self.at), count))
        for pose, delta in zip(self.poses, deltas):
            moved = self._moved(pose)
            products += np.einsum("tac,tbc->tab", moved, moved)
            mixed += np.einsum("tac,tc->ta", moved, delta)
        step = 1 / np.maximum(np.trace(products, axis1=1, axis2=2), 1e-30)[:, None]
        weights = np.full((len(self.at), count + 1), 1 / (count + 1))
        for _ in range(STEPS):
            slope = np.einsum("tab,tb->ta", products, weights[:, :-1]) - mixed
            weights[:, :-1] -= step * slope
            weights = _simplex(weights)
        # In 8 bits.
        return np.rint(weights * 255) / 255


def _simplex(values: np.ndarray) -> np.ndarray:
    """The nearest rows that are not negative and add up to 1 (Duchi et al. 2008)."""
    ordered = -np.sort(-values, axis=1)
    over = (np.cumsum(ordered, axis=1) - 1) / np.arange(1, values.shape[1] + 1)
    last = (ordered > over).sum(axis=1) - 1
    return np.maximum(values - over[np.arange(len(values)), last][:, None], 0)
