#!/usr/bin/env python3
"""Runs the add-on's checks in Blender as a Python module (bpy), with the extension installed from its archive.

    python bindings/blender/tests/run.py [--wheel vrtm-...whl | --zip vrtm-...zip] [--seconds 150] [NAME ...]

Prints a line per check, or "skipped: why" where bpy cannot be imported, and at the end how many there were. The exit
code is 0 if none failed. Without --wheel and --zip the wheel is built with pip (VRTM_LIBRARY names a library that is
built already). With VRTM_REQUIRE_BLENDER=1, what would be skipped fails.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent

INSTALL = """
import sys
import bpy
done = bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
assert done == {"FINISHED"} and "bl_ext.user_default.vrtm" in bpy.context.preferences.addons, done
"""


def finish(passed: int, failed: int, skipped: int) -> int:
    if os.environ.get("VRTM_REQUIRE_BLENDER") == "1":
        failed, skipped = failed + skipped, 0
    print(f"test result: {'FAILED' if failed else 'ok'}. {passed} passed; {failed} failed; {skipped} ignored")
    return 1 if failed else 0


def main() -> int:
    parser = argparse.ArgumentParser(description="Runs the add-on's checks in Blender as a Python module.")
    parser.add_argument("names", nargs="*", help="which files: build, live, ...; all if left out")
    parser.add_argument("--wheel", type=Path, help="a wheel of the Python package, to be packed")
    parser.add_argument("--zip", type=Path, help="an archive that is packed already")
    parser.add_argument("--seconds", type=float, default=150, help="for all of it (%(default)s)")
    arguments = parser.parse_args()
    found = subprocess.run([sys.executable, "-c", "import bpy"], capture_output=True, text=True)
    if found.returncode != 0:
        why = (found.stderr.strip().splitlines() or [f"exit code {found.returncode}"])[-1]
        print(f"skipped: bpy cannot be imported: {why}")
        return finish(0, 0, 1)
    end = time.monotonic() + arguments.seconds
    with tempfile.TemporaryDirectory(prefix="vrtm-blender-") as folder:
        environment = {
            **os.environ,
            "BLENDER_USER_RESOURCES": os.path.join(folder, "user"),
            "PYTHONDONTWRITEBYTECODE": "1",
            "VRTM_CHECK_FOLDER": folder,
        }
        archive = arguments.zip
        if archive is None:
            command = [sys.executable, str(HERE.parent / "build.py"), "--out", folder]
            command += ["--wheel", str(arguments.wheel)] if arguments.wheel else []
            if subprocess.run(command, env=environment).returncode != 0:
                print("FAILED the archive cannot be made")
                return finish(0, 1, 0)
            archive = next(Path(folder).glob("vrtm-*.zip"))
        environment["VRTM_CHECK_ZIP"] = str(archive)
        # The library is that of the wheel, as it is for artists.
        environment.pop("VRTM_LIBRARY", None)
        installed = subprocess.run(
            [sys.executable, "-c", INSTALL, str(archive)], env=environment, capture_output=True, text=True
        )
        if installed.returncode != 0:
            print(f"FAILED the extension cannot be installed: {installed.stderr.strip()[-500:]}")
            return finish(0, 1, 0)
        print("ok the extension is installed from its archive by bpy.ops.extensions")
        passed, failed, skipped = 1, 0, 0
        for file in sorted(HERE.glob("check_*.py")):
            name = file.stem.removeprefix("check_")
            if arguments.names and name not in arguments.names:
                continue
            one = run_file(file, name, environment, end - time.monotonic())
            passed, failed, skipped = passed + one[0], failed + one[1], skipped + one[2]
        return finish(passed, failed, skipped)


def run_file(file: Path, name: str, environment: dict[str, str], seconds: float) -> tuple[int, int, int]:
    """Each file in a process of its own: a crash of Blender ends one file's checks."""
    begun = time.monotonic()
    command = [sys.executable, "-m", "unittest", "-v", file.stem]
    try:
        ran = subprocess.run(
            command,
            env=environment,
            cwd=HERE,
            capture_output=True,
            text=True,
            timeout=max(seconds, 1),
            errors="replace",
        )
        code, text = ran.returncode, ran.stderr + ran.stdout
    except subprocess.TimeoutExpired as expired:
        code, text = "none: out of time", (expired.stderr or b"").decode(errors="replace")
    # A line of unittest: "test_name (module.Class.test_name)", perhaps a docstring, and "... ok".
    results = re.findall(
        r"^(test_\w+) \([\w.]+\)(?:\n.*?)? \.\.\. (?:.*\n)*?.*?(ok|FAIL|ERROR|skipped '[^']*')$", text, re.M
    )
    words = {"ok": "ok", "FAIL": "FAILED", "ERROR": "FAILED"}
    for test, result in results:
        word = words.get(result)
        print(f"{word} {name}: {test}" if word else f"{name} {result.replace(' ', ': ', 1)}")
    passed = sum(result == "ok" for _, result in results)
    failed = sum(result in ("FAIL", "ERROR") for _, result in results)
    skipped = len(results) - passed - failed
    if (failed or code != 0) and not (failed == 0 and code == 0):
        print("\n".join(text.splitlines()[-60:]))
    if code != 0 and not failed:
        print(f"FAILED {name}: ended with exit code {code}")
        failed = 1
    print(f"{name}: {time.monotonic() - begun:.0f} s", flush=True)
    return passed, failed, skipped


if __name__ == "__main__":
    sys.exit(main())
