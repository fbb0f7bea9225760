"""`vrtm bake --carry-pieces connected`: connected parts of detail meshes are rigid, and bound to one sheet each."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import scenes
import test_bake_carry
from bake_scenes import image
from conftest import grid
from vrtm.bake.carry_parts import Nearest, connected, to_triangles

GAP, STUDS = 0.02, "/model/studs"
PARTS = "--carry-pieces", "connected"
BOX = np.array([(x, y, z) for z in (1, 0) for y in (0, 1) for x in (0, 1)], float)
"""The foot's corners are the last ones."""
SIDES = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
EDGES = np.concatenate([SIDES[:, [k, (k + 1) % 4]] for k in range(4)])
PLACES = np.array([(0.2, 0.3, 0.0), (0.6, 0.7, 0.0), (0.3, 0.6, GAP)])
"""The middles of the studs' feet: two on the lower sheet, one that hangs from the upper one."""


def studs() -> np.ndarray:
    """(studs, 8, 3): each reaches nearly to the other sheet."""
    up = np.where(PLACES[:, 2] > 0, -1, 1)
    size = np.array([0.06, 0.04, 0.9 * GAP])
    return PLACES[:, None] + (BOX - [0.5, 0.5, 0]) * size * np.stack([up * 0 + 1, up * 0 + 1, up], -1)[:, None]


def lips(folder: Path) -> Usd.Stage:
    """Two sheets that lie one over the other at rest, and part: the lower one is stretched, the upper one turns."""
    stage = scenes.stage(folder / "lips.usda", 1, 2)
    UsdGeom.Xform.Define(stage, "/model")
    lower, faces = grid(6)
    rest = np.concatenate([lower, np.add(lower, [0, 0, GAP])])
    pose = np.concatenate([lower * [1.5, 1, 1], np.add(lower[:, [0, 2, 1]], [0, 0, 1])])
    uvs = np.concatenate([0.05 + 0.4 * lower[:, :2], 0.55 + 0.4 * lower[:, :2]])
    faces = np.concatenate([faces, faces + len(lower)])
    scenes.mesh(stage, "/model/skin", rest, uvs, faces=faces, poses={1: rest, 2: pose})
    image(folder / "rigid.png", np.zeros((16, 16, 1), np.uint8))
    sides = np.concatenate([SIDES + 8 * k for k in range(3)])
    scenes.mesh(stage, STUDS, studs().reshape(-1, 3), None, faces=sides)
    return stage


def bake(folder: Path, stage: Usd.Stage, *more: object, expect: int = 0) -> str:
    return test_bake_carry.bake(folder, stage, "--carry-prims", STUDS, *more, expect=expect, file="lips.usda")


def moved(folder: Path) -> np.ndarray:
    """(studs, 8, 3) in frame 2; (points, 3) of others."""
    layer = Sdf.Layer.OpenAsAnonymous(str(folder / "out" / "carried.usdc"))
    found = np.array(layer.QueryTimeSample(f"{STUDS}.points", 2), np.float64)
    return found.reshape(3, 8, 3) if len(found) == 24 else found


def lengths(of: np.ndarray) -> np.ndarray:
    return np.linalg.norm(of[:, EDGES[:, 0]] - of[:, EDGES[:, 1]], axis=-1)


def test_studs_between_two_sheets_are_not_torn(tmp_path: Path) -> None:
    stage = lips(tmp_path)
    bake(tmp_path, stage)
    assert (lengths(moved(tmp_path)) / lengths(studs())).max() > 10, "bound point by point they are torn"
    said = bake(tmp_path, stage, *PARTS, "--report", tmp_path / "report.json")
    assert f"{STUDS}: mesh, 3 connected parts, carried by /model/skin" in said
    assert "1 file written, 2 up to date" in said, "how parts are bound belongs to what the layer depends on"
    found = moved(tmp_path)
    np.testing.assert_allclose(lengths(found), lengths(studs()), atol=1e-5 * 0.06)
    # Each as the sheet under its foot.
    low, hanging = np.eye(3), np.array([(1, 0, 0), (0, 0, -1), (0, 1, 0)], float)
    for stud, rest, turn in zip(found, studs(), (low, low, hanging), strict=True):
        near = np.linalg.norm(stud - rest @ turn.T - (stud[0] - turn @ rest[0]), axis=1)
        assert near.max() < 1e-6
    foot = studs()[:, 4:]
    for stud, rest in zip(found[:2], foot[:2]):
        away = stud[4:].mean(0) - (rest * [1.5, 1, 1]).mean(0)
        assert np.abs(away).max() < 1e-6, "the centre of the foot is on the skin"
    away = found[2, 4:] - np.stack([foot[2, :, 0], 0 * foot[2, :, 0], 1 + foot[2, :, 1]], -1)
    assert np.abs(away.mean(0)).max() < 1e-6
    [row] = json.loads((tmp_path / "report.json").read_text())["carried"]
    assert row["prims"][0]["places"] == row["prims"][0]["bound"] == 3
    assert "0 files written, 3 up to date" in bake(tmp_path, stage, *PARTS)


