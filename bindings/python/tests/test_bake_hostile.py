"""Attacks on a bake: links in the place of its files, and inputs that lie about themselves or never end."""

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pxr import Sdf, Usd

import scenes
from bake_scenes import image
from conftest import refused
from vrtm.bake import frames, image_file, not_baked, report, staging, warped
from vrtm.bake.failure import Failure
from vrtm.bake.layer.clips import export
from vrtm.bake.mark import mark
from vrtm.bake.scene import Scene, SceneError
from vrtm.bake.scene.images import read_map, said
from vrtm.bake.scene.obj import read_obj
from vrtm.bake.settings import Settings


def an_image(path: str) -> None:
    form = {".exr": "openexr", ".png": "png", ".tif": "tiff"}[os.path.splitext(path)[1]]
    dtype = "float32" if form == "openexr" else "uint8"
    target = image_file.Target(path, 4, 4, ("R", "G", "B"), dtype, {}, format=form)
    image_file.write(target, np.ones((4, 4, 3), dtype))


def a_layer(path: str) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    mark(layer, "layer")
    export(layer, path, Sdf.Layer.ExportToString)


WRITERS: dict[str, Callable[[str], None]] = {
    **dict.fromkeys(("a.exr", "a.png", "a.tif"), an_image),
    **dict.fromkeys(("a.usda", "a.usdc", "a.usd"), a_layer),
    "a.json": lambda path: report.write(path, {}),
}


@pytest.fixture(params=[True, False], ids=["proc", "no proc"])
def proc(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """True if the system has paths that lead to open files."""
    real = os.path.exists
    if not request.param:
        monkeypatch.setattr(os.path, "exists", lambda path: not str(path).startswith("/proc/self/") and real(path))
    return request.param


@pytest.mark.parametrize("name", WRITERS)
def test_a_link_in_the_place_of_a_new_file_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, proc: bool
) -> None:
    victim, out = tmp_path / "victim", tmp_path / "out"
    victim.write_bytes(b"mine")
    WRITERS[name](str(out / name))
    assert os.listdir(out) == [name] and (out / name).stat().st_size
    before = (out / name).read_bytes()
    has = staging._Place.has

    def gate(*arguments: object) -> bool:
        """The file has just been made, and nothing is written yet."""
        monkeypatch.setattr(staging._Place, "has", has)
        assert has(*arguments)
        (made,) = out.glob(".*.part")
        made.unlink()
        made.symlink_to(victim)
        return True

    monkeypatch.setattr(staging._Place, "has", gate)
    refused((Failure, OSError), "another program put something else in its place", WRITERS[name], str(out / name))
    assert victim.read_bytes() == b"mine"
    assert os.listdir(out) == [name] and (out / name).read_bytes() == before


def test_a_link_in_the_place_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "a").write_bytes(b"mine")

    def body(place: str) -> None:
        out.rename(tmp_path / "moved")
        out.symlink_to(elsewhere)
        Path(place).write_bytes(b"content")

    staging.write(str(out / "a"), body)
    assert (elsewhere / "a").read_bytes() == b"mine" and (tmp_path / "moved" / "a").read_bytes() == b"content"


def test_a_sweep_waits_for_nothing(tmp_path: Path) -> None:
    (tmp_path / "kept").write_bytes(b"")
    os.utime(tmp_path / "kept", (0, 0))
    (tmp_path / ".a.0123456789abcdef.part").symlink_to("kept")
    os.mkfifo(tmp_path / ".b.0123456789abcdef.part")
    assert staging.sweep(str(tmp_path)) == [] and (tmp_path / "kept").exists()


def test_what_usd_quotes_of_a_file_may_be_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_bytes(b'#usda 1.0\ndef Mesh "m" { int[] a = [0, \xb5\x80] }' + b"x" * 10_000)
    with pytest.raises(SceneError, match=r"a\.usda: .*parse error.*\\xb5") as caught:
        Scene(tmp_path / "a.usda")
    assert len(str(caught.value)) < 600 + len(str(tmp_path))


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    made = scenes.stage(tmp_path / "a.usda", -1e9, 1e9)
    scenes.mesh(made, "/m")
    return made


@pytest.mark.parametrize("end", [np.nan, np.inf, 1e300])
def test_frames_that_nobody_counts_to(stage: Usd.Stage, end: float) -> None:
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(end)
    refused(SceneError, r"a\.usda: its frames go from 1 to .*is no frame", Scene, scenes.saved(stage))


