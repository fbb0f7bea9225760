"""Morph targets of positions and UVs that the same weights drive."""

from collections.abc import Sequence

import numpy as np

from vrtm.basis.gltf import Morph


def morphs(
    names: Sequence[str], weights: np.ndarray, positions: np.ndarray, uvs: np.ndarray, tolerance: float
) -> tuple[list[Morph], np.ndarray]:
    """The targets whose sums come nearest to the poses, and the weights of all of them, (poses, targets).

    `weights`: (poses, K) of the targets with `names`. `positions`, `uvs`: (poses, vertices, 3 and 2), less those at
    rest. Positions that are then off by more than `tolerance` get targets of their own, which leave the UVs alone: as
    many singular vectors of the difference as it takes."""
    count = len(positions)
    given = np.asarray(weights, np.float64)
    flat = [values.reshape(count, -1).astype(np.float64) for values in (positions, uvs)]
    solved = [np.linalg.lstsq(given, values, rcond=1e-9)[0] for values in flat]
    left = (flat[0] - given @ solved[0]).reshape(positions.shape)
    more, of_positions = _residual(left, tolerance)
    shapes = [values.reshape(len(values), *like.shape[1:]) for values, like in zip(solved, (positions, uvs))]
    made = [Morph(name, *parts) for name, *parts in zip(names, *shapes)]
    still = np.zeros(uvs.shape[1:])
    made += [Morph(f"shape {k + 1}", shape, still) for k, shape in enumerate(of_positions)]
    return made, np.hstack([given, more])


def _residual(left: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """(poses, count) and (count, vertices, 3): the fewest singular vectors whose sums are near enough."""
    flat = left.reshape(len(left), -1)
    vectors = np.linalg.eigh(flat @ flat.T)[1][:, ::-1]
    for count in range(len(left) + 1):
        some = vectors[:, :count]
        shapes = some.T @ flat
        off = np.linalg.norm((flat - some @ shapes).reshape(left.shape), axis=-1)
        if off.max(initial=0) <= tolerance:
            break
    # The largest weight of each is 1.
    scale = np.abs(some).max(axis=0, initial=1e-30) if count else np.ones(0)
    return some / scale, (shapes * scale[:, None]).reshape(count, *left.shape[1:])
