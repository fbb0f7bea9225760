"""A mesh of the scene as the library has it, and the files that are written of it."""

import dataclasses
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

import vrtm
from vrtm.bake import dilate, gain, image_file, outputs, rows, warped
from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.frames import Frame
from vrtm.bake.image_file import Target
from vrtm.bake.left_out import LeftOut
from vrtm.bake.names import Pattern
from vrtm.bake.outputs import CornerFile, frame_name
from vrtm.bake.part import Given, Part, TileWork, parts
from vrtm.bake.scene.topology import outside
from vrtm.bake.settings import AUTO, Borders


@dataclass(frozen=True, eq=False)
class Piece:
    """A file to be written of a frame."""

    tile: TileWork
    target: Target
    output: outputs.Output | None = None
    copy: warped.Copy | None = None
    texture: str = ""
    """The file that `copy` is made of."""

    @property
    def is_redirection(self) -> bool:
        """True for the file that keeps the tile's figures."""
        return self.target.facts["vrtm:kind"] == "redirect"


@dataclass
class FrameResult:
    """Files and figures of a mesh in one frame, for the report."""

    mesh: str
    frame: Frame
    milliseconds: float = 0.0
    tiles: list[dict] = field(default_factory=list)
    files: list[dict] = field(default_factory=list)
    """Files of no single tile."""
    warnings: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    """Details, for --verbose."""
    strain: rows.Strain | None = None
    """The strain of all tiles, if it was measured."""
    features: list[dict] = field(default_factory=list)
    """With it, the painted features of each tile."""
    left_out: list[LeftOut] = field(default_factory=list)

    @property
    def every_file(self) -> list[dict]:
        return [*self.files, *(file for tile in self.tiles for file in tile["files"])]

    def count(self, state: str) -> int:
        """Files that were `written`, or `skipped` since they were up to date."""
        return sum(file["state"] == state for file in self.every_file)


