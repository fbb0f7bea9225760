"""Records with many figures, as tables."""

import dataclasses
from collections.abc import Iterator
from typing import Any, NoReturn


def refuse(record: Any, name: str, value: Any) -> NoReturn:
    """Takes the place of a record's __setattr__: what was set in a copy would be lost without a word."""
    kind = type(record).__name__
    how = {
        "TileSettings": f": tile.set_settings(tile.settings, {name}={value!r}) sets it",
        "PbdSettings": f": PbdSettings({name}={value!r}) makes another",
    }
    raise dataclasses.FrozenInstanceError(f"{name}: a {kind} is a copy, and cannot be changed{how.get(kind, '')}")


class Table:
    """A dataclass that shows its fields one below another, with those of records that it holds."""

    def __repr__(self) -> str:
        rows = list(_rows(self, ""))
        width = max(len(name) for name, _ in rows)
        return "\n".join([type(self).__name__, *(f"  {name:<{width}}  {value}" for name, value in rows)])


def _rows(record: Any, prefix: str) -> Iterator[tuple[str, str]]:
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if dataclasses.is_dataclass(value):
            yield from _rows(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, f"{value:.6g}" if isinstance(value, float) else str(value)
