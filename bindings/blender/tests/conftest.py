"""Installs the add-on as an artist does, from its archive as an extension, into a scratch folder of the user's files,
which Blender's module is told of before it is imported.

Variables: VRTM_WHEEL, the wheel of the Python package to be packed. Without it that in CARGO_TARGET_DIR (target) is
taken, where tests/python/run.sh puts it, or else pip builds one.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[2]
FOLDER = Path(tempfile.mkdtemp(prefix="vrtm-blender-"))
STATUS = 1

INSTALL = """
import sys
import bpy
done = bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
assert done == {"FINISHED"} and "bl_ext.user_default.vrtm" in bpy.context.preferences.addons, done
"""


def wheel() -> Path | None:
    """A wheel that is built already."""
    if given := os.environ.get("VRTM_WHEEL"):
        return Path(given)
    target = Path(os.environ.get("CARGO_TARGET_DIR") or REPOSITORY / "target")
    return max((target / "python").glob("vrtm-*.whl"), key=os.path.getmtime, default=None)


def run(what: str, *command: str) -> None:
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=600)
    if done.returncode != 0:
        pytest.exit(f"{what}: {(done.stderr or done.stdout).strip()[-2000:]}", returncode=1)


def pytest_configure() -> None:
    # Blender's module is looked for, and not imported yet: it reads the variable when it is.
    if importlib.util.find_spec("bpy") is None:
        return
    os.environ["BLENDER_USER_RESOURCES"] = str(FOLDER / "user")
    found = wheel()
    build = [str(HERE.parent / "build.py"), "--out", str(FOLDER)]
    run("the archive cannot be made", *build, *(["--wheel", str(found)] if found else []))
    archive = next(FOLDER.glob("vrtm-*.zip"))
    os.environ["VRTM_ARCHIVE"] = str(archive)
    run("the extension cannot be installed", "-c", INSTALL, str(archive))


def pytest_sessionfinish(exitstatus: int) -> None:
    global STATUS
    STATUS = int(exitstatus)


def pytest_unconfigure() -> None:
    shutil.rmtree(FOLDER, ignore_errors=True)
    blender = sys.modules.get("bpy")
    if blender is not None and blender.app.version < (4, 5, 0):
        # As a module, Blender 4.2 crashes at its end once it has unregistered properties with update functions.
        sys.stdout.flush()
        os._exit(STATUS)
