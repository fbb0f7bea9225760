"""Results of a bake are read back: each mistake that a writer could make ends it, and is named."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Sdf

import test_bake_basis
import test_bake_carry
import test_bake_carry_abc
from bake_scenes import MESH, run, sheet_arguments, with_material
from scenes import preview_material
from test_bake_basis import BOUND, gentle
from test_bake_carry import SCALES
from vrtm.bake import basis_morphs, basis_shapes, carry_abc, carry_usd
from vrtm.bake.layer import write
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.scene.axes import Axes


def carried(folder: Path, *more: object) -> str:
    stage = test_bake_carry.scene(folder)
    test_bake_carry.scales(stage)
    return test_bake_carry.bake(folder, stage, "--carry-prims", SCALES, *more, expect=None)


def archive(folder: Path, *more: object) -> str:
    test_bake_carry_abc.scene(folder)
    return test_bake_carry_abc.bake(folder, "--carry-prims", "/model/on/dots", *more, expect=None)


def layer(folder: Path, *more: object) -> str:
    scene = with_material(folder / "shot", preview_material, 3, 8)
    texture = ("--texture", scene.parent / "colour.<UDIM>.png", "--seams", "shut")
    over = ("--layer", folder / "over.usda", "--root", folder / "root.usda")
    ended = run(*sheet_arguments(scene, folder / "maps", *texture, *over, *more), expect=None)
    return ended.stdout + ended.stderr


def primvar(folder: Path, *more: object) -> str:
    return layer(folder, "--layer-mode", "primvar", *more)


def basis(folder: Path, *more: object) -> str:
    """A left-handed mesh of a world with z up, in centimetres."""
    gentle(folder, 3)
    shot = Sdf.Layer.FindOrOpen(str(folder / "scene" / "sheet.usda"))
    shot.pseudoRoot.SetInfo("upAxis", "Z")
    shot.pseudoRoot.SetInfo("metersPerUnit", 0.01)
    Sdf.AttributeSpec(shot.GetPrimAtPath(MESH), "orientation", Sdf.ValueTypeNames.Token).default = "leftHanded"
    shot.Save()
    return test_bake_basis.bake(folder, "--gltf", "--blend-shapes", "--max-error", BOUND, *more, expect=None)


ADD = carry_abc.Motion.add


def sample(words: str, change: Callable[[str, float, Any], Any]) -> tuple:
    """A writer that changes values of samples of the carried instances, or loses them."""
    real = carry_usd.UsdScatter._set

    def write(self: Any, prim: Any, name: str, kind: Any, time: float, value: Any) -> None:
        found = change(name, time, value)
        if found is not None:
            real(self, prim, name, kind, time, found)

    return carried, carry_usd.UsdScatter, "_set", write, f"{SCALES}: {words}"


def result(bake: Callable, target: Any, name: str, words: str, change: Callable[[Any], Any]) -> tuple:
    """A function whose result is changed."""
    real = getattr(target, name)
    return bake, target, name, lambda *arguments, **named: change(real(*arguments, **named)), words


def argument(bake: Callable, target: Any, name: str, number: int, words: str, change: Callable[[Any], Any]) -> tuple:
    """A function that gets another argument."""
    real = getattr(target, name)
    return bake, target, name, lambda *of: real(*of[:number], change(of[number]), *of[number + 1 :]), words


def swapped(plan: LayerPlan) -> LayerPlan:
    assert plan.corner_path is not None
    path = plan.corner_path
    return replace(plan, corner_path=lambda mesh, frame: path(mesh, 4 - frame))


def turned(tiles: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: triangles[:, ::-1] for name, triangles in tiles.items()}


def of_positions(change: Callable[[Any], Any]) -> Callable[[str, float, Any], Any]:
    return lambda name, _, value: change(value) if name == "positions" else value


OTHER_FILE = "not that of frame "
FEWER_FIELDS = tuple(name for name in write.STAGE_FIELDS if name != "upAxis")
MISTAKES = {
    "lost orientations": sample(
        "frame 2: orientations: an axis is off by", lambda name, _, value: value if name == "positions" else None
    ),
    "a lost frame": sample("positions: has no sample at 2", lambda _, time, value: value if time < 2 else None),
    "a count that does not follow": sample("frame 1: has 3 points, not 4", of_positions(lambda points: points[1:])),
    "a shift": sample("frame 1: a point is off by 0.001", of_positions(lambda points: np.add(points, (0, 0, 1e-3)))),
    "another rate": (carried, carry_usd, "tell", lambda *_, **__: None, f"{SCALES}: positions: has no sample at 1"),
    "a lost sample of an archive": (
        archive,
        carry_abc.Motion,
        "add",
        lambda self, _, points: ADD(self, 0.04, points),
        "/model/on/dots: P: has 1 samples, not 2",
    ),
    "a lost file of a layer": result(
        layer, LayerPlan, "values", f"./maps/colour.0002.<UDIM>.png, {OTHER_FILE}3, frame 3", lambda found: found[:-1]
    ),
    "files of other frames": result(
        layer, LayerPlan, "values", f"{OTHER_FILE}1, frame 1", lambda found: [(path, 4 - time) for path, time in found]
    ),
    "maps of another frame": result(
        layer, MeshWork, "_facts", "frame is 7, not 1", lambda facts: facts | {"vrtm:frame": 7}
    ),
    "a lost axis of a layer": (layer, write, "STAGE_FIELDS", FEWER_FIELDS, "upAxis is Y, and Z in the shot"),
    "UVs of other frames": argument(
        primvar, write, "author_clips", 2, f"{MESH}.primvars:st_redirected: its UVs are not those of", swapped
    ),
    "an axis of glTF": (basis, basis_morphs, "GLTF", Axes(None, 1.0), "basis.glb: frame 1: it reaches from"),
    "a unit of glTF": (basis, basis_morphs, "GLTF", Axes("Y"), "basis.glb: frame 1: it reaches from"),
    "faces inside out": argument(basis, basis_morphs, "glb", 3, "basis.glb: frame 1: it is inside out", turned),
    "UVs upside down": argument(
        basis, basis_morphs, "glb", 2, "basis.glb: frame 1: its UVs are off by", lambda uvs: (0, 1) + uvs * (1, -1)
    ),
    "a rate of glTF": argument(
        basis, basis_morphs, "glb", 5, "basis.glb: its 3 poses are not at the times of 3 frames", lambda of: 2 * of
    ),
    "lost orientation of blend shapes": (
        basis,
        basis_shapes.UsdGeom.Mesh,
        "CreateOrientationAttr",
        lambda *_: None,
        "basis.usdc: frame 1: it is inside out",
    ),
}


@pytest.mark.parametrize(("bake", "target", "name", "mistake", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_of_a_writer_ends_the_bake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bake: Callable, target: Any, name: str, mistake: Any, words: str
) -> None:
    monkeypatch.setattr(target, name, mistake)
    last = bake(tmp_path).splitlines()[-1]
    assert last.startswith("vrtm: read back: ") and words in last, last
    if mistake is FEWER_FIELDS:
        assert "read back" not in bake(tmp_path, "--no-check", "--verbose")


@pytest.mark.parametrize("bake", [carried, archive, layer, primvar, basis])
def test_what_is_right_passes(tmp_path: Path, bake: Callable) -> None:
    assert "read back in " in (said := bake(tmp_path, "--verbose")) and "read back: " not in said
