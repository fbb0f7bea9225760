"""The baselines and the measurements against closed forms: pytest benches/peers/test_peers.py"""

import json

import baselines
import case as cases
import control_maps
import feature_aware
import measure
import mvc
import numpy as np
import obj
import overlay
import peers
import pytest
import skin
from geometry import find, grid_nodes, grid_triangles, invert, warp_folds
from PIL import Image
from report import report
from surface import Surface

CELLS, GRID = 32, 64
OURS = [name for name in baselines.METHODS if name not in ("slim", "blender")]


def sheet(rest, pose, painted=None) -> cases.Case:
    """A sheet of CELLS x CELLS quads over a tile of GRID x GRID cells; functions give positions from UVs of 0..1."""
    uv, faces = grid_nodes(CELLS) / CELLS, grid_triangles(CELLS)
    nodes = grid_nodes(GRID) / GRID
    rigidity = np.zeros(len(nodes)) if painted is None else painted(*nodes.T).astype(float)
    rim = ((nodes > 0) & (nodes < 1)).all(axis=1)
    flat, none = np.zeros(len(uv), int), np.zeros_like(nodes)
    facts = {"scene": "sheet", "frame": 1, "udim": 1001, "grid": GRID}
    place = [np.stack(np.broadcast_arrays(*f(*uv.T)), axis=1).astype(float) for f in (rest, pose)]
    border = cases.border(faces)
    return cases.Case(facts, GRID, *place, uv * GRID, faces, flat, border, rigidity, rim, none, np.arange(len(uv)))


def plane(u, v):
    return u, v, 0 * u


def wavy(u, v):
    return u + 0.05 * np.sin(5 * v), v + 0.04 * np.sin(4 * u), 0.1 * np.sin(3 * u + v)


def disc(u, v):
    return (u - 0.5) ** 2 + (v - 0.5) ** 2 < 0.2**2


def test_find_gives_the_point_back():
    points = np.random.default_rng(1).uniform(0, CELLS, (500, 2))
    found, weights, least = find(grid_nodes(CELLS), grid_triangles(CELLS), points)
    assert (least > -1e-9).all()
    back = (weights[:, :, None] * grid_nodes(CELLS)[grid_triangles(CELLS)[found]]).sum(axis=1)
    assert np.abs(back - points).max() < 1e-12


def test_inverse_of_a_warp():
    nodes = grid_nodes(GRID)
    bump = np.prod(np.sin(np.pi * nodes / GRID), axis=1)[:, None]
    displacement = bump * [3.0, -2.0]
    assert warp_folds(displacement, GRID) == 0 and warp_folds(20 * displacement, GRID) > 0
    assert np.abs(invert(displacement, GRID, nodes + displacement) - nodes).max() < 1e-9


def test_strain_of_known_stretches():
    squashed = sheet(plane, lambda u, v: (0.7 * u, v, 0 * u), disc)
    size = np.unique(np.abs(measure.strains(squashed)).round(6))
    diagonal = 1 - np.sqrt((0.7**2 + 1) / 2)
    assert np.allclose(size, [0, diagonal, 0.3], atol=1e-6)
    assert len(measure.features(squashed)) == 1
    # A warp that undoes the squash inside the feature leaves no strain there.
    nodes = grid_nodes(GRID)
    inside = np.linalg.norm(nodes - GRID / 2, axis=1) < 0.25 * GRID
    warp = np.where(inside[:, None], (nodes - GRID / 2) * [1 / 0.7 - 1, 0], 0)
    assert measure.strain(squashed, warp=warp)["max"] < 1e-6


def test_second_difference_of_an_accelerating_point():
    track = [np.full((10, 2), [0.5 * k * k, 0.0]) for k in range(5)]
    assert measure.second_difference(track) == {"d2_rms": 1.0, "d2_p999": 1.0, "d2_max": 1.0}


@pytest.mark.parametrize("name", OURS)
def test_a_flat_sheet_of_another_size_keeps_its_uvs(name):
    # The features of some methods keep their size: these get the sheet as it was.
    scale = 1 if name.startswith("control") or name == "features_rigid" else 2
    case = sheet(plane, lambda u, v: (scale * u, scale * v, 0 * u), disc)
    assert np.abs(baselines.METHODS[name].solve(case).uv - case.uv).max() < 1e-6


