"""Devices: the GPU or CPU that solves assets."""

import ctypes
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

from . import _abi
from ._library import Owned, check, library, new
from ._names import name_of, natural, told, value_of
from ._records import Adapter, Backend, DeviceInfo, LogCode, LogLevel


@dataclass(frozen=True)
class LogEntry:
    """A line of the log. Programs decide by its code and values: the words of a message may change."""

    level: LogLevel
    code: LogCode
    udim: int
    """UDIM number of the tile that it is about; 0 = about no single tile. Its UV set and layer follow."""
    uv_set: int
    layer: int
    values: tuple[float, ...]
    """The numbers of the message, as VRTM_LOG_CODE_... in vrtm.h lists them; the others are 0."""
    message: str


Log = Callable[[LogEntry], Any]


def _to_logging(entry: LogEntry) -> None:
    level = logging.WARNING if entry.level == "warning" else logging.INFO
    logging.getLogger("vrtm").log(level, "%s", entry.message)


def adapters() -> list[Adapter]:
    """The GPUs that a device can be made on, hardware first; a device's `adapter` is an index into this list. Empty
    without a GPU or a driver. This loads drivers, which takes tens of milliseconds."""
    count = ctypes.c_uint32()
    check(library.vrtm_adapter_count(ctypes.byref(count)))
    return [told(Adapter, library.vrtm_adapter_get_info, index) for index in range(count.value)]


class Device(Owned):
    """A GPU or the CPU, on which assets are solved. Make one and keep it.

    backend         "auto" (a hardware GPU if available, else the CPU), "cpu" or "gpu"
    adapter         which GPU: its index in adapters()
    adapter_uuid    which GPU, instead of its index: the 16 bytes of its Vulkan UUID (Adapter.uuid), so that
                    the device is on the GPU of another program. "gpu" requires this GPU; "auto" uses the CPU if
                    this GPU cannot be used
    adapter_luid    which GPU, instead of its index: the 8 bytes of its Direct3D LUID
    threads         CPU threads that one solve uses; 0 = one per core. Results do not depend on it
    memory_budget   maximum bytes that all assets of the device may hold; 0 = no limit
    log             called with each LogEntry, on the thread of the call (a job has a thread of its own); None =
                    Python's logger "vrtm": a warning as WARNING, which Python shows by itself, all else as INFO

    Raises UnsupportedError if the GPU was not found. Assets keep what they need of a device and may outlive it. May be
    used with `with`, which closes it.
    """

    def __init__(
        self,
        backend: Backend = "auto",
        *,
        adapter: int = 0,
        adapter_uuid: bytes | None = None,
        adapter_luid: bytes | None = None,
        threads: int = 0,
        memory_budget: int = 0,
        log: Log | None = None,
    ) -> None:
        desc = new(_abi.vrtm_device_desc)
        desc.backend = value_of("backend", backend)
        desc.adapter = natural("adapter", adapter, 32)
        _set_id(desc, adapter_uuid, adapter_luid)
        desc.threads = natural("threads", threads, 32)
        desc.memory_budget = natural("memory_budget", memory_budget, 64)
        if log is not None and not callable(log):
            raise TypeError(f"log: {log!r} cannot be called")
        tell = log or _to_logging

        def line(_user: int, address: int) -> None:
            entry = _abi.vrtm_log_entry.from_address(address)
            level = cast(LogLevel, name_of("log_level", entry.level))
            code = cast(LogCode, name_of("log_code", entry.code))
            message = entry.message.decode(errors="replace")
            tell(LogEntry(level, code, entry.udim, entry.uv_set, entry.layer, tuple(entry.values), message))

        # The assets keep the log function alive, too: the library calls it as long as one of them exists.
        self._log = desc.log = _abi.vrtm_log_fn(line)
        handle = _abi.vrtm_device()
        check(library.vrtm_device_create(ctypes.byref(desc), ctypes.byref(handle)))
        self._own(handle, library.vrtm_device_destroy)

    @property
    def info(self) -> DeviceInfo:
        """The chosen backend, the reason, and how much memory the device's assets hold."""
        return told(DeviceInfo, library.vrtm_device_get_info, self._handle)

    def __repr__(self) -> str:
        return "<vrtm.Device, closed>" if self.closed else f"<vrtm.Device {self.info.backend}: {self.info.name}>"


def _set_id(desc: ctypes.Structure, uuid: bytes | None, luid: bytes | None) -> None:
    """Sets the adapter's identity in the struct, if one is given."""
    if uuid is not None and luid is not None:
        raise ValueError("adapter_luid: adapter_uuid is given, too")
    for name, by, value, size in (("adapter_uuid", "uuid", uuid, 16), ("adapter_luid", "luid", luid, 8)):
        if value is None:
            continue
        identity = bytes(memoryview(value))
        if len(identity) != size:
            raise ValueError(f"{name}: {len(identity)} bytes, not {size}")
        desc.adapter_by = value_of("adapter_by", by)
        desc.adapter_id[:size] = identity
