"""Refined subdivision surfaces, against what Catmull and Clark's rules give by hand."""

from pathlib import Path

import numpy as np
import pytest
from pxr import UsdGeom

import scenes
from conftest import refused
from vrtm.bake.scene import Scene, SceneError, SceneOptions, Shape

CUBE = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
CUBE_FACES = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
CUBE_EDGES = [(a, a ^ bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]
CUBE_UVS = [(0, 0), (1, 0), (1, 1), (0, 1)] * 6
GRID = [(x, y, 0) for y in range(4) for x in range(4)]
GRID_FACES = [v for y in range(3) for x in range(3) for v in (4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4)]


def refined(folder: Path, levels: int, change=lambda mesh: None, grid: bool = False, **mesh) -> Shape:
    """A cube, or a grid of 3 x 3 squares, refined."""
    stage = scenes.stage(folder / "a.usda")
    if grid:
        mesh = {"points": GRID, "uvs": [p[:2] for p in GRID], "faces": GRID_FACES} | mesh
    else:
        cube = {"points": CUBE, "uvs": CUBE_UVS, "faces": CUBE_FACES}
        mesh = cube | {"interpolation": "faceVarying"} | mesh
    made = scenes.mesh(stage, "/mesh", **mesh)
    made.CreateSubdivisionSchemeAttr("catmullClark")
    change(made)
    stage.Save()
    return Scene(folder / "a.usda", SceneOptions(subdivide=levels)).shapes[0]


def at_cage(shape: Shape, corner: int) -> np.ndarray:
    return shape.rest[shape.indices[shape.cage_corners[corner]]]


def crease(sharpness: float, edges=CUBE_EDGES):
    def change(mesh: UsdGeom.Mesh) -> None:
        mesh.CreateCreaseIndicesAttr([v for edge in edges for v in edge])
        mesh.CreateCreaseLengthsAttr([2] * len(edges))
        mesh.CreateCreaseSharpnessesAttr([sharpness] * len(edges))

    return change


def test_a_cube(tmp_path: Path) -> None:
    shape = refined(tmp_path, 1)
    assert shape.rest.shape == (26, 3) and shape.face_counts.tolist() == [4] * 24
    # Vertices go to 5/9 of their places, edges' points to 3/4, faces' points stay.
    assert sorted(np.abs(shape.rest).sum(axis=1).round(6)) == pytest.approx([1] * 6 + [1.5] * 12 + [5 / 3] * 8)
    assert at_cage(shape, 0) == pytest.approx(np.array(CUBE[0]) * 5 / 9)
    # The surface's limit at a vertex of valence 3: (9 P + 4 sum of neighbours + sum of faces' other corners) / 24.
    limit = (9 * np.ones(3) + 4 * np.ones(3) + -1 * np.ones(3)) / 24
    assert at_cage(refined(tmp_path, 5), 6) == pytest.approx(np.sign(CUBE[CUBE_FACES[6]]) * limit, abs=2e-3)
    # Its faces hang together.
    shape = refined(tmp_path, 2)
    quads = shape.indices.reshape(-1, 4)
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, often = np.unique(edges, axis=0, return_counts=True)
    assert len(quads) == 96 and (often == 2).all() and len(shape.rest) - len(often) + len(quads) == 2


@pytest.mark.parametrize(
    ("sharpness", "corner", "edge"), [(0, 5 / 9, 0.75), (0.5, 7 / 9, 0.875), (1, 1, 1), (10, 1, 1)]
)
def test_creases(tmp_path: Path, sharpness: float, corner: float, edge: float) -> None:
    # Half as sharp as one level: the mean of both rules.
    shape = refined(tmp_path, 1, crease(sharpness))
    assert np.abs(at_cage(shape, 0)) == pytest.approx([corner] * 3)
    assert np.abs(shape.rest).sum(axis=1).max() == pytest.approx(max(3 * corner, 2 * edge))
    middle = [p for p in np.abs(shape.rest) if np.isclose(p.min(), 0) and np.isclose(p, edge).sum() == 2]
    assert len(middle) == 12


def test_a_crease_ends_after_its_levels(tmp_path: Path) -> None:
    two, three = (refined(tmp_path, levels, crease(2)) for levels in (2, 3))
    assert np.abs(at_cage(two, 0)) == pytest.approx([1, 1, 1])
    assert np.abs(at_cage(three, 0)).max() < 0.95


def test_a_ring_of_creases_and_a_sharp_corner(tmp_path: Path) -> None:
    ring = [(0, 1), (1, 3), (3, 2), (2, 0)]
    shape = refined(tmp_path, 1, crease(10, ring))
    # 3/4 of the vertex, 1/8 of each neighbour along the crease.
    assert at_cage(shape, 0) == pytest.approx([-0.75, -0.75, -1])

    def corner(mesh: UsdGeom.Mesh) -> None:
        mesh.CreateCornerIndicesAttr([0])
        mesh.CreateCornerSharpnessesAttr([10.0])

    assert at_cage(refined(tmp_path, 3, corner), 0) == pytest.approx([-1, -1, -1])


def test_a_flat_grid_with_sharp_corners_fills_its_square(tmp_path: Path) -> None:
    shape = refined(tmp_path, 3, grid=True)
    assert shape.rest.min(axis=0).tolist() == [0, 0, 0] and shape.rest.max(axis=0).tolist() == [3, 3, 0]
    # UVs of vertices follow the points.
    assert shape.uvs[shape.uv_indices] == pytest.approx(shape.rest[shape.indices][:, :2])
    soft = refined(tmp_path, 1, lambda mesh: mesh.CreateInterpolateBoundaryAttr("edgeOnly"), grid=True)
    assert at_cage(soft, 0) == pytest.approx([0.125, 0.125, 0])
    assert soft.uvs[soft.uv_indices] == pytest.approx(soft.rest[soft.indices][:, :2])
    linear = refined(tmp_path, 1, lambda mesh: mesh.CreateSubdivisionSchemeAttr("bilinear"))
    assert np.abs(linear.rest).max(axis=1).tolist() == [1] * 26
    assert at_cage(linear, 5) == pytest.approx(CUBE[CUBE_FACES[5]])


@pytest.mark.parametrize(
    ("rule", "at_corner"),
    [("all", 0), ("boundaries", 0), ("cornersPlus2", 0), ("cornersPlus1", 0), ("cornersOnly", 0), ("none", 0.125)],
)
def test_face_varying_uvs_at_a_corner(tmp_path: Path, rule: str, at_corner: float) -> None:
    uvs = [GRID[vertex][:2] for vertex in GRID_FACES]
    change = {"uvs": uvs, "interpolation": "faceVarying", "grid": True}
    shape = refined(tmp_path, 1, lambda mesh: mesh.CreateFaceVaryingLinearInterpolationAttr(rule), **change)
    assert shape.uvs[shape.uv_indices[shape.cage_corners[0]]] == pytest.approx([at_corner] * 2)


def test_face_varying_uvs_inside_and_along_seams(tmp_path: Path) -> None:
    # One UV inside is moved. Smooth rules see it at its neighbours; the linear one does not.
    uvs = np.array([GRID[vertex][:2] for vertex in GRID_FACES], float)
    uvs[np.array(GRID_FACES) == 5] += (0.4, 0)
    corner = GRID_FACES.index(6)
    change = {"uvs": uvs.tolist(), "interpolation": "faceVarying", "grid": True}
    for rule, u in (("cornersPlus1", 2 + 0.4 * (1 / 16 + 2 / 64)), ("all", 2)):
        shape = refined(
            tmp_path, 1, lambda mesh, rule=rule: mesh.CreateFaceVaryingLinearInterpolationAttr(rule), **change
        )
        assert shape.uvs[shape.uv_indices[shape.cage_corners[corner]]][0] == pytest.approx(u)
    # A seam along x = 1: the UVs to its right are 10 further, and keep their distance.
    uvs = np.array([GRID[vertex][:2] for vertex in GRID_FACES], float)
    right = (np.arange(36) // 4 % 3) > 0
    uvs[right] += (10, 0)
    shape = refined(tmp_path, 2, **{**change, "uvs": uvs.tolist()})
    found = shape.uvs[shape.uv_indices]
    side = np.repeat(right, 16)
    assert found[~side][:, 0].max() == 1 and found[side][:, 0].min() == 11
    assert found[~side][:, 0].min() == 0 and found[side][:, 0].max() == 13


def test_poses_values_and_faces_without_uvs_are_refined_alike(tmp_path: Path) -> None:
    stage = scenes.stage(tmp_path / "a.usda")
    mesh = scenes.mesh(stage, "/mesh", GRID, [p[:2] for p in GRID], faces=GRID_FACES)
    mesh.CreateSubdivisionSchemeAttr("catmullClark")
    mesh.CreateHoleIndicesAttr([4])
    scenes.primvar(mesh.GetPrim(), "stiff", scenes.TYPES.FloatArray, [float(p[0]) for p in GRID], "vertex")
    mesh.GetPointsAttr().Set([(2 * x, y, 5) for x, y, _ in GRID], 2)
    mesh.GetPointsAttr().Set(GRID, 1)
    stage.Save()
    scene = Scene(tmp_path / "a.usda", SceneOptions(subdivide=2, rigidity_primvar="stiff"))
    shape = scene.shapes[0]
    assert scene.positions(shape, 2) == pytest.approx(shape.rest * (2, 1, 1) + (0, 0, 5))
    assert shape.vertex_rigidity == pytest.approx(shape.rest[:, 0])
    assert (shape.uv_indices < 0).sum() == 16 * 4
    stage.GetPrimAtPath("/mesh").GetAttribute("holeIndices").Set([8])
    for interpolation in ("vertex", "faceVarying"):
        corners = [GRID[vertex][:2] for vertex in GRID_FACES]
        values = corners if interpolation == "faceVarying" else [p[:2] for p in GRID]
        scenes.primvar(mesh.GetPrim(), "st", scenes.TYPES.TexCoord2fArray, values, interpolation)
        stage.Save()
        shape = Scene(tmp_path / "a.usda", SceneOptions(subdivide=2)).shapes[0]
        shown = shape.uv_indices >= 0
        assert shown.sum() == 16 * 32
        assert shape.uvs[shape.uv_indices[shown]] == pytest.approx(shape.rest[shape.indices[shown]][:, :2]), (
            interpolation
        )
    plain = Scene(tmp_path / "a.usda").shapes[0]
    assert len(plain.rest) == 16 and plain.cage_corners is None, "the cage, unless it is asked for"


def test_what_cannot_be_refined(tmp_path: Path) -> None:
    for change, message in {
        lambda mesh: mesh.CreateSubdivisionSchemeAttr("loop"): "/mesh: the subdivision scheme 'loop' cannot be refined",
        crease(1, [(0, 9)]): "/mesh: its creases or corners do not fit",
    }.items():
        refused(SceneError, message, refined, tmp_path, 1, change)
    refused(SceneError, "9 levels", refined, tmp_path, 9)
    none = refined(tmp_path, 1, lambda mesh: mesh.CreateSubdivisionSchemeAttr("none"))
    assert len(none.rest) == 8, "polygons are no subdivision surface"
