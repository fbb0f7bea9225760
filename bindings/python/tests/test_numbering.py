"""The number of the frame in a file's name, and tokens that stand for it or for a tile."""

from pathlib import Path

import pytest

from conftest import refused
from vrtm.bake import arguments, frames, parsing, tokens, warped
from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene import SceneError
from vrtm.bake.scene.images import find_maps
from vrtm.bake.scene.poses import find_poses


def found(folder: Path, names: str, *patterns: str, warnings: list[str] | None = None) -> dict[int, str]:
    """The poses among files of these names, by their names below the folder."""
    for name in names.split():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    poses = find_poses(tuple(str(folder / pattern) for pattern in patterns), warnings)
    return {frame: str(Path(path).relative_to(folder)) for frame, path in poses.items()}


@pytest.mark.parametrize(
    ("names", "pattern", "expected"),
    [
        ("sim.-0002.obj sim.-0001.obj sim.0000.obj sim.0001.obj", "sim.*.obj", [-2, -1, 0, 1]),
        ("sim_-2.obj sim_-1.obj", "*.obj", [-2, -1]),
        ("-10.obj -9.obj", "*.obj", [-10, -9]),
        ("sim--2.obj sim--1.obj", "*.obj", [-2, -1]),
        # As fileseq reads them, since some have no hyphen.
        ("sim-0001.obj sim0000.obj sim0001.obj", "*.obj", [-1, 0, 1]),
        # The hyphen stands outside of the wildcard.
        ("sim-0001.obj sim-0002.obj", "sim-*.obj", [1, 2]),
        ("v2_f0007_take3.obj v2_f0009_take3.obj", "*.obj", [7, 9]),
        ("7/a.obj 12/a.obj", "*/a.obj", [7, 12]),
        ("angry.obj smile.obj", "*.obj", [1, 2]),
        ("sim.0012.obj", "*.obj", [12]),
        # By a token.
        ("a.0001.obj a.0020.obj a.10000.obj a.-0003.obj a.-004.obj", "a.####.obj", [1, 20, 10000, -3, -4]),
        *(
            ("a.0001.obj a.-0003.obj", f"a.{token}.obj", [1, -3])
            for token in ("@@@@", "%04d", "$F4", "${F4}", "<frame>", "<FRAME04>")
        ),
        ("a.0001.obj a.10.obj", "a.<f>.obj", [1, 10]),
        *(("a.1.obj a.10.obj a.-3.obj", f"a.{token}.obj", [1, 10, -3]) for token in ("%d", "$F")),
        *(("a.1.obj a.10.obj", f"a.{token}.obj", [1, 10]) for token in "#@"),
        ("a-0001.obj a-0002.obj", "a-####.obj", [1, 2]),
        ("a.-0001.obj a.0002.obj", "a.-####.obj", [-1]),
        ("a-0001.obj a0000.obj", "a####.obj", [-1, 0]),
        ("0001/a.obj 0002/a.obj", "$F4/a.obj", [1, 2]),
        ("v1/a.0001.obj v2/a.0002.obj", "v*/a.####.obj", [1, 2]),
        ("joe@work.0001.obj", "joe@work.####.obj", [1]),
        ("shot#3/[a]/a.0001.obj", "shot#3/[a]/a.####.obj", [1]),
        ("a[1].0001.obj a[1].0002.obj", "a[1].####.obj", [1, 2]),
        ("a1.0001.obj b1.0002.obj", "[ab]1.####.obj", [1, 2]),
        ("a1.0001.obj", "a[!2].####.obj", [1]),
    ],
)
def test_files_by_the_number_in_which_they_differ(tmp_path, names: str, pattern: str, expected: list[int]) -> None:
    warnings: list[str] = []
    poses = dict(zip(expected, names.split()))
    assert found(tmp_path, names, pattern, warnings=warnings) == poses and not warnings
    # A shell puts names in the place of the wildcard: then a hyphen is that of a number.
    if pattern in ("sim.*.obj", "*.obj", "*/a.obj"):
        assert found(tmp_path, "", *names.split(), warnings=warnings) == poses and not warnings


@pytest.mark.parametrize(
    ("names", "patterns", "message"),
    [
        ("a.1.obj a.0001.obj", "a.*.obj", r"a\.1\.obj: frame 1 is already .*a\.0001\.obj"),
        ("a.1.obj a.0001.obj", "a.<frame>.obj", "frame 1 is already"),
        ("a.-0003.obj a.-003.obj", "a.####.obj", "frame -3 is already"),
        ("a.0000.obj a.-0000.obj", "a.*.obj", "frame 0 is already"),
        ("a.0001.obj b.0001.obj", "?.####.obj", "frame 1 is already"),
        ("a1.0001.obj a2.0002.obj", "a*.obj", r"which of 1 and 0001 is the frame\? Write a token"),
        ("a.0001.25.obj a.0002.50.obj", "a.*.obj", "which of 0001 and 25 is the frame"),
        ("a.0001.obj b.0002.obj", "*.obj", r"a\.0001\.obj and .*b\.0002\.obj are not of one sequence"),
        ("a.0001.obj rest.obj", "*.obj", "are not of one sequence"),
        ("", "a.####.$F4.obj", r"#### and \$F4 both stand for the frame"),
        ("", "$F4/a.$F4.obj", "both stand for the frame"),
        ("a-0001.obj a-0002.obj", "a*.obj", r"a-0001\.obj: frame -1, or 1\? Write .*a-####\.obj if the hyphen is no "),
        ("a-0001.obj a-0002.obj", "a-0001.obj a-0002.obj", "frame -1, or 1"),
        ("a-0001.obj a-0002.obj", "*####.obj", "frame -1, or 1"),
        ("a-1.obj b-2.obj", "a-1.obj b-2.obj", "frame -1, or 1"),
        ("a.1.obj", "a.####.obj", r"a\.####\.obj: no such files, but .*a\.1\.obj, whose number has other digits"),
        ("pose.0001.obj", "posse.<frame>.obj", r"posse\.<frame>\.obj: no such files: did you mean pose\.0001\.obj"),
        ("", "a.{frame}.obj", "no such file; tokens of a frame are ####, @@@@, %04d, "),
        ("pose.0001.obj", "pose..obj", r"pose\.\.obj: no such file: did you mean pose\.0001\.obj"),
        ("b7.obj c.obj", "b%d.obj c.obj", "cannot be mixed"),
    ],
)
def test_two_readings_are_refused(tmp_path: Path, names: str, patterns: str, message: str) -> None:
    refused(SceneError, message, found, tmp_path, names, *patterns.split())


