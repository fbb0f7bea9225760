"""Errors that end the program, each with the exit code that tells a farm what to do about it."""

import traceback

import vrtm
from vrtm.bake.overwrite import Conflict
from vrtm.bake.scene import SceneError

DONE = 0
BUG = 1
"""An error of vrtm itself, printed with a traceback."""
INPUT = 2
"""A file or an option cannot be used, or an output cannot be written."""
TOLERANCE = 3
"""All files were written, but a result is worse than asked for."""
DEVICE = 4
"""The device is missing or lost, or memory is short."""
SIGNAL = 128
"""Plus the signal's number: the program was asked to end."""

EXTRAS = {"pxr": "bake", "OpenImageIO": "bake", "tqdm": "bake", "alembic3d": "alembic", "alembic": "alembic"}
"""Modules that are not installed with vrtm itself, and the extra that brings each."""


class Failure(Exception):
    """Ends the program with an exit code and a message of one line that names the file or option."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(code, message)
        self.code = code
        self.message = message

    def __str__(self) -> str:
        return self.message


def one_line(text: object) -> str:
    """A library's message without its line breaks."""
    return " ".join(str(text).split())


def unwritable(place: str, error: OSError) -> Failure:
    """The failure of a file or folder, in the system's words."""
    return Failure(INPUT, f"{place}: {one_line(error.strerror or error)}")


def describe(error: BaseException, subject: str = "") -> Failure:
    """The failure that an exception means to the caller of the program. `subject` names the work in progress, if the
    message does not."""
    named = f"{subject}: " if subject else ""
    if isinstance(error, Failure):
        return error
    if isinstance(error, SceneError):
        return Failure(INPUT, one_line(error))
    if isinstance(error, Conflict):
        return Failure(INPUT, f"{error}{': --overwrite replaces it' if error.replaceable else ''}")
    if isinstance(error, ModuleNotFoundError) and (error.name or "").split(".")[0] in EXTRAS:
        module = (error.name or "").split(".")[0]
        return Failure(INPUT, f"the Python module {module} is missing: pip install 'vrtm[{EXTRAS[module]}]'")
    if isinstance(error, ImportError) and (error.name or "vrtm").split(".")[0] != "vrtm":
        # It is there, and lacks something: a library of the system, or a part that another version has.
        return Failure(INPUT, f"the Python module {error.name} cannot be loaded: {one_line(error)}")
    if isinstance(error, vrtm.InvalidArgumentError):
        return Failure(INPUT, named + one_line(error))
    if isinstance(error, (vrtm.UnsupportedError, vrtm.OutOfMemoryError, vrtm.DeviceLostError)):
        return Failure(DEVICE, named + one_line(error))
    if isinstance(error, UnicodeEncodeError):
        return Failure(INPUT, f"{error.object!a}: a name that is no UTF-8, which USD and OpenImageIO cannot take")
    if isinstance(error, MemoryError):
        return Failure(DEVICE, f"{named}memory is short; try fewer --jobs")
    if isinstance(error, OSError) and not isinstance(error, vrtm.Error):
        place = f"{error.filename}: " if error.filename else named
        return Failure(INPUT, place + one_line(error.strerror or error))
    return Failure(BUG, named + "".join(traceback.format_exception(error)).rstrip())
