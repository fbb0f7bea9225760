"""Runs one check of checks.py in Blender's window. A check is a generator: it does something, and yields the seconds
that Blender shall have for itself, to handle events and to draw, before it goes on."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator

import bpy

HERE = os.path.dirname(os.path.abspath(__file__))
# The checks, and what the tests share.
sys.path[:0] = [HERE, os.path.dirname(HERE)]
from support import EXTENSION  # noqa: E402

OUT = "/out"


def install() -> None:
    done = bpy.ops.extensions.package_install_files(
        filepath=f"{OUT}/vrtm.zip", repo="user_default", enable_on_install=True
    )
    assert done == {"FINISHED"} and EXTENSION in bpy.context.preferences.addons, done


def window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def area(kind: str) -> bpy.types.Area:
    return next(area for area in window().screen.areas if area.type == kind)


def at(kind: str, **more):
    """The context of an editor's main region, for operators."""
    where = area(kind)
    region = next(region for region in where.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window(), screen=window().screen, area=where, region=region, **more)


def until(condition: Callable[[], bool], seconds: float = 60) -> Iterator[float]:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come about in time"
        yield 0.05


def picture(name: str) -> None:
    """A picture of the whole window, as it was drawn last."""
    subprocess.run(["scrot", "--overwrite", f"{OUT}/{name}.png"], check=True, timeout=20)


def press(*keys: str) -> None:
    """Keys and clicks as a user makes them: arguments of xdotool."""
    subprocess.run(["xdotool", *keys], check=True, timeout=20)


def run(name: str) -> None:
    import checks

    steps = getattr(checks, f"check_{name}")()

    def step() -> float | None:
        try:
            return next(steps)
        except StopIteration:
            print(f"ok {name}", flush=True)
            code = 0
        except BaseException:
            traceback.print_exc()
            print(f"FAILED {name}", flush=True)
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
        # Blender asks what to do with what is not saved; a check that wants it to quit does so itself.
        os._exit(code)

    bpy.app.timers.register(step, first_interval=0.5, persistent=True)


if __name__ == "__main__":
    install()
    run(sys.argv[sys.argv.index("--") + 1])
