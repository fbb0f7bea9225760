"""Maps from image files; warnings of odd values in maps and primvars, of UVs outside of tiles, and of missing files."""

import re
from pathlib import Path

import numpy as np
import pytest
from pxr import UsdGeom

import scenes
from bake_scenes import flat, image, opened
from conftest import centres, refused
from vrtm.bake import remarks
from vrtm.bake.failure import Failure
from vrtm.bake.scene import SceneError, SceneOptions
from vrtm.bake.scene.images import find_maps, read_map


def shot(folder: Path, uvs: list | None = None, name: str = "cloth") -> Path:
    stage = scenes.stage(folder / "shot.usda", 1, 2)
    prim = scenes.mesh(stage, f"/{name}", uvs=uvs or [(0.1 + 0.8 * u, 0.1 + 0.8 * v) for u, v in scenes.UVS])
    scenes.stretch(prim, (1, 2))
    stage.Save()
    return folder / "shot.usda"


def notes(scene: Path, options: SceneOptions | None = None, **settings: object) -> list[str]:
    with opened(scene, options, **settings) as work:
        return [note for note in remarks.notes(work) if "--rigidity" in note or "--mask" in note]


@pytest.mark.parametrize("option", ["rigidity", "mask"])
@pytest.mark.parametrize(
    ("values", "told"),
    [
        (np.uint8([0, 1]), "has no value above 1 of 255: next to nothing {then}, white is 255"),
        (np.uint16([0, 255]), "has no value above 255 of 65535: next to nothing {then}, white is 65535"),
        (np.float32([0, 1 / 255]), "has no value above 0.003922: next to nothing {then}, white is 1"),
        (np.float32([0, 255]), "has values up to 255: those above 1 count as 1, which is white"),
        (np.float16([0, 100]), "has values up to 100: those above 1 count as 1, which is white"),
        # As painted, as filtered, and a rigidity that is meant to be low.
        (np.uint8([0, 255]), ""),
        (np.uint16([0, 65535]), ""),
        (np.float32([-0.1, 1.2]), ""),
        (np.uint8([0, 40]), ""),
    ],
)
def test_maps_that_seem_to_have_another_white_are_told(
    tmp_path: Path, option: str, values: np.ndarray, told: str
) -> None:
    white = str(flat(tmp_path / "white.png"))
    ending = "exr" if values.dtype.kind == "f" else "png"
    odd = str(image(tmp_path / f"odd.{ending}", np.tile(values, (16, 8))[..., None]))
    with opened(shot(tmp_path), **({"rigidity": white} | {option: odd})) as work:
        found = [note for note in remarks.notes(work) if "--rigidity" in note or "--mask" in note]
        # The library says it of a tile, which does not name the file.
        assert [line for line in work.heard() if "goes up to" in line] == []
    then = "keeps its shape there" if option == "rigidity" else "moves there"
    assert found == ([f"/cloth: --{option} {odd} {told.format(then=then)}"] if told else [])


def test_primvars_are_told_as_maps_are(tmp_path: Path) -> None:
    scene = shot(tmp_path)
    with opened(scene, rigidity=str(flat(tmp_path / "w.png"))) as work:
        stage = work.scene.source.stage
        prim = UsdGeom.Mesh.Get(stage, "/cloth").GetPrim()
        made = {"zero": [0.0] * 6, "bytes": [0.0, 255.0] * 3, "dim": [0.004] * 6, "good": [0.0, 1.0] * 3}
        for name, values in made.items():
            scenes.primvar(prim, name, scenes.TYPES.FloatArray, values, "vertex")
        stage.Save()
    for name, told in {
        "zero": "is black all over: nothing keeps its shape there",
        "bytes": "has values up to 255: those above 1 count as 1",
        "dim": "has no value above 0.004: next to nothing keeps its shape there",
    }.items():
        (note,) = notes(scene, SceneOptions(rigidity_primvar=name), size=32)
        assert note.startswith(f"/cloth: --rigidity-primvar {name} {told}")
    assert notes(scene, SceneOptions(rigidity_primvar="good", mask_primvar="good"), size=32) == []
    (note,) = notes(scene, SceneOptions(rigidity_primvar="good", mask_primvar="bytes"), size=32)
    assert note.startswith("/cloth: --mask-primvar bytes has values up to 255")


