"""The parser of all commands: kinds of options and of values, and messages of one line."""

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
    """A parser that reports an error in one line."""

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


def option(to: argparse._ActionsContainer, name: str, text: str, value: str = "", **more: Any) -> None:
    """Adds an option with its sentence, which the default ends. `value`: the value's name in the help, with dots if
    there may be several values. An option without a value, choices or a number of values is a flag."""
    if value.endswith("..."):
        more = {"nargs": "+", "action": "extend", "default": []} | more
    elif not value and not more.keys() & {"action", "choices", "nargs"}:
        more["action"] = "store_true"
    if value:
        more["metavar"] = value.removesuffix("...")
    to.add_argument(name, help=f"{text} (default: %(default)s)" if more.get("default") else text, **more)


def normal_maps(add: Callable[..., None]) -> None:
    """Adds `--normal-map` and `--normal-y`."""
    text = "Do as with --texture for normal maps in tangent space, whose normals turn along."
    add("--normal-map", text, "PATTERN...", dest="normal_maps")
    text = "Green of normal maps points up (as in OpenGL) or down (as in DirectX)."
    add("--normal-y", text, choices=("up", "down"), default="up")


def listed(parse: Callable[[str], Value]) -> Callable[[str], Value]:
    """The kind of values that a parser reads which raises ValueError."""

    def read(text: str) -> Value:
        try:
            return parse(text)
        except ValueError as error:
            raise ArgumentTypeError(str(error)) from None

    return read


def either(word: str, kind: Callable[[str], Any]) -> Callable[[str], Any]:
    """A word, or values of a kind."""
    return lambda text: text if text == word else kind(text)


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
