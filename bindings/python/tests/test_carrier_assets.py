"""Carried points beside the paint of real meshes: each texel of a map names the paint that it shows, and the posed mesh
has the texel's place. Nothing is shared with carriers: paint is found in maps, places by the weights of corners."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

import vrtm
from bake_scenes import asset_of
from conftest import LONG, real_mesh
from vrtm.bake.raster import area, cover, weights_at
from vrtm.bake.scene import Scene
from vrtm.bake.scene.images import read_map

GRID = 256
EXACT = 1e-3
"""Cells. A map in f32 rounds to 1.5e-5 of a cell, which faces and the warp enlarge by some dozens of times at most."""
ON_BORDER = 0.01
"""Cells. Where seams continue, paint just beyond the border is shown, too; up to 1.5e-5 beside a chart a point is put
on the border, which is 0.004 of a cell before the warp stretches it."""
SEEN = 0.05
"""Cells: what nobody sees."""
REACH, TEXELS = 1 / 32, 2048


def read(name: str) -> SimpleNamespace:
    """A mesh, its triangles, poses and maps."""
    folder = real_mesh(name)
    facts = json.loads((folder / "asset.json").read_text())
    with Scene(str(folder / "rest.obj")) as file:
        (shape,) = file.shapes
    uvs, found, first = shape.uvs.astype(float), [], 0
    for count in shape.face_counts.tolist():
        face = list(range(first, first + count))
        fans = [[[f[0], f[k], f[k + 1]] for k in range(1, count - 1)] for f in (face, face[1:] + face[:1])]
        # A concave quadrilateral has one diagonal inside.
        signs = np.sign(area(*np.moveaxis(uvs[shape.uv_indices[fans[0]]], 1, 0)))
        found += fans[0] if (signs == signs[0]).all() else fans[1]
        first += count
    rest = shape.rest.astype(float)
    frames = np.fromfile(folder / "frames.f32", "<f4").reshape(-1, *rest.shape).astype(float)
    maps = {int(udim): read_map(str(folder / name)) for udim, name in facts["rigidity"].items()}
    vertices, corners = shape.indices[found], uvs[shape.uv_indices[found]]
    return SimpleNamespace(shape=shape, rest=rest, frames=frames, maps=maps, vertices=vertices, corners=corners)


def origin(udim: int) -> np.ndarray:
    return np.array([(udim - 1001) % 10, (udim - 1001) // 10], float)


def make(model: SimpleNamespace, seams: str = "shut", **mesh: object) -> vrtm.Asset:
    asset = asset_of(model.shape, **mesh)
    for tile in asset.tiles:
        if tile.udim in model.maps:
            tile.set_rigidity(model.maps[tile.udim])
            tile.set_settings(grid_width=GRID, grid_height=GRID, seams=seams, seam_reach=REACH)
    return asset


def covered(model: SimpleNamespace, udim: int) -> SimpleNamespace:
    """The texels of a tile that triangles cover: their UVs, triangles, weights, and which ones touch a border."""
    flat = np.concatenate([(model.corners - origin(udim)) * GRID, np.zeros((len(model.corners), 3, 1))], -1)
    triangle, weights = cover(flat, (GRID, GRID))
    wide = np.pad(triangle >= 0, 1)
    inner = np.all([wide[1 + i : GRID + 1 + i, 1 + j : GRID + 1 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)], 0)
    rows, columns = np.nonzero(triangle >= 0)
    return SimpleNamespace(
        rows=rows,
        columns=columns,
        uv=(np.stack([columns, rows], -1) + 0.5) / GRID,
        triangle=triangle[rows, columns],
        weights=weights[rows, columns],
        beside=~inner[rows, columns],
    )


def on_surface(model: SimpleNamespace, pose: np.ndarray, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return (weights[..., None] * pose[model.vertices[triangle]]).sum(1)


def cell(model: SimpleNamespace, pose: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """The side of a square with the area of a cell in the pose."""
    a, b, c = np.moveaxis(pose[model.vertices[triangle]], 1, 0)
    in_uv = np.abs(area(*np.moveaxis(model.corners[triangle], 1, 0)))
    return np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1) / in_uv) / GRID


def rims(asset: vrtm.Asset, tile: vrtm.Tile, model: SimpleNamespace, pose: np.ndarray, **bind) -> SimpleNamespace:
    """Binds points at the rigid paint that each texel shows, and finds how far from the texel they are carried, in
    cells. Those of another chart's paint, beyond a seam, cannot be bound where it is looked up: NaN."""
    texels = covered(model, tile.udim)
    # Carriers follow the solves that come after they are made; a first one shows what the map is.
    asset.solve(pose)
    shown = tile.fetch("redirection", GRID, origin="bottom")[texels.rows, texels.columns, :2].astype(float)
    map = model.maps[tile.udim]
    at = np.clip(shown * map.shape[::-1], 0, np.array(map.shape[::-1]) - 1).astype(int)
    rigid = map[map.shape[0] - 1 - at[:, 1], at[:, 0]] > 127
    shown, triangle = shown[rigid], texels.triangle[rigid]
    bind = {name: np.full(len(shown), value) if name == "layers" else value for name, value in bind.items()}
    with asset.carrier(shown + origin(tile.udim), fit="surface", **bind) as carrier:
        asset.solve(pose)
        carried = carrier.fetch(dtype=np.float64).positions
        bound = carrier.states() == 0
    expected = on_surface(model, pose, triangle, texels.weights[rigid])
    error = np.linalg.norm(carried - expected, axis=1) / cell(model, pose, triangle)
    moved = np.abs(shown - texels.uv[rigid]).max() * GRID
    return SimpleNamespace(error=np.where(bound, error, np.nan), beside=texels.beside[rigid], moved=moved)