@pytest.mark.parametrize("side", [1, 3, 15])
def test_a_map_of_a_few_texels_makes_no_grid_of_a_few_cells(tmp_path: Path, side: int) -> None:
    small = str(flat(tmp_path / "rigid.1001.png", size=side))
    for more, cells, size in (({}, (64, 64), (512, 512)), ({"size": 32}, (32, 32), (32, 32))):
        with opened(shot(tmp_path), rigidity=small, **more) as work:
            (tile,) = work.meshes["cloth"].tiles
            assert (tile.cells, tile.size) == (cells, size)
    # As the tiles beside it.
    image(tmp_path / "rigid.1002.png", np.full((48, 64, 1), 255, np.uint8))
    scene = shot(tmp_path, [(2 * u, v) for u, v in scenes.UVS])
    with opened(scene, rigidity=str(tmp_path / "rigid.<UDIM>.png")) as work:
        assert [tile.size for tile in work.meshes["cloth"].tiles] == [(64, 48), (64, 48)]


def test_the_grid_follows_the_features_and_maps_the_image(tmp_path: Path) -> None:
    u, v = centres(1024)
    for diameter, cells in ((0.045, 512), (0.06, 384)):
        disc = np.hypot(u - 0.5, v - 0.5) < diameter / 2
        painted = image(tmp_path / "disc.png", np.uint8(255 * disc[..., None]))
        with opened(shot(tmp_path), rigidity=str(painted)) as work:
            (tile,) = work.meshes["cloth"].tiles
            assert (tile.cells, tile.size) == ((cells, cells), (1024, 1024))
            assert (tile.tile.info.grid_width, tile.tile.settings.grid_width) == (cells, 0)


@pytest.mark.parametrize(
    ("u", "v", "told"),
    [
        (10.25, 0.25, "u from 10.25 to 10.75; v from 0.25 to 0.75"),
        (-0.75, 0.25, "u from -0.75 to -0.25; v from 0.25 to 0.75"),
        (0.25, 900.25, "u from 0.25 to 0.75; v from 900.2 to 900.8"),
    ],
)
def test_uvs_without_a_tile_are_told_with_their_place(tmp_path: Path, u: float, v: float, told: str) -> None:
    rigid = str(flat(tmp_path / "rigid.png"))
    scene = shot(tmp_path, [(u + 0.5 * x, v + 0.5 * y) for x, y in scenes.UVS])
    tiles = "tiles have numbers where u is 0 to 10 and v is 0 to 900"
    with pytest.raises(Failure, match=f"/cloth: none of its UVs lies in a UDIM tile: {re.escape(told)}; {tiles}"):
        opened(scene, rigidity=rigid)


def test_faces_without_a_tile_are_told_with_their_place(tmp_path: Path) -> None:
    rigid = str(flat(tmp_path / "rigid.png"))
    # One face in 1010, one beyond.
    scene = shot(tmp_path, [(9.1 + 1.8 * u, 0.1 + 0.8 * v) for u, v in scenes.UVS])
    with opened(scene, rigidity=rigid) as work:
        (note,) = [note for note in remarks.notes(work) if "UDIM" in note]
        assert note.startswith("/cloth: mesh: 1 faces lie in no UDIM tile")
        assert ": u from 10.9 to 10.9; v from 0.1 to 0.9; tiles have" in note


def test_maps_of_a_mesh_whose_name_is_not_ascii(tmp_path: Path) -> None:
    scene = shot(tmp_path, name="\u00fcber\u76ae")
    maps = tmp_path / "maps"
    maps.mkdir()
    # As file systems that take names apart write it.
    flat(maps / "u\u0308ber\u76ae.1001.png")
    with opened(scene, rigidity=str(maps / "<mesh>.<UDIM>.png")) as work:
        assert work.left_out == []
        assert work.meshes["\u00fcber\u76ae"].names(1, work.pattern) == ["out/redirect.0001.1001.exr"]


