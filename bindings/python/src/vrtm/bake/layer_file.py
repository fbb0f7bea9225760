"""The USD layer over what was baked."""

import dataclasses
import os
from collections.abc import Callable, Iterator

from vrtm.bake import image_file, tokens, warped
from vrtm.bake.failure import INPUT, TOLERANCE, Failure, one_line
from vrtm.bake.frames import Frame
from vrtm.bake.layer.clips import manifest_path
from vrtm.bake.layer.differences import differences
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.layer.write import redirected, relative, write_layer, write_root
from vrtm.bake.mark import meshes_of
from vrtm.bake.outputs import frame_name
from vrtm.bake.part import Part
from vrtm.bake.settings import Settings
from vrtm.bake.words import others
from vrtm.bake.work import Work

_SCENES = (".usda", ".usdc", ".usd", ".usdz")


def names(settings: Settings) -> list[str]:
    """The paths of the layer and the files beside it."""
    assert settings.layer is not None
    manifest = [manifest_path(settings.layer)] if settings.corner_uvs else []
    return [settings.layer, *manifest]


def write(work: Work) -> tuple[list[str], Failure | None, Callable[[], Iterator[str]]]:
    """Writes the layer of all frames and meshes that the settings name; returns warnings, a failure if files that it
    names are missing or of another form, and what reads it back. Raises Failure."""
    settings = work.settings
    assert settings.layer is not None
    try:
        named: dict[str, tuple[Frame, list[str]]] = {}
        with work.scene.listening():
            plan = planned(work, named)
            written = write_layer(settings.layer, work.scene, plan)
            if settings.root is not None:
                write_root(settings.root, settings.layer, settings.scene)
    except OSError as error:
        raise _failure(work, error.strerror or error) from error
    warnings, layer = written.warnings, os.path.abspath(settings.layer)

    def compared() -> Iterator[str]:
        with work.scene.listening():
            found = list(differences(layer, settings.root, work.scene, plan, named))
        yield from (f"{settings.layer}: {what}" for what in found)

    lacking = work.lacking()
    if lacking and settings.freeze is None:
        warnings = [*warnings, f"--layer {settings.layer}: {lacking}, and show the ones before them"]
    paths = [path for name in sorted(written.files & named.keys()) for path in named[name][1]]
    gone = [path for path in paths if not os.path.isfile(path)]
    forms = ((path, image_file.told(path).get("vrtm:form", settings.form)) for path in paths)
    wrong = [path for path, form in forms if form != settings.form]
    message = ""
    if wrong:
        message = f"{len(wrong)} of the maps are not of form {settings.form}, such as {wrong[0]}: bake them anew"
    elif gone:
        message = f"{len(gone)} of the files that it names do not exist, such as {gone[0]}: bake all tiles of its "
        message += "meshes, and all of its frames, into the same folder"
    return warnings, Failure(TOLERANCE, f"--layer {settings.layer}: {message}") if message else None, compared


def foretell(work: Work) -> tuple[list[str], Failure | None]:
    """Warnings of the layer that will be written, and a failure if it would redirect nothing: better known before hours
    of baking."""
    assert work.settings.layer is not None
    plan = planned(work, {})
    # Its frames have the same materials.
    plan = dataclasses.replace(plan, frames=plan.frames[:1], freeze=None)
    with work.scene.listening():
        _, warnings, changes = redirected(work.settings.layer, work.scene, plan)
    # Without a gain there is nothing to redirect.
    return warnings, Failure(INPUT, _idle(work.settings)) if plan.shapes and not changes else None


def _idle(settings: Settings) -> str:
    if settings.textures or settings.normal_maps:
        return (
            f"--layer {settings.layer}: it redirects nothing: no material looks a texture of --texture up by the "
            "UVs that were baked, as they are (warnings say what each does); --layer-mode primvar redirects the UVs"
        )
    return (
        f"--layer {settings.layer}: it redirects nothing: give --texture for materials of UsdPreviewSurface, "
        "whose textures are then replaced by warped copies, or --layer-mode primvar; the meshes must have materials "
        "that look textures up by their UVs"
    )


