"""Scenes in the hands of the library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr")

import scenes
import vrtm
from vrtm.bake.layer import corner_uv_layer
from vrtm.bake.scene import Scene, SceneOptions

SIDE = 9


@pytest.mark.parametrize("levels", [0, 1])
def test_a_shape_becomes_an_asset(tmp_path: Path, device: vrtm.Device, levels: int) -> None:
    stage = scenes.stage(tmp_path / "a.usda", 1, 2)
    grid = [(x / (SIDE - 1), y / (SIDE - 1), 0) for y in range(SIDE) for x in range(SIDE)]
    cells = [SIDE * y + x for y in range(SIDE - 1) for x in range(SIDE - 1)]
    faces = [vertex for first in cells for vertex in (first, first + 1, first + SIDE + 1, first + SIDE)]
    mesh = scenes.mesh(stage, "/mesh", grid, [p[:2] for p in grid], counts=[4] * len(cells), faces=faces)
    mesh.CreateSubdivisionSchemeAttr("catmullClark")
    mesh.CreateHoleIndicesAttr([len(cells) - 1])
    stiff = [float(0.3 < x < 0.7 and 0.3 < y < 0.7) for x, y, _ in grid]
    scenes.primvar(mesh.GetPrim(), "stiff", scenes.TYPES.FloatArray, stiff, "vertex")
    mesh.GetPointsAttr().Set(grid, 1)
    mesh.GetPointsAttr().Set([(x * (0.6 + 0.6 * x), y, z) for x, y, z in grid], 2)
    stage.Save()
    scene = Scene(tmp_path / "a.usda", SceneOptions(rigidity_primvar="stiff", subdivide=levels))
    (shape,) = scene.shapes
    with vrtm.Asset(
        device,
        shape.rest,
        shape.indices,
        face_counts=shape.face_counts,
        uvs=shape.uvs,
        uv_indices=shape.uv_indices,
    ) as asset:
        asset.set_vertex_rigidity(shape.vertex_rigidity)
        asset.solve(scene.positions(shape, 1))
        painted = shape.uv_indices >= 0
        own = shape.uvs[shape.uv_indices[painted]]
        assert asset.corner_uvs()[painted] == pytest.approx(own, abs=1e-6), "nothing moves at rest"
        asset.solve(scene.positions(shape, 2))
        found = asset.corner_uvs()
        assert np.abs(found[painted] - own).max() > 0.02 and not found[~painted].any()
    layer = corner_uv_layer(shape, 2, found)
    values = np.array(layer.QueryTimeSample("/redirected.primvars:st_redirected", 2.0))
    assert values.shape == (len(faces), 2) and len(found) == len(faces) * 4**levels
    expected = found if shape.cage_corners is None else found[shape.cage_corners]
    assert np.array_equal(values, expected)
