"""The archive: Blender's own tool finds it valid, the same inputs make the same bytes, and wrong wheels are refused."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest
import zipfile
from pathlib import Path

from support import EXTENSION, start

HERE = Path(__file__).resolve().parent
ARCHIVE = Path(os.environ.get("VRTM_ARCHIVE", ""))


def build():
    spec = importlib.util.spec_from_file_location("build", HERE.parent / "build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Build(unittest.TestCase):
    def wheel(self):
        """The path of the archive, in a folder that the test's end removes."""
        with zipfile.ZipFile(ARCHIVE) as archive:
            name = next(name for name in archive.namelist() if name.endswith(".whl"))
            path = Path(self.enterContext(tempfile.TemporaryDirectory()), Path(name).name)
            path.write_bytes(archive.read(name))
        return path

    def test_blender_finds_it_valid(self):
        import bpy

        tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
        found = subprocess.run([sys.executable, str(tool), "validate", str(ARCHIVE)], capture_output=True, text=True)
        self.assertEqual(found.returncode, 0, found.stdout + found.stderr)

    def test_the_same_inputs_make_the_same_bytes(self):
        wheel = self.wheel()
        first = build().pack(wheel)
        os.utime(wheel, (0, 0))
        self.assertEqual(first, build().pack(wheel))
        self.assertEqual(first[1], ARCHIVE.read_bytes())

    def test_platforms(self):
        platforms_of = build().platforms_of
        for tag, expected in (
            ("manylinux_2_35_x86_64", ["linux-x64"]),
            ("manylinux2014_x86_64.manylinux_2_17_x86_64", ["linux-x64"]),
            ("win_amd64", ["windows-x64"]),
            ("macosx_11_0_arm64", ["macos-arm64"]),
            ("macosx_11_0_universal2", ["macos-arm64", "macos-x64"]),
        ):
            self.assertEqual(platforms_of(Path(f"vrtm-0.1.0-py3-none-{tag}.whl")), expected)

    def test_wrong_wheels_are_refused(self):
        tool, wheel = build(), self.wheel()
        for name, word in (
            ("vrtm-0.1.0-cp311-cp311-linux_x86_64.whl", "one version of Python only"),
            ("vrtm-0.1.0-py3-none-any.whl", "none of Blender's platforms"),
            ("vrtm.whl", "not that of a wheel"),
            ("vrtm-0.1.0-py3-none-win_amd64.whl", "is no library for win_amd64"),
            ("vrtm-0.1.0-py3-none-manylinux_2_36_aarch64.whl", "is no library for manylinux_2_36_aarch64"),
        ):
            other = wheel.with_name(name)
            other.write_bytes(wheel.read_bytes())
            with self.assertRaisesRegex(tool.Refused, word):
                tool.pack(other)

        def edited(change):
            """The wheel with some files changed or left out."""
            path = wheel.parent / "edited" / wheel.name
            path.parent.mkdir(exist_ok=True)
            with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(path, "w") as new:
                for name in old.namelist():
                    data = change(name, old.read(name))
                    if data is not None:
                        new.writestr(name, data)
            return path

        def metadata(old, new):
            return lambda name, data: data.replace(old, new) if name.endswith("METADATA") else data

        for change, word in (
            (metadata(b"Version: ", b"Version: 9"), "takes vrtm"),
            (metadata(b"Requires-Dist: numpy", b"Requires-Dist: scipy"), "it needs scipy"),
            (lambda name, data: None if tool.LIBRARY.search(name) else data, "no library in it"),
            (lambda name, data: b"\x7fELF" if tool.LIBRARY.search(name) else data, "is no library for"),
        ):
            with self.assertRaisesRegex(tool.Refused, word):
                tool.pack(edited(change))
        wheel.write_bytes(b"no archive")
        with self.assertRaisesRegex(tool.Refused, "not a zip"):
            tool.pack(wheel)

    def test_the_wheel_is_installed_with_it(self):
        start()
        user = Path(os.environ["BLENDER_USER_RESOURCES"])
        self.assertTrue(Path(sys.modules[EXTENSION].__file__).is_relative_to(user))
        packages = list((user / "extensions" / ".local").rglob("site-packages/vrtm/__init__.py"))
        self.assertEqual(len(packages), 1)
        self.assertIn(str(packages[0].parents[1]), sys.path)
        self.assertTrue([file for file in packages[0].parent.iterdir() if build().LIBRARY.search(file.name)])
