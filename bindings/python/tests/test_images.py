"""Maps in and out, in all formats and layouts."""

import numpy as np
import pytest

import vrtm
from conftest import centres, refused, studs


def redirection(asset, model, rigidity, **how):
    tile = asset.tile(1001)
    tile.set_rigidity(rigidity, **how)
    return asset.redirect(model.pose, [vrtm.Fetch(tile, size=(48, 32))])[0]


def test_maps_in(asset, model):
    painted = studs()
    expected = redirection(asset, model, painted)
    assert expected.shape == (32, 48, 2)
    colour = np.zeros((128, 128, 3), np.uint8)
    colour[..., 1] = painted
    same = {
        "bool": painted > 0,
        "u16": painted.astype(np.uint16) * 257,
        "f16": (painted / 255).astype(np.float16),
        "f32": (painted / 255).astype(np.float32),
        "f64": painted / 255,
        "one channel": painted[..., None],
        "columns": np.asfortranarray(painted),
        "negative": painted[::-1, ::-1].copy()[::-1, ::-1],
        "byte order": (painted / 255).astype(">f4"),
    }
    for name, given in same.items():
        assert np.array_equal(redirection(asset, model, given), expected), name
    assert np.array_equal(redirection(asset, model, colour, channel=1), expected)
    assert np.array_equal(redirection(asset, model, painted[::-1], origin="bottom"), expected)
    # And another map gives another result.
    assert not np.array_equal(redirection(asset, model, painted[:, ::-1] // 2), expected)


@pytest.fixture
def solved(asset, model):
    asset.solve(model.pose)
    return asset.tile(1001)


def test_shapes(solved):
    assert solved.fetch().shape == (128, 128, 2)
    assert solved.fetch("warp").shape == (129, 129, 2)
    assert solved.fetch("jacobian", 16).shape == (16, 16, 4)
    assert solved.fetch("filter_scale", (8, 4)).shape == (4, 8, 1)
    assert solved.fetch(size=16, dtype=np.float16).dtype == np.float16
    colour = solved.fetch(size=16, channels=4)
    assert np.array_equal(colour[..., :2], solved.fetch(size=16))
    assert (colour[..., 2] == 0).all() and (colour[..., 3] == 1).all()


def test_forms(solved):
    size = 32
    absolute = solved.fetch(size=size)
    texel = np.stack(centres(size), -1)
    assert np.allclose(absolute - solved.fetch("redirection_delta", size), texel, atol=1e-6)
    assert np.array_equal(solved.fetch("redirection_udim", size), absolute)  # Tile 1001 has no offset.
    assert np.array_equal(solved.fetch(size=size, origin="bottom")[::-1], absolute)
    assert np.array_equal(solved.fetch("warp", origin="bottom")[::-1], solved.fetch("warp"))


def test_out(solved):
    expected = solved.fetch(size=(24, 16))
    spaced = np.full((32, 48, 5), 7, np.float32)
    outs = {
        "packed": np.empty((16, 24, 2), np.float32),
        "columns": np.empty((16, 24, 2), np.float32, order="F"),
        "negative": np.empty((16, 24, 2), np.float32)[::-1],
        "spaced": spaced[::2, ::2, 1:3],
    }
    for name, out in outs.items():
        assert solved.fetch(out=out) is out
        assert np.array_equal(out, expected), name
    untouched = spaced.copy()
    untouched[::2, ::2, 1:3] = 7
    assert (untouched == 7).all()
    for bad in (np.empty((16, 24, 3), np.float32), [[0.0]], np.empty((16, 24), np.float32)):
        refused(ValueError, "out: is", solved.fetch, out=bad, size=(24, 16))
    frozen = np.empty((16, 24, 2), np.float32)
    frozen.flags.writeable = False
    refused(ValueError, "read-only", solved.fetch, out=frozen)


def test_parts(solved):
    whole = solved.fetch(size=(40, 30))
    part = solved.fetch_part("redirection", (40, 30), (5, 7, 20, 11))
    assert np.array_equal(part, whole[7:18, 5:25])
