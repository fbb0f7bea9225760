"""`vrtm bake --basis --blend-shapes`: the file, evaluated by UsdSkel, against the library's own corner UVs."""

import re
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel

import test_bake_basis
from bake_scenes import solved_alone
from conftest import REPOSITORY
from test_bake_basis import BOUND, SIZE, document, gentle
from vrtm.bake.scene import Scene


def test_usd_evaluates_what_the_frames_have(tmp_path: Path) -> None:
    """By the page's own way to take UVs from points, at each corner of the scene's mesh."""
    gentle(tmp_path, 3)
    (tmp_path / "controls.csv").write_text("frame,pull,left-arm\n1,1,0\n2,0,1\n3,1,1\n")
    more = ("--blend-shapes", "--max-error", BOUND, "--controls", tmp_path / "controls.csv")
    test_bake_basis.bake(tmp_path, *more, expect=None)
    told, scene = document(tmp_path)["blend_shapes"], tmp_path / "scene" / "sheet.usda"
    # In memory, so that what is changed stays out of the layer that others may open.
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(tmp_path / "out" / "basis.usdc")))
    root = stage.GetDefaultPrim()
    motion = UsdSkel.Animation(root.GetChild("motion"))
    assert list(motion.GetBlendShapesAttr().Get())[:3] == ["pull", "left_arm", "pull_left_arm"]
    mesh, of_uvs = (UsdGeom.Mesh(root.GetChild(name)) for name in ("mesh", "uvs"))
    assert of_uvs.ComputePurpose() == "guide" and mesh.ComputePurpose() == "default"
    page = (REPOSITORY / "docs" / "games.md").read_text()
    exec(re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0], {"stage": stage})
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    with Scene(str(scene)) as file:
        (shape,) = file.shapes
        poses = {frame: file.positions(shape, frame) for frame in file.frames}
    for frame, pose in poses.items():
        wanted = solved_alone(scene, frame, 32).corner_uvs()
        points, uvs = np.array(mesh.GetPointsAttr().Get(frame)), np.array(st.Get(frame))
        most = 0.0
        for corner, vertex in enumerate(shape.indices):
            # Among the vertices in its place the one with the nearest UV: the tiles' borders are in one place.
            there = np.linalg.norm(points - pose[vertex], axis=1) < 1e-3 * np.ptp(shape.rest, axis=0).max()
            most = max(most, SIZE * float(np.linalg.norm(uvs[there] - wanted[corner], axis=1).min()))
        assert most <= told["error"] + 1e-3 and most <= BOUND and told["folds"] == 0
