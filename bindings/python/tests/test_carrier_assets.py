"""Carried points beside the paint of real meshes: each texel of a map names the paint that it shows, and the posed mesh
has the texel's place. Nothing is shared with carriers: paint is found in maps, places by the weights of corners."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import vrtm
from bake_scenes import asset_of
from conftest import LONG, real_mesh
from vrtm.bake.raster import area, cover
from vrtm.bake.scene import Scene
from vrtm.bake.scene.images import read_map

GRID = 256
EXACT = 1e-3
"""Cells. A map in f32 rounds to 1.5e-5 of a cell, which faces and the warp enlarge by some dozens of times at most."""
ON_BORDER = 0.01
"""Cells. Where seams continue, paint just beyond the border is shown, too; up to 1.5e-5 beside a chart a point is put
on the border, which is 0.004 of a cell before the warp stretches it."""
REACH = 1 / 32


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


def make(model: SimpleNamespace, seams: str) -> vrtm.Asset:
    asset = asset_of(model.shape)
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


def rims(asset: vrtm.Asset, tile: vrtm.Tile, model: SimpleNamespace, pose: np.ndarray) -> SimpleNamespace:
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
    with asset.carrier(shown + origin(tile.udim), fit="surface") as carrier:
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
