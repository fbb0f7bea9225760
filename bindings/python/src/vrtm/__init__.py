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

from . import rigidity as rigidity
from ._asset import Asset as Asset
from ._carrier import Carried as Carried
from ._carrier import Carrier as Carrier
from ._device import Device as Device
from ._device import LogEntry as LogEntry
from ._device import adapters as adapters
from ._errors import BusyError as BusyError
from ._errors import CancelledError as CancelledError
from ._errors import DeviceLostError as DeviceLostError
from ._errors import Error as Error
from ._errors import InternalError as InternalError
from ._errors import InvalidArgumentError as InvalidArgumentError
from ._errors import InvalidHandleError as InvalidHandleError
from ._errors import NotSolvedError as NotSolvedError
from ._errors import OutOfMemoryError as OutOfMemoryError
from ._errors import TimeoutError as TimeoutError
from ._errors import UnsupportedError as UnsupportedError
from ._fetch import CarrierFetch as CarrierFetch
from ._fetch import Fetch as Fetch
from ._job import Job as Job
from ._library import library_path as library_path
from ._library import version as version
from ._options import SolveOptions as SolveOptions
from ._records import Adapter as Adapter
from ._records import AssetInfo as AssetInfo
from ._records import AssetReport as AssetReport
from ._records import Backend as Backend
from ._records import CarrierInfo as CarrierInfo
from ._records import DeviceInfo as DeviceInfo
from ._records import FetchKind as FetchKind
from ._records import Fit as Fit
from ._records import LogCode as LogCode
from ._records import LogLevel as LogLevel
from ._records import MapInfo as MapInfo
from ._records import OpenBorders as OpenBorders
from ._records import Origin as Origin
from ._records import Overlap as Overlap
from ._records import PbdSettings as PbdSettings
from ._records import Quality as Quality
from ._records import RefinementInfo as RefinementInfo
from ._records import Scale as Scale
from ._records import Seams as Seams
from ._records import Solver as Solver
from ._records import Strain as Strain
from ._records import TileEstimate as TileEstimate
from ._records import TileInfo as TileInfo
from ._records import TileReport as TileReport
from ._records import TileSettings as TileSettings
from ._records import Weld as Weld
from ._records import WorstFeature as WorstFeature
from ._refinement import Pattern as Pattern
from ._refinement import Refinement as Refinement
from ._tile import Tile as Tile

__version__ = version()

# Type checkers take what is imported `as` itself for a part of the package.
__all__ = [name for name in dir() if not name.startswith("_")]
