"""Maps from image files."""

from pathlib import Path

import numpy as np
import pytest

from bake_scenes import image
from vrtm.bake.scene import SceneError
from vrtm.bake.scene.images import find_maps, read_map


@pytest.mark.parametrize(
    ("name", "kind", "largest"),
    [
        ("a.png", np.uint8, 255),
        ("a.png", np.uint16, 65535),
        ("a.tif", np.uint16, 65535),
        ("a.exr", np.float16, 2),
        ("a.exr", np.float32, 2),
        ("a.tif", np.float32, 2),
    ],
)
def test_values_are_read_as_they_are_stored(tmp_path: Path, name: str, kind: type, largest: float) -> None:
    texels = np.linspace(0, largest, 12).astype(kind).reshape(3, 4, 1)
    read = read_map(str(image(tmp_path / name, texels)))
    assert read.dtype == kind and read.flags.c_contiguous and np.array_equal(read, texels[..., 0])


def test_f64_becomes_f32(tmp_path: Path) -> None:
    read = read_map(str(image(tmp_path / "a.tif", np.full((2, 2, 1), 0.3))))
    assert read.dtype == np.float32 and read[0, 0] == np.float32(0.3)


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
        with pytest.raises(SceneError, match=message):
            find_maps(pattern, "body", udims)


def test_files_that_are_no_images(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("no image")
    for name in ("a.png", "none.png"):
        with pytest.raises(SceneError, match=rf"{name}: .*"):
            read_map(str(tmp_path / name))
