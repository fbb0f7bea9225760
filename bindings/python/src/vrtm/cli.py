"""The console command `vrtm`."""

import argparse
import os
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import vrtm

if TYPE_CHECKING:
    from vrtm.bake.settings import Settings


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command line and returns its exit code: 0 done, 2 bad input, 3 not within tolerance, 4 device, 128 + a
    signal's number if it was ended by one."""
    from vrtm.bake import console
    from vrtm.bake.failure import describe

    if arguments is None:
        _ensure_utf8()
    if sys.platform == "linux":
        # Mesa's Vulkan drivers complain on stderr if it is not set, although vrtm opens no window.
        os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
    console.keep_streams_open()
    try:
        return _run(sys.argv[1:] if arguments is None else list(arguments))
    except OSError as error:
        # Of the template, whose reader needs all of it.
        failure = describe(error, "stdout")
        console.Console().error(failure.message)
        return failure.code
    except KeyboardInterrupt:
        # While the arguments are read; `bake`, `dilate` and `rigidity` handle signals themselves.
        console.Console().error("ended by SIGINT")
        return 130
    finally:
        console.leave_streams()


def _ensure_utf8() -> None:
    """Restarts Python if its file names are ASCII, as in the C locale: USD and OpenImageIO expect UTF-8, and names
    outside ASCII could not be passed on."""
    # Restart only once: an option of Python itself may take precedence.
    if sys.getfilesystemencoding().lower() not in ("utf-8", "utf8") and os.environ.get("PYTHONUTF8") != "1":
        sys.stdout.flush()
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | {"PYTHONUTF8": "1"})


def _run(given: list[str]) -> int:
    from vrtm.bake import arguments, image_arguments
    from vrtm.bake.parsing import Parser

    parser = Parser(prog="vrtm", description=(vrtm.__doc__ or "").splitlines()[0])
    parser.add_argument("--version", action="version", version=f"vrtm {vrtm.version()}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    bake = arguments.add_to(commands)
    image_arguments.add_dilate(commands)
    image_arguments.add_rigidity(commands)
    template = commands.add_parser(
        "farm-template",
        help="print a job template for a render farm",
        description="Prints a template of OpenJobDescription, or a script for Slurm.",
    )
    template.add_argument("--slurm", action="store_true", help="print a script that submits a bake to Slurm")
    template.add_argument("--no-layer", action="store_true", help="without the step that writes a USD layer")
    template.add_argument("--carry", action="store_true", help="with steps that carry geometry on the surface")
    commands.add_parser("devices", help="list what can compute", description="Lists the CPU and all GPUs.")
    parsed = parser.parse_args(given)
    if parsed.command == "bake" and (parsed.more or parsed.settings):
        try:
            # Of an option that is given twice, the last one holds: that of the command line.
            inside = shlex.split(Path(parsed.settings).read_text("utf-8")) if parsed.settings else []
            parsed = parser.parse_args([*given[:1], *inside, *given[1:], *shlex.split(" ".join(parsed.more or []))])
        except (OSError, ValueError) as error:
            bake.error(f"--settings or --more: {error}")
    if parsed.command == "farm-template":
        if parsed.slurm and (parsed.no_layer or parsed.carry):
            template.error("--slurm takes what to write from the options of the bake")
        from vrtm import farm

        text = farm.slurm() if parsed.slurm else farm.template(not parsed.no_layer, parsed.carry)
        print(text, end="", flush=True)
        return 0
    if parsed.command == "devices":
        return _devices()
    return _work(parsed, arguments.settings(bake, parsed) if parsed.command == "bake" else None)


def _work(parsed: argparse.Namespace, settings: "Settings | None") -> int:
    """Runs a command that reads scenes or images, and heeds signals."""
    from vrtm.bake.console import Console
    from vrtm.bake.failure import DONE, describe
    from vrtm.bake.stopping import signals

    console = Console(parsed.quiet)
    # USD's modules swallow a Ctrl-C that comes while they are being loaded, and OpenImageIO's ends in a crash.
    with signals() as stop:
        try:
            if settings is not None:
                console = Console(parsed.quiet, parsed.openjd)
                console = Console(parsed.quiet, parsed.openjd, parsed.verbose, parsed.log, not parsed.no_progress)
                from vrtm.bake.run import bake

                return bake(settings, console, stop)
            if parsed.command == "dilate":
                from vrtm.bake.dilate import dilate as work
            else:
                from vrtm.bake.rigidity import make as work
            work(parsed, console, stop)
            return DONE
        except Exception as error:
            failure = describe(error)
            console.error(failure.message)
            return failure.code


def _devices() -> int:
    from vrtm.bake import pool
    from vrtm.bake.console import Console

    console = Console()
    with vrtm.Device("cpu") as device:
        console.info(f"cpu    {device.info.name or 'CPU'}, {pool.available()} cores")
    for index, adapter in enumerate(vrtm.adapters()):
        kind = ", software" if adapter.software else ""
        console.info(f"gpu {index}  {adapter.name}, {adapter.api}, {adapter.driver}{kind}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
