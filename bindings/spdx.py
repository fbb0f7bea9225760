#!/usr/bin/env python3
"""Prints what is in the files of a release, as SPDX 2.3 in JSON. bindings/release.sh runs it.

    python3 bindings/spdx.py --system TRIPLE [--no-default-features] [--features LIST] FILE...
    python3 bindings/spdx.py --system web FILE...

FILEs are those of one system, which all hold the same library; of "web" the npm package and the page, which hold
WebAssembly, and the page also three.js. The variable SOURCE_DATE_EPOCH is the document's time.
"""

import argparse
import datetime
import hashlib
import json
import os
import re
import subprocess
from pathlib import Path

import tomllib
from notices import ROOT, linked

LICENCE = "MIT OR Apache-2.0"
ABSENT = "NOASSERTION"


def package(name, version, licence, *, purl=None, **more):
    entry = {
        "SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", f"{name}-{version}"),
        "name": name,
        "versionInfo": version,
        "downloadLocation": ABSENT,
        "filesAnalyzed": False,
        "licenseConcluded": ABSENT,
        # Old manifests have a slash for "or".
        "licenseDeclared": re.sub(r"\s*/\s*", " OR ", licence),
        "copyrightText": ABSENT,
        **more,
    }
    if purl:
        reference = {"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": purl}
        entry["externalRefs"] = [reference]
    return entry


def crates(system, options):
    """The library's parts: cargo's packages, and Rust's standard library."""
    web = system == "web"
    chosen = ("vrtm-web",) if web else ("vrtm-c",)
    for one in linked(chosen, "wasm32-unknown-unknown" if web else system, options):
        name, version = one["name"], one["version"]
        homepage = {"homepage": one["repository"]} if one["repository"] else {}
        yield package(name, version, one["license"], purl=f"pkg:cargo/{name}@{version}", **homepage)
    release = re.search(r"^release: (\S+)", subprocess.check_output(["rustc", "-vV"], text=True), re.M)[1]
    yield package("rust-std", release, LICENCE, homepage="https://github.com/rust-lang/rust")


def document(system, options, files):
    version = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["package"]["version"]
    library = package("vrtm", version, LICENCE)
    packages, links = [library], []

    def link(one, kind, other):
        links.append({"spdxElementId": one, "relationshipType": kind, "relatedSpdxElement": other})

    for part in crates(system, options):
        packages.append(part)
        link(library["SPDXID"], "STATIC_LINK", part["SPDXID"])
    sums = []
    for file in files:
        sums.append(hashlib.sha256(file.read_bytes()).hexdigest())
        checksums = [{"algorithm": "SHA256", "checksumValue": sums[-1]}]
        artefact = package(file.name, version, LICENCE, packageFileName=file.name, checksums=checksums)
        packages.append(artefact)
        link("SPDXRef-DOCUMENT", "DESCRIBES", artefact["SPDXID"])
        link(artefact["SPDXID"], "CONTAINS", library["SPDXID"])
        if file.name.startswith("vrtm-page"):
            lock = json.loads((ROOT / "bindings/web/package-lock.json").read_text("utf-8"))
            three = lock["packages"]["node_modules/three"]
            version_of_three = three["version"]
            packages.append(
                package("three", version_of_three, three["license"], purl=f"pkg:npm/three@{version_of_three}")
            )
            link(artefact["SPDXID"], "CONTAINS", packages[-1]["SPDXID"])
    name = f"vrtm-{version}-{system}"
    time = datetime.datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), datetime.timezone.utc)
    return {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": name,
        "documentNamespace": f"https://spdx.org/spdxdocs/{name}-{hashlib.sha256(''.join(sums).encode()).hexdigest()}",
        "creationInfo": {"created": time.strftime("%Y-%m-%dT%H:%M:%SZ"), "creators": ["Tool: vrtm-spdx"]},
        "packages": packages,
        "relationships": links,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--system", required=True)
    parser.add_argument("--no-default-features", action="store_true")
    parser.add_argument("--features")
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    arguments = parser.parse_args()
    options = ["--no-default-features"] if arguments.no_default_features else []
    options += ["--features", arguments.features] if arguments.features else []
    print(json.dumps(document(arguments.system, options, arguments.files), indent=1))


if __name__ == "__main__":
    main()
