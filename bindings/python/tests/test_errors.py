"""Bad input gets an exception that names the argument, and nothing is lost."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest

import vrtm
from conftest import refused, studded, studs
from vrtm import _abi
from vrtm._errors import error_of


def test_every_status_has_a_class():
    names = [name for name in vars(_abi) if name.startswith("VRTM_ERROR_")]
    kinds = {type(error_of(getattr(_abi, name), name, "")) for name in names}
    assert kinds == set(vrtm.Error.__subclasses__()) and len(kinds) == len(names) == 10


def test_mesh(device, model):
    def make(positions=model.rest, faces=model.faces, **more):
        vrtm.Asset(device, positions, faces, **{"uvs": model.uvs, "uv_indices": model.faces, **more}).close()

    make()
    bad = model.rest.copy()
    bad[5, 1] = np.nan
    refused(vrtm.InvalidArgumentError, "positions.*5", make, bad)
    refused(ValueError, r"positions: has the shape \(289, 2\), not \(count, 3\)", make, model.uvs)
    refused(TypeError, "positions: holds <U1", make, np.full((9, 3), "x"))
    refused(TypeError, "indices: holds float64, not integers", make, faces=model.faces.astype(float))
    refused(ValueError, "indices: -1 at 0 is out of range", make, faces=model.faces - 1)
    refused(ValueError, "indices: 4294967584 at 1022 is out of range", make, faces=model.faces + 2**32)
    refused(vrtm.InvalidArgumentError, "indices", make, faces=model.faces + 1)
    refused(ValueError, "uvs: a mesh without UVs", make, uvs=None)
    refused(ValueError, r"uvs: has the shape", make, uvs=model.rest)
    refused(vrtm.InvalidArgumentError, "uv_indices", make, uv_indices=model.faces[:-1].reshape(-1))
    refused(
        vrtm.InvalidArgumentError, "face_counts", make, faces=model.faces.reshape(-1), face_counts=[3], uv_indices=None
    )
    refused(ValueError, r"weld: 'maybe' is none of 'index', 'position', 'off'", make, weld="maybe")
    refused(ValueError, r"seams: has the shape", make, seams=[1, 2, 3])
    refused(ValueError, "max_layers: -1", make, max_layers=-1)
    # Corners by columns would be other faces.
    turned = model.faces.T
    refused(ValueError, r"indices: has the shape \(4, 256\), not \(faces, n\)", make, faces=turned, uv_indices=turned)
    for name in ("uv_indices", "textured_faces"):
        refused(ValueError, rf"{name}: has the shape \(4, 256\), not \(count,\) or \(256, n\)", make, **{name: turned})
    told = "indices: holds rows of different lengths: faces of different lengths are .* face_counts"
    triangle, quadrilateral = [0, 1, 2], [0, 1, 18, 17]
    for ragged in ([triangle, quadrilateral], [np.array(triangle), np.array(quadrilateral)]):
        refused(ValueError, told, make, faces=ragged)
        refused(ValueError, f"uv_{told}", make, uv_indices=ragged)
        refused(ValueError, "seams: holds rows of different lengths$", make, seams=ragged)
        refused(ValueError, r"uv_sets\[0\]: holds rows of different lengths$", make, uv_sets=[(ragged, triangle)])
    refused(ValueError, told, make, faces=np.array([triangle, quadrilateral], object))
    refused(TypeError, "indices: holds object, not integers", make, faces=[[0, 1, None]])
    refused(TypeError, "device", vrtm.Asset, None, model.rest, model.faces, uvs=model.uvs)


def test_pose_and_options(asset, model):
    asset.solve(model.pose)
    before = asset.tile(1001).fetch()
    refused(vrtm.InvalidArgumentError, "positions: 288 elements", asset.solve, model.pose[:-1])
    refused(vrtm.InvalidArgumentError, "positions", asset.solve, np.full_like(model.pose, np.inf))
    refused(
        TypeError, "speed: there is no such option of a solve; there are .*quality,", asset.solve, model.pose, speed=3
    )
    for tiles in (asset.tile(1001), [1001]):
        refused(TypeError, "tiles: .* is no list of vrtm.Tile", asset.solve, model.pose, tiles=tiles)
    refused(ValueError, "quality: 'best' is none of 'normal', 'draft'", asset.solve, model.pose, quality="best")
    refused(ValueError, "threads: -1", asset.solve, model.pose, threads=-1)
    refused(TypeError, "threads: 1.5", asset.solve, model.pose, threads=1.5)
    refused(vrtm.InvalidArgumentError, "tolerance", asset.solve, model.pose, tolerance=2.0)
    refused(TypeError, "tolerance: 'x'", asset.solve, model.pose, tolerance="x")
    refused(TypeError, "pbd", asset.solve, model.pose, solver="pbd", pbd={})
    refused(TypeError, "progress", asset.solve, model.pose, progress=3)
    refused(vrtm.InvalidArgumentError, "dirty_vertices", asset.solve, model.pose, dirty_vertices=[999])
    refused(TypeError, "tile", asset.redirect, model.pose, ["redirection"])
    assert np.array_equal(asset.tile(1001).fetch(), before)


def test_images(asset, model):
    tile = asset.tile(1001)
    refused(ValueError, "rigidity: has the shape", tile.set_rigidity, np.zeros(5))
    refused(ValueError, "rigidity: has the shape", tile.set_rigidity, np.zeros((0, 4)))
    refused(ValueError, r"rigidity: has the shape \(3, 8, 8\)", tile.set_rigidity, np.zeros((3, 8, 8)))
    refused(TypeError, "rigidity: holds int32", tile.set_rigidity, np.zeros((4, 4), np.int32))
    refused(ValueError, "channel: 3 is none of the 3", tile.set_rigidity, np.zeros((4, 4, 3)), channel=3)
    refused(ValueError, "origin: 'left'", tile.set_mask, np.zeros((4, 4)), origin="left")
    refused(vrtm.InvalidArgumentError, "rigidity", tile.set_rigidity, np.full((4, 4), np.nan))
    refused(vrtm.InvalidArgumentError, "", tile.update_rigidity, studs(64), 0, 0, 8, 8)
    refused(ValueError, "x: -1", tile.update_rigidity, studs(), -1, 0, 8, 8)
    refused(vrtm.NotSolvedError, "", tile.fetch, size=8)
    asset.solve(model.pose)
    refused(ValueError, "kind: 'colour' is none of", tile.fetch, "colour")
    refused(ValueError, "size: 0 is no width", tile.fetch, size=0)
    refused(ValueError, "dtype: uint8", tile.fetch, size=8, dtype=np.uint8)
    refused(vrtm.InvalidArgumentError, "channels", tile.fetch, "warp", 8, channels=4)
    refused(vrtm.InvalidArgumentError, "", tile.fetch_part, "redirection", 8, (4, 4, 5, 5))
    refused(vrtm.InvalidArgumentError, "kind", tile.inspect_map, "warp", 8)


def test_settings(asset):
    tile = asset.tile(1001)
    tile.set_settings(smoothness=0.05, overlap="first_face")
    assert tile.settings.smoothness == pytest.approx(0.05) and tile.settings.overlap == "first_face"
    tile.set_settings(tile.settings, room=0)
    assert tile.settings.smoothness == pytest.approx(0.05) and tile.settings.room == 0
    refused(TypeError, "stiffness: there is no such setting.*smoothness,", tile.set_settings, stiffness=1)
    refused(ValueError, "overlap: 'last'", tile.set_settings, overlap="last")
    refused(vrtm.InvalidArgumentError, "smoothness", tile.set_settings, smoothness=-3)
    refused(ValueError, "grid_width: -1", tile.set_settings, grid_width=-1)
    refused(TypeError, "smoothness: 'x'", tile.set_settings, smoothness="x")
    assert tile.settings.overlap == "first_face"
    tile.set_settings()
    assert tile.settings.overlap == "fixed"


def test_nothing_is_set_without_a_word(asset, model):
    """Records are copies, and objects of the library have no attributes to set."""
    tile, how = asset.tile(1001), r"tile.set_settings\(tile.settings, smoothness=0.7\) sets it"
    refused(dataclasses.FrozenInstanceError, how, setattr, tile.settings, "smoothness", 0.7)
    refused(AttributeError, r"PbdSettings\(iterations=2\)", setattr, vrtm.PbdSettings(), "iterations", 2)
    job = asset.submit(model.pose)
    for report in (job.result(), tile.report(), tile.info, asset.info, asset.tile(1001).estimate()):
        refused(AttributeError, "a .* is a copy", setattr, report, next(iter(report.__annotations__)), 1)
    objects = [asset.tiles[0].asset, tile, job, asset.carrier([[0.5, 0.5]]), asset.refine(), vrtm.Device("cpu")]
    for owned in objects:
        for name in ("smoothness", "udim", "settings"):
            refused(AttributeError, f"{name}: no attribute of a vrtm", setattr, owned, name, 1)
        for copied in (copy.copy, copy.deepcopy, pickle.dumps):
            refused(TypeError, "belongs to this process", copied, owned)
    fetch = vrtm.Fetch(tile, "warp", 8)
    fetch.kind = "jacobian"
    assert np.array_equal(asset.redirect(model.pose, [fetch])[0], tile.fetch("jacobian", 8))


def test_device():
    refused(ValueError, "backend: 'tpu' is none of 'auto', 'cpu', 'gpu'", vrtm.Device, "tpu")
    refused(vrtm.InvalidArgumentError, "threads", vrtm.Device, "cpu", threads=5000)
    refused(TypeError, "log", vrtm.Device, "cpu", log="stderr")


def test_memory_budget(model):
    with vrtm.Device("cpu", memory_budget=2_000_000) as device, studded(device, model) as asset:
        asset.tile(1001).set_settings(grid_width=1024, grid_height=1024)
        with pytest.raises(vrtm.OutOfMemoryError) as caught:
            asset.solve(model.pose)
        assert isinstance(caught.value, MemoryError)
        asset.tile(1001).set_settings(grid_width=16, grid_height=16)
        asset.solve(model.pose)


def test_closed(device, model, asset):
    tile = asset.tile(1001)
    asset.solve(model.pose)
    asset.close()
    asset.close()
    for call in (asset.report, asset.cancel, tile.fetch, lambda: tile.info, lambda: asset.solve(model.pose)):
        refused(vrtm.InvalidHandleError, "", call)
    assert repr(asset) == "<vrtm.Asset, closed>"


def test_exceptions_cross_processes():
    error = vrtm.BusyError(6, "VRTM_ERROR_BUSY", "vrtm_asset_solve: in use")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is vrtm.BusyError and (again.status, again.status_name) == (6, "VRTM_ERROR_BUSY")
    assert str(again) == "vrtm_asset_solve: in use"


def test_saved_tiles(device, model, asset):
    tile = asset.tile(1001)
    data = tile.save()
    with studded(device, model) as other:
        refused(vrtm.InvalidArgumentError, "", other.tile(1001).load, data)
        other.tile(1001).set_settings(tile.settings)
        refused(vrtm.InvalidArgumentError, "", other.tile(1001).load, data[:-1])
        refused(vrtm.InvalidArgumentError, "", other.tile(1001).load, b"")
        other.tile(1001).load(data)
        other.solve(model.pose)
        asset.solve(model.pose)
        assert np.array_equal(other.tile(1001).fetch(), tile.fetch())
    needs = tile.estimate()
    assert needs.movable_nodes == tile.info.movable_nodes and needs.solving_bytes > 0