def check(name: str, found: list[SimpleNamespace], most: float = EXACT) -> None:
    error, beside = (np.concatenate([getattr(one, what) for one in found]) for what in ("error", "beside"))
    bound = ~np.isnan(error)
    for where, some in (("at borders", bound & beside), ("inside", bound & ~beside)):
        print(
            f"{name}, {where}: {some.sum()} texels, 99 % {np.quantile(error[some], 0.99):.2g}, "
            f"most {error[some].max():.2g} cells; moved by up to {max(one.moved for one in found):.1f}"
        )
        assert some.sum() > 3 and error[some].max() < most, f"{name}, {where}"
    assert bound.mean() > 0.98


SOME = [("mh_face", "shut"), ("fox", "continue")]
ALL = [(name, seams) for seams in ("shut", "continue") for name in ("cesium_man", "fox", "mh_face", "spot")]


@pytest.mark.parametrize(("name", "seams"), [("ict_inner", "shut"), *ALL] if LONG else SOME)
def test_rims_coincide(name, seams):
    model = read(name)
    pose = model.frames[min(3, len(model.frames) - 1) if name != "mh_face" else 0]
    with make(model, seams) as asset:
        # The gums are enough of the mouth.
        tiles = [asset.tile(udim) for udim in list(model.maps)[:1]]
        most = EXACT if seams == "shut" else ON_BORDER
        check(f"{name} {seams}", [rims(asset, tile, model, pose) for tile in tiles], most)


def test_rims_coincide_in_layers():
    """Two mirrored halves in one place of the UV plane, each in a pose of its own."""
    model = read("cesium_man")
    shape, count = model.shape, len(model.rest)
    halves = [model.rest, model.rest * [-1, 1, 1] + [9, 0, 0]]
    pose = np.concatenate([model.frames[3], model.frames[1] * [-1, 1, 1] + [9, 0, 0]])
    model.shape = dataclasses.replace(
        shape,
        rest=np.concatenate(halves),
        face_counts=np.tile(shape.face_counts, 2),
        indices=np.concatenate([shape.indices, shape.indices + count]),
        uv_indices=np.tile(shape.uv_indices, 2),
    )
    with make(model, max_layers=2) as asset:
        layers = asset.face_layers().reshape(2, -1)
        for layer in (0, 1):
            # Which half a layer has differs from chart to chart: its mesh is put together of both.
            of_face = np.repeat((layers[1] == layer).astype(int), shape.face_counts - 2)
            one = SimpleNamespace(**vars(model) | {"vertices": model.vertices + count * of_face[:, None]})
            check(f"layer {layer}", [rims(asset, asset.tile(1001, layer=layer), one, pose, layers=layer)])


