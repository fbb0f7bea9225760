"""The shared library: finding it, loading it, calling it."""

import ctypes
import os
import platform
import sys
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from . import _abi
from ._errors import error_of

Struct = TypeVar("Struct", bound=ctypes.Structure)
Object = TypeVar("Object", bound="Owned")

FILE = {"win32": "vrtm.dll", "darwin": "libvrtm.dylib"}.get(sys.platform, "libvrtm.so")


def library_path() -> Path:
    """The library's file: that of the package, unless the environment variable VRTM_LIBRARY names another."""
    return Path(os.environ.get("VRTM_LIBRARY") or Path(__file__).parent / FILE)


def _load() -> ctypes.CDLL:
    file = library_path()
    if not file.is_file():
        raise ImportError(f"vrtm: the shared library {file} is not there: install the package with pip")
    try:
        # By its whole path: on Windows what the DLL needs is then looked for beside it and in the system, not in PATH.
        library = ctypes.CDLL(str(file.resolve()))
    except OSError as error:
        machine = f"{platform.system()} on {platform.machine()}"
        raise ImportError(f"vrtm: the shared library {file} does not load on {machine}: {error}") from error
    for name, (result, *arguments) in _abi.functions.items():
        try:
            function = getattr(library, name)
        except AttributeError:
            raise ImportError(f"vrtm: {file} is older than this package: it has no {name}") from None
        function.restype, function.argtypes = result, arguments
    found, wanted = library.vrtm_version(), _abi.VRTM_VERSION
    if found // 1_000_000 != wanted // 1_000_000 or found < wanted:
        raise ImportError(f"vrtm: {file} is version {_text(found)}, and this package wants {_text(wanted)}")
    return library


def _text(version: int) -> str:
    return f"{version // 1_000_000}.{version // 1000 % 1000}.{version % 1000}"


library = _load()


def version() -> str:
    """The version of the loaded library, such as "0.1.0"."""
    return _text(library.vrtm_version())


def check(status: int) -> None:
    """Raises the exception for a status, unless it is VRTM_OK. Call it on the thread of the failed call, whose message
    it reads."""
    if status != _abi.VRTM_OK:
        name = library.vrtm_status_string(status).decode()
        raise error_of(status, name, library.vrtm_last_error().decode(errors="replace"))


def new(struct: type[Struct]) -> Struct:
    """A struct initialised as by its _init() function: its size, the defaults, and zeros."""
    value = struct()
    check(library.vrtm_defaults(struct.__name__.encode(), ctypes.byref(value), ctypes.sizeof(struct)))
    return value


class Handle:
    """An object of the library, by its number there."""

    if not TYPE_CHECKING:

        def __setattr__(self, name: str, value: Any) -> None:
            if not name.startswith("_"):
                raise AttributeError(f"{name}: no attribute of a vrtm.{type(self).__name__} can be set")
            super().__setattr__(name, value)

    def __reduce__(self) -> NoReturn:
        # A copy would share the number, and another process does not know it.
        raise TypeError(f"a vrtm.{type(self).__name__} belongs to this process, and cannot be copied or pickled")


class Owned(Handle):
    """An object of the library. close(), the end of a `with` block, or the end of its last reference destroys it."""

    def _own(self, handle: Any, destroy: Callable[[Any], Any], kept: object = None) -> None:
        """Takes a handle. `kept` lives until the handle is destroyed."""
        self._handle = handle
        self._end = weakref.finalize(self, _destroy, destroy, handle, kept)

    def close(self) -> None:
        """Destroys the object; a second call does nothing."""
        self._end()

    @property
    def closed(self) -> bool:
        """True after close()."""
        return not self._end.alive

    def __enter__(self: Object) -> Object:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _destroy(destroy: Callable[[Any], Any], handle: Any, _kept: object) -> None:
    destroy(handle)
