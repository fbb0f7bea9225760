"""Weights as functions of a rig's controls, exact at the poses that they were fitted to.

Each weight is a sum of terms. Where each control has a pose in which it moves alone, and further poses move other sets
of controls, a term is the product of such a set, as riggers drive corrective shapes: one shape is linear, two shapes
with their combination bilinear. Otherwise a term is the distance to a pose in the space of controls (a radial basis
function; in one control it is linear between the poses), and a linear function is added. Distances between different
poses are a regular matrix (Micchelli 1986)."""

from dataclasses import dataclass, replace

import numpy as np

PRODUCTS, DISTANCES = "products", "distances"
_STILL = 1e-2
"""Share of the largest range up to which a control counts as still: it is not scaled to the same range."""
_KNOWN = 0.1
"""Variation of the poses in a direction, relative to the largest one, below which no slope is fitted: it would grow
without bound beyond the poses."""


@dataclass(frozen=True, eq=False)
class Driver:
    """A function from controls to weights. At controls of 0 all weights are 0, unless a pose there has others."""

    form: str
    """`products` or `distances`."""
    names: tuple[str, ...]
    """The controls."""
    centres: np.ndarray
    """(terms, controls): exponents, 0 or 1, of products; or the poses that distances are measured to."""
    ranges: np.ndarray
    """(controls,): divisors of the controls before distances are measured."""
    coefficients: np.ndarray
    """(terms, weights); of distances, with the controls and 1 as further terms."""

    def __call__(self, controls: np.ndarray) -> np.ndarray:
        """(poses, weights) for (poses, controls)."""
        return self.terms(controls) @ self.coefficients

    def terms(self, controls: np.ndarray) -> np.ndarray:
        """(poses, terms)."""
        given = np.atleast_2d(np.asarray(controls, np.float64))
        if self.form == PRODUCTS:
            return np.where(self.centres[None] > 0, given[:, None], 1.0).prod(axis=-1)
        scaled = given / self.ranges
        away = np.linalg.norm(scaled[:, None] - self.centres[None], axis=-1)
        return np.hstack([away, scaled, np.ones((len(given), 1))])

    def term_names(self) -> list[str]:
        """Names of the products: `smile`, `smile*jaw`."""
        return ["*".join(name for name, has in zip(self.names, row) if has) for row in self.centres]

    def document(self) -> dict:
        """Returns the driver as plain lists, for a file."""
        arrays = {"centres": self.centres, "ranges": self.ranges, "coefficients": self.coefficients}
        return {"form": self.form, "controls": list(self.names)} | {k: v.tolist() for k, v in arrays.items()}


def drive(names: tuple[str, ...], controls: np.ndarray, weights: np.ndarray) -> Driver:
    """The driver of poses: controls (poses, controls) and the weights (poses, K) of each. The pose whose controls are
    all 0 is the rest, and is added if it is missing. Raises ValueError for two poses with the same controls."""
    controls, weights = np.asarray(controls, np.float64), np.asarray(weights, np.float64)
    if controls.any(axis=1).all():
        controls = np.vstack([np.zeros((1, controls.shape[1])), controls])
        weights = np.vstack([np.zeros((1, weights.shape[1])), weights])
    alike = np.unique(controls, axis=0, return_index=True)[1]
    if len(alike) < len(controls):
        twice = next(k for k in range(len(controls)) if k not in alike)
        raise ValueError(f"two poses have the controls {dict(zip(names, controls[twice].tolist()))}")
    ranges = np.ptp(controls, axis=0)
    most = float(ranges.max(initial=0)) or 1.0
    ranges = np.where(ranges <= _STILL * most, most, ranges)
    used = controls != 0
    poses = used.any(axis=1)
    alone = used[used.sum(axis=1) == 1].any(axis=0)
    different = len(np.unique(used[poses], axis=0)) == poses.sum()
    if different and (alone == used.any(axis=0)).all() and not weights[~poses].any():
        driver = Driver(PRODUCTS, names, used[poses].astype(np.float64), ranges, np.zeros((poses.sum(), 0)))
        matrix = driver.terms(controls[poses])
        # Each product is not 0 at its own pose, and those of more controls are 0 there: a triangular system.
        return replace(driver, coefficients=np.linalg.solve(matrix, weights[poses]))
    driver = Driver(DISTANCES, names, controls / ranges, ranges, np.zeros((len(controls), 0)))
    matrix = driver.terms(controls)
    # The linear part is fitted first, as far as the poses tell it, and distances take what is left.
    linear = matrix[:, len(controls) :]
    slopes = np.linalg.lstsq(linear, weights, rcond=_KNOWN)[0]
    near = np.linalg.solve(matrix[:, : len(controls)], weights - linear @ slopes)
    return replace(driver, coefficients=np.vstack([near, slopes]))
