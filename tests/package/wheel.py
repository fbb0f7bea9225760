"""Looks at what is in a release's wheel, in its add-on for Blender, in its package for Unity and in its list of what is
in them; then a program for its system, where need be in an emulator, loads the library of the wheel as Python does.
With --use the wheel is for this machine: it is installed to an empty folder, and a Python that has nothing but numpy
solves with it.

    python wheel.py --release FOLDER --tag win_amd64 --platform windows-x64 --out FOLDER --program LOADS --version V
        --triple TRIPLE [--run EMULATOR] [--use]

LOADS is loads.c, compiled; the tag is a regular expression.
"""

import argparse
import hashlib
import io
import json
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import tomllib

SOLVE = """
import numpy as np
import vrtm

rest = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]], float)
faces = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
pose = rest.copy()
pose[[1, 4], 0] = 1.3
painted = np.zeros((64, 64), np.uint8)
painted[24:40, 8:24] = 255
with vrtm.Device("cpu") as device:
    asset = vrtm.Asset(device, rest, faces, uvs=rest[:, :2] / (2, 1), uv_indices=faces)
    tile = asset.tile(1001)
    tile.set_rigidity(painted)
    [redirection] = asset.redirect(pose, [tile])
    assert np.abs(redirection[32, 16, 0] - 16.5 / 64) > 0.01, redirection[32, 16]
print("solved by", vrtm.__file__)
"""


def check_wheel(wheel: zipfile.ZipFile, arguments: argparse.Namespace) -> bytes:
    """Returns the library that is in it."""
    names = wheel.namelist()
    ours = "vrtm/vrtm.dll" if arguments.tag.startswith("win") else "vrtm/libvrtm.so"
    libraries = [name for name in names if Path(name).suffix in (".dll", ".so", ".dylib", ".pyd", ".a", ".lib")]
    assert libraries == [ours], libraries
    for name in ("vrtm/__init__.py", "vrtm/_abi.py", "vrtm/_records.py", "vrtm/py.typed"):
        assert name in names, name
    about = f"vrtm-{arguments.version}.dist-info"
    licences = [name.rpartition("/")[2] for name in names if name.startswith(f"{about}/licenses/")]
    assert sorted(licences) == ["LICENSE-APACHE", "LICENSE-MIT", "THIRD-PARTY.txt"], names
    assert b"glam" in wheel.read(f"{about}/licenses/THIRD-PARTY.txt")
    lines = wheel.read(f"{about}/WHEEL").decode().splitlines()
    assert any(re.fullmatch(f"Tag: py3-none-{arguments.tag}", line) for line in lines), lines
    assert "Root-Is-Purelib: false" in lines, lines
    metadata = wheel.read(f"{about}/METADATA").decode()
    # A registry shows the description away from its folder.
    assert "\n# vrtm for Python\n" in metadata and not re.search(r"\]\(\s*(?!\s|https:)", metadata), metadata
    needed = [line for line in metadata.splitlines() if line.startswith("Requires-Dist")]
    assert any(line.startswith("Requires-Dist: numpy") for line in needed), needed
    return wheel.read(ours)


def check_list(files: list[Path], arguments: argparse.Namespace) -> None:
    """Checks the SPDX file's entries for the other files, and for the library's parts."""
    text = (arguments.release / f"vrtm-{arguments.version}-{arguments.triple}.spdx.json").read_text()
    packages = {package["name"]: package for package in json.loads(text)["packages"]}
    for file in files:
        [checksum] = packages[file.name]["checksums"]
        assert checksum["checksumValue"] == hashlib.sha256(file.read_bytes()).hexdigest(), file
    for name in ("vrtm", "rust-std", "glam", "half", "fearless_simd", "xxhash-rust"):
        assert "Apache-2.0" in packages[name]["licenseDeclared"] or name == "xxhash-rust", packages[name]
    assert ("libc" in packages) == ("windows" not in arguments.triple), list(packages)
    assert "wgpu" not in packages and "objc2" not in packages, list(packages)


def use(wheel: Path, arguments: argparse.Namespace) -> None:
    folder = arguments.out / "installed"
    install = "-m pip install --quiet --disable-pip-version-check --no-deps --no-index --target".split()
    subprocess.run([sys.executable, *install, str(folder), str(wheel)], check=True)
    command = [sys.executable, "-c", f"import sys\nsys.path.insert(0, {str(folder)!r})\n{SOLVE}"]
    found = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert found.stdout == f"solved by {folder / 'vrtm' / '__init__.py'}\n", found.stdout + found.stderr


def main() -> None:
    parser = argparse.ArgumentParser()
    for name in ("release", "out", "program"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    for name in ("tag", "platform", "version", "triple"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--run", default="")
    parser.add_argument("--use", action="store_true")
    arguments = parser.parse_args()
    shutil.rmtree(arguments.out, ignore_errors=True)
    arguments.out.mkdir(parents=True)

    [wheel] = arguments.release.glob(f"vrtm-{arguments.version}-py3-none-*.whl")
    addon = arguments.release / f"vrtm-{arguments.version}-{arguments.platform.replace('-', '_')}.zip"
    packages = list(arguments.release.glob(f"vrtm-{arguments.version}-unity-{arguments.platform}.tgz"))
    assert len(packages) == (arguments.platform != "linux-arm64"), packages
    check_list([wheel, addon, *packages], arguments)
    with zipfile.ZipFile(wheel) as archive:
        library = check_wheel(archive, arguments)
        abi: dict = {}
        exec(archive.read("vrtm/_abi.py"), abi)
    with zipfile.ZipFile(addon) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert manifest["platforms"] == [arguments.platform], manifest["platforms"]
        assert manifest["wheels"] == [f"./wheels/{wheel.name}"], manifest["wheels"]
        with zipfile.ZipFile(io.BytesIO(archive.read(f"wheels/{wheel.name}"))) as inner:
            assert check_wheel(inner, arguments) == library
    for package in packages:
        with tarfile.open(package) as archive:
            plugins = [name for name in archive.getnames() if re.search(r"/Plugins/.*\.(dll|so|dylib)$", name)]
            assert [archive.extractfile(name).read() for name in plugins] == [library], plugins
            assert "package/Runtime/Vrtm.cs" in archive.getnames(), archive.getnames()
    path = arguments.out / ("vrtm.dll" if arguments.tag.startswith("win") else "libvrtm.so")
    path.write_bytes(library)
    run = [arguments.run] if arguments.run else []
    # Wine has this system's files in the drive Z.
    seen = "Z:" + str(path).replace("/", "\\") if run and arguments.tag.startswith("win") else str(path)
    found = subprocess.run(
        [*run, str(arguments.program), seen], input="\n".join(abi["functions"]), capture_output=True, text=True
    )
    assert found.returncode == 0, found.stdout + found.stderr
    print(found.stdout.strip())
    major, minor, patch = (int(part) for part in arguments.version.split("."))
    version = 1_000_000 * major + 1000 * minor + patch
    assert found.stdout.split() == [str(len(abi["functions"])), "functions,", "version", str(version)], found.stdout
    if arguments.use:
        use(wheel, arguments)


if __name__ == "__main__":
    main()
