"""Assets: one mesh with its tiles, their maps and results."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _abi
from ._arrays import Pinned, Pixels, array_of, filled
from ._call import interruptible
from ._carrier import Carried, Carrier
from ._device import Device
from ._errors import InvalidArgumentError
from ._fetch import CarrierFetch, Fetch
from ._job import Job
from ._library import Owned, check, library, new
from ._names import natural, told, value_of
from ._options import SolveOptions, build
from ._records import AssetInfo, AssetReport, Fit, Weld
from ._refinement import Refinement
from ._tile import Tile

if TYPE_CHECKING:
    from typing_extensions import Unpack

_Wanted = Fetch | Tile | CarrierFetch | Carrier

_NAMED = 20
"""Tiles that a message names at most."""


class Asset(Owned):
    """A mesh at rest, and all that is computed for it.

    positions       rest positions, (vertices, 3) or (vertices, 4) of float32 or float64, any unit of length
    indices         the vertex of each face corner, (corners,) of integers; or (faces, n), a row per face
    face_counts     corners of each face, (faces,); None = triangles
    face_offsets    instead of face_counts: the first corner of each face, then the number of corners, (faces + 1,)
    uvs             UVs, (count, 2), v up, in UDIM tiles; or a pair of arrays (u, v)
    uv_indices      the UV of each corner, (corners,), -1 at all corners of a face without texture; None = one per
                    corner
    uv_sets         further UV sets, from set 1 on: UVs, or pairs (uvs, uv_indices)
    seams           edges at which charts end, (count, 2) vertices
    textured_faces  the faces that carry the texture; None = all
    weld            how faces are connected: "index" (the default), "position" for game meshes, "off"
    max_layers      from 2 on: charts that lie over one another, as mirrored halves do, are told apart by up to so many
                    layers, each a tile of its own; see Tile.layer and face_layers

    The asset keeps copies: the arrays may be changed afterwards. Raises InvalidArgumentError, which names the array and
    the index. close(), or the end of a `with` block, also ends the tiles and cancels a solve in progress; refinements
    and carriers stay usable.
    """

    def __init__(
        self,
        device: Device,
        positions: ArrayLike,
        indices: ArrayLike,
        *,
        face_counts: ArrayLike | None = None,
        face_offsets: ArrayLike | None = None,
        uvs: ArrayLike | tuple[ArrayLike, ArrayLike] | None = None,
        uv_indices: ArrayLike | None = None,
        uv_sets: Sequence[ArrayLike | tuple[ArrayLike, ArrayLike]] = (),
        seams: ArrayLike | None = None,
        textured_faces: ArrayLike | None = None,
        weld: Weld = "index",
        weld_position_tolerance: float = 1e-5,
        weld_uv_tolerance: float = 1 / 2048,
        max_layers: int = 0,
    ) -> None:
        if not isinstance(device, Device):
            raise TypeError(f"device: {device!r} is no vrtm.Device")
        pinned, desc = Pinned(), new(_abi.vrtm_mesh_desc)
        desc.positions = ctypes.pointer(pinned.vectors("positions", positions, 3, more=1))
        corners = array_of("indices", indices)
        if corners.ndim == 2 and face_counts is None and face_offsets is None:
            # One row per face.
            face_counts = np.full(corners.shape[0], corners.shape[1], np.uint32)
            if len(corners) in (3, 4) and corners.shape[1] > 4:
                # More likely a column per face.
                raise ValueError(f"indices: has the shape {corners.shape}, not (faces, n); such faces need face_counts")
        _set_list(pinned, desc, "face_counts", face_counts, "face_count")
        _set_list(pinned, desc, "face_offsets", face_offsets, "face_offset_count")
        counts = face_counts if face_counts is not None else face_offsets
        pinned.rows = corners.size // 3 if counts is None else np.size(counts) - (face_counts is None)
        _set_list(pinned, desc, "indices", corners, "index_count")
        _set_list(pinned, desc, "textured_faces", textured_faces, "textured_face_count")
        if seams is not None:
            pairs = array_of("seams", seams)
            if pairs.size and (pairs.ndim != 2 or pairs.shape[1] != 2):
                raise ValueError(f"seams: has the shape {pairs.shape}, not (count, 2)")
            _set_list(pinned, desc, "seams", pairs.reshape(-1), "seam_count")
            desc.seam_count //= 2
        _set_uvs(pinned, desc, "uvs", uvs, "uv_indices", uv_indices)
        if further := list(uv_sets):
            sets = pinned.keep((_abi.vrtm_uv_set * len(further))())
            for k, (struct, given) in enumerate(zip(sets, further)):
                # A pair (uvs, uv_indices), or the UVs alone, which may be a pair (u, v).
                paired = isinstance(given, tuple) and len(given) == 2 and array_of(f"uv_sets[{k}]", given[0]).ndim == 2
                values, at = given if paired else (given, None)
                _set_uvs(pinned, struct, f"uv_sets[{k}]", values, f"uv_sets[{k}] indices", at)
            desc.uv_sets, desc.uv_set_count = sets, len(further)
        desc.weld = value_of("weld", weld)
        desc.weld_position_tolerance, desc.weld_uv_tolerance = weld_position_tolerance, weld_uv_tolerance
        desc.max_layers = natural("max_layers", max_layers, 64)
        handle = _abi.vrtm_asset()
        check(library.vrtm_asset_create(device._handle, ctypes.byref(desc), ctypes.byref(handle)))
        self._own(handle, library.vrtm_asset_destroy, device._log)
        info = self.info
        self._corners = info.corners
        self._tiles = tuple(Tile(self, index) for index in range(info.tiles))

    @property
    def info(self) -> AssetInfo:
        """Counts of the mesh's parts, and of its defects."""
        return told(AssetInfo, library.vrtm_asset_get_info, self._handle)

    @property
    def tiles(self) -> tuple[Tile, ...]:
        """The tiles with at least one triangle: those of UV set 0 by their UDIM numbers, then those of set 1. The
        layers of a UDIM number follow one another."""
        return self._tiles

    def tile(self, udim: int, uv_set: int = 0, layer: int = 0) -> Tile:
        """The tile with a UDIM number, 1001 + U + 10 V, or one of its layers. Raises InvalidArgumentError if the mesh
        has no triangle there, or no such layer."""
        handle = _abi.vrtm_tile()
        key = _abi.vrtm_tile_key(
            uv_set=natural("uv_set", uv_set, 32), udim=natural("udim", udim, 32), layer=natural("layer", layer, 32)
        )
        try:
            check(library.vrtm_asset_find_tile(self._handle, ctypes.byref(key), ctypes.byref(handle)))
        except InvalidArgumentError as error:
            there = list(dict.fromkeys(tile.udim for tile in self._tiles if tile.uv_set == uv_set))
            if udim in there or not there:
                raise
            more = f" and {len(there) - _NAMED} more" if len(there) > _NAMED else ""
            of = f"UV set {uv_set}" if uv_set else "it"
            message = f"{error.message}; {of} has {', '.join(map(str, there[:_NAMED]))}{more}"
            raise InvalidArgumentError(error.status, error.status_name, message) from None
        return next(tile for tile in self._tiles if tile._handle.id == handle.id)

    def face_layers(self, uv_set: int = 0) -> NDArray[np.uint32]:
        """The layer of each face, (faces,) of uint32: which of the tiles with its UDIM number has its redirection; 0
        for faces in no tile. All 0 unless the asset was made with max_layers. An attribute of faces, by which a shader
        picks the map of the layer."""
        layers = np.zeros(self.info.faces, np.uint32)
        uv_set = natural("uv_set", uv_set, 32)
        check(library.vrtm_asset_fetch_face_layers(self._handle, uv_set, layers.ctypes.data, len(layers)))
        return layers

    def set_vertex_rigidity(self, values: ArrayLike | None) -> None:
        """The rigidity of the vertices, (vertices,) of 0 (elastic) to 1 (rigid), for the tiles that have no map, in
        whatever order both are set; None removes it."""
        self._set_vertices(library.vrtm_asset_set_vertex_rigidity, values)

    def set_vertex_mask(self, values: ArrayLike | None) -> None:
        """The warp mask of the vertices, (vertices,), for the tiles that have no mask: under 0.5 nothing moves. None
        removes it."""
        self._set_vertices(library.vrtm_asset_set_vertex_mask, values)

    def _set_vertices(self, function: Any, values: ArrayLike | None) -> None:
        pinned = Pinned()
        check(function(self._handle, None if values is None else ctypes.byref(pinned.vectors("values", values, 1))))

    def solve(self, positions: ArrayLike, **options: Unpack[SolveOptions]) -> AssetReport:
        """Solves all tiles for a pose: positions (vertices, 3) in the order of the rest positions. Returns a report.

        Ctrl-C cancels the solve; the last result stays. The options are those of SolveOptions.
        """
        self._run(positions, [], options)
        return self.report()

    @overload
    def redirect(
        self, positions: ArrayLike, fetches: Sequence[Fetch | Tile], **options: Unpack[SolveOptions]
    ) -> list[Pixels]: ...
    @overload
    def redirect(
        self, positions: ArrayLike, fetches: Sequence[CarrierFetch | Carrier], **options: Unpack[SolveOptions]
    ) -> list[Carried]: ...
    @overload
    def redirect(
        self, positions: ArrayLike, fetches: Sequence[_Wanted], **options: Unpack[SolveOptions]
    ) -> list[Pixels | Carried]: ...
    def redirect(self, positions: ArrayLike, fetches: Sequence[_Wanted], **options: Unpack[SolveOptions]) -> list[Any]:
        """Solves for a pose and returns an output for each of `fetches`, in one call: as solve, Tile.fetch and
        Carrier.fetch, but nothing else can use the asset in between. A bare Tile means its redirection map at the
        grid's size, a bare Carrier the positions and rotations of its points."""
        return self._run(positions, fetches, options)

    @overload
    def fetch(self, fetches: Sequence[Fetch | Tile]) -> list[Pixels]: ...
    @overload
    def fetch(self, fetches: Sequence[CarrierFetch | Carrier]) -> list[Carried]: ...
    @overload
    def fetch(self, fetches: Sequence[_Wanted]) -> list[Pixels | Carried]: ...
    def fetch(self, fetches: Sequence[_Wanted]) -> list[Any]:
        """Outputs of the last solve, as redirect returns them: all of one and the same solve, even if another one ends
        meanwhile. Never waits for a solve. Raises NotSolvedError before the first."""
        targets, structs = self._targets(Pinned(), fetches, next=False)
        check(library.vrtm_asset_fetch(structs, len(targets)))
        return [target.done() for target in targets]

    def _targets(self, pinned: Pinned, fetches: Sequence[Any], next: bool) -> tuple[list[Any], Any]:
        """The arrays that outputs are written to, and the library's structs."""
        targets: list[Any] = []
        structs = (_abi.vrtm_fetch * max(len(fetches), 1))()
        for k, fetch in enumerate(fetches):
            if not isinstance(fetch, (Fetch, CarrierFetch)):
                fetch = CarrierFetch(fetch) if isinstance(fetch, Carrier) else Fetch(fetch)
            if isinstance(fetch, Fetch) and fetch.tile.asset is not self:
                raise ValueError(f"fetches[{k}]: {fetch.tile!r} belongs to another asset")
            targets += [fetch.target(pinned, next)]
            structs[k] = fetch.struct(targets[-1])
        return targets, structs

    def _run(self, positions: ArrayLike, fetches: Sequence[Any], options: SolveOptions) -> list[Any]:
        pinned = Pinned()
        points = pinned.vectors("positions", positions, 3, more=1)
        struct, progress = build(pinned, options)
        targets, structs = self._targets(pinned, fetches, next=True)

        def call() -> None:
            status = library.vrtm_asset_redirect(
                self._handle, ctypes.byref(points), ctypes.byref(struct), structs, len(targets)
            )
            if progress is not None and progress.error is not None:
                raise progress.error
            check(status)

        interruptible(call, self.cancel)
        return [target.done() for target in targets]

    def submit(self, positions: ArrayLike, **options: Unpack[SolveOptions]) -> Job:
        """Begins to solve for a pose and returns at once: a job is a future, and can be awaited. Until it is done,
        calls that solve or change the asset raise BusyError, and results are those of the last solve."""
        return Job(self._handle, self.report, positions, options)

    def cancel(self) -> None:
        """Cancels the solve in progress, on another thread or in a job. Does nothing if no solve is in progress."""
        check(library.vrtm_asset_cancel(self._handle))

    def report(self) -> AssetReport:
        """The report of the last solve, over all tiles. Raises NotSolvedError before the first solve."""
        return told(AssetReport, library.vrtm_asset_get_report, self._handle)

    def corner_uvs(self, uv_set: int = 0, *, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """The redirected UV of each face corner, (corners, 2) of float32, with the tile's place added as in the mesh's
        own UVs. They recover less than the map where the mesh is coarser than the painted detail: see refine."""
        number = natural("uv_set", uv_set, 32)

        def write(at: int) -> None:
            check(library.vrtm_asset_fetch_corner_uvs(self._handle, number, at, self._corners))

        return filled(out, (self._corners, 2), write)

    def refine(self, uv_set: int = 0, *, tolerance: float = 1 / 2048, max_triangles: int = 0) -> Refinement:
        """The mesh with its triangles split where linear interpolation of the last result's UVs would err by more than
        `tolerance`, in UV of a tile, into at most `max_triangles` (0 = a million more than the mesh
        has)."""
        return Refinement(self._handle, uv_set, tolerance, max_triangles)

    def carrier(
        self,
        uvs: ArrayLike | None = None,
        *,
        layers: ArrayLike | None = None,
        corners: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        positions: ArrayLike | None = None,
        farthest: float = 0,
        heights: ArrayLike | None = None,
        frames: ArrayLike | None = None,
        pieces: ArrayLike | None = None,
        uv_set: int = 0,
        fit: Fit = "feature",
        skirt: float = 0,
    ) -> Carrier:
        """Binds points to the rest surface: studs, scales, hair roots, vertices of detail meshes. They are where the
        texture at `uvs` is shown, (points, 2), in `layers`; or at `weights` of three `corners` of a face, (points, 3)
        both; or at the nearest point to `positions`, (points, 3), up to a distance of `farthest` (0 = any).

        heights   above the surface, along its normal, (points,)
        frames    their orientation at rest: quaternions x, y, z, w, (points, 4), or matrices, (points, 3, 3)
        pieces    the number of the rigid piece that each point belongs to, (points,); -1 = none
        fit       "feature": points of rigid features as one body each; "surface": all with the surface; "none": with
                  the skin, as if nothing were redirected
        skirt     the height up to which points of a body are blended to the surface
        """
        points = {"uvs": uvs, "layers": layers, "corners": corners, "weights": weights, "positions": positions}
        settings = {"farthest": farthest, "heights": heights, "frames": frames, "pieces": pieces}
        return Carrier(self._handle, points, settings | {"uv_set": uv_set, "fit": fit, "skirt": skirt})

    def __repr__(self) -> str:
        if self.closed:
            return "<vrtm.Asset, closed>"
        info = self.info
        return f"<vrtm.Asset of {info.faces} faces, tiles {', '.join(tile._name for tile in self._tiles)}>"


def _set_list(pinned: Pinned, struct: ctypes.Structure, name: str, value: Any, count: str) -> None:
    if value is not None:
        array = pinned.indices(name, value)
        setattr(struct, name, array.ctypes.data)
        setattr(struct, count, len(array))


def _set_uvs(pinned: Pinned, struct: ctypes.Structure, name: str, uvs: Any, indices_name: str, indices: Any) -> None:
    if uvs is None:
        raise ValueError(f"{name}: a mesh without UVs has no texture")
    if isinstance(uvs, tuple) and len(uvs) == 2 and array_of(name, uvs[0]).ndim == 1:
        # u and v in separate arrays.
        struct.u = ctypes.pointer(pinned.vectors(f"{name}[0]", uvs[0], 1))
        struct.v = ctypes.pointer(pinned.vectors(f"{name}[1]", uvs[1], 1))
    else:
        struct.uvs = ctypes.pointer(pinned.vectors(name, uvs, 2))
    if indices is not None:
        array = pinned.indices(indices_name, indices, none=True)
        struct.uv_indices, struct.uv_index_count = array.ctypes.data, len(array)
