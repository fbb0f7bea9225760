"""`vrtm bake --sheet`: the rasteriser, the strain that is drawn, and the file."""

import contextlib
import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bake_scenes import attributes, files, flat, image, opened, pixels, run, sheet, sheet_arguments
from mirrored import CELLS, mirrored
from vrtm.bake import sheet as drawing
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.raster import cover
from vrtm.bake.scene import SceneOptions


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "_WIDTH", 96)


def test_triangles_cover_what_a_plain_loop_finds() -> None:
    random = np.random.default_rng(1)
    width, height = 24, 18
    # Of all sizes, some beyond the picture's edges, one without an area, one that is no number.
    corners = random.uniform(-4, 28, (40, 1, 3)) + random.uniform(-1, 1, (40, 3, 3)) * random.choice(
        [1, 4, 20], (40, 1, 1)
    )
    corners[7, 2], corners[9, 1] = corners[7, 1], np.nan
    found, weights = cover(corners, (width, height))
    for y in range(height):
        for x in range(width):
            best, nearest = -1, -np.inf
            for k, ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) in enumerate(corners):
                area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
                if not np.isfinite(area) or area == 0:
                    continue
                px, py = x + 0.5, y + 0.5
                v = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / area
                w = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / area
                depth = (1 - v - w) * az + v * bz + w * cz
                if min(v, w, 1 - v - w) >= 0 and depth > nearest:
                    best, nearest, at = k, depth, (1 - v - w, v, w)
            assert found[y, x] == best, (x, y)
            assert best < 0 or np.abs(weights[y, x] - at).max() < 1e-9
    assert (found >= 0).mean() > 0.5


@contextlib.contextmanager
def drawn(scene: Path, frame: int, **settings: object) -> Iterator[tuple[MeshWork, drawing._Surface]]:
    """A mesh that is solved in a frame, and its surface as the sheet draws it."""
    with opened(scene, **settings) as work:
        [mesh] = work.meshes.values()
        positions = work.scene.positions(mesh.shape, frame)
        mesh.parts[0].asset.solve(positions, measure=True)
        yield mesh, drawing._Surface(mesh, positions)


def square(folder: Path, pose: str) -> dict[str, object]:
    """Arguments of `drawn` for a square that is rigid all over, and its pose."""
    faces = "vt .1 .1\nvt .9 .1\nvt .9 .9\nvt .1 .9\nf 1/1 2/2 3/3 4/4\n"
    (folder / "rest.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + faces)
    (folder / "pose.1.obj").write_text(pose + faces)
    options = SceneOptions(poses=(str(folder / "pose.1.obj"),))
    rigidity = str(flat(folder / "rigid.png", size=48))
    return {"scene": folder / "rest.obj", "frame": 1, "options": options, "rigidity": rigidity}


@pytest.mark.parametrize(
    ("pose", "strain"),
    [
        ("v 0 0 0\nv 1.2 0 0\nv 1.2 .9 0\nv 0 .9 0\n", (0.2, 0.1)),
        ("v 5 0 0\nv 5 0 1\nv 4 0 1\nv 4 0 0\n", (0, 0)),
        # A shear by s: the ratios of lengths are sqrt(1 + s s / 4) +- s / 2.
        ("v 0 0 0\nv 1 0 0\nv 1.5 1 0\nv .5 1 0\n", (np.sqrt(1.0625) - 0.75, 1.25 - np.sqrt(1.0625))),
    ],
)
def test_strain_of_known_poses(tmp_path: Path, pose: str, strain: tuple[float, float]) -> None:
    with drawn(**square(tmp_path, pose)) as (_, surface):
        [looked] = surface.looked
        assert np.abs(looked.strains[0][8:-8, 8:-8] - strain).max() < 1e-5
        assert surface.figures().startswith("strain ")


def test_what_vrtm_gains_is_seen(tmp_path: Path) -> None:
    scene = sheet(tmp_path, frames=5, cells=16)
    with drawn(scene, 5, rigidity=str(tmp_path / "rigid.<UDIM>.png"), size=64) as (mesh, surface):
        for looked, tile in zip(surface.looked, mesh.tiles):
            rigid = looked.rigidity[..., 0] > 0.5
            before, after = (np.sqrt((strain**2).sum(-1)[rigid].mean() / 2) for strain in looked.strains)
            report = tile.tile.report()
            # The picture's texels weigh otherwise than the lengths that the solve measures.
            assert before == pytest.approx(report.before.rms, rel=0.35)
            assert after < 0.5 * before and report.after.rms < 0.5 * report.before.rms


def test_each_layer_is_drawn_with_its_own_map(tmp_path: Path) -> None:
    scene = mirrored(tmp_path)
    with drawn(scene, 2, rigidity=str(tmp_path / "rigid.<UDIM>.png")) as (mesh, surface):
        places = [(tile.udim, tile.layer) for tile in mesh.every_tile]
        assert places == [(1001, 0), (1001, 1), (1002, 0)]
        # Two triangles for each of the squares of a part, which is all of the surface.
        assert np.bincount(surface.owner).tolist() == [2 * CELLS * CELLS] * 3
        first, second = (surface.looked[k] for k in (0, 1))
        assert np.abs(first.delta - second.delta).max() > 0.01
        assert np.abs(first.strains[0] - second.strains[0]).max() > 0.05


def test_rigidity_of_vertices_is_drawn(tmp_path: Path) -> None:
    with drawn(**square(tmp_path, "v 0 0 0\nv 1.2 0 0\nv 1.2 .9 0\nv 0 .9 0\n")) as (mesh, _):
        mesh.parts[0].maps["rigidity"].clear()
        mesh.shape = dataclasses.replace(mesh.shape, vertex_rigidity=np.float32([0, 1, 1, 0]))
        rigidity = drawing._Surface(mesh, mesh.shape.rest).looked[0].rigidity[..., 0]
    # Along u, from 0 at .1 to 1 at .9; nothing beside the chart.
    u = (np.arange(48) + 0.5) / 48
    inside = (u > 0.1) & (u < 0.9)
    expected = np.where(inside & inside[:, None], (u - 0.1) / 0.8, 0)
    assert np.abs(rigidity - expected).max() < 1e-6


def test_the_sheet_of_a_bake(tmp_path: Path) -> None:
    scene, out = sheet(tmp_path / "shot", frames=3, cells=4), tmp_path / "out"
    bake = [*sheet_arguments(scene, out, "--size", 32, "--sheet", "--texture", scene.parent / "colour.<UDIM>.png")]
    path = out / "sheet.png"
    assert f"sheet: {path}\n" in run(*bake, "--dry-run").stdout and not path.exists()
    # The one that is stretched the most.
    assert f"{path}: frame 3\n" in run(*bake).stdout
    picture = pixels(path)
    assert attributes(path)["vrtm:kind"] == "sheet" and picture.dtype == np.uint8
    # Three columns and two rows of pictures: each has something else than paper in it, less the one of the legend.
    paper = np.abs(picture.astype(int) - picture[-1, -1]).max(-1) < 3
    width = (picture.shape[1] - 64) // 3
    for k in range(3):
        column = paper[80:, 16 + k * (width + 16) :][:, :width]
        assert (~column).mean() > 0.1
    before = files(out)
    assert f"{path}: frame 3, up to date\n" in run(*bake).stdout
    assert files(out) == before
    assert f"{path}: frame 2\n" in run(*bake, "--frames", "1-2").stdout
    # One that somebody has drawn on is not replaced.
    image(path, picture)
    assert str(path) in run(*bake, expect=2).stderr
    assert np.array_equal(pixels(path), picture)
