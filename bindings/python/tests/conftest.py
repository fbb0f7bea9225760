"""Fixtures that several tests share: a device, a sheet with painted studs, and its poses."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vrtm


@pytest.fixture(scope="session")
def device() -> Iterator[vrtm.Device]:
    with vrtm.Device("cpu") as device:
        yield device


def sheet(side: int = 17) -> SimpleNamespace:
    """A flat square of quadrilaterals, one UV per vertex, and a pose that stretches one half of it."""
    line = np.linspace(0.0, 1.0, side)
    x, y = np.meshgrid(line, line)
    rest = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    number = np.arange(side * side).reshape(side, side)
    corners = (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    faces = np.stack(corners, -1).reshape(-1, 4)
    pose = rest.copy()
    pose[:, 0] = 0.7 * rest[:, 0] + 0.6 * rest[:, 0] ** 2
    pose[:, 2] = 0.1 * np.sin(4 * rest[:, 1])
    return SimpleNamespace(rest=rest, uvs=rest[:, :2].copy(), faces=faces, pose=pose)


def studs(size: int = 128, step: int = 32) -> np.ndarray:
    """A rigidity map of round studs, in u8."""
    y, x = np.mgrid[:size, :size]
    return np.where((x % step - step / 2) ** 2 + (y % step - step / 2) ** 2 < (0.3 * step) ** 2, 255, 0).astype(
        np.uint8
    )


@pytest.fixture
def model() -> SimpleNamespace:
    return sheet()


@pytest.fixture
def asset(device: vrtm.Device, model: SimpleNamespace) -> Iterator[vrtm.Asset]:
    with vrtm.Asset(device, model.rest, model.faces, uvs=model.uvs, uv_indices=model.faces) as asset:
        asset.tile(1001).set_rigidity(studs())
        asset.tile(1001).set_settings(grid_width=128, grid_height=128)
        yield asset


@pytest.fixture
def assets() -> Path:
    """The folder of real meshes beside the repository."""
    folder = Path(os.environ.get("VRTM_ASSETS") or Path(__file__).resolve().parents[4] / "shared" / "assets")
    if not folder.is_dir():
        if os.environ.get("VRTM_REQUIRE_ASSETS") == "1":
            pytest.fail(f"the assets are not in {folder}")
        pytest.skip(f"the assets are not in {folder}")
    return folder