def test_rims_coincide_in_a_second_uv_set():
    model = read("mh_face")
    shape = model.shape
    nowhere = {"uvs": np.full((1, 2), 0.5), "uv_indices": np.zeros_like(shape.indices)}
    with make(model, **nowhere, uv_sets=[(shape.uvs, shape.uv_indices)]) as asset:
        check("UV set 1", [rims(asset, asset.tile(1001, uv_set=1), model, model.frames[0], uv_set=1)])


def forward(nodes: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The warp between its nodes, affine on two triangles of each cell."""
    x = uv * GRID
    at = np.floor(x).astype(int)
    (s, t), (i, j) = (x - at).T[:, :, None], at.T
    near, far = nodes[j, i], nodes[j + 1, i + 1]
    third = np.where(s >= t, nodes[j, i + 1], nodes[j + 1, i])
    return near + np.maximum(s, t) * (third - near) + np.minimum(s, t) * (far - third)


def beyond(dilation: np.ndarray, at: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places on the surface of UVs beside the charts, by the affine map of the nearest three texels of the gutter; and
    a mask of the UVs that have such texels. UVs on charts have none."""
    own = (np.stack(np.meshgrid(*(np.arange(TEXELS),) * 2), -1) + 0.5) / TEXELS + place
    gutter = (np.abs(dilation[..., :2] - own).max(-1) > 1 / TEXELS) & (dilation[..., 3] > 0.5)
    i, j = np.clip(np.floor(at * TEXELS).astype(int), 1, TEXELS - 2).T
    found, whole = np.full(at.shape, np.nan), np.zeros(len(at), bool)
    for di, dj in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        texel, right, up = dilation[j, i, :2], dilation[j, i + di, :2], dilation[j + dj, i, :2]
        slope = np.stack([(right - texel) * di, (up - texel) * dj], -1) * TEXELS
        # Neighbours in different charts are far from one another.
        fits = gutter[j, i] & gutter[j, i + di] & gutter[j + dj, i] & (np.abs(slope).max((1, 2)) < 6) & ~whole
        offset = at - (np.stack([i, j], -1) + 0.5) / TEXELS
        found[fits] = (texel + np.einsum("nij,nj->ni", slope, offset))[fits]
        whole |= fits
    return found, whole


def locate(model: SimpleNamespace, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle under each UV, and the weights of its corners."""
    triangle, weights = np.zeros(len(uv), int), np.zeros((len(uv), 3))
    for k, at in enumerate(uv):
        of_all = np.nan_to_num(weights_at(model.corners, at), nan=-9)
        triangle[k] = np.argmax(of_all.min(1))
        weights[k] = of_all[triangle[k]]
    return triangle, weights


@pytest.mark.parametrize("name", ["cesium_man", "fox"] if LONG else ["fox"])
def test_points_go_over_seams(name):
    """A point that the warp leads over a seam is at the place of the texel that the dilation names there."""
    model = read(name)
    pose = model.frames[3]
    with make(model, "continue") as asset:
        tile, texels = asset.tile(1001), covered(model, 1001)
        asset.solve(pose)
        nodes = tile.fetch("warp", origin="bottom")[..., :2].astype(float)
        dilation = tile.dilation(TEXELS, reach=REACH, channels=4, origin="bottom").astype(float)
        there, over = beyond(dilation, forward(nodes, texels.uv), origin(1001))
        over &= np.abs(forward(nodes, texels.uv) - texels.uv).max(1) * GRID > 0.1
        over[np.flatnonzero(over)[::2]] = False
        with asset.carrier(texels.uv[over], fit="surface") as carrier:
            asset.solve(pose)
            carried = carrier.fetch(dtype=np.float64).positions
        triangle, weights = locate(model, there[over])
        expected = on_surface(model, pose, triangle, weights)
        error = np.linalg.norm(carried - expected, axis=1) / cell(model, pose, triangle)
        print(f"{name}: {over.sum()} over seams, 50, 99 %, most: {np.quantile(error, [0.5, 0.99, 1])} cells")
        # A dilation is not affine where its three texels are parts of two triangles.
        assert over.sum() > 50 and np.quantile(error, 0.95) < SEEN and np.median(error) < EXACT
