"""The mark of the layers that vrtm writes, by which a later bake knows that it may replace them."""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Sdf, Tf, Vt

from vrtm.bake.fingerprint import Fingerprint

_KIND, _CONTENT, _MESHES = "vrtm_kind", "vrtm_content", "vrtm_meshes"
CORNERS = "corners"
"""The kind of files of corner UVs. They are many and large: their content is looked at when they are read."""


def mark(layer: Sdf.Layer, kind: str, meshes: Sequence[str] = ()) -> None:
    """Marks a layer, whose content must not change afterwards. `meshes`: the paths of those that it redirects."""
    told: dict = {_KIND: kind} if kind == CORNERS else {_KIND: kind, _CONTENT: _content(layer)}
    layer.customLayerData = told | ({_MESHES: Vt.StringArray(list(meshes))} if meshes else {})


def meshes_of(path: str) -> list[str]:
    """The meshes that a layer of vrtm redirects; none if it is none."""
    try:
        return list(Sdf.Layer.OpenAsAnonymous(path, metadataOnly=True).customLayerData.get(_MESHES, ()))
    except (Tf.ErrorException, AttributeError, RuntimeError):
        return []


def has_mark(told: dict) -> bool:
    """Whether what a layer tells of itself has a mark, be it right or not."""
    return _KIND in told


def is_marked(layer: Sdf.Layer) -> bool:
    """Whether a layer has the mark and the content that it was marked with: one that was edited by hand, or flattened
    with others, which keeps what it tells of itself, is not vrtm's any more."""
    told = layer.customLayerData
    return told.get(_KIND) == CORNERS or (_CONTENT in told and told[_CONTENT] == _content(layer))


def _content(layer: Sdf.Layer) -> str:
    """A hash of all but what the layer tells of itself."""
    bare = Sdf.Layer.CreateAnonymous(".usda")
    bare.TransferContent(layer)
    bare.ClearCustomLayerData()
    return Fingerprint().text(bare.ExportToString()).hex()
