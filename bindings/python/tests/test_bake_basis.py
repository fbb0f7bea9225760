"""`vrtm bake --basis`: the sums of the maps that it writes, computed here from the files, against the map of each
frame."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from bake_scenes import MESH, attributes, files, image, pixels, run, sheet, sheet_arguments
from conftest import centres
from vrtm.bake import basis_tiles

# Texels of the texture per side, and the bound on errors in these.
SIZE = 1024
BOUND = 4.0


def gentle(folder: Path, frames: int) -> None:
    """The sheet with a third of its motion: what is squeezed by more folds between the texels of small maps."""
    stage = Usd.Stage.Open(str(sheet(folder / "scene", frames=frames, cells=4)))
    points = UsdGeom.Mesh(stage.GetPrimAtPath(MESH)).GetPointsAttr()
    rest = np.array(points.Get())
    for frame in range(1, frames + 1):
        points.Set(rest + (np.array(points.Get(frame)) - rest) / 3, frame)
    stage.Save()


def bake(folder: Path, *more: object, expect: int | None = 0) -> str:
    arguments = sheet_arguments(folder / "scene" / "sheet.usda", folder / "out", "--size", 32, "--texture-size", SIZE)
    ended = run(*arguments, "--basis", "--jobs", 1, *more, expect=expect)
    return ended.stdout + ended.stderr


def document(folder: Path) -> dict:
    return json.loads((folder / "out" / "basis.json").read_text())


def off(folder: Path, row: dict, weights: list[float] | None = None) -> float:
    """The largest distance of the sum from a frame's map, in texels of the texture, over both tiles; by the stored
    numbers, as a shader takes them, and by the frame's weights in the document unless told otherwise."""
    told, out, most = document(folder), folder / "out", 0.0
    for tile in told["files"]:
        delta = pixels(out / f"redirect.{row['frame']:04}.{tile['udim']}.exr")[..., :2] - np.stack(centres(32), -1)
        for weight, of, name in zip(row["weights"] if weights is None else weights, told["ranges"], tile["maps"]):
            texels = pixels(out / name)[..., :2]
            share = texels / np.iinfo(texels.dtype).max if texels.dtype.kind == "u" else texels.astype(float)
            delta -= weight * (np.array(of["offset"]) + np.array(of["scale"]) * share)
        most = max(most, SIZE * float(np.linalg.norm(delta, axis=-1).max()))
    return most


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("motion")
    gentle(folder, 6)
    bake(folder, "--max-error", BOUND, "--held-out", 4, expect=None)
    return folder


def test_sums_are_within_the_bound_in_each_frame_and_the_worst_is_named(motion: Path) -> None:
    told = document(motion)
    assert 0 < told["maps"] < 5 and told["max_error"] == BOUND and told["texture_size"] == SIZE
    assert [row["frame"] for row in told["frames"]] == [1, 2, 3, 5, 6]
    found = {row["frame"]: off(motion, row) for row in told["frames"]}
    for row in told["frames"]:
        # The maps hold UVs in f32, and what is compared here is not rounded in between.
        assert row["error"] == pytest.approx(found[row["frame"]], abs=2e-4)
        assert found[row["frame"]] <= BOUND + 2e-4 and row["folds"] == {"map": 0, "basis": 0}
        strain = row["strain"]
        assert strain["basis"]["rms"] < 0.5 * strain["own_uvs"]["rms"]
        assert strain["basis"]["rms"] == pytest.approx(strain["map"]["rms"], abs=0.01)
    assert told["worst"]["frame"] == max(found, key=lambda frame: found[frame])
    [held] = told["held_out"]
    assert held["frame"] == 4 == told["worst_held_out"]["frame"]
    assert held["error"] == pytest.approx(off(motion, held), abs=2e-4)
    # The maps are data of 16 bits.
    out = motion / "out"
    path = out / "basis.0000.1001.exr"
    assert pixels(path).dtype == np.float16 and attributes(path)["colorInteropID"] == "data"
    assert told["format"] == "half" and {tuple(of["offset"] + of["scale"]) for of in told["ranges"]} == {(0, 0, 1, 1)}
    listed = [name for tile in told["files"] for name in tile["maps"]]
    assert sorted(listed) == sorted(p.name for p in out.glob("basis.*.exr"))
    assert len(listed) == 2 * told["maps"]


def test_what_is_up_to_date_stays_and_what_is_missing_is_written(motion: Path) -> None:
    """Of all kinds of files."""
    arguments = ("--max-error", BOUND, "--held-out", 4, "--gltf")
    bake(motion, *arguments, expect=None)
    before, count = files(motion / "out"), 2 * document(motion)["maps"] + 2
    assert f"0 files written, {12 + count} up to date" in bake(motion, *arguments, expect=None)
    assert files(motion / "out") == before
    (motion / "out" / "basis.0000.1002.exr").unlink()
    assert f"{count} files written, 12 up to date" in bake(motion, *arguments, expect=None)
    (motion / "out" / "basis.glb").unlink()
    bake(motion, *arguments, expect=None)
    assert files(motion / "out") == before, "the same bytes"


