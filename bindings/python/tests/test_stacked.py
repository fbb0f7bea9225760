"""Charts that lie over one another, in layers; and redirections as UVs of another set."""

import numpy as np
import pytest

import vrtm
from conftest import grid, refused, studs

SIDE = 16


def halves(layers):
    """Two sheets on the same UVs in set 0, and on their own in set 1, which deform differently."""
    sheet, quads = grid(SIDE)
    u, v, none = sheet.T
    faces = np.concatenate([quads, quads + len(u)])
    rest = np.concatenate([sheet, sheet * [-1, 1, 1]])
    first, second = ([0.2 * np.sin(3 * v) * u, 0.1 * u * v, none], [-0.15 * u * u, 0.2 * u, none])
    pose = rest + np.concatenate([np.stack(moved, -1) for moved in (first, second)])
    shared = np.tile(0.05 + 0.9 * sheet[:, :2], (2, 1))
    unique = shared * [0.5, 1] + np.repeat([[0, 0], [0.5, 0]], len(u), 0)
    sets = {"uv_indices": faces, "uv_sets": [(unique, faces)]}
    asset = vrtm.Asset(vrtm.Device("cpu"), rest, faces, uvs=shared, max_layers=layers, **sets)
    return asset, studs(64, 16), pose


def test_each_layer_has_a_map_of_its_own():
    asset, rigid, pose = halves(8)
    first, second, unique = asset.tiles
    assert [(t.udim, t.uv_set, t.layer, t.layers) for t in asset.tiles] == [
        (1001, 0, 0, 2),
        (1001, 0, 1, 2),
        (1001, 1, 0, 1),
    ]
    assert repr(second) == "<vrtm.Tile 1001 layer 1 of UV set 0>" and "1001 layer 1" in repr(asset)
    assert asset.tile(1001, layer=1) is second and asset.tile(1001) is first and asset.tile(1001, 1) is unique
    assert asset.face_layers().tolist() == [0] * SIDE**2 + [1] * SIDE**2
    assert not asset.face_layers(1).any()
    second.set_rigidity(rigid)
    asset.solve(pose)
    assert first.info.rigid_nodes > 0 and second.info.rigid_nodes > 0, "maps are shared"
    assert not np.array_equal(first.fetch(), second.fetch())
    images = asset.redirect(pose, [second, vrtm.Fetch(first, "redirection_delta", 32)])
    assert np.array_equal(images[0], second.fetch()) and images[1].shape == (32, 32, 2)


def test_uvs_of_another_set():
    asset, rigid, pose = halves(0)
    tile = asset.tile(1001, 1)
    tile.set_rigidity(rigid)
    [other] = asset.redirect(pose, [vrtm.Fetch(tile, "uv_set", 128, uv_set=0)])
    assert np.array_equal(tile.fetch("uv_set", 128, uv_set=0), other)
    # Set 1 has the halves side by side at half of the width.
    redirected = tile.fetch("redirection", 128, channels=4)
    expected = (redirected[..., :2] * [2, 1])[:, :64]
    assert np.abs(other[:, :64] - expected)[redirected[:, :64, 3] > 0].max() < 1e-5


def test_what_is_wrong_is_named():
    asset, _, pose = halves(8)
    refused(vrtm.InvalidArgumentError, "layer is 2, but tile 1001 has 2", asset.tile, 1001, layer=2)
    refused(vrtm.InvalidArgumentError, "uv_set", asset.face_layers, 2)
    asset.solve(pose)
    refused(vrtm.InvalidArgumentError, r"fetches\[0\]\.uv_set is 2", asset.tile(1001, 1).fetch, "uv_set", 16, uv_set=2)
    with pytest.raises(vrtm.InvalidArgumentError, match=r"fetches\[0\]\.uv_set is 1"):
        asset.tile(1001, 1).fetch("redirection", 16, uv_set=1)
    refused((ValueError, TypeError), "max_layers", halves, -1)
