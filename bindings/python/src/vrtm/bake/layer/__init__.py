"""The USD layer that a bake hands to a shot: redirected texture lookups, and redirected corner UVs as a primvar."""

from vrtm.bake.layer.clips import corner_uv_layer, export, manifest_path, values_hash
from vrtm.bake.layer.plan import LayerError, LayerPlan
from vrtm.bake.layer.write import looked_up, redirected, relative, write_layer, write_root

__all__ = [
    "LayerError",
    "LayerPlan",
    "corner_uv_layer",
    "export",
    "looked_up",
    "manifest_path",
    "redirected",
    "relative",
    "values_hash",
    "write_layer",
    "write_root",
]
