"""The farm's template in OpenJobDescription's own programs: checked, run, killed and run again."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom

from bake_scenes import INSTALLED, files, processes, run, sheet_arguments, with_material
from vrtm.farm import template

FRAMES = 4
OPTIONS = "--size 128 --jacobian"
CARRIED = "/model/dots", "/model/more"


@pytest.fixture(scope="module")
def openjd() -> str:
    """The program; skips the test where it is not installed."""
    beside = Path(sys.executable).parent / "openjd"
    found = str(beside) if beside.exists() else shutil.which("openjd")
    if not found:
        assert not os.environ.get("VRTM_REQUIRE_OPENJD"), "openjd is missing"
        pytest.skip("skipped: no openjd")
    return found


class Farm:
    """A folder with a scene, a template, and a program `vrtm` to be found by the farm's tasks."""

    def __init__(self, openjd: str, folder: Path) -> None:
        self.openjd, self.folder = openjd, folder
        self.scene = with_material(folder / "scene", frames=FRAMES, cells=8)
        stage = Usd.Stage.Open(str(self.scene))
        for path in CARRIED:
            UsdGeom.Points.Define(stage, path).CreatePointsAttr([(0.3, 0.4, 0)])
        stage.Save()
        self.template = folder / "job.yaml"
        self.template.write_text(run("farm-template", "--carry").stdout)
        program = folder / "bin" / "vrtm"
        program.parent.mkdir()
        program.write_text(f'#!/bin/sh\nPYTHONPATH="{INSTALLED}" exec "{sys.executable}" -m vrtm.cli "$@"\n')
        program.chmod(0o755)
        self.environment = dict(os.environ) | {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}

    def command(self, verb: str, out: Path, *more: str) -> list[str]:
        """A command line with all parameters of the job."""
        values = {
            "Scene": self.scene,
            "MapDir": self.scene.parent,
            "Rigidity": "rigid.<UDIM>.png",
            "OutDir": out,
            "Frames": f"1-{FRAMES}",
            "ChunkSize": 3,
            "Tiles": "1001-1002",
            "Options": OPTIONS,
            "CarryPrims": " ".join(CARRIED),
        }
        given = [word for name, value in values.items() for word in ("-p", f"{name}={value}")]
        return [self.openjd, verb, str(self.template), *given, *more]

    def start(self, out: Path, *more: str) -> subprocess.Popen[str]:
        """Begins to run the job, in a process group of its own."""
        return subprocess.Popen(
            self.command("run", out, *more),
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )


@pytest.fixture(scope="module")
def farm(openjd: str, tmp_path_factory: pytest.TempPathFactory) -> Farm:
    return Farm(openjd, tmp_path_factory.mktemp("farm"))


@pytest.fixture(scope="module")
def local(farm: Farm, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Files of a run without a farm."""
    out = tmp_path_factory.mktemp("local")
    more = ("--layer", out / "redirect.usda", "--carry-prims", *CARRIED)
    run(*sheet_arguments(farm.scene, out, "--form", "udim", *OPTIONS.split(), *more))
    return files(out)


def test_the_template_is_valid(farm: Farm, tmp_path: Path) -> None:
    for words in (farm.command("summary", tmp_path), [farm.openjd, "check", str(farm.template)]):
        ended = subprocess.run(words, capture_output=True, text=True, timeout=100)
        assert ended.returncode == 0, ended.stdout
    assert "Layer" in farm.template.read_text() and "# begin" not in farm.template.read_text()
    for option, word in (("--no-layer", "redirect.usda"), ("", "carry")):
        short = run("farm-template", *filter(None, [option])).stdout
        assert short == template(layer=not option) and word not in short
        (tmp_path / "short.yaml").write_text(short)
        ended = subprocess.run([farm.openjd, "check", str(tmp_path / "short.yaml")], capture_output=True, text=True)
        assert ended.returncode == 0, ended.stdout


def test_a_job_that_is_ended_twice_writes_what_a_local_run_does(
    farm: Farm, local: dict[str, bytes], tmp_path: Path
) -> None:
    out, whole = tmp_path / "out", 0
    for way in ("SIGTERM", "SIGKILL to all"):
        process = farm.start(out)
        # Until all files of a further frame are there, which the next run must leave alone.
        while process.poll() is None and sum(names <= listed(out) for names in by_frame(local)) <= whole:
            time.sleep(0.005)
        if way == "SIGTERM":
            process.terminate()
        else:
            # Also what is in sessions of its own: openjd starts each task in one.
            all_ = tree(process.pid)
            for found in all_:
                os.kill(found, signal.SIGKILL)
            while any(processes().get(found, "Z")[0] != "Z" for found in all_):
                time.sleep(0.005)
        told, _ = process.communicate(timeout=60)
        assert process.returncode != 0
        found = {name: content for name, content in files(out).items() if not name.startswith(".")}
        if way == "SIGTERM":
            assert "exited with code: 143" in told, told[-2000:]
            assert found == files(out)
        assert 0 < len(found) < len(local) and found.items() <= local.items()
        whole = sum(names <= set(found) for names in by_frame(local))
    ended = farm.start(out)
    told, _ = ended.communicate(timeout=280)
    assert ended.returncode == 0, told[-3000:]
    found = files(out)
    assert local.items() <= found.items()
    assert set(found) - set(local) == {f"carried.{frame:04d}.tif" for frame in range(1, FRAMES + 1)}
    assert "openjd_progress: 100.0" in told and "openjd_status: writing" in told and "files up to date" in told
    # Two chunks of two tiles, the layer, two chunks of what is carried, and its file.
    assert told.count("Running Task") == 8


def listed(folder: Path) -> set[str]:
    return set(os.listdir(folder)) if folder.is_dir() else set()


def by_frame(names: Iterable[str]) -> list[set[str]]:
    """The maps of each frame and tile, by their names: jacobian.0001.1001.exr."""
    groups: dict[str, set[str]] = defaultdict(set)
    for name in names:
        if name.endswith(".exr"):
            groups[name.split(".", 1)[1]].add(name)
    return list(groups.values())


def tree(root: int) -> list[int]:
    """A process and all that descend from it."""
    found, all_ = [root], processes()
    for process in found:
        found += [child for child, (_, parent, _) in all_.items() if parent == process]
    return found


def test_paths_are_mapped(farm: Farm, local: dict[str, bytes], tmp_path: Path) -> None:
    """The farm mounts the files elsewhere than the artist does."""
    rule = {"source_path_format": "POSIX", "source_path": "/artist", "destination_path": str(tmp_path / "there")}
    rules = tmp_path / "rules.json"
    rules.write_text(json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": [rule]}))
    shutil.copytree(farm.scene.parent, tmp_path / "there" / "scene")
    command = farm.command("run", Path("/artist/out"), "--path-mapping-rules", f"file://{rules}")
    command = [word.replace(str(farm.scene.parent), "/artist/scene") for word in command]
    # One chunk of them will do.
    command[command.index(f"Frames=1-{FRAMES}")] = "Frames=1-2"
    ended = subprocess.run(command, env=farm.environment, capture_output=True, text=True, timeout=280)
    assert ended.returncode == 0, ended.stdout[-3000:]
    maps = {name: content for name, content in files(tmp_path / "there" / "out").items() if name.endswith(".exr")}
    assert len(maps) == 2 * 2 * 2 and maps.items() <= local.items()
