"""Basis maps: the fit and its bound, folds, weights of controls, strain. The checks are computed here, from their
definitions."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

import vrtm
from vrtm.basis.controls import drive
from vrtm.basis.fit import fit, fitted_weights, summed
from vrtm.basis.folds import folds
from vrtm.basis.morph import morphs
from vrtm.basis.stored import FORMATS, numbers, stored, values
from vrtm.basis.strain import Ruler, Strain

SIDE = 24


def bumps(count: int, seed: int = 1, size: float = 0.01) -> np.ndarray:
    """(count, texels, 2): smooth deltas, each of another place."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(*(np.arange(SIDE) / SIDE,) * 2)
    made = []
    for _ in range(count):
        u, v = random.uniform(0.2, 0.8, 2)
        made.append(np.exp(-((x - u) ** 2 + (y - v) ** 2) / 0.01)[..., None] * random.uniform(-size, size, 2))
    return np.array(made, np.float32).reshape(count, -1, 2)


def largest(maps: np.ndarray, weights: np.ndarray, deltas: np.ndarray) -> np.ndarray:
    """(frames,): the largest error, by plain loops."""
    found = []
    for row, delta in zip(weights, deltas):
        total = np.zeros(delta.shape)
        for weight, one in zip(row, maps):
            total += float(weight) * one.astype(float)
        found.append(np.hypot(*(total - delta).T).max())
    return np.array(found)


def test_sums_stay_within_the_bound_with_as_few_maps_as_that_takes() -> None:
    """Twelve frames of three shapes take three maps; with a coarse bound fewer do."""
    shapes, random = bumps(3), np.random.default_rng(2)
    deltas = np.einsum("fk,ktc->ftc", random.uniform(-1, 1, (12, 3)), shapes).astype(np.float32)
    # Three maps in f16 are off by some 2^-11 of their largest value, 0.01.
    basis = fit(deltas, 2e-5)
    assert basis is not None and len(basis) == 3
    found = largest(basis.maps, basis.weights, deltas)
    assert (found <= 2e-5).all()
    np.testing.assert_allclose(found, basis.errors, rtol=1e-6)
    assert basis.maps.dtype == np.float16
    np.testing.assert_allclose(np.abs(basis.weights).max(axis=0), 1, rtol=0.01)
    coarse = fit(deltas, 0.5 * np.hypot(*deltas.reshape(-1, 2).T).max())
    assert coarse is not None and len(coarse) < 3
    assert fit(deltas, 1e-9) is None, "f16 cannot hold it"
    assert fit(bumps(4, size=0.05), 1e-5, form="unorm8") is None, "steps of 0.1 / 255"


def test_frames_at_rest_take_no_map() -> None:
    basis = fit(np.zeros((3, 10, 2), np.float32), 1e-3)
    assert basis is not None and len(basis) == 0 and basis.weights.shape == (3, 0)
    # All that follows takes no map, too.
    assert fitted_weights(basis.maps, np.ones((2, 10, 2))).shape == (2, 0)
    assert not summed(basis.maps, basis.weights).any()
    assert drive(("a",), np.array([[1.0], [0.5], [2.0]]), basis.weights)(np.ones((4, 1))).shape == (4, 0)
    made, weights = morphs([], basis.weights, np.ones((3, 5, 3)), np.zeros((3, 5, 2)), 1e-9)
    assert [morph.name for morph in made] == ["shape 1"] and weights.shape == (3, 1)


def test_a_sum_of_maps_without_folds_may_fold_and_is_told_apart() -> None:
    """Two shears along different axes, each one-to-one: together they turn a quad over."""
    ramp = np.linspace(0, 1, SIDE)
    x, y = np.meshgrid(ramp, ramp[::-1])
    one, other = np.stack([-0.8 * x, 0 * x], -1), np.stack([-0.8 * x, 0 * x], -1)
    assert folds(one)[0] == 0 and folds(other)[0] == 0
    count, least = folds(one + other)
    assert count == (SIDE - 1) ** 2
    # x becomes x - 1.6 x, over texels that are 1/24 apart and ramps of 1/23.
    assert least == pytest.approx(1 - 1.6 * SIDE / (SIDE - 1))
    turned = np.stack([0 * x, -0.9 * y], -1)
    assert folds(turned)[1] == pytest.approx(1 - 0.9 * SIDE / (SIDE - 1)), "rows go down, v goes up"


