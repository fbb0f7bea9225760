"""The examples in the documents run as they stand there, and the shaders of docs/games.md compile."""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Usd

from bake_scenes import run
from conftest import REPOSITORY

README = REPOSITORY / "bindings" / "python" / "README.md"
GAMES = REPOSITORY / "docs" / "games.md"
GLSL = """#version 330
#define COUNT 8
{code}
uniform sampler2D albedo;
in vec2 uv;
out vec4 colour;
void main() {{
    vec2 at = redirected(uv);
    colour = textureGrad(albedo, at, dFdx(at), dFdy(at));
}}
"""
HLSL = """#define COUNT 8
{code}
Texture2D<float4> albedo;
float4 main(float2 uv : TEXCOORD0) : SV_Target {{
    float2 at = redirected(uv);
    return albedo.SampleGrad(linear_clamp, at, ddx(at), ddy(at));
}}
"""


def test_examples(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)
    assert len(blocks) == 2
    names: dict = {}
    for block in blocks:
        exec(compile(block, str(README), "exec"), names)
    # The squashed feature is looked up elsewhere than at its own UV, and the map does not fold.
    (u, _v), jacobian = names["redirection"][32, 16], float(capsys.readouterr().out.split()[-1])
    assert abs(u - 16.5 / 64) > 0.005 and jacobian > 0
    assert names["report"].tiles == 1


def test_the_front_page():
    """The few lines in the README of the repository, with the arrays of the package's own README."""
    [block] = re.findall(r"```python\n(.*?)```", (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.S)
    arrays, _, _ = README.read_text(encoding="utf-8").partition("with vrtm.Device()")
    names: dict = {}
    exec(compile(arrays.rpartition("```python\n")[2], str(README), "exec"), names)
    names["uvs"] = names["rest"][:, :2] / (2, 1)
    exec(compile(block, str(REPOSITORY / "README.md"), "exec"), names)
    cells, _ = names["tile"].grid
    assert names["redirection"].shape == (cells, cells, 2)


def test_the_bake_to_try(tmp_path, monkeypatch):
    """The lines of docs/bake.md for those without a scene: the second of them, given again, writes nothing."""
    text = (REPOSITORY / "docs" / "bake.md").read_text(encoding="utf-8").replace("\\\n", " ")
    made, baked = (
        next(shlex.split(line, comments=True) for line in text.splitlines() if line.startswith(f"    {start}"))
        for start in ("python bindings/python/examples/scene.py", "vrtm bake shot/arm.usda")
    )
    # Two of its five frames will do, and a coarse grid.
    baked[baked.index("1-24x6,24")] = "1,24"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", made[1:])
    runpy.run_path(str(REPOSITORY / made[1]), run_name="__main__")
    told = [run(*baked[1:], "--size", 128).stdout for _ in range(2)]
    frames = (1, 24)
    names = [
        f"{kind}.{frame:04}.1001.{end}" for kind, end in (("colour", "png"), ("redirect", "exr")) for frame in frames
    ]
    assert sorted(os.listdir(tmp_path / "shot" / "maps")) == sorted(names)
    assert "4 files written" in told[0] and "0 files written, 4 up to date" in told[1]
    layer = Usd.Stage.Open(str(tmp_path / "shot" / "arm_vrtm.usda"))
    assert layer.GetEndTimeCode() == 24


@pytest.mark.parametrize(
    ("language", "program", "options"),
    [("glsl", GLSL, []), ("hlsl", HLSL, ["-D", "-V", "-e", "main", "--aml", "--amb"])],
)
def test_shaders_compile(tmp_path: Path, language: str, program: str, options: list[str]) -> None:
    compiler = shutil.which("glslangValidator")
    if compiler is None:
        pytest.skip("skipped: no glslangValidator")
    codes = re.findall(rf"```{language}\n(.*?)```", GAMES.read_text(), re.DOTALL)
    assert len(codes) == 2, "of 16-bit floats, and of integers"
    file = tmp_path / "shader.frag"
    if options:
        options = [*options, "-o", str(tmp_path / "shader.spv")]
    for code in codes:
        file.write_text(program.format(code=code))
        ended = subprocess.run([compiler, *options, str(file)], capture_output=True, text=True)
        assert ended.returncode == 0, ended.stdout + ended.stderr


def test_the_options_of_the_games_page_are_there() -> None:
    told = run("bake", "--help-all").stdout
    for option in set(re.findall(r"--[a-z][a-z-]+", GAMES.read_text())):
        assert option in told, option