@pytest.mark.parametrize(
    "solve",
    [
        lambda case: mvc.solve(case, True),
        lambda case: overlay.solve(case, True)[0],
        lambda case: skin.solve(case)[0],
        lambda case: control_maps.solve(case, False)[0],
        lambda case: feature_aware.solve(case, True)[0],
        lambda case: feature_aware.solve(case, False)[0],
    ],
)
def test_methods_that_know_the_rest_pose_keep_it(solve):
    case = sheet(wavy, wavy, disc)
    assert np.abs(solve(case) - case.uv).max() < 0.02


def test_mean_value_coordinates_of_a_plane_are_its_positions():
    """They reproduce linear functions: whatever the vertices' positions in a plane, the UVs become these."""
    case = sheet(plane, lambda u, v: (u + 0.05 * np.sin(2 * np.pi * u) * np.sin(np.pi * v), v, 0 * u))
    assert np.abs(mvc.solve(case) - case.pose[:, :2] * GRID).max() < 1e-9


def stretched(u, v):
    """Along u twice as long in the first half as in the second one."""
    return np.where(u < 0.5, 4 / 3 * u, 2 / 3 + 2 / 3 * (u - 0.5)), v, 0 * u


def test_the_overlay_grid_evens_out_a_strip():
    """With edges along u alone each row is a strip: its edges get the same length on the surface."""
    surface = Surface(sheet(plane, stretched), GRID)
    pairs = surface.edges()
    rows = pairs[:, pairs[1] == pairs[0] + 1]
    surface.edges = lambda: rows
    for relative in (False, True):
        displacement, iterations, moved = overlay.warp(surface, relative)
        assert moved < overlay.STILL and iterations < overlay.ITERATIONS
        on_surface = stretched(*((surface.nodes + displacement)[surface.free] / GRID).T)[0] * GRID
        assert np.abs(on_surface - surface.nodes[surface.free, 0]).max() < 0.1 < 5 < np.abs(displacement).max()


def test_the_skin_is_homogeneous_on_a_strip():
    """Its sides slide freely here, so that the strip is one-dimensional: the material spreads evenly."""
    case = sheet(plane, stretched)
    ends = (case.uv[:, 0] == 0) | (case.uv[:, 0] == GRID)
    chart = skin.Chart(case.rest, case.pose, case.uv, case.faces, ~ends)
    uv, _, converged = chart.minimise(None)
    assert converged
    assert np.abs(uv[:, 0] - case.pose[:, 0] * GRID).max() < 0.01


def test_the_skins_gradient():
    case = sheet(wavy, lambda u, v: (1.3 * u, 0.8 * v + 0.2 * u * u, 0.1 * np.sin(4 * v)))
    inner, generator = case.inner(), np.random.default_rng(2)
    chart = skin.Chart(case.rest, case.pose, case.uv, case.faces, inner)
    uv = case.uv + inner[:, None] * generator.uniform(-0.3, 0.3, case.uv.shape)
    move = inner[:, None] * generator.standard_normal(case.uv.shape)
    slope = (chart.energy(uv)[1] * move).sum()
    numeric = (chart.energy(uv + 1e-6 * move)[0] - chart.energy(uv - 1e-6 * move)[0]) / 2e-6
    assert abs(numeric - slope) < 1e-5 * abs(slope)


def test_the_skin_does_not_fold_and_lowers_its_energy():
    case = sheet(plane, lambda u, v: (u, v, 0.4 * np.exp(-20 * ((u - 0.5) ** 2 + (v - 0.5) ** 2))))
    chart = skin.Chart(case.rest, case.pose, case.uv, case.faces, case.inner())
    uv, _, converged = chart.minimise(None)
    assert converged and chart.energy(uv)[0] < 0.95 * chart.energy(case.uv)[0]
    assert measure.folds(case, uv=uv) == 0
    # The frame before as start leads to the same minimum.
    again, iterations, _ = chart.minimise(uv)
    assert iterations < 10 and np.abs(again - uv).max() < 0.2


def test_control_maps_have_the_derivatives_of_their_residuals():
    case = sheet(wavy, lambda u, v: (1.3 * u, 0.8 * v + 0.2 * u * u, 0.1 * np.sin(4 * v)), disc)
    rectangle = control_maps.Rectangle(case, case.faces, np.zeros(2), np.full(2, float(GRID)))
    generator = np.random.default_rng(3)
    at = (rectangle.nodes + generator.uniform(-0.4, 0.4, rectangle.nodes.shape)).clip(0.1, control_maps.SAMPLES - 0.1)
    move = generator.standard_normal(at.shape)
    slope = rectangle.residuals(at, True)[1] @ move.T.ravel()
    numeric = (rectangle.residuals(at + 1e-7 * move) - rectangle.residuals(at - 1e-7 * move)) / 2e-7
    # A few samples lie at an edge of a cell, where the derivative jumps.
    assert np.quantile(np.abs(numeric - slope), 0.999) < 1e-4 * np.abs(slope).max()