@pytest.mark.parametrize(
    ("names", "patterns", "expected", "warning"),
    [
        ("a-0001.obj", "a####.obj", {-1: "a-0001.obj"}, "taken for frame -1: write a hyphen before #### if"),
        ("c.obj b7.obj", "c.obj b7.obj", {1: "c.obj", 2: "b7.obj"}, "in the order in which they are listed"),
        ("a1.obj b1.obj", "b1.obj a1.obj", {1: "b1.obj", 2: "a1.obj"}, "in the order in which they are listed"),
        ("a5.obj a6.obj", "a5.obj a6.obj a5.obj", {1: "a5.obj", 2: "a6.obj", 3: "a5.obj"}, "in the order in which"),
    ],
)
def test_what_is_left_out_or_counted_is_told(tmp_path: Path, names, patterns, expected, warning) -> None:
    warnings: list[str] = []
    assert found(tmp_path, names, *patterns.split(), warnings=warnings) == expected
    assert len(warnings) == 1 and warning in warnings[0]


def test_files_with_other_digits_are_listed(tmp_path: Path) -> None:
    for name in ("a.0001.obj", "a.1.obj", "a.2.obj", "a.00003.obj"):
        (tmp_path / name).touch()
    left_out: list[LeftOut] = []
    assert list(find_poses((str(tmp_path / "a.####.obj"),), left_out=left_out)) == [1]
    (entry,) = left_out
    assert entry.frames == (2, 3) and entry.why.endswith("have numbers with other digits than ####") and not entry.meant


def test_tokens_of_a_tile() -> None:
    """OpenImageIO's tokens mean the same here."""
    for patterns, expected in {
        "a.<UDIM> a.<udim> a.%(UDIM)d": "a.1023",
        "a_<UVTILE> a_<U>_<V> a_u<U>_v<V> a_%(UVTILE)d": "a_u3_v3",
        "a_<uvtile> a_<u>_<v> a_u<u>_v<v>": "a_u2_v2",
        "a_u%(U)02d_v%(V)02d": "a_u03_v03",
        "menu<U><V>": "menuu3v3",
    }.items():
        for pattern in patterns.split():
            assert tokens.tiled(pattern, 1023) == expected and tokens.has_tile(pattern), pattern
    assert [tokens.tiled("<UVTILE>", udim) for udim in (1001, 1010, 1011)] == ["u1_v1", "u10_v1", "u1_v2"]
    assert not tokens.has_tile("a.<frame>.$F4.1001.<mesh>")


def test_maps_by_tokens_of_a_tile(tmp_path: Path) -> None:
    for name in ("a.1001.png", "a.1012.png", "a_u1_v1.png", "a_u2_v2.png"):
        (tmp_path / name).touch()
    for pattern in ("a.%(UDIM)d.png", "a_<UVTILE>.png", "a_u<U>_v<V>.png"):
        assert sorted(find_maps(str(tmp_path / pattern), "mesh", (1001, 1012))) == [1001, 1012]
        assert warped.listed((pattern,), (), False)[0].kind == "a"
    for pattern, message in {
        "a_u<U>_v1.png": "some of the tiles 1001, 1011 have the same name: write <UDIM>",
        "b.<UVTILE>.png": r"b\.<UVTILE>\.png: no such file for the tiles 1001, 1011 of mesh$",
        "a_<TILE>.png": "has 2 tiles",
    }.items():
        refused(SceneError, message, find_maps, str(tmp_path / pattern), "mesh", (1001, 1011))
    with pytest.raises(SceneError, match=r"no such file .*; the tokens of a tile are <UDIM>, <UVTILE>"):
        find_maps(str(tmp_path / "a_<TILE>.png"), "mesh")


def test_names_of_frames_have_four_digits() -> None:
    texts = [frames.padded(frame) for frame in (-2, -2.5, -0.5, -12345, 0, 7, 1003.5, 12345)]
    assert texts == ["-0002", "-0002.5", "-0000.5", "-12345", "0000", "0007", "1003.5", "12345"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("-3", (-3,)), ("-10--1x3", (-10, -7, -4, -1)), ("-3, -1", (-3, -1)), ("-0.5-0.5x0.5", (-0.5, 0, 0.5))],
)
def test_negative_frames_are_an_argument_of_their_own(text: str, expected: tuple) -> None:
    parser = parsing.Parser(prog="vrtm")
    bake = arguments.add_to(parser.add_subparsers(dest="command"))
    for given in (["--frames", text, "--half"], [f"--frames={text}"]):
        parsed = parser.parse_args(["bake", "a.usda", "--rigidity", "r.png", *given])
        assert arguments.settings(bake, parsed).frames == expected
    assert parser.parse_args(["bake", "a.usda", "--layer", "l.usda", "--freeze", "-2"]).freeze == -2
