"""Records with many figures, as tables."""

import dataclasses
from collections.abc import Iterator
from typing import Any


class Table:
    """A dataclass that shows its fields one below another, with those of records that it holds."""

    def rows(self) -> list[tuple[str, str]]:
        """The name and the text of each figure, `before.rms` for one of a record within this."""
        return list(_rows(self, ""))

    def __repr__(self) -> str:
        rows = self.rows()
        width = max(len(name) for name, _ in rows)
        return "\n".join([type(self).__name__, *(f"  {name:<{width}}  {value}" for name, value in rows)])


def _rows(record: Any, prefix: str) -> Iterator[tuple[str, str]]:
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if dataclasses.is_dataclass(value):
            yield from _rows(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, f"{value:.6g}" if isinstance(value, float) else str(value)