def test_folds_are_counted_as_by_the_library(asset: vrtm.Asset, model: SimpleNamespace) -> None:
    asset.solve(model.pose)
    tile = asset.tile(1001)
    for size in (32, 64):
        told = tile.inspect_map("redirection_delta", size)
        count, least = folds(tile.fetch("redirection_delta", size)[..., :2].astype(float))
        assert count == told.folds and least == pytest.approx(told.min_jacobian, abs=1e-6)
        assert 0 < told.error_p99 <= told.error_max < 0.05
        assert tile.inspect_map("redirection_delta", size, dtype=np.float16).error_rms != told.error_rms


POSES = {
    "one shape": [(1,)],
    "two shapes and their combination": [(1, 0), (0, 0.5), (1, 1)],
    "in between": [(0.5,), (1,), (-1,)],
    "mixtures": [(0.2, 0.4, 0.1), (0.9, 0.1, 0.3), (0.5, 0.5, 0.5), (0.1, 0.2, 0.9)],
}


@pytest.mark.parametrize("poses", POSES.values(), ids=POSES)
def test_weights_are_exact_at_the_poses_and_0_at_rest(poses: list[tuple[float, ...]]) -> None:
    controls = np.array(poses)
    weights = np.random.default_rng(3).uniform(-1, 1, (len(controls), 2))
    driver = drive(tuple("abc"[: controls.shape[1]]), controls, weights)
    np.testing.assert_allclose(driver(controls), weights, atol=1e-12)
    np.testing.assert_allclose(driver(np.zeros((1, controls.shape[1]))), 0, atol=1e-12)


def test_products_of_controls_are_those_of_the_poses() -> None:
    """w(a, b) = 2 a + 3 b + 5 a b, from three poses; and in between, linear from pose to pose."""
    controls = np.array(POSES["two shapes and their combination"])
    driver = drive(("a", "b"), controls, (2 * controls[:, :1] + 3 * controls[:, 1:] + 5 * controls.prod(1)[:, None]))
    assert driver.form == "products" and driver.term_names() == ["a", "b", "a*b"]
    for a, b in itertools.product((0, 0.3, 0.7, 1), repeat=2):
        assert driver(np.array([[a, b]]))[0, 0] == pytest.approx(2 * a + 3 * b + 5 * a * b)
    line = drive(("a",), np.array([[0.5], [1.0]]), np.array([[3.0], [4.0]]))
    assert [line(np.array([[x]]))[0, 0] for x in (0.25, 0.75)] == pytest.approx([1.5, 3.5])


def test_strain_of_a_stretch_and_of_the_map_that_undoes_it() -> None:
    """A square that is stretched by 1.5 in x: 0.5 along x with its own UVs, and none where the map samples the texture
    1.5 times as fast."""
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    rest = np.hstack([uvs, np.zeros((4, 1))])
    ruler = Ruler(uvs[triangles], triangles, triangles, np.ones((SIDE, SIDE)))
    own = Strain.of(*ruler.strains(np.zeros((SIDE, SIDE, 2)), rest, rest * (1.5, 1, 1)))
    # In equal numbers, less a row or a column: along x, along y, and along both diagonals, which grow to sqrt(1.625).
    sizes = {0.5: SIDE * (SIDE - 1), 0.0: SIDE * (SIDE - 1), math.sqrt(1.625) - 1: 2 * (SIDE - 1) ** 2}
    mean = sum(size**2 * count for size, count in sizes.items()) / sum(sizes.values())
    assert own.rms == pytest.approx(math.sqrt(mean)) and own.max == pytest.approx(0.5)
    assert own.segments == sum(sizes.values()) and own.lost == 0
    x = (np.arange(SIDE) + 0.5) / SIDE
    delta = np.zeros((SIDE, SIDE, 2))
    delta[..., 0] = 0.5 * (x - x[0])
    values, lost = ruler.strains(delta, rest, rest * (1.5, 1, 1))
    assert np.abs(values).max() < 1e-9
    assert lost > 0, "what leaves the chart is told"


