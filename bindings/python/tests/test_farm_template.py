"""The farm's templates in their schedulers' own programs: checked, run, killed and run again."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom

from bake_scenes import INSTALLED, files, processes, run, sheet_arguments, with_material
from conftest import until
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


def with_program(folder: Path, before: str = "") -> dict[str, str]:
    """The environment of tasks that find a program `vrtm`. `before`: lines of its script."""
    program = folder / "bin" / "vrtm"
    program.parent.mkdir()
    start = f'"{sys.executable}" -m vrtm.cli "$@"'
    lines = ["#!/bin/sh", f'export PYTHONPATH="{INSTALLED}"', f"vrtm() {{ {start}; }}", before, f"exec {start}"]
    program.write_text("\n".join(lines))
    program.chmod(0o755)
    return dict(os.environ) | {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}


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
        self.environment = with_program(folder)
        rule = {"source_path_format": "POSIX", "source_path": "/artist", "destination_path": str(folder)}
        self.rules = folder / "rules.json"
        self.rules.write_text(json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": [rule]}))

    def command(self, verb: str, out: Path, *more: str) -> list[str]:
        """A command line with all parameters of the job, by an artist who has the folder elsewhere than the farm."""
        values = {
            "Scene": f"/artist/scene/{self.scene.name}",
            "MapDir": "/artist/scene",
            "Rigidity": "rigid.<UDIM>.png",
            "OutDir": f"/artist/{out.name}",
            "Frames": f"1-{FRAMES}",
            "ChunkSize": 3,
            "Tiles": "1001-1002",
            "Options": OPTIONS,
            "CarryPrims": " ".join(CARRIED),
        }
        given = [word for name, value in values.items() for word in ("-p", f"{name}={value}")]
        return [self.openjd, verb, str(self.template), *given, *more]

    def start(self, out: Path) -> subprocess.Popen[str]:
        """Begins to run the job, in a process group of its own."""
        return subprocess.Popen(
            self.command("run", out, "--path-mapping-rules", f"file://{self.rules}"),
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
    commands = [farm.command("summary", tmp_path), [farm.openjd, "check", str(farm.template)]]
    assert "Layer" in farm.template.read_text() and "# begin" not in farm.template.read_text()
    for option, word in (("--no-layer", "redirect.usda"), ("", "carry")):
        short, path = run("farm-template", *filter(None, [option])).stdout, tmp_path / f"{word}.yaml"
        assert short == template(layer=not option) and word not in short
        path.write_text(short)
        commands.append([farm.openjd, "check", str(path)])
    for words in commands:
        ended = subprocess.run(words, capture_output=True, text=True, timeout=100)
        assert ended.returncode == 0, ended.stdout


def test_a_job_that_is_ended_twice_writes_what_a_local_run_does(farm: Farm, local: dict[str, bytes]) -> None:
    out, before = farm.folder / "out", 0
    for way in ("SIGTERM", "SIGKILL to all"):
        process = farm.start(out)
        # Until all files of a further frame are there, which the next run must leave alone.
        while process.poll() is None and whole((path.name for path in out.glob("*")), local) <= before:
            time.sleep(0.005)
        if way == "SIGTERM":
            process.terminate()
        else:
            # Also what is in sessions of its own: openjd starts each task in one.
            all_ = tree(process.pid)
            for found in all_:
                os.kill(found, signal.SIGKILL)
            until(lambda all_=all_: all(processes().get(found, "Z")[0] == "Z" for found in all_))
        told, _ = process.communicate(timeout=60)
        assert process.returncode != 0
        found = {name: content for name, content in files(out).items() if not name.startswith(".")}
        if way == "SIGTERM":
            assert "exited with code: 143" in told, told[-2000:]
            assert found == files(out)
        assert 0 < len(found) < len(local) and found.items() <= local.items()
        before = whole(found, local)
    ended = farm.start(out)
    told, _ = ended.communicate(timeout=280)
    assert ended.returncode == 0, told[-3000:]
    found = files(out)
    assert local.items() <= found.items()
    assert set(found) - set(local) == {f"carried.{frame:04d}.tif" for frame in range(1, FRAMES + 1)}
    assert "openjd_progress: 100.0" in told and "openjd_status: writing" in told and "files up to date" in told
    # Two chunks of two tiles, the layer, two chunks of what is carried, and its file.
    assert told.count("Running Task") == 8


def whole(there: Iterable[str], wanted: Iterable[str]) -> int:
    """The number of frames and tiles all of whose maps are there, by their names: jacobian.0001.1001.exr."""
    lacking = {name.split(".", 1)[1] for name in set(wanted).difference(there)}
    return len({name.split(".", 1)[1] for name in wanted if name.endswith(".exr")} - lacking)


def tree(root: int) -> list[int]:
    """A process and all that descend from it."""
    found, all_ = [root], processes()
    for process in found:
        found += [child for child, (_, parent, _) in all_.items() if parent == process]
    return found


SLURM = {
    "sbatch": """#!/bin/bash
# Runs a job at once, all tasks of an array in turn, and each again if it has asked for that.
for word; do case $word in --array=1-*) tasks=$(seq "${word#*1-}") ;; --*) ;; *) break ;; esac; shift; done
for task in ${tasks-last}; do
    for SLURM_RESTART_COUNT in 0 1 2 3; do
        rm -f again
        export SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=${task#last} SLURM_RESTART_COUNT
        bash "$@" >>log 2>&1
        echo "$task $?" >>codes
        [ -e again ] || break
    done
done
echo 7
""",
    "scontrol": """#!/bin/sh
# Slurm ends a job that is to begin again.
[ "$1 $2" != "requeue 7_3" ] || { touch again && kill $PPID; }
""",
}
"""Stand-ins for Slurm's own programs."""


def test_slurm_begins_a_killed_task_again(tmp_path: Path) -> None:
    folder = tmp_path / 'a "job\'s" $folder'
    scene = with_material(folder / "scene", frames=2)

    def given(out: Path) -> list[str]:
        more = ("--layer", out / "redirect.usda", "--max-strain", 1e-6)
        return [*map(str, sheet_arguments(scene, out, *more))]

    (folder / "job.sh").write_text(run("farm-template", "--slurm").stdout)
    # The second of two frames, in the middle.
    killed = '*--task=3/3) mkdir killed 2>/dev/null && { vrtm "$@" --tiles=1001; kill -KILL $$; } ;;'
    environment = with_program(folder, f'case "$*" in {killed} esac')
    for name, text in SLURM.items():
        (folder / "bin" / name).write_text(text)
        (folder / "bin" / name).chmod(0o755)

    def submit(*words: object) -> subprocess.CompletedProcess[str]:
        command = ["bash", "job.sh", *map(str, words)]
        return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=280)

    assert submit("three", *given(folder / "out")[1:]).returncode == 2 and submit(3).returncode == 2
    submitted, told = submit(3, *given(folder / "out")[1:]), (folder / "log").read_text()
    assert submitted.stdout == "job 7: 3 tasks, job 7: the files of all frames\n", submitted.stderr
    # The last job ends so since strain is left, and tasks do not.
    codes = (folder / "codes").read_text().splitlines()
    assert codes == ["1 0", "2 0", "3 143", "3 0", "last 3"], told
    assert "--task 1/3: no frame is left for it" in told and (folder / "killed").exists()
    run(*given(tmp_path / "local"), expect=3)
    assert files(folder / "out") == files(tmp_path / "local")
