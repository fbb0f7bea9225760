"""Builds the shared library with cargo and takes it into the wheel, with what generate.py makes of the header.

Variables:
    VRTM_LIBRARY          a library that is built already: cargo is not called. One for another system than this
                          machine's makes a wheel for that system.
    VRTM_CARGO_PROFILE    cargo's profile: "dist" (the default), or "release", which builds in less time and costs some
                          milliseconds per frame of a GPU
    VRTM_GPU              "OFF" leaves the GPU backend out, which builds in seconds
    VRTM_WHEEL_PLATFORM   the wheel's platform tag, such as manylinux_2_35_x86_64, for those who publish wheels
    VRTM_REPOSITORY       the repository's address, for the links of the wheel's description: without it they are text
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10, where hatchling brings the same from outside.
    import tomli as tomllib

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parents[1]


class MetadataHook(MetadataHookInterface):
    """The package has the library's version and licences, and a description whose links are absolute."""

    def update(self, metadata: dict[str, Any]) -> None:
        with _project_file("Cargo.toml").open("rb") as file:
            version = tomllib.load(file)["workspace"]["package"]["version"]
        sys.path.insert(0, str(_project_file("bindings/links.py").parent))
        from links import absolute

        # A wheel names its licences by their places in this folder.
        for licence in ("LICENSE-MIT", "LICENSE-APACHE", "bindings/THIRD-PARTY.txt"):
            shutil.copyfile(_project_file(licence), HERE / Path(licence).name)
        metadata["version"] = version
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(HERE / "README.md", version)}
        repository = os.environ.get("VRTM_REPOSITORY")
        if repository:
            metadata["urls"] = {"Repository": repository, "Changelog": f"{repository}/blob/v{version}/CHANGELOG.md"}


class BuildHook(BuildHookInterface):
    """Puts the library and the generated modules into a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel":
            raise SystemExit(
                "vrtm: the Rust sources lie outside of this folder: build a wheel (pip wheel, build --wheel)"
            )
        sys.path.insert(0, str(HERE))
        from generate import generate
        from platforms import file_name, tag_for

        package = HERE / "src" / "vrtm"
        generate(_project_file("include/vrtm.h"), package)
        prebuilt = os.environ.get("VRTM_LIBRARY")
        library = Path(prebuilt).resolve() if prebuilt else _cargo()
        if not library.is_file():
            raise SystemExit(f"vrtm: VRTM_LIBRARY: {library} is not there")
        here = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        wanted = os.environ.get("VRTM_WHEEL_PLATFORM", "").replace("-", "_")
        tag = tag_for(library, wanted, here)
        file = file_name(tag)
        if version == "editable":
            # An editable install runs from the sources.
            shutil.copy2(library, package / file)
        else:
            build_data["force_include"][str(library)] = f"vrtm/{file}"
        # It is for any Python 3, since ctypes calls the library, and for one platform.
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag}"


def _project_file(name: str) -> Path:
    path = PROJECT / name
    if not path.is_file():
        raise SystemExit(f"vrtm: {path} is not there: this package is built inside of vrtm's repository")
    return path


def _cargo() -> Path:
    """Builds the library; returns its path."""
    path = os.environ.get("PATH", "") + os.pathsep + str(Path.home() / ".cargo" / "bin")
    cargo = shutil.which("cargo", path=path)
    if cargo is None:
        raise SystemExit(
            "vrtm: cargo is not there: install Rust 1.89 or newer (https://rustup.rs), or name a library that is built "
            "already in the variable VRTM_LIBRARY"
        )
    command = [cargo, "build", "--package", "vrtm-c", "--message-format", "json-render-diagnostics"]
    profile = os.environ.get("VRTM_CARGO_PROFILE", "dist")
    command += ["--profile", profile, "--manifest-path", str(PROJECT / "Cargo.toml")]
    if os.environ.get("VRTM_GPU") == "OFF":
        command.append("--no-default-features")
    # The library holds the paths of its sources, for messages: those of this machine have no place in it.
    home = os.environ.get("CARGO_HOME") or Path.home() / ".cargo"
    remap = [f"--remap-path-prefix={PROJECT}=/vrtm", f"--remap-path-prefix={home}=/cargo"]
    command += ["--config", f"target.'cfg(all())'.rustflags={json.dumps(remap)}"]
    result = subprocess.run(command, stdout=subprocess.PIPE, check=False)
    if result.returncode != 0:
        raise SystemExit("vrtm: cargo could not build the library; its messages stand above")
    for line in result.stdout.splitlines():
        message = json.loads(line)
        if message.get("reason") == "compiler-artifact" and message["target"]["name"] == "vrtm":
            for file in message["filenames"]:
                if Path(file).suffix in (".so", ".dylib", ".dll"):
                    return Path(file)
    raise SystemExit("vrtm: cargo built no shared library")