class MeshWork:
    """A mesh with the assets of its parts. Not for several threads at once."""

    def __init__(self, given: Given, borders: Borders) -> None:
        """`given`: with the settings of the bake, where `borders` says more."""
        self.settings = settings = borders.of(given.settings)
        self.shape = shape = given.shape
        device = given.device
        self.borders = borders
        self.threads = device.info.threads
        self.releases = False
        """True if the memory of a tile's solver is given back once the tile is solved."""
        self.listed = outputs.listed(settings)
        common = Fingerprint().text(vrtm.version(), device.info.backend, settings.quality, settings.weld)
        if settings.scale != "keep":
            common.text("scale", settings.scale)
        if settings.warm:
            common.text("warm", settings.temporal_weight)
        self.dilated: dict[tuple[Part, str, int], warped.Texture] = {}
        """Textures with what lies beyond the seams of a part's layer, by their files and layers."""
        if device.info.backend == "gpu":
            # The CPU gives the same bits on every machine.
            common.text(device.info.name)
        for array in (*shape.arrays, shape.vertex_rigidity, shape.vertex_mask, *(shape.texture_uvs or ())):
            common.array(array)
        self.left_out: list[LeftOut] = []
        """Parts without maps."""
        self.parts = parts(dataclasses.replace(given, settings=settings), common, self.left_out)
        self.all_udims = tuple(dict.fromkeys(udim for part in self.parts for udim in part.all_udims))
        if not self.all_udims:
            where = outside(shape.uvs, shape.uv_indices)
            raise Failure(INPUT, f"{settings.scene} {shape.path}: none of its UVs lies in a UDIM tile: {where}")
        self.tiles = [tile for part in self.parts for tile in part.tiles]
        self.every_tile = self.tiles
        """All tiles, also those without a gain."""
        self.idle: dict[gain.Group, str] = {}
        """The parts and layers that get no files, since their maps would be the identity, and why."""
        self.common = common.copy()
        for tile in self.tiles:
            self.common.text(tile.inputs.hex())

    def close(self) -> None:
        for part in self.parts:
            part.asset.close()

    @property
    def gains(self) -> bool:
        """True if there are files of it."""
        return len(self.idle) < len(gain.groups(self.parts))

    def leave_out(self, idle: dict[gain.Group, str]) -> None:
        """Takes parts and layers that gain nothing out of what is baked."""
        self.idle = idle
        self.tiles = [tile for tile in self.every_tile if (tile.part.subset, tile.layer) not in idle]

    def face_layers(self) -> np.ndarray:
        """(faces,): the layer of each face, in its part; -1 where there are no maps, since nothing is gained."""
        layers = np.zeros(len(self.shape.face_counts), np.int64)
        for part in self.parts:
            faces = slice(None) if part.faces is None else part.faces
            own = part.asset.face_layers()[faces].astype(np.int64)
            without = [layer for subset, layer in self.idle if subset == part.subset]
            layers[faces] = np.where(np.isin(own, without), -1, own)
        return layers

    def idle_names(self, frame: Frame, pattern: Pattern) -> list[str]:
        """The paths of the images of a frame that are not written, since nothing is gained."""
        return self._image_names([tile for tile in self.every_tile if tile not in self.tiles], frame, pattern)

    def names(self, frame: Frame, pattern: Pattern) -> list[str]:
        names = self._image_names(self.tiles, frame, pattern)
        if self.settings.corner_uvs and self.gains:
            names.append(os.path.join(self.settings.out, frame_name(pattern, self.shape.name, frame)))
        return names

    def _images(self, tile: TileWork) -> Iterator[tuple[outputs.Output | warped.Copy, str]]:
        """The outputs and copies of a tile, with the texture that a copy is made of."""
        yield from ((output, "") for output in self.listed)
        yield from ((copy, paths[tile.udim]) for copy, paths in tile.part.textures if tile.udim in paths)

    def _image_names(self, tiles: Sequence[TileWork], frame: Frame, pattern: Pattern) -> list[str]:
        return [self.path(pattern, of.kind, frame, tile, path) for tile in tiles for of, path in self._images(tile)]

    def path(
        self, pattern: Pattern, kind: str, frame: Frame, tile: TileWork, texture: str = "", ending: str = ".exr"
    ) -> str:
        """The file of a tile; that of a basis map has its number in the frame's place."""
        ending = warped.extension(texture) if texture else ending
        name = pattern.name(self.shape.name, kind, frame, tile.udim, ending, tile.layer, tile.part.subset)
        return os.path.join(self.settings.out, name)

    def pieces(self, frame: Frame, pose: str, pattern: Pattern) -> list[Piece]:
        """The images of a frame. `pose`: a hash of the positions, and of what was before them where that counts."""
        return [
            self._copy(frame, tile, of, path, pose, pattern) if path else self._map(frame, tile, of, pose, pattern)
            for tile in self.tiles
            for of, path in self._images(tile)
        ]

    def _map(self, frame: Frame, tile: TileWork, output: outputs.Output, pose: str, pattern: Pattern) -> Piece:
        size = (tile.cells[0] + 1, tile.cells[1] + 1) if output.kind == "warp" else tile.size
        inputs = tile.inputs.copy().text(pose, dataclasses.astuple(output), size)
        if not size[0]:
            inputs.text(AUTO, self.settings.bound)
        facts = self._facts(output.kind, frame, tile, inputs)
        if output.form is not None:
            facts["vrtm:form"] = output.form
        name = self.path(pattern, output.kind, frame, tile)
        attributes = image_file.DATA | {"Software": ("string", f"vrtm {vrtm.version()}")}
        alpha = 3 if output.kind == "redirect" and len(output.channels) == 4 else -1
        target = Target(name, *size, output.channels, output.dtype, facts, attributes, alpha=alpha)
        return Piece(tile, target, output=output)

    def _copy(self, frame: Frame, tile: TileWork, copy: warped.Copy, path: str, pose: str, pattern: Pattern) -> Piece:
        texture = copy.read(path)
        inputs = tile.inputs.copy().text(pose, texture.inputs, copy.is_normal, copy.down)
        name, facts = self.path(pattern, copy.kind, frame, tile, path), self._facts(copy.kind, frame, tile, inputs)
        target = texture.target(name, facts)
        return Piece(tile, target, copy=copy, texture=path)

    def _facts(self, kind: str, frame: Frame, tile: TileWork, inputs: Fingerprint) -> dict[str, str | int]:
        facts: dict[str, str | int] = {
            "vrtm:kind": kind,
            "vrtm:mesh": self.shape.name,
            "vrtm:udim": tile.udim,
            "vrtm:frame": frame if isinstance(frame, int) else str(frame),
            "vrtm:version": vrtm.version(),
            "vrtm:inputs": inputs.hex(),
        }
        further = {
            "vrtm:texture_uv": self.shape.texture_uv_name,
            "vrtm:layer": tile.layer,
            "vrtm:subset": tile.part.subset,
        }
        return facts | {name: value for name, value in further.items() if value}

    def corners(self, frame: Frame, pose: str, pattern: Pattern) -> CornerFile:
        path = os.path.join(self.settings.out, frame_name(pattern, self.shape.name, frame))
        return CornerFile(path, self.common.copy().text(pose).hex())

    def check(self, pieces: Sequence[Piece]) -> list[dict | None]:
        """The record of each file that is up to date; None for each that has to be written."""
        found = [image_file.up_to_date(piece.target, self.settings.overwrite) for piece in pieces]
        measured = {"strain", "features", "map"} if self.settings.measure else set()
        wanted = {"fixed", "rigid", "texels_limited"} | measured
        return [
            None if figures is not None and piece.is_redirection and not wanted <= set(figures) else figures
            for piece, figures in zip(pieces, found)
        ]

    def bake(
        self,
        frame: Frame,
        positions: np.ndarray,
        pose: str,
        pattern: Pattern,
        stop: Callable[[], None],
        write: bool = True,
        measure: bool = False,
    ) -> FrameResult | None:
        """Writes what is not up to date of a frame; None if there is something, and it is not to be written. `pose` is
        as for `pieces`. `stop` is called often, and raises to cancel. `measure`: the strain, for the result
        alone."""
        start = time.perf_counter()
        result = FrameResult(self.shape.name, frame)
        pieces = self.pieces(frame, pose, pattern)
        records = self.check(pieces)
        stale = [piece for piece, figures in zip(pieces, records) if figures is None]
        figures: dict[TileWork, dict] = {}
        corners = self.corners(frame, pose, pattern) if self.settings.corner_uvs else None
        whole = corners is not None and not corners.up_to_date()
        if (stale or whole) and not write:
            return None
        if write and (stale or whole or self.settings.warm):
            # Corner UVs are those of all tiles together, and a later frame may start from any of them.
            every = whole or self.settings.warm
            wanted = self.every_tile if whole else self.tiles
            tiles = [tile for tile in wanted if every or any(piece.tile is tile for piece in stale)]
            for part in self.parts:
                own = [tile for tile in tiles if tile.part is part]
                if own:
                    measured = measure or self.settings.measure
                    part.solve(frame, positions, own, measured, self.releases, self.settings.warm, stop)
                for tile in own:
                    figures[tile] = self._write(tile, [piece for piece in stale if piece.tile is tile], stop)
        if corners is not None:
            if whole:
                stop()
                corners.write(self.shape, frame, self._corner_uvs())
            result.files.append(rows.file(corners.path, whole, self.settings))
        for tile in self.tiles:
            own = [(piece, record) for piece, record in zip(pieces, records) if piece.tile is tile]
            kept = next((record for piece, record in own if piece.is_redirection), None)
            files = [rows.file(piece.target.path, record is None, self.settings) for piece, record in own]
            result.tiles.append(rows.row(tile, files, (kept or {}) | figures.get(tile, {}), self.settings))
        told = [tile["strain"] for tile in result.tiles]
        counted = [tile["features"] for tile in result.tiles]
        if measure and all(tile in figures for tile in self.tiles):
            told = [rows.strain(tile) for tile in self.tiles]
            counted = [rows.features(tile.tile) for tile in self.tiles]
        if told and all(told):
            result.strain, result.features = rows.mean(map(rows.Strain.of, told)), counted if all(counted) else []
        result.milliseconds = 1e3 * (time.perf_counter() - start)
        return result

    def _corner_uvs(self) -> np.ndarray:
        """(corners, 2): those of each part, from its own asset."""
        first, *others = self.parts
        uvs = first.asset.corner_uvs()
        for part in others:
            assert part.faces is not None
            faces = np.zeros(len(self.shape.face_counts), bool)
            faces[part.faces] = True
            corners = np.repeat(faces, self.shape.face_counts)
            uvs[corners] = part.asset.corner_uvs()[corners]
        return uvs

    def _write(self, tile: TileWork, pieces: list[Piece], stop: Callable[[], None]) -> dict:
        """Writes files of a tile that is solved, and returns its figures."""
        if not pieces:
            return {}
        size, found = self._size(tile, stop)
        if self.settings.measure:
            found = found or self._inspected(tile, size)
        figures = rows.figures(tile, size, found, self.settings)
        for piece in pieces:
            stop()
            target = piece.target
            if not target.width:
                target = dataclasses.replace(target, width=size[0], height=size[1])
            pixels = self._pixels(piece, (target.width, target.height), stop)
            stop()
            if piece.is_redirection:
                # These two figures are those of the image just fetched.
                report = tile.tile.report()
                figures |= {"texels_limited": report.texels_limited, "max_limit": report.max_limit}
            image_file.write(target, pixels, figures if piece.is_redirection else None)
        return figures

    def _size(self, tile: TileWork, stop: Callable[[], None]) -> tuple[tuple[int, int], vrtm.MapInfo | None]:
        """The size of a tile's maps, and what was found about it. If the map is to choose: the smallest of an eighth of
        the grid, a quarter of it and so on to twice the grid that is near enough, or the one that is nearest."""
        if tile.size[0]:
            return tile.size, None
        sizes = [tuple(max(16, int(n * scale)) for n in tile.cells) for scale in (1 / 8, 1 / 4, 1 / 2, 1, 2)]
        tried = []
        for size in sizes:
            stop()
            found = self._inspected(tile, size)
            if found.error_p99 <= self.settings.bound:
                return size, found
            tried.append((found.error_p99, size, found))
        _, size, found = min(tried, key=lambda entry: entry[:2])
        return size, found

    def _inspected(self, tile: TileWork, size: tuple[int, int]) -> vrtm.MapInfo:
        output = self.listed[0]
        # A map of UVs of another set is as good as one of its own.
        return tile.tile.inspect_map(outputs.FETCH[self.settings.form], size, dtype=np.dtype(output.dtype).type)

    def _pixels(self, piece: Piece, size: tuple[int, int], stop: Callable[[], None]) -> np.ndarray:
        tile = piece.tile.tile
        if piece.output is not None:
            return piece.output.image(tile, size)
        assert piece.copy is not None

        def fetch(kind: str, width: int, height: int, first: int, rows: int) -> np.ndarray:
            return tile.fetch_part(kind, (width, height), (0, first, width, rows))

        texture = self._texture(piece.texture, piece.copy, piece.tile.part, tile.layer)
        return warped.warp(texture, piece.copy, fetch, stop, self.threads)

    def _texture(self, path: str, copy: warped.Copy, part: Part, layer: int) -> warped.Texture:
        """A texture as it is looked up: if features go on over seams, with what lies beyond those of the layer."""
        if self.settings.seams != "continue":
            return copy.read(path)
        if (part, path, layer) not in self.dilated:
            files = next(paths for other, paths in part.textures if other is copy)
            meshes = [dilate.Mesh(self.shape, part.asset, files, layer)]
            found = dilate.dilated(copy, meshes, part.all_tiles[0].settings.seam_reach)
            self.dilated |= {(part, file, layer): texture for file, texture in found.items()}
        return self.dilated[part, path, layer]
