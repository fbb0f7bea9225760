"""The USD layer over what was baked."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from vrtm.bake import warped
from vrtm.bake.corners import corner_name
from vrtm.bake.failure import INPUT, TOLERANCE, Failure, one_line
from vrtm.bake.settings import Settings

if TYPE_CHECKING:
    from vrtm.bake.layer import LayerPlan
    from vrtm.bake.work import Work

_SCENES = (".usda", ".usdc", ".usd", ".usdz")


def names(settings: Settings) -> list[str]:
    """The paths of all that is written with the layer."""
    from vrtm.bake.layer import manifest_path

    assert settings.layer is not None
    return [settings.layer, *([manifest_path(settings.layer)] if settings.corner_uvs else [])]


def write(work: Work) -> tuple[list[str], Failure | None]:
    """Writes the layer of all frames and meshes that the settings name; returns warnings, and a failure if the layer
    changes nothing. Raises Failure."""
    from vrtm.bake.layer import LayerError, write_layer

    assert work.settings.layer is not None
    try:
        # What is in its place was looked at before anything was baked.
        written = write_layer(work.settings.layer, work.scene, planned(work), overwrite=True)
    except LayerError as error:
        raise _failure(work, error) from error
    except OSError as error:
        raise _failure(work, error.strerror or error) from error
    if written.changes:
        return written.warnings, None
    message = (
        f"--layer {work.settings.layer}: it redirects nothing: give --texture for materials of UsdPreviewSurface, "
        "whose textures are then replaced by warped copies, or --layer-mode primvar; the meshes must have materials "
        "that look textures up by their UVs"
    )
    return written.warnings, Failure(TOLERANCE, message)


def check(work: Work) -> None:
    """Raises Failure for a layer that cannot be, before anything is baked for it."""
    from vrtm.bake.layer import LayerError

    if os.path.splitext(work.settings.scene)[1].lower() not in _SCENES:
        raise _failure(work, f"{work.settings.scene} is no USD file, which a layer could lie over")
    if os.path.splitext(work.settings.layer or "")[1].lower() not in _SCENES[:3]:
        raise _failure(work, f"its name must end in one of {', '.join(_SCENES[:3])}")
    try:
        planned(work).check()
    except LayerError as error:
        raise _failure(work, error) from error


def _failure(work: Work, reason: object) -> Failure:
    return Failure(INPUT, f"--layer {work.settings.layer}: {one_line(reason)}")


def planned(work: Work) -> LayerPlan:
    """What the layer is to say."""
    from vrtm.bake.layer import LayerPlan

    settings = work.settings
    assert settings.layer is not None
    beside = os.path.dirname(os.path.abspath(settings.layer))

    def relative(name: str) -> str:
        path = os.path.join(os.path.abspath(settings.out), name)
        try:
            found = os.path.relpath(path, beside).replace(os.sep, "/")
        except ValueError:
            # On another drive.
            return path.replace(os.sep, "/")
        return found if found.startswith("..") else f"./{found}"

    def map_path(mesh: str, frame: int, udim: int | str) -> str:
        return relative(work.pattern.name(mesh, "redirect", frame, udim))

    def warped_path(mesh: str, frame: int, texture: str) -> str | None:
        for copy, paths in work.meshes[mesh].textures:
            own = os.path.basename(copy.pattern.replace("<mesh>", mesh))
            if own == os.path.basename(texture) or os.path.basename(texture) in map(os.path.basename, paths.values()):
                udim, extension = next((u, warped.extension(path)) for u, path in paths.items())
                tile = "<UDIM>" if "<UDIM>" in texture else udim
                return relative(work.pattern.name(mesh, copy.kind, frame, tile, extension))
        return None

    def corner_path(mesh: str, frame: int) -> str:
        return relative(corner_name(work.pattern, mesh, frame))

    return LayerPlan(
        frames=work.frames,
        shapes=tuple(work.meshes),
        mode=settings.layer_mode,
        tiles={name: mesh.all_udims for name, mesh in work.meshes.items()},
        map_path=map_path,
        form=settings.form,
        warped_path=warped_path if any(mesh.textures for mesh in work.meshes.values()) else None,
        corner_path=corner_path if settings.corner_uvs else None,
    )