@pytest.mark.parametrize("fit", ["surface", "none"])
def test_parts_are_rigid_with_each_fit_and_one_that_is_far_stays(tmp_path: Path, fit: str) -> None:
    stage = lips(tmp_path)
    rest = studs()
    rest[1, :, 2] -= 0.1
    UsdGeom.Mesh(stage.GetPrimAtPath(STUDS)).GetPointsAttr().Set(np.float32(rest.reshape(-1, 3)))
    said = bake(tmp_path, stage, *PARTS, "--carry-farthest", 0.05, "--carry-fit", fit)
    assert f"{STUDS}: 1 of 3 connected parts is farther than 0.05 (--carry-farthest)" in said
    np.testing.assert_allclose(moved(tmp_path)[1], rest[1], atol=1e-6)
    np.testing.assert_allclose(lengths(moved(tmp_path)), lengths(studs()), atol=1e-5 * 0.06)


def test_the_foot_is_the_middle_of_what_is_near(tmp_path: Path) -> None:
    stage = lips(tmp_path)
    square, faces = grid(4)
    plate = 0.2 * (square - 0.5) @ [[1, 0, 0.01], [0, 1, 0], [0, 0, 0]] + [0.4, 0.5, -0.01]
    stage.RemovePrim(STUDS)
    scenes.mesh(stage, STUDS, plate, None, faces=faces)
    bake(tmp_path, stage, *PARTS)
    np.testing.assert_allclose(moved(tmp_path).reshape(-1, 3), np.add(plate, [0.2, 0, 0]), atol=1e-6)


def test_faces_that_cannot_be_are_named(tmp_path: Path) -> None:
    stage = lips(tmp_path)
    indices = UsdGeom.Mesh(stage.GetPrimAtPath(STUDS)).GetFaceVertexIndicesAttr()
    indices.Set([*indices.Get()[:-1], 24])
    said = bake(tmp_path, stage, *PARTS, "--strict", expect=2)
    assert f"{STUDS}: not carried: has 24 points, and a face with point 24" in said
    indices.Set(indices.Get()[:-1])
    said = bake(tmp_path, stage, *PARTS, "--strict", expect=2)
    assert f"{STUDS}: not carried: has 71 corners, and faces with 72" in said


def test_connected_parts() -> None:
    counts, indices = np.array([3, 4, 0, 3]), np.array([0, 1, 2, 4, 5, 6, 7, 7, 8, 9])
    points = np.arange(36.0).reshape(12, 3)
    assert connected(points, counts, indices).tolist() == [0, 0, 0, 1, 2, 2, 2, 2, 2, 2, 3, 4]
    assert connected(points[:3], counts[:0], indices[:0]).tolist() == [0, 1, 2]
    points[11] = points[2]
    assert connected(points, counts, indices).tolist() == [0, 0, 0, 1, 2, 2, 2, 2, 2, 2, 3, 0]
    # A strip of points in no order.
    order = np.random.default_rng(2).permutation(3001)
    strip = np.stack([order[:-1], order[1:], order[1:]], axis=1).reshape(-1)
    assert not connected(np.stack([order] * 3, -1), np.full(3000, 3), strip).any()


@pytest.mark.parametrize("count", [1, 3, 50, 700])
def test_distances_are_those_of_all_triangles(count: int) -> None:
    rng = np.random.default_rng(count)
    triangles = rng.random((count, 1, 3)) + 0.2 * rng.random((count, 3, 3))
    # Of no area.
    triangles[0] = triangles[0, 0]
    points = rng.random((200, 3))
    shares = rng.dirichlet((1, 1, 1), 2000)
    all_ = np.min([to_triangles(points, np.broadcast_to(of, (200, 3, 3))) for of in triangles], axis=0)
    for k in range(5):
        seen = np.linalg.norm(shares @ triangles[k % count] - points[k], axis=1).min()
        own = to_triangles(points[k : k + 1], triangles[k % count][None])[0]
        assert own - 1e-12 <= seen < own + 0.02
    nearest = np.full(200, np.inf)
    found = Nearest(triangles).distances(points, np.arange(200), nearest, np.zeros(200))
    np.testing.assert_allclose(found, all_, atol=1e-12)
    # Of parts, the points that are near enough.
    part, slack = np.arange(200) // 20, np.full(10, 0.01)
    nearest = np.full(10, np.inf)
    found = Nearest(triangles).distances(points, part, nearest, slack)
    least = all_.reshape(10, 20).min(axis=1)
    np.testing.assert_allclose(nearest, least, atol=1e-12)
    near = all_ <= least[part] + 0.01
    np.testing.assert_allclose(found[near], all_[near], atol=1e-12)
    assert np.isinf(found[~near]).all()