def test_very_many_frames_are_not_listed(stage: Usd.Stage) -> None:
    scenes.mesh(stage, "/hidden").CreateVisibilityAttr("invisible")
    late = scenes.mesh(stage, "/late").CreateVisibilityAttr()
    late.Set("invisible", 1)
    late.Set("inherited", 7.5)
    with Scene(scenes.saved(stage)) as scene:
        assert [shape.path for shape in scene.shapes] == ["/m", "/late"]
        assert frames.clamp((5, 1.5, 10**10), scene.frames, True) == ((5, 1.5), (10**10,))
        assert frames.text(scene.frames) == "-1000000000-1000000000"
        refused(ValueError, r"2000000001 frames, .* more than 100000: --frames", frames.clamp, None, scene.frames)
        (entry,) = not_baked.of_frames(Settings("a.usda", frames=(1, 2)), scene.frames, ())
        assert entry.line() == "all but 2 of 2000000001 frames: not in --frames" and entry.meant


def test_an_index_of_thousands_of_digits(tmp_path: Path) -> None:
    for index in ("9" * 5000, "-" + "9" * 5000):
        (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {index}\n")
        with pytest.raises(SceneError, match=r"a\.obj: line 4: '-?9{50,60}' names") as caught:
            read_obj(str(tmp_path / "a.obj"))
        assert len(str(caught.value)) < 200 + len(str(tmp_path))


READERS = {"map": read_map, "texture": warped.read, "copy": warped.extension}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_images_that_are_too_large_are_refused_by_their_header(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable
) -> None:
    monkeypatch.setenv("VRTM_MAX_IMAGE", "8")
    read(str(image(tmp_path / "fits.png", np.zeros((16, 4, 4), np.uint8))))
    noise = np.random.default_rng(1).integers(0, 256, (99, 98, 1), np.uint8)
    large = str(image(tmp_path / "large.png", noise))
    # So that its texels cannot be read: nothing tries to.
    os.truncate(large, 5000)
    refused(SceneError, r"large\.png: 98 x 99 texels of 1 channels: more than 8 x 8 .*VRTM_MAX_IMAGE", read, large)
    monkeypatch.setenv("VRTM_MAX_IMAGE", "1e4")
    refused(SceneError, "VRTM_MAX_IMAGE: '1e4' is not a number", read, large)
    # The display window counts, too.
    monkeypatch.delenv("VRTM_MAX_IMAGE")
    wide = image(tmp_path / "a.exr", np.zeros((4, 4, 1), np.float16), full_width=1 << 20, full_height=1 << 20)
    refused(SceneError, r"a\.exr: 1048576 x 1048576 texels", read, str(wide))


@pytest.mark.parametrize("read", [*READERS.values(), read_obj], ids=[*READERS, "obj"])
def test_pipes_and_devices_are_no_files(tmp_path: Path, read: Callable) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (str(tmp_path / "pipe"), "/dev/zero"):
        refused(SceneError, f"{path}: is no file", read, path)


def test_a_library_may_fail_anywhere_in_a_damaged_file(stage: Usd.Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(5)

    def fail(*_: object) -> None:
        raise RuntimeError("read failed\nsomewhere")

    with Scene(scenes.saved(stage)) as scene:
        monkeypatch.setattr(scene.source, "positions", fail)
        refused(SceneError, r"a\.usda: cannot be read: read failed somewhere$", scene.positions, scene.shapes[0], 1)
    monkeypatch.setattr("vrtm.bake.scene.usd_stage.stage_frames", fail)
    refused(SceneError, r"a\.usda: cannot be read: read failed somewhere$", Scene, scenes.saved(stage))


def test_errors_and_attributes_of_images_may_be_no_text() -> None:
    assert said(SimpleNamespace(geterror=lambda: b"no attribute type \xb5\n".decode())) == r"no attribute type \xb5"
    told = [("camera", "string", "x"), ("Artist", "string", "\udcff"), ("compression", "string", "zip")]
    kept = [warped._can_be_kept(SimpleNamespace(name=n, type=t, value=v)) for n, t, v in told]
    assert kept == [True, False, False]


def test_figures_that_were_changed_are_told(tmp_path: Path) -> None:
    target = image_file.Target(str(tmp_path / "a.exr"), 4, 4, ("R", "G", "B"), "float32", {"vrtm:kind": "redirect"})
    image_file.write(target, np.ones((4, 4, 3), np.float32), {"movable": 1})
    assert image_file.up_to_date(target) == {"movable": 1}
    content = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(content.replace(b"movable", b"mo?able"))
    refused(Failure, "are not those that vrtm wrote", image_file.up_to_date, target)
    assert image_file.up_to_date(target, replace=True) is None
