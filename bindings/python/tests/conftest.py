"""Fixtures and arrays that several tests share: a device, a sheet with painted studs, and its poses."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vrtm

REPOSITORY = Path(__file__).resolve().parents[3]
# Of sweeps all cases, and otherwise some.
LONG = os.environ.get("VRTM_LONG_TESTS") == "1"


@pytest.fixture(scope="session")
def device() -> Iterator[vrtm.Device]:
    with vrtm.Device("cpu") as device:
        yield device


def refused(kind: type | tuple, words: str, function: Callable, *arguments: object, **named: object) -> None:
    """Checks that a call raises an exception of a kind, in whose message a pattern, if any, is found."""
    with pytest.raises(kind, match=words or None):
        function(*arguments, **named)


def until(done: Callable[[], bool], seconds: float = 400) -> None:
    """Waits for something that comes, be the machine ever so busy."""
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "it has not come"
        time.sleep(0.01)


def grid(columns: int, rows: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(points, faces) of quadrilaterals over the unit square at z = 0, row by row from y = 0."""
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, (rows or columns) + 1))
    at = np.arange(x.size).reshape(x.shape)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], -1).reshape(-1, 4)
    return np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces


def centres(width: int, height: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(u, v) at the centres of an image's texels, v up, the first row at the top."""
    height = height or width
    return tuple(np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height))


def sheet(side: int = 17) -> SimpleNamespace:
    """A flat square of quadrilaterals, one UV per vertex, and a pose that stretches one half of it."""
    rest, faces = grid(side - 1)
    pose = rest.copy()
    pose[:, 0] = 0.7 * rest[:, 0] + 0.6 * rest[:, 0] ** 2
    pose[:, 2] = 0.1 * np.sin(4 * rest[:, 1])
    return SimpleNamespace(rest=rest, uvs=rest[:, :2].copy(), faces=faces, pose=pose)


def studs(size: int = 128, step: int = 32) -> np.ndarray:
    """A rigidity map of round studs, in u8."""
    y, x = np.mgrid[:size, :size] % step - step / 2
    return np.where(x**2 + y**2 < (0.3 * step) ** 2, 255, 0).astype(np.uint8)


def studded(device: vrtm.Device, model: SimpleNamespace, size: int = 128, step: int = 32, **mesh: object) -> vrtm.Asset:
    """An asset of a sheet, painted with studs."""
    asset = vrtm.Asset(device, model.rest, model.faces, uvs=model.uvs, uv_indices=model.faces, **mesh)
    asset.tile(1001).set_rigidity(studs(size, step))
    return asset


@pytest.fixture
def model() -> SimpleNamespace:
    return sheet()


@pytest.fixture(scope="session")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sheet of bake_scenes in five frames, as a file of USD; nothing may change it."""
    from bake_scenes import sheet as written

    return written(tmp_path_factory.mktemp("sheet"))


@pytest.fixture
def asset(device: vrtm.Device, model: SimpleNamespace) -> Iterator[vrtm.Asset]:
    with studded(device, model) as asset:
        asset.tile(1001).set_settings(grid_width=128, grid_height=128)
        yield asset


def real_mesh(name: str) -> Path:
    """The folder of a real mesh, which lies beside the repository; skips the test where there is none."""
    folder = Path(os.environ.get("VRTM_ASSETS") or REPOSITORY.parent / "shared" / "assets") / name
    if not folder.is_dir():
        assert not os.environ.get("VRTM_REQUIRE_ASSETS"), f"{folder} is missing"
        pytest.skip(f"skipped: no {folder}")
    return folder
