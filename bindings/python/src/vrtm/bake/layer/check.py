"""USD's own validation of a layer."""

from __future__ import annotations

import os
from typing import Any

from pxr import Sdf, Sdr, Tf, Usd, UsdUtils

from vrtm.bake.layer.plan import LayerError
from vrtm.bake.layer.write import compose
from vrtm.bake.scene import SceneOptions


def check_layer(
    path: str | os.PathLike[str], shot: str | os.PathLike[str] | None = None, options: SceneOptions | None = None
) -> list[str]:
    """What USD's validators, those that usdchecker runs, say of a layer: over its shot, less what they say of the shot
    alone, or by itself. Each entry names the error and the place.

    Raises LayerError if this build of USD has no validators: usd-core from 26 on has them.

    That a node of MaterialX is not known is left out in a build of USD that knows none of them.
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
    try:
        from pxr import UsdValidation

        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    except (ImportError, Tf.ErrorException) as error:
        raise LayerError(f"the validators of USD {'.'.join(map(str, Usd.GetVersion()))} cannot be loaded") from error
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
