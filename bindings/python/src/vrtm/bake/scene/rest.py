"""The rest positions of a mesh from another file."""

from __future__ import annotations

import os

import numpy as np

from vrtm.bake.scene.obj_file import read_obj
from vrtm.bake.scene.topology import check_faces
from vrtm.bake.scene.types import SceneError


def rest_from_file(
    file: str, path: str, counts: np.ndarray, indices: np.ndarray, points: int
) -> tuple[np.ndarray, float | None]:
    """(vertices, 3) of the mesh of `file` that has the same path, else the same name, else is its only one; at the
    file's first frame; and how many meters its unit is, None if the file does not say it. Raises SceneError if no mesh
    fits, or its faces are not those of the mesh."""
    meters: dict[str, float | None] = {}
    if not os.path.isfile(file):
        raise SceneError(f"--rest {file}: no such file, and none of bind, pref, first and frame:N")
    if file.lower().endswith(".obj"):
        mesh = read_obj(file)
        found = [("", mesh.positions, mesh.counts, mesh.indices)]
    elif file.lower().endswith(".abc"):
        from vrtm.bake.scene.alembic_file import AlembicFile

        found = AlembicFile(file).meshes_at_first_frame()
    else:
        from vrtm.bake.scene.usd_stage import meshes_at_first_frame

        found, meters = meshes_at_first_frame(file)
    same = [mesh for mesh in found if mesh[0] == path]
    same = same or [mesh for mesh in found if mesh[0].rsplit("/", 1)[-1] == path.rsplit("/", 1)[-1]]
    same = same or (found if len(found) == 1 else [])
    if len(same) != 1:
        raise SceneError(f"{file}: {len(same) or 'no'} meshes have the name of {path}, whose rest is asked for")
    where, positions, its_counts, its_indices = same[0]
    check_faces(f"{file}{where and ' ' + where}", its_counts, its_indices, counts, indices)
    if len(positions) != points:
        raise SceneError(f"{file}{where and ' ' + where}: {len(positions)} vertices, but {path} has {points}")
    return positions, meters.get(where)
