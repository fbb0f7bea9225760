"""The mark of the layers that vrtm writes, by which a later bake knows that it may replace them."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from pxr import Sdf, Vt

from vrtm.bake.fingerprint import Fingerprint

Found = TypeVar("Found")

_KIND, _CONTENT, _MESHES = "vrtm_kind", "vrtm_content", "vrtm_meshes"
CORNERS = "corners"
"""The kind of files of corner UVs. They are many and large: their content is looked at when they are read."""
SHAPES = "shapes"
"""The kind of a mesh with blend shapes, which is large, too."""
CARRIED = "carried"
"""The kind of layers with geometry on the surface."""


def mark(layer: Sdf.Layer, kind: str, meshes: Sequence[str] = ()) -> None:
    """Marks a layer, whose content must not change afterwards. `meshes`: the paths of those that it redirects."""
    told: dict = {_KIND: kind} if kind in (CORNERS, SHAPES) else {_KIND: kind, _CONTENT: _content(layer)}
    layer.customLayerData = told | ({_MESHES: Vt.StringArray(list(meshes))} if meshes else {})


def is_carried(layer: Sdf.Layer) -> bool:
    """True if a layer's mark says that it moves geometry on the surface."""
    return layer.customLayerData.get(_KIND) == CARRIED


def meshes_of(path: str) -> list[str]:
    """The meshes that a layer of vrtm redirects; none if it is none."""
    return found_in(path, lambda layer: list(layer.customLayerData.get(_MESHES, ())), [], values=False)


def found_in(path: str, look: Callable[[Sdf.Layer], Found], otherwise: Found, values: bool = True) -> Found:
    """The result of `look` for a layer's file, be its values read or not; `otherwise` if it cannot be read."""
    try:
        # Anonymous: USD would hand out what it read of an earlier file of that name.
        return look(Sdf.Layer.OpenAsAnonymous(path, metadataOnly=not values))
    except (AttributeError, RuntimeError, ValueError, TypeError):
        # There is no layer, or something of it is damaged.
        return otherwise


def is_marked_file(path: str) -> bool:
    """The same as `is_marked` of a file."""
    # Most have no mark, which takes no reading of all their values.
    has_mark = found_in(path, lambda layer: _KIND in layer.customLayerData, False, values=False)
    return has_mark and found_in(path, is_marked, False)


def is_marked(layer: Sdf.Layer) -> bool:
    """True if a layer has the mark, and the content that it was marked with: a layer that was edited by hand, or
    flattened with others, keeps its mark and is not vrtm's any more."""
    told = layer.customLayerData
    return told.get(_KIND) in (CORNERS, SHAPES) or (_CONTENT in told and told[_CONTENT] == _content(layer))


def _content(layer: Sdf.Layer) -> str:
    """A hash of all but what the layer tells of itself."""
    bare = Sdf.Layer.CreateAnonymous(".usda")
    bare.TransferContent(layer)
    bare.ClearCustomLayerData()
    return Fingerprint().text(bare.ExportToString()).hex()
