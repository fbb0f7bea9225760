"""What others may do to a bake: links in the place of its files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf

from vrtm.bake import image_file, report, staging
from vrtm.bake.failure import Failure
from vrtm.bake.layer import export
from vrtm.bake.mark import mark


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
    "a.yaml": lambda path: staging.write_bytes(path, b"a template"),
}


@pytest.fixture(params=[True, False], ids=["proc", "no proc"])
def proc(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether the system has paths that lead to open files."""
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
    with pytest.raises((Failure, OSError), match="another program put something else in its place"):
        WRITERS[name](str(out / name))
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
