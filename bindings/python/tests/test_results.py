"""Reports, corner UVs and refinements against what they must be."""

import dataclasses

import numpy as np

import vrtm
from conftest import refused


def test_reports(asset, model):
    report = asset.solve(model.pose, measure=True)
    tile = asset.tile(1001).report()
    assert dataclasses.is_dataclass(report) and dataclasses.asdict(tile)["before"]["rms"] == tile.before.rms
    assert report.tiles == 1 and report.folds == 0 and report.min_jacobian == tile.min_jacobian > 0
    assert tile.udim == 1001 and tile.grid_width == 128 and tile.measured is True and tile.truncated is False
    # The stretched half's studs lose most of their strain.
    assert tile.before.rms > 0.1 and tile.after.rms < 0.2 * tile.before.rms
    assert tile.energy < tile.energy_before
    # They are shown as tables.
    lines = repr(report).splitlines()
    assert lines[0] == "AssetReport" and len(lines) == 1 + len(dataclasses.fields(report))
    assert lines[1].split() == ["tiles", "1"]
    assert ["before.rms", f"{tile.before.rms:.6g}"] in [line.split() for line in repr(tile).splitlines()]
    # Settings are written as they are made.
    assert eval(repr(asset.tile(1001).settings), vars(vrtm)) == asset.tile(1001).settings


def test_options_reach_the_library(asset, model):
    normal, draft = (energy(asset, model, quality=q) for q in ("normal", "draft"))
    assert energy(asset, model, max_corrections=7) <= normal < draft
    pbd = vrtm.PbdSettings(iterations=2)
    assert energy(asset, model, solver="pbd", pbd=pbd) != energy(asset, model, solver="pbd")
    asset.solve(model.pose, time_budget_ms=1e-3)
    assert asset.report().truncated
    asset.solve(model.pose)
    asset.solve(model.pose, dirty_vertices=[])
    assert asset.report().tiles_kept == 1
    asset.solve(model.pose * 2, tiles=[])
    assert asset.report().tiles_kept == 1
    asset.tile(1001).freeze()
    asset.solve(model.pose)
    assert asset.report().tiles_kept == 1
    asset.tile(1001).freeze(False)


def energy(asset, model, **options):
    asset.solve(model.pose, **options)
    # Relative to the identity's, since a draft has the energies of a coarser level.
    report = asset.tile(1001).report()
    return report.energy / report.energy_before


def test_corner_uvs(asset, model):
    asset.solve(model.rest)
    assert np.array_equal(asset.corner_uvs(), model.uvs[model.faces.reshape(-1)].astype(np.float32))
    asset.solve(model.pose)
    uvs = asset.corner_uvs()
    # A corner's UV is the redirection at the corner, which a large map comes close to.
    size = 512
    redirection = asset.tile(1001).fetch(size=size, origin="bottom")
    at = np.clip((model.uvs[model.faces.reshape(-1)] * size).astype(int), 0, size - 1)
    assert np.abs(redirection[at[:, 1], at[:, 0]] - uvs).max() < 3 / size
    spaced = np.zeros((len(uvs), 4), np.float32)[:, ::2]
    assert asset.corner_uvs(out=spaced) is spaced and np.array_equal(spaced, uvs)
    refused(vrtm.InvalidArgumentError, "uv_set", asset.corner_uvs, 3)


def test_refinement(asset, model):
    refused(vrtm.NotSolvedError, "", asset.refine)
    asset.solve(model.pose)
    with asset.refine(tolerance=1 / 512) as refinement:
        info, pattern = refinement.info, refinement.pattern()
        assert info.reached is True and info.error <= info.tolerance and info.triangles > 512
        positions = (model.pose[pattern.vertex_sources] * pattern.vertex_weights[..., None]).sum(1)
        assert positions.shape == (info.vertices, 3) and np.array_equal(positions[: len(model.pose)], model.pose)
        assert pattern.face_corners.sum() == info.corners == len(refinement.corner_uvs())
        own = model.uvs[model.faces.reshape(-1)]
        assert np.allclose((own[pattern.corner_sources] * pattern.corner_weights[..., None]).sum(1), pattern.corner_uvs)
        before = info.triangles
        asset.solve(model.rest + 2 * (model.pose - model.rest))
        refinement.extend()
        assert refinement.info.triangles >= before
        asset.close()
        assert len(refinement.corner_uvs()) == refinement.info.corners
