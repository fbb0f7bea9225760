#!/usr/bin/env python3
"""Writes bindings/THIRD-PARTY.txt: the licences of all packages that the library may be linked with, on any system, and
of those in the npm package. Archives, wheels, installs and packages carry the file.

    python3 bindings/notices.py            write it
    python3 bindings/notices.py --check    fail if it is out of date
"""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "bindings/THIRD-PARTY.txt"
PACKAGES = ("vrtm-c", "vrtm-web")
HEAD = """\
vrtm's library holds code of the packages below, of those that its system and its features ask for, and of Rust's
standard library, which is licensed under MIT or Apache-2.0 (https://github.com/rust-lang/rust). Each package is listed
with its licence and its origin; the texts of the licences, which many have in common, follow.
"""
NAMES = ("LICENSE", "LICENCE", "COPYING", "NOTICE", "COPYRIGHT")


def cargo(*arguments):
    return subprocess.run(
        ["cargo", *arguments, "--locked", "--manifest-path", ROOT / "Cargo.toml"],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout


def linked(packages=PACKAGES, target="all", options=()):
    """Cargo's metadata of the packages that are linked into `packages`, in the order of their names and versions."""
    chosen = [part for package in packages for part in ("--package", package)]
    text = cargo("tree", *chosen, "--edges", "normal,no-proc-macro", "--target", target, "--prefix", "none", *options)
    pairs = {tuple(line.split()[:2]) for line in text.splitlines() if line.strip()}
    known = {
        (package["name"], package["version"]): package
        for package in json.loads(cargo("metadata", "--format-version", "1"))["packages"]
    }
    names = sorted((name, version.removeprefix("v")) for name, version in pairs if not name.startswith("vrtm"))
    return [known[pair] for pair in names]


def notices():
    listed, texts = [], {}
    for package in linked():
        name, version = package["name"], package["version"]
        listed.append(f"{name} {version}: {package['license']}, {package['repository'] or 'no address'}")
        folder = Path(package["manifest_path"]).parent
        files = sorted(file for file in folder.iterdir() if file.is_file() and file.name.upper().startswith(NAMES))
        for file in files:
            text = "\n".join(line.rstrip() for line in file.read_text("utf-8", "replace").splitlines()).strip("\n")
            texts.setdefault(text, []).append(f"{name} {version}")
        if not files:
            listed[-1] += " (a package without a file of its licence)"
    parts = [HEAD, "\n".join(listed) + "\n"]
    for text, owners in sorted(texts.items(), key=lambda pair: (-len(pair[1]), pair[1], pair[0])):
        parts.append(f"{'=' * 100}\n{', '.join(owners)}\n\n{text}\n")
    return "\n".join(parts)


def main():
    text = notices()
    if "--check" not in sys.argv[1:]:
        FILE.write_text(text, "utf-8")
    elif FILE.read_text("utf-8") != text:
        sys.exit("bindings/THIRD-PARTY.txt is out of date: python3 bindings/notices.py writes it")


if __name__ == "__main__":
    main()
