"""The shaders of docs/games.md compile, and the page's options are those of the command."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from bake_scenes import run
from conftest import REPOSITORY

PAGE = REPOSITORY / "docs" / "games.md"
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


@pytest.mark.parametrize(
    ("language", "program", "options"),
    [("glsl", GLSL, []), ("hlsl", HLSL, ["-D", "-V", "-e", "main", "--aml", "--amb"])],
)
def test_shaders_compile(tmp_path: Path, language: str, program: str, options: list[str]) -> None:
    compiler = shutil.which("glslangValidator")
    if compiler is None:
        pytest.skip("skipped: no glslangValidator")
    codes = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(codes) == 2, "of 16-bit floats, and of integers"
    file = tmp_path / "shader.frag"
    if options:
        options = [*options, "-o", str(tmp_path / "shader.spv")]
    for code in codes:
        file.write_text(program.format(code=code))
        ended = subprocess.run([compiler, *options, str(file)], capture_output=True, text=True)
        assert ended.returncode == 0, ended.stdout + ended.stderr


def test_its_options_are_there() -> None:
    told = run("bake", "--help-all").stdout
    for option in set(re.findall(r"--[a-z][a-z-]+", PAGE.read_text())):
        assert option in told, option
