"""What the command lines of all commands share: the parser, kinds of options, and kinds of values."""

from __future__ import annotations

import argparse
import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable
from typing import Any, NoReturn, TypeVar

from vrtm.bake.words import near

Value = TypeVar("Value")

LARGEST = 65536
WELDS = ("index", "position", "off")


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        # A list of frames that begins with a minus sign is no option.
        self._negative_number_matcher = re.compile(r"-\d[\d.,:x\s-]*")

    def error(self, message: str) -> NoReturn:
        unknown, found = re.match(r"unrecognized arguments: (--[^\s=]+)", message), ""
        if unknown:
            commands = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
            parsers = [self, *(parser for action in commands for parser in action.choices.values())]
            found = near(unknown[1], {name for parser in parsers for name in parser._option_string_actions})
        self.exit(2, f"{self.prog}: {message}{found} (see {self.prog} --help)\n")


def flag(to: argparse._ActionsContainer, name: str, text: str) -> None:
    """Adds an option without a value."""
    to.add_argument(name, action="store_true", help=text)


def several(to: argparse._ActionsContainer, name: str, metavar: str, text: str, dest: str | None = None) -> None:
    """Adds an option that takes one or several values, and may be given again for more."""
    more = {"dest": dest} if dest else {}
    to.add_argument(name, nargs="+", action="extend", default=[], metavar=metavar, help=text, **more)


def normal_maps(to: argparse._ActionsContainer) -> None:
    """Adds `--normal-map`, after `--texture`."""
    several(
        to,
        "--normal-map",
        "PATTERN",
        "the same for normal maps in tangent space, whose normals are turned along",
        "normal_maps",
    )
    to.add_argument(
        "--normal-y",
        choices=("up", "down"),
        default="up",
        help="whether green grows with v in these (up, as in OpenGL) or against it (down, as in DirectX)",
    )


def uv_names(given: list[str]) -> tuple[str, ...] | None:
    """The UV sets of `--uv`, in order of preference."""
    return tuple(name for text in given for name in text.split(",") if name) or None


def listed(parse: Callable[[str], Value]) -> Callable[[str], Value]:
    """A kind of values that a parser reads which raises ValueError."""

    def read(text: str) -> Value:
        try:
            return parse(text)
        except ValueError as error:
            raise ArgumentTypeError(str(error)) from None

    return read


def whole(first: int, last: int) -> Callable[[str], int]:
    """Whole numbers of a range."""
    return lambda text: _number(text, int, lambda n: first <= n <= last, f"a whole number from {first} to {last}")


def positive(text: str) -> float:
    return _number(text, float, lambda n: 0 < n < math.inf, "a number above 0")


def not_negative(text: str) -> float:
    return _number(text, float, lambda n: 0 <= n < math.inf, "a number from 0 on")


def fraction(text: str) -> float:
    return _number(text, float, lambda n: 0 <= n <= 1, "a number from 0 to 1")


def _number(text: str, kind: Callable[[str], Any], fits: Callable[[Any], bool], wanted: str) -> Any:
    try:
        number = kind(text)
    except ValueError:
        number = math.nan
    if not fits(number):
        raise ArgumentTypeError(f"'{text}' is not {wanted}")
    return number
