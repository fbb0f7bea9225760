"""Variable rigidity texture mapping: keeps painted features rigid while the surface under them deforms.

    import numpy as np
    import vrtm

    with vrtm.Device() as device:
        asset = vrtm.Asset(device, rest, faces, uvs=uvs)        # once per mesh
        tile = asset.tile(1001)
        tile.set_rigidity(painted)                              # when the artist paints; white is rigid
        for pose in poses:                                      # every frame: positions in, map out
            [redirection] = asset.redirect(pose, [tile])

A redirection map has two channels: for a surface point's UV it holds the UV at which to sample the texture, within the
tile, with v up. Arrays go in and out as numpy arrays, as views wherever their layout allows it, in float32 or float64.
Exceptions carry the library's status and message. The GIL is released in every call, and any thread may call; a call
that solves or changes an asset while another does raises BusyError.
"""

from . import rigidity
from ._asset import Asset
from ._carrier import Carried, Carrier
from ._device import Device, LogEntry, adapters
from ._errors import (
    BusyError,
    CancelledError,
    DeviceLostError,
    Error,
    InternalError,
    InvalidArgumentError,
    InvalidHandleError,
    NotSolvedError,
    OutOfMemoryError,
    TimeoutError,
    UnsupportedError,
)
from ._fetch import CarrierFetch, Fetch
from ._job import Job
from ._library import path as library_path
from ._library import version
from ._options import SolveOptions
from ._records import (
    Adapter,
    AssetInfo,
    AssetReport,
    Backend,
    CarrierInfo,
    DeviceInfo,
    FetchKind,
    Fit,
    LogCode,
    LogLevel,
    MapInfo,
    OpenBorders,
    Origin,
    Overlap,
    PbdSettings,
    Quality,
    RefinementInfo,
    Seams,
    Solver,
    Strain,
    TileEstimate,
    TileInfo,
    TileReport,
    TileSettings,
    Weld,
    WorstFeature,
)
from ._refinement import Pattern, Refinement
from ._tile import Tile

__version__ = version()

__all__ = [
    "Adapter",
    "Asset",
    "AssetInfo",
    "AssetReport",
    "Backend",
    "BusyError",
    "CancelledError",
    "Carried",
    "Carrier",
    "CarrierFetch",
    "CarrierInfo",
    "Device",
    "DeviceInfo",
    "DeviceLostError",
    "Error",
    "Fetch",
    "FetchKind",
    "Fit",
    "InternalError",
    "InvalidArgumentError",
    "InvalidHandleError",
    "Job",
    "LogCode",
    "LogEntry",
    "LogLevel",
    "MapInfo",
    "NotSolvedError",
    "OpenBorders",
    "Origin",
    "OutOfMemoryError",
    "Overlap",
    "Pattern",
    "PbdSettings",
    "Quality",
    "Refinement",
    "RefinementInfo",
    "Seams",
    "SolveOptions",
    "Solver",
    "Strain",
    "Tile",
    "TileEstimate",
    "TileInfo",
    "TileReport",
    "TileSettings",
    "TimeoutError",
    "UnsupportedError",
    "Weld",
    "WorstFeature",
    "adapters",
    "library_path",
    "rigidity",
    "version",
]
