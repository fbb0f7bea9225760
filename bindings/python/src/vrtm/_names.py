"""Values as the library has them: checked numbers, names for the header's constants, dataclasses for its structs."""

import ctypes
from collections.abc import Collection, Iterable
from typing import Any, TypeVar

from . import _abi, _records
from ._library import check, new

Record = TypeVar("Record")


def values(argument: str) -> dict[str, int]:
    """The names that an argument such as "quality" may have, and their values."""
    return getattr(_abi, f"vrtm_{argument}_values")


def value_of(argument: str, name: Any, shown: str | None = None) -> int:
    """The value of a name: 1 for `value_of("quality", "draft")`."""
    try:
        return values(argument)[name]
    except (KeyError, TypeError):
        names = ", ".join(repr(n) for n in values(argument))
        raise ValueError(f"{shown or argument}: {name!r} is none of {names}") from None


def name_of(argument: str, value: int) -> str:
    """The name of a value; the number itself if only a newer library knows it."""
    return next((n for n, v in values(argument).items() if v == value), str(value))


def _named(field: str) -> bool:
    """True if the numbers of a field have names."""
    return hasattr(_abi, f"vrtm_{field}_values")


def record(cls: type[Record], struct: ctypes.Structure) -> Record:
    """Converts a struct that the library has filled to its dataclass."""
    fields = {}
    for name, hint in cls.__annotations__.items():
        value = getattr(struct, name)
        if isinstance(value, bytes):
            value = value.decode(errors="replace")
        elif isinstance(value, ctypes.Array):
            value = bytes(value)
        elif isinstance(value, ctypes.Structure):
            value = record(getattr(_records, hint), value)
        elif isinstance(value, int) and _named(name):
            value = name_of(name, value)
        elif hint == "bool":
            value = bool(value)
        fields[name] = value
    return cls(**fields)


def told(cls: type[Record], function: Any, *arguments: Any) -> Record:
    """Calls a function of the library whose last argument is a struct to fill; returns the struct's dataclass."""
    struct = new(getattr(_abi, _records.structs[cls]))
    check(function(*arguments, ctypes.byref(struct)))
    return record(cls, struct)


def fill(struct: ctypes.Structure, settings: Any) -> None:
    """Copies the fields of a dataclass of settings into its struct."""
    for name in type(settings).__annotations__:
        value = getattr(settings, name)
        put(struct, name, value_of(name, value) if _named(name) else value)


def put(struct: ctypes.Structure, name: str, value: Any) -> None:
    """Sets a number of a struct."""
    try:
        setattr(struct, name, value)
    except TypeError:
        raise TypeError(f"{name}: {value!r} is no number") from None


def known(what: str, names: Iterable[str], choices: Collection[str]) -> None:
    """Checks the names of keyword arguments."""
    for name in set(names) - set(choices):
        raise TypeError(f"{name}: there is no such {what}; there are {', '.join(choices)}")


def natural(name: str, value: Any, bits: int) -> int:
    """Checks an unsigned number, which ctypes would silently truncate to its number of bits."""
    try:
        number = value.__index__()
    except AttributeError:
        raise TypeError(f"{name}: {value!r} is no whole number") from None
    if not 0 <= number < 1 << bits:
        raise ValueError(f"{name}: {number} is not between 0 and {(1 << bits) - 1}")
    return number