@pytest.mark.parametrize(("form", "numbers"), [("unorm16", np.uint16), ("unorm8", np.uint8)])
def test_integers_of_a_stated_range(tmp_path: Path, form: str, numbers: type) -> None:
    gentle(tmp_path, 3)
    bake(tmp_path, "--max-error", BOUND, expect=None)
    half, out = document(tmp_path)["bytes"]["basis"], tmp_path / "out"
    bake(tmp_path, "--max-error", BOUND, "--basis-format", form, expect=None)
    told = document(tmp_path)
    assert not list(out.glob("basis.*.exr")), "those of 16-bit floats go"
    assert told["format"] == form and len(told["ranges"]) == told["maps"] >= 1
    assert told["bytes"]["basis"] == 2 * 32 * 32 * 2 * np.dtype(numbers).itemsize * told["maps"]
    assert (told["bytes"]["basis"] < 0.6 * half) == (form == "unorm8")
    for tile in told["files"]:
        for of, name in zip(told["ranges"], tile["maps"], strict=True):
            assert pixels(out / name).dtype == numbers and name.endswith(".png")
            assert attributes(out / name)["vrtm:scale"] == " ".join(f"{x:.9g}" for x in of["scale"])
    for row in told["frames"]:
        most = off(tmp_path, row)
        assert most <= BOUND + 2e-4 and row["error"] == pytest.approx(most, abs=2e-4)
        assert row["folds"] == {"map": 0, "basis": 0}
    before = files(out)
    bake(tmp_path, "--max-error", BOUND, "--basis-format", form, expect=None)
    assert files(out) == before


def test_a_format_that_cannot_hold_the_bound_is_refused_by_name(tmp_path: Path) -> None:
    gentle(tmp_path, 2)
    said = bake(tmp_path, "--max-error", 0.03, "--basis-format", "unorm8", expect=2)
    assert "maps of unorm8 are off by more than 0.03 texels, or fold" in said and "or --basis-format half" in said
    bake(tmp_path, "--max-error", 0.03, expect=None)
    assert document(tmp_path)["worst"]["error"] <= 0.03


def test_nothing_of_others_is_replaced_and_maps_that_are_left_over_go(tmp_path: Path) -> None:
    gentle(tmp_path, 3)
    painted = image(tmp_path / "strange.exr", np.ones((4, 4, 3), np.float32))
    (tmp_path / "out").mkdir()
    for name, content in (
        ("basis.json", b'{"mine": 1}'),
        ("basis.0001.1001.exr", painted.read_bytes()),
        ("basis.glb", b"glTF" + bytes(16) + b'{"asset":{"generator":"other"'),
    ):
        (tmp_path / "out" / name).write_bytes(content)
        said = bake(tmp_path, "--gltf", expect=2)
        assert f"{name} is there, and is no file that vrtm has written" in said
        assert files(tmp_path / "out") == {name: content}
        (tmp_path / "out" / name).unlink()
    bake(tmp_path, "--max-error", 0.1, expect=None)
    many = document(tmp_path)["maps"]
    bake(tmp_path, "--max-error", 40, expect=None)
    few = document(tmp_path)["maps"]
    assert few < many and len(list((tmp_path / "out").glob("basis.*.1001.exr"))) == few


def test_weights_of_controls_are_exact_at_the_poses_and_measured_between(tmp_path: Path) -> None:
    """Frame N of the sheet is N times one shape."""
    gentle(tmp_path, 5)
    table = tmp_path / "controls.csv"
    table.write_text("frame,pull\n" + "".join(f"{n},{n / 5}\n" for n in range(1, 6)))
    bake(tmp_path, "--controls", table, "--held-out", "2,4", "--max-error", 0.2, expect=None)
    told = document(tmp_path)
    driver = told["driver"]
    assert driver["controls"] == ["pull"] and driver["form"] == "distances"

    def weights(pull: float) -> np.ndarray:
        scaled = pull / np.array(driver["ranges"])
        away = [np.linalg.norm(scaled - np.array(centre)) for centre in driver["centres"]]
        return np.array([*away, *scaled, 1.0]) @ np.array(driver["coefficients"])

    for row in told["frames"]:
        np.testing.assert_allclose(weights(row["frame"] / 5), row["weights"], atol=1e-5)
    # Linear in between, from pose to pose.
    np.testing.assert_allclose(weights(0.4), (weights(0.2) + weights(0.6)) / 2, atol=1e-9)
    for row in told["held_out"]:
        assert row["error"] == pytest.approx(off(tmp_path, row, weights(row["frame"] / 5)), abs=1e-3)
    assert told["random"]["poses"] == 32 and told["random"]["folding"] == 0


