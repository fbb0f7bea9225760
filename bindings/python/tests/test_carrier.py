"""Carried points against what they must be."""

import numpy as np

import vrtm
from conftest import refused, studded

GRID = [(x, y) for x in (0.2, 0.4, 0.6) for y in (0.3, 0.5, 0.7)]


def test_points_go_with_the_surface(asset, model):
    with asset.carrier(GRID, heights=np.full(9, 0.1), fit="surface") as carrier:
        assert carrier.info.points == 9 and not carrier.states().any()
        refused(vrtm.NotSolvedError, "", carrier.fetch)
        asset.solve(model.rest)
        rest = carrier.fetch("positions", "rotations", "stretch", "uvs", dtype=np.float64)
        assert np.allclose(rest.uvs, GRID, atol=1e-6) and np.allclose(rest.stretch, 1, atol=1e-5)
        assert np.allclose(carrier.fetch("matrices").matrices, np.eye(3), atol=1e-6)
        assert np.allclose(np.abs(rest.rotations[:, 3]), 1)
        step = np.array([3, 2, 1])
        asset.solve(model.rest + step)
        assert np.allclose(carrier.fetch().positions, rest.positions + step, atol=1e-5)
        asset.close()
        assert carrier.info.points == 9


def test_the_ways_to_bind_agree(asset, model):
    weights = np.full((4, 3), 1 / 3)
    # A row of the sheet's own faces: the first three corners of each.
    wide = model.faces.shape[1]
    corners = np.arange(4)[:, None] * wide + np.arange(3)
    vertices = model.faces.reshape(-1)[corners]
    points = model.rest[vertices].mean(1)
    uvs = model.uvs[vertices].mean(1)
    carriers = [
        asset.carrier(uvs, fit="surface"),
        asset.carrier(corners=corners, weights=weights, fit="surface"),
        asset.carrier(positions=points, farthest=1, fit="surface"),
    ]
    asset.solve(model.pose)
    found = [carrier.fetch().positions for carrier in carriers]
    assert np.allclose(found[0], found[1], atol=1e-5) and np.allclose(found[0], found[2], atol=1e-5)


def test_frames_pieces_and_arrays_of_the_caller(asset, model):
    quaternion = np.tile([0.6, 0, 0, 0.8], (9, 1))
    turned = np.tile([[1, 0, 0], [0, 0.28, -0.96], [0, 0.96, 0.28]], (9, 1, 1))
    pieces = [0, 0, 0, 0, 1, 1, 1, 1, -1]
    carriers = [asset.carrier(GRID, frames=frames, pieces=pieces) for frames in (quaternion, turned)]
    asset.solve(model.pose)
    rows = np.full((9, 8), 7, np.float32)
    first, second = (carrier.fetch("stretch", out={"rotations": rows[:, 2:6]}).rotations for carrier in carriers)
    assert np.allclose(np.abs((first * second).sum(1)), 1, atol=1e-5)
    assert (rows[:, :2] == 7).all() and (rows[:, 6:] == 7).all()


def test_points_come_with_the_images_of_one_solve(device, asset, model):
    tile, carrier = asset.tiles[0], asset.carrier(GRID)
    rows = np.zeros((9, 3), np.float64)
    carried = [vrtm.CarrierFetch(carrier, "stretch"), vrtm.CarrierFetch(carrier, "positions", out={"positions": rows})]
    image, points, stretch, more = asset.redirect(model.pose, [vrtm.Fetch(tile, size=32), carrier, *carried])
    assert (image == tile.fetch(size=32)).all()
    alone = carrier.fetch("positions", "rotations", "stretch")
    assert (points.positions == alone.positions).all() and (points.rotations == alone.rotations).all()
    assert points.stretch is None and (stretch.stretch == alone.stretch).all()
    # As they are without a solve, all of the last one.
    again = asset.fetch([vrtm.Fetch(tile, size=32), carrier, tile])
    assert (again[0] == image).all() and (again[1].positions == points.positions).all()
    assert (again[2] == tile.fetch()).all() and asset.fetch([]) == []
    with studded(device, model) as other:
        refused(ValueError, r"fetches\[1\]: .* belongs to another asset", other.fetch, [carrier, tile])
        refused(vrtm.NotSolvedError, "", other.fetch, other.tiles)
    assert more.positions is rows and np.allclose(rows, alone.positions, atol=1e-5) and rows.any()
    refused(TypeError, "carrier: 7 is no", vrtm.CarrierFetch, 7)


def test_what_is_wrong_is_named(asset):
    for arguments, words in (
        ({}, "one of uvs, corners and positions"),
        ({"uvs": GRID, "positions": GRID}, "one of uvs"),
        ({"uvs": GRID, "weights": GRID}, "weights: does not go with uvs"),
        ({"corners": [[0, 1, 2]]}, "weights: missing"),
        ({"corners": np.zeros((3, 4), int), "weights": np.ones((4, 3))}, r"corners: has the shape \(3, 4\)"),
        ({"uvs": GRID, "pieces": [1]}, "pieces: has 1 elements"),
        ({"uvs": GRID, "fit": "best"}, "fit: 'best'"),
        ({"uvs": GRID, "heights": [1, 2]}, "heights: 2 elements"),
        ({"corners": [[0, 1, 9]], "weights": [[1, 1, 1]]}, "not three corners of one face"),
    ):
        refused((ValueError, vrtm.InvalidArgumentError), words, asset.carrier, **arguments)
    fetch, rows = asset.carrier(GRID).fetch, np.zeros((9, 4))
    refused(ValueError, "'places' is none of positions, rotations", fetch, "places")
    refused(ValueError, r"\['positions'\] is none of", fetch, ["positions"])
    refused(ValueError, "'rotation' is none of positions, rotations", fetch, out={"rotation": rows})
    refused(TypeError, "out: is a list, not a dict of arrays by name", fetch, out=[rows])
    refused(ValueError, "rotations: is list, not an array of", fetch, out={"rotations": rows.tolist()})
    refused(ValueError, "rotations: int64 is neither float32 nor float64", fetch, out={"rotations": rows.astype(int)})
    refused(ValueError, r"stretch: is float64 \(9, 4\), not an array of float64 \(9, 2\)", fetch, out={"stretch": rows})
