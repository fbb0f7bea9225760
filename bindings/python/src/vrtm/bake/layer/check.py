"""USD's own validation of a layer."""

from __future__ import annotations

import glob
import os
import re

from pxr import Sdf, Sdr, Usd, UsdUtils, UsdValidation

from vrtm.bake.layer.write import compose
from vrtm.bake.scene import SceneOptions


def check_layer(
    path: str | os.PathLike[str], shot: str | os.PathLike[str] | None = None, options: SceneOptions | None = None
) -> list[str]:
    """What USD's validators, those that usdchecker runs, say of a layer: over its shot, less what they say of the shot
    alone, or by itself. Each entry names the error and the place.

    Two of their complaints are checked again here, since they are wrong of what renderers take: that a path with <UDIM> is
    no file, and that nodes of MaterialX are not known, in a build of USD that has none of these.
    """
    path = os.path.abspath(os.fspath(path))
    layer = Sdf.Layer.FindOrOpen(path)
    if layer is None:
        return [f"{path}: cannot be opened"]
    if shot is None:
        return sorted(_complaints(Usd.Stage.Open(layer)))
    options, shot = options or SceneOptions(), os.path.abspath(os.fspath(shot))
    alone = compose(Sdf.Layer.CreateAnonymous(".usda"), shot, options, muted=path)
    return sorted(_complaints(compose(layer, shot, options)) - _complaints(alone))


def _complaints(stage: Usd.Stage) -> set[str]:
    # Kept while the validators run: what they say besides is about paths that are checked below.
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    registry = UsdValidation.ValidationRegistry()
    knows_materialx = any(name.startswith("ND_") for name in Sdr.Registry().GetShaderNodeIdentifiers())
    found = set()
    for error in UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage):
        text = error.GetMessage()
        unresolved = re.search("dependency '(.*<UDIM>.*)'", text)
        if error.GetName() == "UnresolvableDependency" and unresolved and _has_tile(unresolved[1], stage):
            continue
        if error.GetName() == "MissingShaderIdInRegistry" and "'ND_" in text and not knows_materialx:
            continue
        places = {_place(site) for site in error.GetSites()} - {""}
        found.add(f"{error.GetName()}: {text}{' at ' if places else ''}{' '.join(sorted(places))}")
    delegate.TakeUncoalescedDiagnostics()
    return found


def _place(site: UsdValidation.ValidationErrorSite) -> str:
    """A prim's or property's path; layers in memory have no name worth telling."""
    if site.IsPrim():
        return str(site.GetPrim().GetPath())
    if site.IsProperty():
        return str(site.GetProperty().GetPath())
    layer = site.GetLayer()
    return layer.identifier if layer and not layer.anonymous else ""


def _has_tile(path: str, stage: Usd.Stage) -> bool:
    """True if a file of any tile exists; a relative path is tried beside all layers."""
    pattern = glob.escape(path).replace("<UDIM>", "[0-9]" * 4)
    folders = {os.path.dirname(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath}
    return any(glob.glob(os.path.join(glob.escape(folder), pattern)) for folder in folders)
