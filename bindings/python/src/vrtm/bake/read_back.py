"""The results of a bake as those find them who take them, compared with what was meant."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from vrtm.bake import basis_differences, image_file
from vrtm.bake.basis_tiles import read_delta
from vrtm.bake.failure import TOLERANCE, Failure, one_line
from vrtm.bake.frames import Frame
from vrtm.bake.mesh_work import FrameResult, MeshWork
from vrtm.bake.work import Work

Differences = Callable[[], Iterator[str]]


def failure(differences: Sequence[Differences]) -> Failure | None:
    """The failure of results that are not as meant."""
    found = [one_line(what) for compared in differences for what in compared()]
    more = f" (and {len(found) - 1} more differences)" if len(found) > 1 else ""
    return Failure(TOLERANCE, f"read back: {found[0]}{more}") if found else None


def maps(work: Work, results: Sequence[FrameResult]) -> Iterator[str]:
    """Redirection maps of the first and the last frame, as OpenImageIO reads them. The pixels of all are compared with
    what was fetched when they are written."""
    written = [result for result in results if result.tiles]
    frames = {result.frame for result in written}
    for result in (of for of in written if of.frame in (min(frames), max(frames))):
        mesh = work.meshes[result.mesh]
        for tile in mesh.tiles:
            path = mesh.path(work.pattern, "redirect", result.frame, tile)
            told = image_file.told(path)
            meant = {"mesh": result.mesh, "frame": result.frame, "udim": tile.udim, "form": work.settings.form}
            for name, value in meant.items():
                if str(told.get(f"vrtm:{name}")) != str(value):
                    yield f"{path}: {name} is {told.get(f'vrtm:{name}')}, not {value}"
            if work.settings.options.texture_uv is None and np.abs(read_delta(path, work.settings.form)).max() >= 1:
                yield f"{path}: moves texels by more than a tile: it is not of form {work.settings.form}"


def morphed(work: Work, path: str, mesh: MeshWork, frames: list[Frame]) -> Iterator[str]:
    """A mesh with morph targets: USD, or glTF."""
    if path.endswith(".glb"):
        seconds, ends = [work.scene.seconds(frame) for frame in frames], {0: frames[0], len(frames) - 1: frames[-1]}
        meant = {k: (f"frame {of}", basis_differences.meant(work, mesh, of, True)) for k, of in ends.items()}
        found = basis_differences.of_gltf(path, seconds, meant)
    else:
        found = basis_differences.of_usd(path, work, mesh, frames)
    yield from (f"{path}: {what}" for what in found)
