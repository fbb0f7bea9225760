"""Exceptions: one for each status of the library."""

import builtins
import concurrent.futures


class Error(Exception):
    """A call of the library failed. It left earlier results and settings unchanged."""

    def __init__(self, status: int, status_name: str, message: str) -> None:
        super().__init__(message or status_name)
        #: The library's status: one of VRTM_ERROR_.
        self.status = status
        #: Its name, such as "VRTM_ERROR_BUSY".
        self.status_name = status_name
        #: The library's message, which names the function and the argument.
        self.message = message

    def __reduce__(self) -> tuple:
        # With all three arguments, so that the exception can be pickled for another process.
        return type(self), (self.status, self.status_name, self.message)


class InvalidArgumentError(Error, ValueError):
    """An argument is out of its range, of a wrong size, or holds a NaN or an infinity."""


class InvalidHandleError(Error, ValueError):
    """The object was closed."""


class UnsupportedError(Error):
    """The backend or the combination is not available in this build or on this machine."""


class OutOfMemoryError(Error, MemoryError):
    """Out of memory, or over the device's memory budget."""


class NotSolvedError(Error):
    """The asset has no result yet: solve first."""


class BusyError(Error):
    """Another call, or a job, is using the asset; try again when it is done."""


class DeviceLostError(Error):
    """The GPU was lost. Close the assets and the device, and make new ones."""


class InternalError(Error):
    """A defect of the library; please report the message."""


class CancelledError(Error, concurrent.futures.CancelledError):
    """The solve was cancelled; the asset keeps its last result."""


class TimeoutError(Error, builtins.TimeoutError):
    """The job was not done in time; wait again."""


def error_of(status: int, status_name: str, message: str) -> Error:
    """The exception for a status: InvalidArgumentError for VRTM_ERROR_INVALID_ARGUMENT."""
    name = status_name.removeprefix("VRTM_ERROR_").title().replace("_", "") + "Error"
    return globals().get(name, Error)(status, status_name, message)
