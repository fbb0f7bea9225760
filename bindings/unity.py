#!/usr/bin/env python3
"""Packs the bindings for C# and the component for Unity as a package for Unity, with a library for each system.

    python3 bindings/unity.py --out FOLDER TRIPLE=LIBRARY...

Unity installs it by Window > Package Manager > + > Install package from tarball. Prints the file's path. The variable
SOURCE_DATE_EPOCH is the time of its files. bindings/release.sh runs it.
"""

import argparse
import gzip
import hashlib
import io
import json
import os
import re
import string
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path, PurePosixPath

from links import ROOT, absolute

HERE = ROOT / "bindings/csharp"
# The folder of a system's library, its file, and Unity's names of the editor, the player and the processor.
SYSTEMS = {
    "x86_64-unknown-linux-gnu": ("linux-x64", "libvrtm.so", "Linux", "Linux64", "x86_64"),
    "x86_64-pc-windows-gnu": ("windows-x64", "vrtm.dll", "Windows", "Win64", "x86_64"),
    "x86_64-pc-windows-msvc": ("windows-x64", "vrtm.dll", "Windows", "Win64", "x86_64"),
    "x86_64-apple-darwin": ("macos-x64", "libvrtm.dylib", "OSX", "OSXUniversal", "x86_64"),
    "aarch64-apple-darwin": ("macos-arm64", "libvrtm.dylib", "OSX", "OSXUniversal", "ARM64"),
}


def contents(version, libraries):
    """Yields paths with their bytes, and what a library's meta file says of it."""
    about = json.loads((HERE / "unity/package.json").read_text("utf-8"))
    yield "package.json", json.dumps({"name": about.pop("name"), "version": version, **about}, indent=2).encode(), ""
    yield "README.md", absolute(HERE / "README.md", version).encode(), ""
    yield "CHANGELOG.md", absolute(ROOT / "CHANGELOG.md", version).encode(), ""
    for name, file in (
        ("LICENSE.md", "LICENSE"),
        ("LICENSE-MIT", "LICENSE-MIT"),
        ("LICENSE-APACHE", "LICENSE-APACHE"),
        ("Third Party Notices.md", "bindings/THIRD-PARTY.txt"),
        ("Runtime/Vrtm.asmdef", "bindings/csharp/unity/Vrtm.asmdef"),
        ("Runtime/Asset.cs", "bindings/csharp/Asset.cs"),
        ("Runtime/VrtmSkin.cs", "examples/hosts/unity/VrtmSkin.cs"),
    ):
        yield name, (ROOT / file).read_bytes(), ""
    with tempfile.TemporaryDirectory() as folder:
        generated = Path(folder, "Vrtm.cs")
        subprocess.run([sys.executable, str(HERE / "generate.py"), str(generated)], check=True)
        yield "Runtime/Vrtm.cs", generated.read_bytes(), ""
    meta = string.Template((HERE / "unity/library.meta").read_text("utf-8"))
    for (place, name, editor, player, cpu), library in libraries:
        settings = meta.substitute(editor=editor, player=player, cpu=cpu)
        yield f"Plugins/{place}/{name}", library.read_bytes(), settings


def with_meta(files):
    """Adds the meta file of each file and folder, without which Unity ignores it in an installed package. Scenes name
    assets by their guid, which follows from the path and so stays in later versions."""
    found = {}
    for path, data, settings in files:
        found[path] = data
        for one in (path, *(str(parent) for parent in PurePosixPath(path).parents if parent.name)):
            guid = hashlib.blake2b(f"com.vrtm.unity/{one}".encode(), digest_size=16).hexdigest()
            rest = settings if one == path else "folderAsset: yes\n"
            found[f"{one}.meta"] = f"fileFormatVersion: 2\nguid: {guid}\n{rest}".encode()
    return sorted(found.items())


def packed(files):
    """Bytes of an archive as npm makes them, the same each time."""
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for path, data in files:
            member = tarfile.TarInfo(f"package/{path}")
            member.size, member.mode = len(data), 0o644
            member.mtime = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
            tar.addfile(member, io.BytesIO(data))
    return gzip.compress(archive.getvalue(), mtime=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("libraries", nargs="+", metavar="TRIPLE=LIBRARY")
    arguments = parser.parse_args()
    libraries = []
    for triple, _, library in (given.partition("=") for given in arguments.libraries):
        if triple not in SYSTEMS or not Path(library).is_file():
            parser.error(f"{triple}={library}: not a file, or for none of {', '.join(SYSTEMS)}")
        libraries.append((SYSTEMS[triple], Path(library)))
    version = re.search(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text("utf-8"), re.M)[1]
    places = "-".join(sorted({system[0] for system, _ in libraries}))
    file = arguments.out / f"vrtm-{version}-unity-{places}.tgz"
    arguments.out.mkdir(parents=True, exist_ok=True)
    file.write_bytes(packed(with_meta(contents(version, libraries))))
    print(file)


if __name__ == "__main__":
    main()
