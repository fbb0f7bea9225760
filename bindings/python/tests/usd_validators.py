"""USD's own validation of a layer."""

import os
from typing import Any

from pxr import Sdf, Sdr, Usd, UsdUtils, UsdValidation

from vrtm.bake.layer.write import compose
from vrtm.bake.scene import SceneOptions


def check_layer(
    path: str | os.PathLike[str], shot: str | os.PathLike[str] | None = None, options: SceneOptions | None = None
) -> list[str]:
    """Complaints of USD's validators, which usdchecker runs, about a layer: over its shot, less those about the shot
    alone, or by itself. Unknown nodes of MaterialX are left out in a build of USD that knows none of them."""
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
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    # Kept while the validators run: what they say besides is about paths that are checked below.
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    knows_materialx = any(name.startswith("ND_") for name in Sdr.Registry().GetShaderNodeIdentifiers())
    found = set()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        text = error.GetMessage()
        if error.GetName() == "MissingShaderIdInRegistry" and "'ND_" in text and not knows_materialx:
            continue
        places = {_place(site) for site in error.GetSites()} - {""}
        found.add(f"{error.GetName()}: {text}{' at ' if places else ''}{' '.join(sorted(places))}")
    delegate.TakeUncoalescedDiagnostics()
    return found


def _place(site: Any) -> str:
    """A prim's or property's path; layers in memory have no name worth telling."""
    if site.IsPrim():
        return str(site.GetPrim().GetPath())
    if site.IsProperty():
        return str(site.GetProperty().GetPath())
    layer = site.GetLayer()
    return layer.identifier if layer and not layer.anonymous else ""
