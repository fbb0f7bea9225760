"""Choice of each mesh's UV set, and meshes that cannot end a bake since nothing deforms there."""

from pathlib import Path

import pytest
from pxr import Usd, UsdGeom

import scenes
from vrtm.bake.scene import Scene, SceneError, SceneOptions

BAKE = SceneOptions(skip_still=True)


def uv_set(prim: UsdGeom.Mesh, name: str) -> None:
    scenes.primvar(prim.GetPrim(), name, scenes.TYPES.TexCoord2fArray, scenes.UVS, "vertex")


def two(path: Path) -> Usd.Stage:
    """A body with `st`, and a jacket with two other sets; both are stretched."""
    stage = scenes.stage(path)
    body = scenes.mesh(stage, "/body")
    jacket = scenes.mesh(stage, "/jacket", name="UVMap")
    uv_set(jacket, "lightmap")
    for prim in (body, jacket):
        scenes.stretch(prim, (1, 2, 3))
    stage.Save()
    return stage


def chosen(path: Path, *names: str) -> dict[str, str]:
    return {shape.path: shape.uv_name for shape in Scene(path, SceneOptions(uv=names)).shapes}


def test_each_mesh_takes_the_first_uv_set_that_it_has(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    stage = two(path)
    with pytest.raises(SceneError, match=r"/jacket: several UV sets \(UVMap, lightmap\).* --uv UVMap st"):
        Scene(path, BAKE)
    assert chosen(path, "UVMap", "st") == chosen(path, "st", "none", "UVMap") == {"/body": "st", "/jacket": "UVMap"}
    assert chosen(path, "lightmap", "UVMap", "st") == {"/body": "st", "/jacket": "lightmap"}
    # Those that have none of them are named, with what they have.
    scene = Scene(path, SceneOptions(uv=("UVMap", "UVMap2"), skip_still=True))
    assert [shape.path for shape in scene.shapes] == ["/jacket"]
    (entry,) = scene.left_out
    assert (entry.mesh, entry.meant) == ("/body", False) and entry.why == "has no UVs 'UVMap' or 'UVMap2', but st"
    # The jacket alone is asked for.
    uv_set(UsdGeom.Mesh.Get(stage, "/jacket"), "st")
    stage.Save()
    assert chosen(path, "UVMap", "st") == {"/body": "st", "/jacket": "UVMap"}
    assert {shape.uv_name for shape in Scene(path, BAKE).shapes} == {"st"}


def test_a_still_mesh_does_not_end_a_bake(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    stage = scenes.stage(path)
    scenes.stretch(scenes.mesh(stage, "/body"), (1, 2, 3))
    prop = scenes.mesh(stage, "/prop", name="UVMap")
    uv_set(prop, "lightmap")
    # As many UVs as a mesh of other faces has.
    scenes.mesh(stage, "/broken", uvs=scenes.UVS[:3])
    stage.Save()
    scene = Scene(path, BAKE)
    assert [shape.path for shape in scene.shapes] == ["/body"]
    told = {entry.mesh: entry for entry in scene.left_out}
    assert told["/prop"].why == "nothing deforms there, and it has several UV sets" and told["/prop"].meant
    assert "it cannot be read: primvars:st has 3 values" in told["/broken"].why and not told["/broken"].meant
    # But where it is named, or a pose is not the rest.
    with pytest.raises(SceneError, match="/prop: several UV sets"):
        Scene(path, SceneOptions(skip_still=True, meshes=("prop",)))
    with pytest.raises(SceneError, match="/broken: primvars:st has 3 values"):
        Scene(path, SceneOptions(skip_still=True, meshes=("/body", "/broken")))
    with pytest.raises(SceneError, match="/prop: several UV sets"):
        Scene(path)
    moved = [(2 * x, y, z) for x, y, z in scenes.POINTS]
    scenes.primvar(prop.GetPrim(), "Pref", scenes.TYPES.Point3fArray, moved, "vertex")
    stage.Save()
    with pytest.raises(SceneError, match="/prop: several UV sets"):
        Scene(path, BAKE)


def test_a_rest_file_need_not_have_what_is_still(tmp_path: Path) -> None:
    stage = scenes.stage(tmp_path / "a.usda")
    scenes.stretch(scenes.mesh(stage, "/body"), (1, 2, 3))
    scenes.mesh(stage, "/prop")
    stage.Save()
    rest = scenes.stage(tmp_path / "rest.usda")
    scenes.mesh(rest, "/body")
    scenes.mesh(rest, "/hat")
    rest.Save()
    options = SceneOptions(rest=str(tmp_path / "rest.usda"), skip_still=True)
    scene = Scene(tmp_path / "a.usda", options)
    assert [shape.path for shape in scene.shapes] == ["/body"]
    assert "no meshes have the name of /prop" in scene.left_out[0].why
    scenes.stretch(UsdGeom.Mesh.Get(stage, "/prop"), (1, 2, 3))
    stage.Save()
    with pytest.raises(SceneError, match="no meshes have the name of /prop"):
        Scene(tmp_path / "a.usda", options)
