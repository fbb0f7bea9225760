"""Messages of the program: a bar on a terminal, lines elsewhere, and lines for OpenJobDescription. Nothing that happens
to the streams ends the bake: they may be closed, or full."""

import contextlib
import os
import stat
import sys
import time
from typing import TextIO

from vrtm.bake.failure import INPUT, Failure, unwritable

LOG = "# vrtm bake log"
"""The first line of a log, by which a later bake knows that it may go on in it."""


def keep_streams_open() -> None:
    """Puts the null device where a standard stream is closed: else the first file that is opened would take its place,
    and get what is printed."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != descriptor:
                os.dup2(opened, descriptor)
                os.close(opened)
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def leave_streams() -> None:
    """Writes out what is left; what cannot be written is dropped, so that Python does not complain at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):
            _drop(stream)


def _drop(stream: TextIO) -> None:
    """Lets a stream that cannot be written end in the null device. What is left in its buffer would else be tried again
    by whoever flushes it, such as Python before it starts a process, and fail there."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
        stream.flush()


def _open_log(path: str) -> TextIO:
    try:
        file = open(path, "a+", encoding="utf-8", errors="backslashreplace")
        file.seek(0)
        # Not all of what may be a large file of another kind.
        first = file.read(len(LOG) + 1) if stat.S_ISREG(os.fstat(file.fileno()).st_mode) else ""
        if first and not first.startswith(LOG):
            file.close()
            raise Failure(INPUT, f"--log {path}: it is there, and is no log of vrtm")
        if not first:
            file.write(LOG + "\n")
        file.write(f"\n{time.strftime('%Y-%m-%d %H:%M:%S')} vrtm {' '.join(sys.argv[1:])}\n")
        file.flush()
        return file
    except UnicodeError:
        raise Failure(INPUT, f"--log {path}: it is there, and is no log of vrtm") from None
    except OSError as error:
        raise unwritable(f"--log {path}", error) from error


class Console:
    def __init__(
        self,
        quiet: bool = False,
        openjd: bool = False,
        verbose: bool = False,
        log: str | None = None,
        progress: bool = True,
    ) -> None:
        """`log`: a file that all messages are added to. Raises Failure if that is none that vrtm has begun."""
        self.quiet = quiet
        self.openjd = openjd
        self._verbose = verbose
        self._log: TextIO | None = None if log is None else _open_log(log)
        self._progress = progress and not quiet
        self._bar = None
        self._total = self._done = 0

    def start(self, total: int, message: str) -> None:
        """Begins to count tasks up to `total`."""
        self._total = total
        self.status(message)
        if self._progress and not self.openjd and sys.stderr is not None and sys.stderr.isatty():
            from tqdm import tqdm

            self._bar = tqdm(total=total, file=sys.stderr, dynamic_ncols=True, leave=False)
        self._say_progress()

    def done(self, message: str) -> None:
        self._done += 1
        if self._bar is not None:
            with contextlib.suppress(OSError, ValueError):
                self._bar.set_postfix_str(message, refresh=False)
                self._bar.update()
        elif self._progress:
            self._put(sys.stdout, f"[{self._done}/{self._total}] {message}")
        self._note("info", f"[{self._done}/{self._total}] {message}")
        self._say_progress()

    def status(self, message: str) -> None:
        """Reports the current step to OpenJobDescription."""
        if self.openjd:
            self._put(sys.stdout, f"openjd_status: {message}")

    def info(self, message: str) -> None:
        """A line of text on stdout."""
        self._note("info", message)
        if not self.quiet:
            self._put(sys.stdout, message)

    def verbose(self, message: str) -> None:
        """A line of text on stdout, with --verbose."""
        self._note("detail", message)
        if self._verbose:
            self._put(sys.stdout, message)

    def warning(self, message: str) -> None:
        """A line of text on stderr."""
        self._note("warning", message)
        self._put(sys.stderr, f"vrtm: warning: {message}")

    def error(self, message: str) -> None:
        """Prints why the program fails."""
        self._note("error", message)
        self._put(sys.stderr, f"vrtm: {message}")
        if self.openjd:
            self._put(sys.stdout, f"openjd_fail: {message.splitlines()[-1]}")

    def close(self) -> None:
        if self._bar is not None:
            with contextlib.suppress(OSError, ValueError):
                self._bar.close()
            self._bar = None

    def _note(self, level: str, message: str) -> None:
        """Adds to the log, line by line, so that a bake that is killed leaves what it said."""
        if self._log is None:
            return
        try:
            for line in message.splitlines() or [""]:
                self._log.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {level}: {line}\n")
            self._log.flush()
        except (OSError, ValueError):
            log, self._log = self._log, None
            self._put(sys.stderr, f"vrtm: warning: --log {log.name}: it cannot be written any more")
            _drop(log)

    def _say_progress(self) -> None:
        if self.openjd:
            self._put(sys.stdout, f"openjd_progress: {100 * self._done / max(self._total, 1):.1f}")

    def _put(self, stream: TextIO | None, line: str) -> None:
        if stream is None:
            return
        try:
            if self._bar is not None:
                self._bar.write(line, file=stream)
            else:
                print(line, file=stream, flush=True)
        except (OSError, ValueError):
            _drop(stream)
