"""The surface over the nodes of a grid on the texture, at rest and in the pose, for the methods that warp a grid."""

import numpy as np
from case import Case
from geometry import find, grid_nodes
from scipy.ndimage import distance_transform_edt, minimum_filter
from scipy.sparse import coo_matrix


class Surface:
    """Positions at the nodes of `cells` x `cells` cells; all coordinates here are in these cells."""

    def __init__(self, case: Case, cells: int):
        self.cells, self.scale, width = cells, case.grid / cells, cells + 1
        self.nodes = grid_nodes(cells)
        found, weights, least = find(case.uv / self.scale, case.faces, self.nodes)
        covered = (least > -1e-6).reshape(width, width)
        self.chart = np.where(covered.ravel(), case.chart[case.faces[found, 0]], -1)
        # Nodes beyond a chart's border have the positions of the nearest node on a chart.
        nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
        nearest = (nearest[0] * width + nearest[1]).ravel()
        at = weights[nearest][:, :, None]
        self.rest, self.pose = ((at * x[case.faces[found[nearest]]]).sum(axis=1) for x in (case.rest, case.pose))
        # A node may move if it and its eight neighbours lie on one chart.
        chart = self.chart.reshape(width, width)
        apart = minimum_filter(chart, 3, mode="constant", cval=-1) != -minimum_filter(
            -chart, 3, mode="constant", cval=1
        )
        self.free = ~(apart | (chart < 0)).ravel()
        self.rigidity = sample(case.rigidity.reshape(-1, 1), case.grid, self.nodes * self.scale)[0][:, 0]

    def edges(self, diagonals: bool = False) -> np.ndarray:
        """Pairs of neighbours of which one is free."""
        width = self.cells + 1
        n = np.arange(width * width)
        steps = [(1, 0), (0, 1), (1, 1), (-1, 1)] if diagonals else [(1, 0), (0, 1)]
        pairs = []
        for di, dj in steps:
            a = n[(n % width + di >= 0) & (n % width + di < width) & (n // width + dj < width)]
            b = a + dj * width + di
            keep = self.free[a] | self.free[b]
            pairs.append(np.stack([a[keep], b[keep]]))
        return np.concatenate(pairs, axis=1)

    def to_case(self, displacement: np.ndarray, grid: int) -> np.ndarray:
        """The warp at the nodes of the case's grid, in its cells."""
        return sample(displacement, self.cells, grid_nodes(grid) / self.scale)[0] * self.scale


def sample(values: np.ndarray, cells: int, points: np.ndarray):
    """Bilinear values (n, k) of a grid's nodes at points in cells, and their derivatives (n, k, 2)."""
    width = cells + 1
    cell = np.floor(points).astype(int).clip(0, cells - 1)
    x, y = (points - cell).clip(0, 1).T[:, :, None]
    first = cell[:, 1] * width + cell[:, 0]
    a, b, c, d = values[first], values[first + 1], values[first + width], values[first + width + 1]
    value = (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y
    return value, np.stack([(b - a) * (1 - y) + (d - c) * y, (c - a) * (1 - x) + (d - b) * x], axis=-1)


def differences(pairs: np.ndarray, count: int):
    """The sparse matrix that takes values at nodes to the value at the second minus that at the first of each pair."""
    n = pairs.shape[1]
    ones = np.ones(n)
    rows = np.concatenate([np.arange(n)] * 2)
    return coo_matrix((np.concatenate([-ones, ones]), (rows, np.concatenate(pairs))), (n, count)).tocsr()