def test_control_maps_keep_a_band():
    """A rigid band across a squashed sheet: columns give way beside it."""
    case = sheet(plane, lambda u, v: (0.7 * u, v, 0 * u), lambda u, v: np.abs(u - 0.5) < 0.2)
    original = measure.strain(case)["rms"]
    for along_axes in (True, False):
        warp = control_maps.solve(case, along_axes)[1]
        assert warp_folds(warp, GRID) == 0
        assert measure.strain(case, warp=warp)["rms"] < (0.1 if along_axes else 0.5) * original


def test_control_maps_need_a_rectangle():
    case = sheet(plane, plane, disc)
    case.faces = case.faces[: len(case.faces) * 3 // 4]
    case.uv = case.uv @ [[0.8, 0.6], [-0.6, 0.8]]
    with pytest.raises(baselines.NotApplicable):
        baselines.METHODS["control_free"].solve(case)


def test_features_become_similar_or_rigid():
    case = sheet(plane, lambda u, v: (0.7 * u, v, 0 * u), disc)
    values = {}
    for rigid in (False, True):
        warp = feature_aware.solve(case, rigid)[1]
        assert warp_folds(warp, GRID) == 0
        values[rigid] = measure.strains(case, warp=warp)
    # Rigid: no strain. Similar: the same strain everywhere, but not none.
    assert np.abs(values[True]).max() < 0.06 and np.sqrt((values[True] ** 2).mean()) < 0.02
    assert values[False].std() < 0.03 < 0.1 < abs(values[False].mean())


def asset_folder(folder, pose):
    """A sheet with a rigid disc as the folder of an asset, with one frame."""
    uv, faces = grid_nodes(CELLS) / CELLS, grid_triangles(CELLS)
    rest, corners = np.c_[uv, 0 * uv[:, 0]], np.stack([faces.ravel()] * 2, -1)
    obj.write(folder / "rest.obj", rest, uv, np.full(len(faces), 3), corners)
    np.stack(np.broadcast_arrays(*pose(*uv.T)), axis=1).astype("<f4").tofile(folder / "frames.f32")
    at = (np.arange(GRID) + 0.5) / GRID
    Image.fromarray(np.where(disc(at[None], at[::-1, None]), 255, 0).astype(np.uint8)).save(folder / "rigid.png")
    (folder / "asset.json").write_text(json.dumps({"name": "sheet", "rigidity": {"1001": "rigid.png"}}))


def test_vrtm_from_the_folder_of_an_asset(tmp_path):
    asset_folder(tmp_path, lambda u, v: (0.7 * u, v, 0 * u))
    scene = cases.Scene(tmp_path, GRID)
    case = scene.case(1)
    assert abs(measure.strain(case)["max"] - 0.3) < 1e-5
    assert measure.strain(case, warped=True)["rms"] < 0.02
    assert measure.folds(case, warped=True) == 0 and case.facts["vrtm_seconds"] > 0
    assert case.vertex.tolist() == list(range(len(case.uv)))
    assert not scene.case(1, case.rest).displacement.any()
    with pytest.raises(ValueError, match="udim"):
        cases.Scene(tmp_path, GRID, 1002)
    for wrong in ({"frame": 2}, {"frame": 1, "pose": case.rest[1:]}):
        with pytest.raises(ValueError, match=next(reversed(wrong))):
            scene.case(**wrong)


def test_rows_of_a_folder(tmp_path):
    asset_folder(tmp_path, lambda u, v: (0.7 * u, v, 0 * u))
    rows = peers.of_folder(tmp_path, 1, GRID, ["original", "mvc"], 0, 0)
    assert [r["method"] for r in rows] == ["vrtm", "pbd", "original", "mvc"]
    assert "## sheet, frame 1" in report(rows)


def test_a_strain_that_is_not_the_librarys_ends_the_program(tmp_path):
    asset_folder(tmp_path, lambda u, v: (0.7 * u, v, 0 * u))
    case = cases.Scene(tmp_path, GRID).case(1)
    peers.agree(case)
    case.facts["after"] *= 1.01
    with pytest.raises(SystemExit, match="strain of vrtm"):
        peers.agree(case)