def test_positions_that_the_weights_do_not_drive_get_targets_of_their_own() -> None:
    """Two shapes over time, of which the UVs follow one."""
    random = np.random.default_rng(4)
    weights, other = random.uniform(-1, 1, (2, 9, 1))
    shapes, uvs = random.uniform(-1, 1, (2, 20, 3)), random.uniform(-1, 1, (20, 2))
    positions = np.multiply.outer(weights[:, 0], shapes[0]) + np.multiply.outer(other[:, 0], shapes[1])
    made, driving = morphs(["one"], weights, positions, np.multiply.outer(weights[:, 0], uvs), 1e-6)
    assert [morph.name for morph in made] == ["one", "shape 1"]
    np.testing.assert_allclose(sum(np.multiply.outer(w, m.positions) for w, m in zip(driving.T, made)), positions)
    np.testing.assert_allclose(made[0].uvs, uvs)
    assert not made[1].uvs.any() and np.abs(driving[:, 1]).max() == pytest.approx(1)


@pytest.mark.parametrize("form", ["unorm16", "unorm8"])
def test_integers_hold_the_bound_and_leave_in_place_what_does_not_move(form: str) -> None:
    """By what a shader computes: offset + scale * number / largest."""
    deltas = np.concatenate([bumps(6, size=0.05), np.zeros((6, 40, 2), np.float32)], axis=1)
    # Of 6 maps of 0.1 each, in steps of 0.1 / 255, 8 bits leave some 6 halves of such a step.
    bound = {"unorm16": 1e-5, "unorm8": 1.5e-3}[form]
    basis = fit(deltas, bound, form=form)
    assert basis is not None
    most = np.iinfo(FORMATS[form]).max
    read = []
    for one, of in zip(basis.maps, basis.ranges):
        packed = numbers(one, of, form)
        # The whole of the range is used, but for a step at its ends.
        assert packed.dtype == FORMATS[form] and np.ptp(packed.reshape(-1, 2), axis=0).min() >= most - 2
        read.append(of.offset.astype(float) + of.scale.astype(float) * packed / most)
    # f32 rounds a range of 0.1 by 1e-8.
    np.testing.assert_allclose(read, basis.maps, atol=1e-8)
    assert (largest(np.array(read), basis.weights, deltas) <= bound + 1e-7).all()
    assert not basis.maps[:, -40:].any() and np.abs(np.array(read)[:, -40:]).max() < 1e-8


def test_ranges_of_one_sign_and_of_nothing() -> None:
    """A channel that is 0, one that is positive, one that is negative."""
    maps = np.array([[[0, 0.25], [0, 0.5]], [[-1, 0], [-0.5, 0]]], np.float32)
    for form in FORMATS:
        found, ranges = stored(maps, form)
        np.testing.assert_allclose(found, maps, atol=1 / 255)
        for one, of in zip(found, ranges):
            np.testing.assert_allclose(values(numbers(one, of, form), of), one, atol=1e-7)
        assert (found[0, :, 0] == 0).all() and (found[1, :, 1] == 0).all()


def test_few_maps_that_hold_are_found_where_more_do_not() -> None:
    """As where the rounding of further maps folds: a map per frame is not accepted here."""
    deltas = bumps(8)
    size = float(np.hypot(*deltas.reshape(-1, 2).T).max())
    few = fit(deltas, 0.5 * size)
    assert few is not None and 1 < len(few) < 5
    found = fit(deltas, 0.5 * size, lambda basis: len(basis) <= 5)
    assert found is not None and len(found) == len(few)
    found = fit(deltas, 0.5 * size, lambda basis: len(few) + 1 <= len(basis) <= len(few) + 2)
    assert found is not None and len(found) == len(few) + 1
    assert fit(deltas, 0.5 * size, lambda basis: False) is None


def test_weights_stay_near_those_of_the_poses_with_more_controls_than_poses() -> None:
    """As where the controls are joints' rotations: poses of other clips differ in all of them, and also in those that
    hardly moved in the poses."""
    random = np.random.default_rng(8)
    sizes = np.r_[np.full(20, 0.3), np.full(4, 1e-7)]
    controls, weights = random.uniform(-1, 1, (10, 24)) * sizes, random.uniform(-1, 1, (10, 3))
    driver = drive(tuple(map(str, range(24))), controls, weights)
    np.testing.assert_allclose(driver(controls), weights, atol=1e-9)
    others = np.hstack([random.uniform(-0.3, 0.3, (50, 20)), random.uniform(-1e-3, 1e-3, (50, 4))])
    assert np.abs(driver(others)).max() < 2
