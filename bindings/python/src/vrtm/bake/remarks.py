"""What is to be said of an open scene: what is odd about it, and what was chosen for the user."""

from __future__ import annotations

from vrtm.bake import frames
from vrtm.bake.scene.types import frame_number
from vrtm.bake.words import numbered, others
from vrtm.bake.work import Work


def notes(work: Work) -> list[str]:
    """What is odd about the scene and the options, each as a sentence."""
    notes = [*work.heard(), *work.scene.warnings, *_without_maps(work)]
    found = [(shape.path, work.units[shape.name][1]) for shape in work.shapes if shape.name in work.units]
    notes += [f"{path}: {finding.warning}" for path, finding in found if finding.warning and not finding.ends]
    settings, there = work.settings, work.scene.frames
    rest = settings.options.rest or ""
    if rest.startswith("frame:") and not there[0] <= frame_number(rest) <= there[-1]:
        notes.append(f"--rest {rest}: {settings.scene} has the frames {frames.text(there)}")
    if settings.half and settings.form != "delta":
        notes.append("--half: numbers of 16 bits are off by a texel of a texture of 4096, but for --form delta")
    for part in work.parts:
        for copy, paths in part.textures:
            lacking = [udim for udim in part.udims if udim not in paths]
            if paths and lacking:
                notes.append(f"{part.where}: {copy.pattern} has no file of {numbered('tile', lacking)}")
    other = [path for path, form in work.replaced("vrtm:form") if form != settings.form]
    if other:
        notes.append(
            f"{len(other)} maps of another form, such as {other[0]}, are replaced by ones of form {settings.form}: "
            "layers that name them have to be written again"
        )
    return notes


def _without_maps(work: Work) -> list[str]:
    notes = []
    what = "no map of --mask" if work.settings.mask else "no values of --mask-primvar"
    for part in work.parts:
        udims = part.without("mask")
        if udims:
            notes.append(f"{part.where}: {what} for {numbered('tile', udims)}: all may move there")
        notes += [f"{part.where}: {note}" for note in part.notes]
    return notes


def hints(work: Work) -> list[str]:
    """What may be meant or not, each as a sentence."""
    hints = []
    for option in ("rigidity", "mask"):
        pattern, users = getattr(work.settings, option), {}
        for part in work.parts if pattern else ():
            for path in part.maps[option].values():
                users.setdefault(path, []).append(part.where)
        shared = next(((path, meshes) for path, meshes in users.items() if len(meshes) > 1), None)
        if shared:
            path, (first, second, *more) = shared
            placeholder = "<subset>" if work.settings.subsets and "<subset>" not in pattern else "<mesh>"
            hints.append(
                f"{first}, {second}{others(len(more))} share {path}: with {placeholder} in --{option} each has its own"
            )
    for mesh in work.meshes.values() if not work.settings.layer else ():
        most = max((tile.tile.layers for tile in mesh.tiles), default=1)
        if most > 1:
            hints.append(
                f"{mesh.shape.path}: its UVs lie over one another in {most} layers, each of which has maps of its "
                "own: --layer writes which faces take which"
            )
    return hints


def facts(work: Work) -> list[str]:
    """What was chosen for the user: the device, and rest poses."""
    info = work.device.info
    threads = f", {info.threads} threads" if info.backend == "cpu" else ""
    lines = [f"device: {info.backend}, {info.name}{threads}{f' ({info.reason})' if info.reason else ''}"]
    lines += [f"frames: {work.scene.rate}"] if work.scene.rate else []
    of: dict[str, list[str]] = {}
    for shape in work.shapes:
        of.setdefault(shape.rest_from, []).append(shape.path)
    sets: dict[str, list[str]] = {}
    for shape in work.shapes:
        sets.setdefault(shape.uv_name, []).append(shape.path)
    for uv, (first, *more) in sets.items() if len(sets) > 1 else ():
        lines.append(f"UV set: {uv}: {first}{others(len(more))}")
    for rest, (first, *more) in of.items():
        lines.append(f"rest: {rest}" if rest == first else f"rest: {rest}: {first}{others(len(more))}")
    return lines


def borders(work: Work) -> list[str]:
    """What was chosen to happen at borders, and why."""
    chosen: dict[str, list[str]] = {}
    for mesh in work.meshes.values():
        if mesh.borders.why:
            line = f"seams {mesh.borders.seams}, open borders {mesh.borders.open_borders}: {mesh.borders.why}"
            chosen.setdefault(line, []).append(mesh.shape.path)
    return [f"{first}{others(len(more))}: {line}" for line, (first, *more) in chosen.items()]