def check(work: Work) -> None:
    """Raises Failure for a layer that cannot be, before anything is baked for it."""
    if os.path.splitext(work.settings.scene)[1].lower() not in _SCENES:
        raise _failure(work, f"{work.settings.scene} is no USD file, which a layer could lie over")
    for path in filter(None, (work.settings.layer, work.settings.root)):
        if os.path.splitext(path)[1].lower() not in _SCENES[:3]:
            raise _failure(work, f"{path}: its name must end in one of {', '.join(_SCENES[:3])}")
    meshes = {path for mesh in work.meshes.values() for path in mesh.shape.instances}
    lost = [path for path in meshes_of(work.settings.layer or "") if path not in meshes]
    if lost and not work.settings.overwrite:
        told = f"it redirects {lost[0]}{others(len(lost) - 1)}, too, which is lost"
        raise _failure(work, f"{told}: --overwrite replaces it")
    for name, mesh in work.meshes.items() if work.settings.form == "tile" and not work.settings.corner_uvs else ():
        if mesh.gains and mesh.all_udims != (1001,):
            tiles = f"{name}, whose tiles are {mesh.all_udims}"
            raise _failure(work, f"maps of form 'tile' cannot serve {tiles}: use 'udim'")


def _failure(work: Work, reason: object) -> Failure:
    return Failure(INPUT, f"--layer {work.settings.layer}: {one_line(reason)}")


def planned(work: Work, files: dict[str, tuple[Frame, list[str]]]) -> LayerPlan:
    """The layer's plan. `files` receives the frame and the files behind each name that the plan is asked for."""
    settings = work.settings
    assert settings.layer is not None
    beside = os.path.dirname(os.path.abspath(settings.layer))

    def named(name: str, frame: Frame, *fillings: str) -> str:
        path = os.path.join(settings.out, name)
        found = relative(path, beside)
        files[found] = frame, [path.replace("<UDIM>", filling) for filling in fillings or ("",)]
        return found

    def part_of(mesh: str, subset: str) -> Part:
        return next(part for part in work.meshes[mesh].parts if part.subset == subset)

    def udims(part: Part, layer: int) -> list[int]:
        return [tile.udim for tile in part.all_tiles if tile.layer == layer]

    def map_path(mesh: str, frame: Frame, udim: int | str, layer: int = 0, subset: str = "") -> str:
        name = work.pattern.name(mesh, "redirect", frame, udim, layer=layer, subset=subset)
        return named(name, frame, *map(str, udims(part_of(mesh, subset), layer)))

    def warped_path(mesh: str, frame: Frame, texture: str, layer: int = 0, subset: str = "") -> str | None:
        part = part_of(mesh, subset)
        for copy, paths in part.textures:
            own = os.path.basename(copy.pattern.replace("<mesh>", mesh).replace("<subset>", subset))
            name = os.path.basename(texture)
            # One tile tells whether two patterns name the same files.
            same = tokens.tiled(own, 1013) == tokens.tiled(name, 1013)
            if same or name in map(os.path.basename, paths.values()):
                present = [udim for udim in udims(part, layer) if udim in paths]
                if not present:
                    return None
                tile = "<UDIM>" if tokens.has_tile(name) else present[0]
                extension = warped.extension(paths[present[0]])
                name = work.pattern.name(mesh, copy.kind, frame, tile, extension, layer, subset)
                return named(name, frame, *map(str, present))
        return None

    def corner_path(mesh: str, frame: Frame) -> str:
        return named(frame_name(work.pattern, mesh, frame), frame)

    # Meshes without a gain stay as the shot has them.
    gaining = {name: mesh for name, mesh in work.meshes.items() if mesh.gains}
    layers = {name: mesh.face_layers() for name, mesh in gaining.items()}
    face_layers = {name: of for name, of in layers.items() if of.any()}
    parts = {
        name: {
            part.subset if part.subset in mesh.shape.subsets else "": part.subset
            for part in mesh.parts
            if not {(part.subset, tile.layer) for tile in part.all_tiles} <= set(mesh.idle)
        }
        for name, mesh in gaining.items()
        if settings.subsets
    }
    return LayerPlan(
        frames=work.frames,
        shapes=tuple(gaining),
        tiles={name: mesh.all_udims for name, mesh in gaining.items()},
        face_layers=face_layers,
        parts=parts,
        map_path=map_path,
        form=settings.form,
        warped_path=warped_path if any(part.textures for part in work.parts) else None,
        corner_path=corner_path if settings.corner_uvs else None,
        freeze=settings.freeze,
        time_of=work.scene.clock.time,
    )
