"""Other parameterisers (benches/peers) on an asset folder: pictures' UVs or maps, and what is measured of each."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Outcome:
    corners: np.ndarray | None  # UVs of the model's corners
    map: np.ndarray | None  # or a redirection, first row at v = 1
    row: dict


def corners(model, case, uv):
    """New UVs of the model's corners from those of the case's UV vertices, in cells; others keep theirs."""
    udim = case.facts["udim"]
    tile = np.array([(udim - 1001) % 10, (udim - 1001) // 10])
    own = model.uvs[model.uv_indices]

    def keys(vertex, cells):
        return [(int(v), *np.round(c, 3).tolist()) for v, c in zip(vertex, cells)]

    number = {key: k for k, key in enumerate(keys(case.vertex, case.uv))}
    at = np.array([number.get(key, -1) for key in keys(model.indices, (own - tile) * case.grid)])
    out = own.copy()
    out[at >= 0] = uv[at[at >= 0]] / case.grid + tile
    return out


def run(folder, model, frame, grid, names, frames):
    """Each method on a frame (from 0), and over a smooth sequence of `frames` poses: (name, Outcome); "vrtm" is
    this library, at the default quality."""
    import baselines
    import case as cases
    import geometry
    import measure

    scene = cases.Scene(folder, grid)
    case = scene.case(frame + 1, repeats=5)
    original = measure.features(case)
    out = []
    for name in names:
        tracks, start = [], None
        for pose in frames:
            here = scene.case(frame + 1, pose)
            found = {"warped": True}
            if name != "vrtm":
                solution = baselines.METHODS[name].solve(here, start)
                start, found = solution.uv, solution.map()
            tracks.append(measure.texture_at(here, measure.surface_points(case), **found))
        solution = None if name == "vrtm" else baselines.METHODS[name].solve(case)
        found = {"warped": True} if solution is None else solution.map()
        row = {
            "method": "vrtm, normal" if solution is None else baselines.METHODS[name].name,
            "rms": measure.strain(case, **found)["rms"],
            **measure.against(measure.features(case, **found), original),
            "folds": measure.folds(case, **found),
            "seconds": case.facts["vrtm_seconds"] if solution is None else solution.seconds,
            "d2": measure.second_difference(tracks)["d2_rms"],
            "note": "" if solution is None else solution.note,
        }
        warp = case.displacement if solution is None else solution.warp
        map = None
        if warp is not None:
            v, u = (np.mgrid[:grid, :grid] + 0.5).reshape(2, -1)
            at = geometry.invert(warp, grid, np.stack([u, grid - v], -1))
            map = (at / grid).reshape(grid, grid, 2)
        print(row, flush=True)
        out.append((name, Outcome(None if map is not None else corners(model, case, solution.uv), map, row)))
    return out
