"""The USD layer that a bake hands to a shot: redirected texture lookups, and redirected corner UVs as a primvar."""

from vrtm.bake.layer.check import check_layer
from vrtm.bake.layer.clips import corner_uv_layer, export, manifest_path, values_hash, write_corner_uvs
from vrtm.bake.layer.lookups import looked_up
from vrtm.bake.layer.plan import LayerError, LayerPlan
from vrtm.bake.layer.write import Written, redirected, relative, write_layer, write_root

__all__ = [
    "LayerError",
    "LayerPlan",
    "Written",
    "check_layer",
    "corner_uv_layer",
    "export",
    "looked_up",
    "manifest_path",
    "redirected",
    "relative",
    "values_hash",
    "write_corner_uvs",
    "write_layer",
    "write_root",
]
