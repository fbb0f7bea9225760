"""The choice at the borders of an object's islands if Seams and Open Borders are Auto.

Dilate Textures and Update Now find what takes long, and keep it in the object's settings: all frames, and all machines
of a farm, have the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import dilate, geometry, materials, on_seams, picture, session

if TYPE_CHECKING:
    from .prepared import Prepared

AUTO = "auto"


@dataclass(frozen=True)
class Borders:
    seams: str
    open_borders: str
    # The choice and its reason in a sentence; empty if nothing was left open.
    why: str = ""


def chosen(obj: bpy.types.Object) -> Borders:
    """The borders that follow from the object's settings."""
    settings = obj.vrtm
    if AUTO not in (settings.seams, settings.open_borders):
        return Borders(settings.seams, settings.open_borders)
    looked_up = [node.image for material in materials.materials_of(obj) for node in picture.redirected(material)]
    ends = [image.name for image in looked_up if not dilate.is_dilated(image, settings.seam_reach)]
    if looked_up and not ends and not settings.keep_direction:
        found, why = ("continue", "fixed" if settings.goes_on else "slide"), "all textures are dilated"
        if settings.goes_on and settings.open_borders == AUTO:
            why += ", but open borders lie at vertices of another mesh, or at doubled ones"
    else:
        why = "Keep Direction is on" if looked_up else "no texture is redirected"
        found, why = (settings.seams_found, "fixed"), f"{ends[0]} is not dilated" if ends else why
        if settings.seams == AUTO and settings.seams_why:
            why += f"; {settings.seams_why}"
    seams, open_borders = (
        auto if now == AUTO else now for now, auto in zip((settings.seams, settings.open_borders), found)
    )
    return Borders(seams, open_borders, f"Seams {seams}, open borders {open_borders}: {why}")


def leave_open(obj: bpy.types.Object) -> None:
    """Sets Seams and Open Borders to Auto, unless they were set by hand: the textures are dilated."""
    settings = obj.vrtm
    if not settings.is_property_set("seams"):
        settings.seams = AUTO
    if settings.seams == AUTO and not settings.is_property_set("open_borders"):
        settings.open_borders = AUTO


def find_ends(obj: bpy.types.Object, scene: bpy.types.Scene, prepared: Prepared) -> None:
    """Notes in the settings if other vertices, of the mesh or of other objects, lie at the ends of the mesh: sliding
    textures would come apart there."""
    borders, vertices = session.library("vrtm.borders"), prepared.corner_vertices
    counts = prepared.mesh.topology.face_counts
    others = [other for other in scene.objects if other.type == "MESH" and other != obj]
    own, *places = on_seams.places(_rest(obj), *map(_rest, others))
    border = borders.open_border(vertices, counts, np.ones(len(counts), bool))
    shared = borders.shared([own[np.unique(vertices)], *places])
    obj.vrtm.goes_on = bool(np.isin(own[border], shared).any())


def _rest(obj: bpy.types.Object) -> np.ndarray:
    """(vertices, 3) float64: the mesh without modifiers, in the scene."""
    matrix = np.array(obj.matrix_world)
    return geometry.positions(obj.data).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
