"""Strain in the viewport: a colour attribute that Solid shading shows, red for stretched texture, blue for squeezed."""

from __future__ import annotations

import bpy
import numpy as np

from . import geometry, session, strain
from .prepared import Prepared

NAME = "vrtm strain"

# The shading of viewports before strain was shown, by the space's address.
_shading: dict[int, str] = {}


def colours(prepared: Prepared, pose: np.ndarray, after: bool, of: str) -> np.ndarray:
    """Colours of all vertices, (vertices, 4) float32, `after` the asset's last result or before it, of the "FEATURES",
    of the "SKIN" between them, or of "ALL". On any thread."""
    mesh = prepared.mesh
    jacobians = (lambda uvs: _jacobians(prepared, uvs)) if after else None
    found = strain.of_vertices(mesh.topology, mesh.rest, pose, jacobians)
    if of != "ALL" and (prepared.vertices is not None or prepared.painted):
        rigid = prepared.rigidity_of_vertices(prepared.asset.corner_uvs() if after else mesh.topology.uvs)
        found *= rigid if of == "FEATURES" else 1 - rigid
    return strain.colours(found, strain.FULL_SKIN if of == "SKIN" else strain.FULL)


def _jacobians(prepared: Prepared, uvs: np.ndarray) -> np.ndarray:
    """The redirection's derivatives at a UV of each triangle, (triangles, 2, 2): those of the nearest texels."""
    found = np.broadcast_to(np.eye(2), (len(uvs), 2, 2)).copy()
    tiles = np.floor(uvs).astype(int)
    udims = np.where((tiles[:, 0] >= 0) & (tiles[:, 0] < 10) & (tiles[:, 1] >= 0), 1001 + tiles @ [1, 10], 0)
    layers = prepared.triangle_layers()
    for tile in prepared.asset.tiles:
        chosen = np.flatnonzero((udims == tile.udim) & (layers == tile.layer))
        if len(chosen):
            image = tile.fetch("jacobian", origin="bottom")
            height, width = image.shape[:2]
            within = uvs[chosen] - tiles[chosen]
            x, y = (within[:, 0] * width).astype(int), (within[:, 1] * height).astype(int)
            found[chosen] = image[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1), :4].reshape(-1, 2, 2)
    return found


def write(obj: bpy.types.Object, values: np.ndarray) -> None:
    mesh = obj.data
    new = NAME not in mesh.attributes
    geometry.write(mesh, NAME, "POINT", "FLOAT_COLOR", values)
    if new:
        mesh.color_attributes.active_color = mesh.color_attributes[NAME]
    mesh.update_tag()


def remove(obj: bpy.types.Object) -> None:
    attributes = obj.data.color_attributes
    if NAME in attributes and not geometry.is_linked(obj):
        attributes.remove(attributes[NAME])


def show(on: bool) -> None:
    """Has the viewports with Solid shading show the active colour attribute, or the colours before."""
    for space in [area.spaces.active for area in session.areas("VIEW_3D")]:
        address, shading = space.as_pointer(), space.shading
        if on and shading.color_type != "VERTEX":
            _shading[address] = shading.color_type
            shading.color_type = "VERTEX"
        elif not on and shading.color_type == "VERTEX" and address in _shading:
            shading.color_type = _shading.pop(address)
