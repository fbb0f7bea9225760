"""Rigidity out of pictures: against plain loops, on pictures of which it is known what is in them, and the command."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bake_scenes import files, image, pixels
from conftest import REPOSITORY, centres
from vrtm import cli, rigidity


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(1)


def overlap(one: np.ndarray, other: np.ndarray) -> float:
    """The area of both over the area of either."""
    one, other = one > 0.5, other > 0.5
    return (one & other).sum() / (one | other).sum()


def discs(size: int) -> np.ndarray:
    """Round studs, (size, size) of 0 and 1."""
    u, v = centres(size)
    return (np.hypot((u * 6 % 1 - 0.5) / 6, (v * 4 % 1 - 0.5) / 4) < 0.055).astype(np.float32)


def test_the_threshold_is_the_best_one(random: np.random.Generator) -> None:
    values = np.concatenate([random.normal(0.2, 0.05, 4000), random.normal(0.7, 0.1, 1000)])
    found = rigidity.otsu(values.astype(np.float32))

    def within(threshold: float) -> float:
        parts = values[values <= threshold], values[values > threshold]
        return sum(len(p) * p.var() for p in parts if len(p))

    best = min(within(t) for t in np.linspace(values.min(), values.max(), 1000))
    assert within(found) < 1.01 * best
    # Of all pictures together.
    assert rigidity.otsu(values[:1700].astype(np.float32), values[1700:].astype(np.float32)) == found
    assert rigidity.otsu(np.full(5, 0.5, np.float32)) == 0.5
    # Between two values, and not at one of them.
    assert rigidity.otsu(np.array([0, 0, 1, 1], np.float32)) == pytest.approx(0.5, abs=0.01)


def test_what_stands_out_is_found_on_a_slope(random: np.random.Generator) -> None:
    size = 256
    studs, (rows, columns) = discs(size), np.mgrid[0:size, 0:size] / size
    ground = 0.5 + 0.3 * np.sin(3 * columns) + 0.2 * rows
    heights = (ground + 0.06 * studs + random.normal(0, 0.004, (size, size))).astype(np.float32)
    # A threshold on heights alone would not do.
    assert overlap(rigidity.of_brightness({0: heights})[0], studs) < 0.4
    for given in ({"threshold": 0.0}, {"threshold": 0.3}):
        assert overlap(rigidity.of_heights({0: heights}, 0.11, **given)[0], studs) > 0.85
    assert overlap(rigidity.of_heights({0: 1 - heights}, 0.11, sunken=True)[0], studs) > 0.85
    # In a flat picture nothing stands out, alone or beside others: the threshold is that of all.
    for value in (0.3, 0.1234567, 1000.7):
        assert rigidity.of_heights({0: np.full((33, 31), value, np.float32)}, 0.2)[0].max() == 0
    flat = (0.5 + 0.01 * random.random((size, size))).astype(np.float32)
    both = rigidity.of_heights({1001: heights, 1002: flat}, 0.11)
    assert overlap(both[1001], studs) > 0.85 and both[1002].max() == 0
    assert rigidity.of_brightness({1001: studs, 1002: 0.3 * flat})[1002].max() == 0


def test_detail_is_where_a_tile_is_drawn_on() -> None:
    studs, maps = discs(512), {}
    for size in (512, 1024):
        stripe = np.full((size, size, 4), 0.5, np.float32)
        stripe[:, size // 2 :] = 0.9
        maps[size] = rigidity.fitted(rigidity.of_detail({0: stripe}, ceiling=0.4)[0], (512, 512))
        assert maps[size][:, 255:257].min() == np.float32(0.4) and maps[size][:, :240].max() == 0
        assert np.abs(maps[size] - maps[512]).mean() < 1e-3
        # A contrast that nobody sees.
        assert rigidity.of_detail({0: 0.5 + stripe / 50})[0].max() == 0
    coded = rigidity.of_detail({0: stripe})[0]
    assert np.array_equal(rigidity.of_detail({0: rigidity.light(stripe)}, linear=True)[0], coded)
    # Nothing is drawn, or in the normal map alone.
    for shape in ((64, 64), (1, 9, 3), (300, 200, 4)):
        assert rigidity.of_detail({0: np.full(shape, 0.123, np.float32)})[0].max() == 0
    flat, turned = np.full((2, 512, 512, 3), 0.5, np.float32)
    turned[:256, :, 0] = 0.2
    assert rigidity.of_detail({0: flat}, normals={0: turned})[0][255:257].min() == np.float32(0.3)
    # Features, and what is close to them, stay as they are; a tile without features has nothing to be held.
    found = rigidity.of_detail({1001: stripe, 1002: stripe}, {1001: studs, 1002: studs / 3}, ceiling=0.49, margin=4)
    assert {tuple(values.shape) for values in found.values()} == {(512, 512)}
    assert found[1001].max() == np.float32(0.49) and found[1002].max() == 0
    assert found[1001][rigidity.grown(studs, 8) > 0].max() == 0


def test_rust_has_the_same_definitions() -> None:
    """`crates/paint`, whose tests read these maps, too."""

    def picture(width: int, height: int, value: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
        rows, columns, channels = np.mgrid[0:height, 0:width, 0:4]
        noise = (3 * columns**2 + 5 * columns * rows + 7 * rows**2 + 11 * channels) % 23
        return (value(noise, columns) / 255).astype(np.float32)

    small = picture(12, 9, lambda noise, _: 15 + 10 * noise)
    wide = picture(2100, 6, lambda noise, columns: 100 + noise * columns // 1000)
    features = ((np.arange(2100) // 50 == 30) * np.ones((6, 1))).astype(np.float32)
    height = rigidity.brightness(small)
    found = {
        "brightness": rigidity.of_brightness({0: small})[0],
        "colour": rigidity.of_colour({0: small}, (0.5, 0.3, 0.6), 0.4)[0],
        "fitted": rigidity.fitted(rigidity.smaller(rigidity.soft(height > 0.5), 7), (5, 7)),
        "detail": rigidity.of_detail({0: wide})[0][::2, ::50],
        "outside": rigidity.of_detail({0: wide}, {0: features}, ceiling=1)[0][::2, ::50],
    }
    lines = [f"{name} {np.rint(255 * values).astype(np.uint8).tobytes().hex()}\n" for name, values in found.items()]
    assert (REPOSITORY / "crates/paint/src/agreed.txt").read_text() == "".join(lines)
    # A strip that is narrower than a block.
    assert np.abs(rigidity.smaller(wide, 8)[0, 0] - wide[:, :263].mean((0, 1))).max() < 1e-5


@pytest.fixture
def skin(tmp_path: Path) -> Path:
    """Two tiles of a texture with golden studs on green skin, and their heights."""
    for udim, studs in ((1001, discs(128)), (1012, discs(128)[:, ::-1])):
        colours = np.where(studs[..., None] > 0.5, (204, 153, 77), (26, 77, 26))
        image(tmp_path / f"skin.{udim}.png", colours.astype(np.uint8))
        image(tmp_path / f"height.{udim}.exr", (0.2 + 0.1 * studs[..., None]).astype(np.float32))
    return tmp_path


def made(folder: Path, *more: object, source: str = "skin.<UDIM>.png", expect: int = 0) -> dict[str, np.ndarray]:
    given = ["rigidity", folder / source, "--out", folder / "out" / "rigid.<UDIM>.png", *more]
    assert cli.main([str(part) for part in given]) == expect
    return {path.name: pixels(path) for path in sorted((folder / "out").glob("*"))}


@pytest.mark.parametrize(
    ("source", "more", "inverse"),
    [
        ("skin.<UDIM>.png", (), False),
        ("skin.<UDIM>.png", ("--threshold", "0.4", "--invert"), True),
        ("skin.<udim>.png", ("--from", "colour", "--colour", "#cc994d", "--tolerance", "0.1"), False),
        ("skin.<UDIM>.png", ("--from", "colour", "--colour", "0.1,0.3,0.1"), True),
        ("height.<UDIM>.exr", ("--from", "height", "--feature", "0.11"), False),
    ],
)
def test_the_command_writes_a_map_per_tile(skin: Path, source: str, more: tuple[str, ...], inverse: bool) -> None:
    found = made(skin, *more, source=source)
    assert list(found) == ["rigid.1001.png", "rigid.1012.png"]
    for udim, studs in ((1001, discs(128)), (1012, discs(128)[:, ::-1])):
        map = found[f"rigid.{udim}.png"]
        assert (map.shape, map.dtype) == ((128, 128, 1), np.uint8)
        assert overlap(map[..., 0] / 255, 1 - studs if inverse else studs) > 0.85


def test_the_command_adds_detail_to_maps(skin: Path, capsys: pytest.CaptureFixture[str]) -> None:
    studs = {int(name[6:10]): map for name, map in made(skin, "--size", "128").items()}
    for udim, line in ((1001, 255), (1012, 26)):
        drawn = np.full((512, 512, 3), 26, np.uint8)
        drawn[300:, :] = line
        image(skin / f"drawn.{udim}.png", drawn)
    rigid = ("--from", "detail", "--and", skin / "out" / "rigid.<UDIM>.png", "--margin", "1")
    both = made(skin, *rigid, "--out", skin / "out" / "both.<UDIM>.png", source="drawn.<UDIM>.png")
    for udim, map in studs.items():
        other = both[f"both.{udim}.png"]
        assert other.shape == (128, 128, 1) and np.array_equal(other > 127, map > 127)
        grey = other[(map == 0) & (other > 0)]
        assert (grey.size > 50, grey.max(initial=0)) == ((True, 76) if udim == 1001 else (False, 0))
    # Nor is grey beside less rigid features one of them; a tile is not lost.
    for udim in (1001, 1003):
        image(skin / f"soft.{udim}.png", (studs[1001] * 0.6).astype(np.uint8))
    soft = ("--from", "detail", "--and", skin / "soft.<UDIM>.png", "--margin", "1")
    made(skin, *soft, expect=2)
    assert "soft.1003.png: " in capsys.readouterr().err
    (skin / "soft.1003.png").unlink()
    both = made(skin, *soft, "--out", skin / "out" / "soft.<UDIM>.png", source="drawn.<UDIM>.png")
    assert both["soft.1001.png"][studs[1001] == 0].max() == 46
    made(skin, *rigid, "--mask", "--out", skin / "out" / "mask.<UDIM>.png", source="drawn.<UDIM>.png")
    mask = pixels(skin / "out" / "mask.1001.png")[..., 0]
    assert mask[75].min() == 0 and mask[:70].min() == 255 and mask[discs(128) > 0].min() == 255
    # Any maps are joined.
    image(skin / "square.png", np.pad(np.full((8, 8, 1), 200, np.uint8), ((0, 56), (0, 56), (0, 0))))
    made(skin, "--and", skin / "square.png", expect=2)
    assert "square.png: either it and" in capsys.readouterr().err
    given = ["rigidity", skin / "skin.1001.png", "--and", skin / "square.png", "--out", skin / "one.png"]
    assert cli.main([str(part) for part in given]) == 0
    one = pixels(skin / "one.png")[..., 0]
    assert one.shape == (64, 64) and one[:8, :8].min() >= 200 and one.max() == 255


def test_a_map_that_is_there(skin: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wide = made(skin, "--grow", "2", "--size", "64")
    assert wide["rigid.1001.png"].shape == (64, 64, 1)
    before = files(skin)
    assert "2 up to date" in _said(skin, capsys, "--grow", "2", "--size", "64")
    assert files(skin) == before
    # One that is painted on is the painter's, and so is a texture.
    path = skin / "out" / "rigid.1001.png"
    image(path, wide["rigid.1001.png"] // 2)
    before = files(skin)
    made(skin, expect=2)
    assert str(path) in capsys.readouterr().err
    made(skin, "--out", skin / "skin.<UDIM>.png", "--overwrite", expect=2)
    assert "which is read" in capsys.readouterr().err
    assert files(skin) == before
    assert made(skin, "--overwrite")["rigid.1001.png"].shape == (128, 128, 1)


def _said(folder: Path, capsys: pytest.CaptureFixture[str], *more: object) -> str:
    capsys.readouterr()
    made(folder, *more)
    return capsys.readouterr().out


def test_a_map_of_nothing_is_told(skin: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(skin, "--threshold", "0.99")
    assert "warning: nothing is rigid in any of 2 maps" in capsys.readouterr().err
    made(skin, "--threshold", "0.01")
    assert "warning: all is rigid in all of 2 maps" in capsys.readouterr().err
    # One tile without studs is as it should be; how much is rigid is told for each.
    image(skin / "skin.1012.png", np.full((64, 64, 3), 30, np.uint8))
    said = _said(skin, capsys)
    assert "rigid.1012.png: 0.0% rigid" in said and "rigid.1001.png: " in said


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--from", "colour"), "--from colour: --colour says which"),
        (("--colour", "#ffffff"), "--colour: only with --from colour"),
        (("--feature", "0.1"), "--feature: only with --from height"),
        (("--mask",), "--mask: only with --from detail"),
        (("--normal-map", "n.<UDIM>.png"), "--normal-map: only with --from detail"),
        (("--from", "detail", "--grow", "2"), "--invert, --grow: not with --from detail"),
        (("--from", "detail", "--ceiling", "0.5"), "'0.5' is not under 0.5"),
        (("--and", "none.<UDIM>.png"), "none.<UDIM>.png: no such file"),
        (("--from", "colour", "--colour", "#fff000", "--threshold", "0.5"), "--threshold: only with --from brightness"),
        (("--from", "colour", "--colour", "gold"), "'gold' is no colour"),
        (("--from", "colour", "--colour", "1,nan,1"), "'1,nan,1' is no colour"),
        (("--threshold", "2"), "'2' is not a number from 0 to 1"),
        (("--out", "rigid.png"), "--out rigid.png: either it and"),
        (("--out", "rigid.<UDIM>.jpg"), "--out rigid.<UDIM>.jpg: its name must end in .png, .tif or .exr"),
    ],
)
def test_options_that_do_not_fit(skin: Path, capsys: pytest.CaptureFixture[str], more, message: str) -> None:
    before = files(skin)
    try:
        made(skin, *more, expect=2)
    except SystemExit as end:
        assert end.code == 2
    assert message in capsys.readouterr().err
    assert files(skin) == before


def test_pictures_that_are_not_there(skin: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(skin, source="none.<UDIM>.png", expect=2)
    assert "none.<UDIM>.png: no such file" in capsys.readouterr().err
    (skin / "bad.1001.png").write_bytes(b"no image")
    made(skin, source="bad.<UDIM>.png", expect=2)
    assert "bad.1001.png" in capsys.readouterr().err
    made(skin, source="skin.1001.png", expect=2)
    assert "--out" in capsys.readouterr().err and not (skin / "out").exists()
    # Tiles as other programs write them.
    image(skin / "mari.u1_v1.png", np.full((16, 16, 3), 30, np.uint8))
    image(skin / "mari.u2_v3.png", np.full((16, 16, 3), 200, np.uint8))
    assert list(made(skin, source="mari.<UVTILE>.png")) == ["rigid.1001.png", "rigid.1022.png"]
    made(skin, source="mari.u<U>_v1.png", expect=2)
    assert "mari.u<U>_v1.png: several tiles have the same name" in capsys.readouterr().err
    # A single picture needs no tiles.
    assert cli.main(["rigidity", str(skin / "skin.1001.png"), "--out", str(skin / "one.exr")]) == 0
    assert pixels(skin / "one.exr").dtype == np.float16


def test_specks() -> None:
    # A spiral, whose texels are far from its least one, a square of 4 x 4, and specks at its corner.
    values = np.zeros((40, 60), np.float32)
    values[2, 2:40] = values[2:30, 40] = values[30, 6:41] = values[6:31, 6] = values[6, 6:36] = 1
    values[12:16, 12:16] = 1
    values[16, 16] = values[38, 58] = 1
    for width, features, specks in ((0, 4, 0), (2, 2, 2), (5, 1, 3), (20, 0, 4)):
        left, *counts = rigidity.without_specks(values, width)
        assert counts == [features, specks]
        if features == 4:
            np.testing.assert_array_equal(left, values)
    # Soft borders stay.
    disc = rigidity.soft(np.hypot(*np.mgrid[-20:20, -20:20]) < 8)
    np.testing.assert_array_equal(rigidity.without_specks(disc, 10)[0], disc)
    # A cross, and the octagon that a square makes of it.
    assert [int(rigidity.grown(np.eye(1, 49, 24).reshape(7, 7), steps).sum()) for steps in (1, 2)] == [5, 21]
    assert np.array_equal(rigidity.changed(disc, grow=-2), 1 - rigidity.changed(1 - disc, grow=2))
    assert rigidity.without_specks(np.zeros((8, 8), np.float32), 3)[1:] == (0, 0)