def test_controls_at_which_the_sum_folds_are_named(tmp_path: Path) -> None:
    """Two poses squeeze the same place: both at once fold it in more places than either."""
    sheet(tmp_path / "scene", frames=5, cells=4)
    (tmp_path / "controls.csv").write_text("frame,one,other\n3,1,0\n5,0,1\n")
    said = bake(tmp_path, "--frames", "3,5", "--controls", tmp_path / "controls.csv", expect=3)
    told = document(tmp_path)["random"]
    assert told["folds"] > told["folds_of_maps"] and 0 < told["folding"] <= 32
    one, other = (told["worst"][name] for name in ("one", "other"))
    assert f"places with one {one:g}, other {other:g}: a frame with such a pose helps" in said
    assert 0 <= one <= 1 and 0 <= other <= 1


def test_a_sum_that_folds_where_the_frame_does_not_takes_more_maps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gentle(tmp_path, 3)
    bake(tmp_path, "--max-error", 1000)
    assert document(tmp_path)["maps"] == 1
    own = [basis_tiles.read_delta(str(path), "tile") for path in (tmp_path / "out").glob("redirect.*.exr")]

    def folds(delta: np.ndarray) -> tuple[int, float]:
        """Takes all to fold but the frames' own maps, up to the rounding to 16 bits."""
        return int(min(np.abs(delta - other).max() for other in own) > 1e-4), 0.0

    monkeypatch.setattr(basis_tiles, "folds", folds)
    bake(tmp_path, "--max-error", 900)
    assert document(tmp_path)["maps"] == 3


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("frame,pull\n1,0.5\n", "no row for frame 2-3"),
        ("frame,pull\n1,x\n", ":2: '1,x' is not a frame and numbers"),
        ("frame,pull\n1,nan\n", ":2: 1 finite numbers are needed"),
        ("frame,pull\n1,1\n1,2\n", ":3: frame 1 is there twice"),
        ("frame\n1\n", ":1: the first line must be 'frame', and the names"),
        ("frame,a,a\n", ":1: each control needs a name of its own"),
        ("frame,pull\n1,1\n2,1\n3,2\n", "two poses have the controls {'pull': 1.0}"),
    ],
)
def test_bad_tables_of_controls_are_named(tmp_path: Path, table: str, said: str) -> None:
    sheet(tmp_path / "scene", frames=3, cells=2)
    (tmp_path / "controls.csv").write_text(table)
    assert said in bake(tmp_path, "--controls", tmp_path / "controls.csv", expect=2)
    if "two poses" not in said:
        assert not (tmp_path / "out").exists(), "it is known before the first solve"


def test_held_out_frames_are_some_of_those_that_are_baked(tmp_path: Path) -> None:
    sheet(tmp_path / "scene", frames=2, cells=2)
    assert "--held-out 3: none of 1-2" in bake(tmp_path, "--held-out", 3, expect=2)
    assert "--held-out: no frame is left" in bake(tmp_path, "--held-out", "1,2", expect=2)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--basis", "--map-size", "auto"), "--basis and --map-size auto exclude each other"),
        (("--basis", "--tiles", 1001), "--basis and --tiles exclude each other"),
        (("--controls", "a.csv"), "--controls needs --basis"),
        (("--held-out", 1), "--held-out needs --basis"),
        (("--basis-format", "unorm8"), "--basis-format needs --basis"),
        (("--gltf",), "--gltf needs --basis"),
        (("--basis", "--gltf", "--subsets"), "--gltf and --subsets exclude each other"),
        (("--carry", "a.usda"), "--carry needs --carry-prims"),
        (("--carry-pieces", "connected"), "--carry-pieces needs --carry-prims"),
        (("--carry-prims", "/a", "--subsets"), "--carry-prims and --subsets exclude each other"),
        (("--subsets", "--open-borders", "slide"), "--subsets and --open-borders slide exclude each other"),
        (("--quiet", "--dry-run"), "exclude each other"),
        (("--temporal-weight", 0.2), "--temporal-weight needs --warm"),
        (("--root", "a.usda"), "--root needs --layer"),
        (("--only-layer",), "--only-layer needs --layer"),
        (("--layer", "l.usda", "--layer-mode", "primvar", "--tiles", 1001), "--tiles cannot go with it"),
        (("--max-layers", 4, "--overlap", "fixed"), "--max-layers needs --overlap each"),
    ],
)
def test_options_that_do_not_go_together(tmp_path: Path, options: tuple, said: str) -> None:
    ended = run("bake", "scene.usda", "--rigidity", "r.png", *options, expect=2)
    assert said in ended.stderr and len(ended.stderr.splitlines()) == 1