@pytest.mark.parametrize(
    ("name", "kind", "largest"),
    [
        ("a.png", np.uint8, 255),
        ("a.png", np.uint16, 65535),
        ("a.tif", np.uint16, 65535),
        ("a.exr", np.float16, 2),
        ("a.exr", np.float32, 2),
        ("a.tif", np.float32, 2),
        ("a.tif", np.float64, 2),
    ],
)
def test_values_are_read_as_they_are_stored(tmp_path: Path, name: str, kind: type, largest: float) -> None:
    texels = np.linspace(0, largest, 12).astype(kind).reshape(3, 4, 1)
    read = read_map(str(image(tmp_path / name, texels)))
    texels = texels[..., 0].astype(np.float32 if kind == np.float64 else kind)
    assert read.dtype == texels.dtype and read.flags.c_contiguous and np.array_equal(read, texels)


def test_which_channel(tmp_path: Path) -> None:
    def read(name: str, texels: np.ndarray, **attributes: object) -> np.ndarray:
        return read_map(str(image(tmp_path / name, texels, **{"oiio:UnassociatedAlpha": 1}, **attributes)))

    grey = np.tile(np.arange(4, dtype=np.uint8)[None, :, None] * 80, (2, 1, 3))
    found = read("grey.png", grey)
    assert found.dtype == np.uint8 and np.array_equal(found, grey[..., 0])
    alpha = np.concatenate([grey, np.full((2, 4, 1), 100, np.uint8)], axis=2)
    assert np.array_equal(read("alpha.png", alpha), grey[..., 0]), "alpha does not count"
    alpha[0, 0] = 255, 0, 0, 255
    alpha[0, 1] = 0, 255, 0, 255
    found = read("colour.png", alpha)
    assert found.dtype == np.float32 and found[0, :2] == pytest.approx([0.2126, 0.7152])
    assert found[1, 2] == np.float32(160 / 255)
    layered = np.arange(3, dtype=np.float32).reshape(1, 1, 3) + 1
    for names, value in {
        ("a.Y", "a.R", "b"): 1,
        ("G", "B", "R"): 0.2126 * 3 + 0.7152 + 0.0722 * 2,
        ("q", "R", "z"): 2,
    }.items():
        assert read("a.exr", layered, channelnames=names)[0, 0] == pytest.approx(value), names


def test_outside_of_the_data_window_is_0(tmp_path: Path) -> None:
    ones = np.ones((2, 2, 1), np.float32)
    small = image(tmp_path / "a.exr", ones, x=1, y=0, full_width=4, full_height=3)
    assert read_map(str(small)).tolist() == [[0, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 0]]
    counted = np.arange(9, dtype=np.float32).reshape(3, 3, 1)
    large = image(tmp_path / "b.exr", counted, x=-1, y=-1, full_width=1, full_height=2)
    assert read_map(str(large)).tolist() == [[4], [7]]


def test_patterns(tmp_path: Path) -> None:
    for name in ("body.1001.png", "body.1003.png", "body.1004.png", "hat.png", "1001"):
        (tmp_path / name).touch()
    at = str(tmp_path) + "/"
    wanted = {1001: f"{at}body.1001.png", 1003: f"{at}body.1003.png"}
    assert find_maps(f"{at}body.<UDIM>.png", "body", (1001, 1002, 1003)) == wanted
    assert find_maps(f"{at}<mesh>.<udim>.png", "body", (1001, 1003)) == wanted
    assert find_maps(f"{at}<mesh>.png", "hat", (1012,)) == {1012: f"{at}hat.png"}
    assert find_maps(f"{at}<mesh>.png", "coat", (1001,)) == {}, "other shapes may have one"
    for pattern, udims, message in (
        (f"{at}hat.png", (1001, 1002), r"hat\.png: the shape body has 2 tiles \(1001, 1002\): write <UDIM>"),
        (f"{at}body.<UDIM>.png", (1002,), r"no such file for the tiles 1002 of body; there is .*body\.1001\.png"),
        (f"{at}none.png", (1001,), r"none\.png: no such file"),
    ):
        refused(SceneError, message, find_maps, pattern, "body", udims)
