"""Arrays of any layout and type give the same results, and those that fit are not copied."""

import numpy as np
import pytest

import vrtm
from conftest import centres, refused, studded, studs
from vrtm._arrays import Pinned


def solved(device, model, positions=None, pose=None, faces=None, **mesh):
    positions = model.rest if positions is None else positions
    mesh = mesh or {"uvs": model.uvs, "uv_indices": model.faces}
    with vrtm.Asset(device, positions, model.faces if faces is None else faces, **mesh) as asset:
        asset.tile(1001).set_rigidity(studs())
        asset.tile(1001).set_settings(grid_width=32, grid_height=32)
        return asset.redirect(model.pose if pose is None else pose, asset.tiles)[0]


@pytest.fixture
def expected(device, model):
    result = solved(device, model)
    # The pose moves something, so that equal results mean something.
    assert np.abs(result[..., 0] - centres(result.shape[1])[0]).max() > 0.01
    return result


def layouts(array):
    """The same numbers in other layouts."""
    padded = np.zeros((len(array), 7), array.dtype)
    padded[:, :3] = array
    fields = np.zeros(len(array), [("id", "u2"), ("p", array.dtype, 3)])
    fields["p"] = array
    every_other = np.zeros((2 * len(array), 3), array.dtype)
    every_other[::2] = array
    read_only = array.copy()
    read_only.flags.writeable = False
    return {
        "padded": padded[:, :3],
        "four": np.hstack([array, np.ones((len(array), 1), array.dtype)]),
        "columns": np.asfortranarray(array),
        "negative": array[::-1].copy()[::-1],
        "unaligned": fields["p"],
        "every other": every_other[::2],
        "read-only": read_only,
        "byte order": array.astype(array.dtype.newbyteorder()),
        "list": array.tolist(),
    }


def test_layouts(device, model, expected):
    for name, pose in layouts(model.pose).items():
        assert np.array_equal(solved(device, model, pose=pose), expected), name
    for name, rest in layouts(model.rest).items():
        assert np.array_equal(solved(device, model, positions=rest), expected), name
    narrow = model.pose.astype(np.float32)
    assert np.array_equal(solved(device, model, pose=narrow), solved(device, model, pose=narrow.astype(float)))


def test_views_are_not_copied(model):
    pinned = Pinned()
    wide = np.zeros((len(model.rest), 4))
    for array in (model.rest, model.rest.astype(np.float32), wide, wide[:, :3], wide[::2, :3]):
        struct = pinned.vectors("positions", array, 3, more=1)
        assert struct.data == array.ctypes.data
        assert struct.stride == array.strides[0]
    for indices in (np.arange(9, dtype=np.int32), np.arange(9, dtype=np.uint32)):
        assert pinned.indices("indices", indices).ctypes.data == indices.ctypes.data


def test_indices(device, model, expected):
    flat = model.faces.reshape(-1)
    counts = np.full(len(model.faces), 4)
    for kind in (np.int32, np.uint32, np.int64, np.uint16, np.dtype(">i4")):
        faces = flat.astype(kind)
        result = solved(device, model, faces=faces, face_counts=counts.astype(kind), uvs=model.uvs, uv_indices=faces)
        assert np.array_equal(result, expected), kind
    offsets = np.arange(0, len(flat) + 1, 4)
    result = solved(device, model, faces=flat, face_offsets=offsets, uvs=model.uvs, uv_indices=flat)
    assert np.array_equal(result, expected)


def test_uvs(device, model, expected):
    u, v = model.uvs.T
    assert np.array_equal(solved(device, model, uvs=(u, v), uv_indices=model.faces), expected)
    # One UV per corner.
    assert np.array_equal(solved(device, model, uvs=model.uvs[model.faces.reshape(-1)]), expected)


def test_uv_sets(device, model):
    turned = model.uvs[:, ::-1] + [1, 0]
    faces = model.faces
    sets = [(turned, faces), ((turned[:, 0], turned[:, 1]), faces), turned[faces.reshape(-1)]]
    with vrtm.Asset(device, model.rest, faces, uvs=model.uvs, uv_indices=faces, uv_sets=sets) as asset:
        assert [(tile.udim, tile.uv_set) for tile in asset.tiles] == [(1001, 0), (1002, 1), (1002, 2), (1002, 3)]
        for tile in asset.tiles:
            tile.set_rigidity(studs())
        asset.solve(model.pose)
        first = asset.tile(1002, 1).fetch()
        assert np.array_equal(asset.tile(1002, 2).fetch(), first)
        assert np.array_equal(asset.tile(1002, 3).fetch(), first)
        refused(vrtm.InvalidArgumentError, r"no tile 1002; it has 1001$", asset.tile, 1002)
        refused(vrtm.InvalidArgumentError, r"no tile 1001; UV set 2 has 1002$", asset.tile, 1001, 2)
        refused(vrtm.InvalidArgumentError, r"the mesh has 4 UV sets$", asset.tile, 1001, 4)
        refused(vrtm.InvalidArgumentError, r"tile 1001 has 1 layers$", asset.tile, 1001, layer=1)


def test_faces_without_texture(device, model):
    corners = model.faces.copy()
    corners[:16] = -1
    with vrtm.Asset(device, model.rest, model.faces, uvs=model.uvs, uv_indices=corners) as asset:
        assert asset.info.faces_untextured == 16
        asset.solve(model.pose)
        assert not asset.corner_uvs()[:64].any() and asset.corner_uvs()[64:].any()
    with studded(device, model, textured_faces=range(16, 256)) as asset:
        assert asset.info.faces_untextured == 16


def test_seams(device, model):
    middle = np.arange(17 * 8, 17 * 9)
    pairs = np.stack([middle[:-1], middle[1:]], 1)
    with studded(device, model, seams=pairs) as asset:
        assert asset.info.charts == 2


def test_vertex_maps(device, model, asset):
    tile = asset.tile(1001)
    tile.set_rigidity(None)
    tile.set_settings(grid_width=128, grid_height=128)
    values = (np.hypot(*(model.uvs - 0.5).T) < 0.2).astype(np.float32)
    results = []
    for given in (values, values.astype(np.float64), values.astype(bool), values.astype(np.int8), values[:, None]):
        asset.set_vertex_rigidity(given)
        results.append(asset.redirect(model.pose, [vrtm.Fetch(tile, size=64)])[0])
    assert all(np.array_equal(result, results[0]) for result in results)
    asset.set_vertex_mask(np.zeros(len(model.rest)))
    asset.solve(model.pose)
    assert asset.report().charts_identity == 1
    asset.set_vertex_mask(None)
    asset.solve(model.pose)
    assert asset.report().charts_identity == 0
