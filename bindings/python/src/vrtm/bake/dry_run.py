"""What a bake would do, in lines of text."""

from __future__ import annotations

import os
from collections.abc import Iterator

from vrtm.bake import cores, frames, layer_file, rows
from vrtm.bake.part import Part
from vrtm.bake.words import counted
from vrtm.bake.work import Work


def lines(work: Work) -> Iterator[str]:
    """Meshes, tiles, maps, files and memory. Nothing is prepared, solved or written."""
    settings = work.settings
    yield f"frames: {frames.text(work.frames)} of {frames.text(work.scene.frames)}"
    for mesh in work.meshes.values():
        shape = mesh.shape
        name = f" as {shape.name}" if len(work.meshes) > 1 else ""
        yield f"{shape.path}{name}: UV set {shape.uv_name}, {len(shape.rest)} vertices, rest: {shape.rest_from}"
        for tile in mesh.tiles:
            needs = tile.tile.estimate()
            grid, size = (f"{a} x {b}" for a, b in (tile.cells, tile.size))
            size = size if tile.size[0] else "auto"
            maps = ", ".join(_maps(tile.part, tile.udim))
            share = needs.movable_nodes / ((tile.cells[0] + 1) * (tile.cells[1] + 1))
            needed = _mb(needs.solving_bytes)
            name = rows.tile_name(rows.place(tile))
            yield f"  tile {name}: grid {grid}, maps {size}, {maps}; {share:.1%} may move; {needed}"
    names = [name for mesh in work.meshes.values() for frame in work.frames for name in mesh.names(frame, work.pattern)]
    there = sum(map(os.path.exists, names))
    if names and not settings.only_layer:
        yield f"files: {len(names)} below {settings.out}, {there} of which are there: {names[0]} to {names[-1]}"
    for path in layer_file.names(settings) if settings.layer else ():
        yield f"layer: {path}"
    yield from [f"carried: {settings.carry_file}"] if settings.carry_file else []
    yield from (f"sheet: {path}" for path in work.sheets().values())
    for what in ("root", "report", "log"):
        path = getattr(settings, what)
        yield from [f"{what}: {path}"] if path else []
    jobs, threads = cores.split(settings, work, len(work.frames) * len(work.meshes))
    most = f"{counted(jobs, 'job')} of {counted(threads, 'thread')}"
    yield f"memory: {_mb(work.bytes)} per job, besides the scene; at most {most}"


def _maps(part: Part, udim: int) -> Iterator[str]:
    for option in ("rigidity", "mask"):
        path = part.maps[option].get(udim)
        if path is not None:
            yield f"{option} {path}"
        elif getattr(part.shape, f"vertex_{option}") is not None:
            yield f"{option} per vertex"
        elif option == "rigidity":
            yield "no rigidity"
    for copy, paths in part.textures:
        if udim in paths:
            yield f"{copy.kind} {paths[udim]}"


def _mb(count: int) -> str:
    return f"{count / 1e6:.0f} MB"
