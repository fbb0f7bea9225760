"""pytest benches/gpu_model: what the model reads from kernels and from assembly. It needs no compiler."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from gpu_model import solve, warp, wgsl
from gpu_model.expressions import Failure, evaluate, runs

ENTRY = (
    "const WINDOW: u32 = 324u;\n@compute @workgroup_size(64)\nfn k(@builtin(local_invocation_index) t: u32) {\n%s}\n"
)


def marks(body, **names):
    places, found = wgsl.marked(ENTRY % body, "k", {"": names})
    return [(mark.kind, mark.counts[0] if mark.counts else None, mark.warps) for mark in found], places


def test_counts_from_the_text():
    assert evaluate("select(1u, 2u, params.mode == 3u) * 0x10u", {"params.mode": 3}) == 32
    assert runs("for (var k = t; k < 324u; k += 64u)", {"t": 0})[0] == 6
    assert runs("for (var half = 128u; half > 0u; half /= 2u)", {})[0] == 8
    body = "let lane = t % 8u;\nfor (var k = lane; k < WINDOW; k += 64u) {\n}\nif params.pull > 0.0 {\nf();\n}\n"
    assert marks(body, **{"params.pull": 0.0})[0] == [
        ("loop", 6, 1),
        ("region", 0, 1),
        ("end", 2 - 1, 1),
    ]


def test_counts_from_comments():
    body = "while x < y { // model: 3 times\nif far { // model: 0.5 times, else 2 times\nf();\n} else {\ng();\n}\n}\n"
    assert [mark[:2] for mark in marks(body)[0] if mark[0] != "end"] == [
        ("loop", 3),
        ("region", 0.5),
        ("region", 2),
    ]
    assert marks("if a { // model: 1 times in 1 of 4 warps\nf();\n}\n")[0][0] == (
        "region",
        1,
        4,
    )


def test_what_follows_a_return_is_left_out():
    found, _ = marks("if params.once {\nreturn;\n}\nf();\n", **{"params.once": True})
    assert found[0] == ("region", 0, 1)


@pytest.mark.parametrize(
    "body",
    [
        "while x < y {\n}\n",
        "for (var k = 0u; k < n; k++) {\n}\n",
        "f(); // model: often\n",
    ],
)
def test_an_unknown_count_is_an_error(body):
    with pytest.raises(Failure):
        marks(body)


def loop(mark, times=1, inside=""):
    body = "".join(
        f"\tv_mov_b32_e32 v1, {wgsl.MAGIC + mark:#x}\n\tv_mov_b32_e32 v2, 0\n\tds_write_b32 v2, v1\n"
        for _ in range(times)
    )
    return f"BB1:\n{body}\tv_add_f32_e32 v3, v3, v4\n{inside}\ts_cbranch_scc1 BB1\n"


def test_loops_are_found_by_their_marks():
    known = [wgsl.Mark("loop", "for", [12], 1)]
    for copies, instructions in ((1, 24), (3, 8)):
        one = warp.Warp(
            warp.parts("BB0:\n" + loop(0, copies) + "BB2:\n\ts_endpgm\n", known),
            known,
            0,
        )
        assert one.instructions == instructions
    with pytest.raises(Failure):
        warp.parts("BB0:\nBB1:\n\ts_cbranch_scc1 BB1\n", known)
    with pytest.raises(Failure, match="around"):
        warp.parts("BB0:\n" + loop(0, 12), known)


def test_a_warp_waits_for_what_it_reads():
    code = "BB0:\n\tbuffer_load_dword v1, v0, s[0:3], 0 offen\n\tv_add_f32_e32 v2, v1, v1\n"
    far = warp.Warp(warp.parts(code, []), [], 0).cycles
    assert far == warp.LATENCY["far"] + warp.SLOTS["alu"]


def test_levels_follow_from_sizes():
    counts = {256: {"k": (4, 8)}, 512: {"k": (8, 264)}}
    assert solve.rungs("k", 512, counts) == [(4, 64), (4, 2)]


def test_counts_of_solves_are_read():
    text = (
        "| bulge | 512² | 239121 | 186 | 205 | 390 | 2 | 295 |\n"
        "\n## bulge at 512², kernel by kernel, strain 0.0040\n\n| relax (sampling/metrics, patch, relax) | 5 | 9 | 1.0 |\n"
        "\n## bulge at 512², `pbd 16`: 700 dispatches, 0 empty ones, 650 barriers\n\n| project (pbd/state, x) | 8 | 64 | 1.0 |\n"
    )
    counts = solve.counted(text)
    assert counts.kernels["normal"] == {512: {"relax (sampling/metrics": (5, 9)}}
    assert counts.kernels["pbd 16"] == {512: {"project (pbd/state": (8, 64)}}
    assert counts.all["normal"] == {512: [186, 205, 390]} and counts.all["pbd 16"] == {512: [700, 0, 650]}
    assert counts.strain["normal"] == {512: "0.0040"} and counts.strain["pbd 16"] == {512: "-"}
