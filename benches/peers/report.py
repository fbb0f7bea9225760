"""The tables of benches/results/peers.md."""

from baselines import METHODS

NAMES = {"vrtm": "**vrtm, normal**", "pbd": "the paper's solver, in vrtm"}
COLUMNS = (
    "strain RMS",
    "95 % below",
    "largest",
    "worse",
    "over 0.05",
    "folds",
    "d2 RMS",
    "d2 99.9 %",
    "d2 largest",
    "s",
)
# What is compared with vrtm, and how it is written.
COMPARED = (
    ("rms", "RMS", ".4f"),
    ("p95", "95 %", ".4f"),
    ("max", "largest", ".2f"),
    ("worse", "features worse", "d"),
    ("over", "features over 0.05", "d"),
)

HEAD = """# Beside other methods

Strain inside rigid features on the deformed mesh, and how the texture moves over time, for vrtm and for the methods
that its paper compares with or names. [benches/peers](../peers/README.md) says how to run it; what each method
minimises, and what had to be assumed, stands [at the end](#the-methods).

- *Strain*: |l / L - 1| over all painted segments: root mean square, 95 % quantile, largest.
- *Worse*: features whose error rose by more than 0.02 against the original UVs. *Over 0.05*: features whose error is
  larger. A feature is a connected set of rigid nodes of a chart; its error is the RMS over its edges.
- *Folds*: for methods that give new UVs, triangles of the mesh that are flipped or flat; for those that warp a grid,
  such triangles of the warp on the table's grid, two per cell.
- *d2*: how unsteadily the texture moves, {motion}.
  At 4,000 points fixed on the surface, the same for all methods: the second difference over frames of the texture's
  point that shows there, in cells. Steady motion has none; the original UVs do not move at all.
- *s*: seconds of CPU for a frame, over all threads, the median over the poses that were solved; the machine was busy
  with other work, so that elapsed time would say nothing. vrtm is compiled and uses all cores: on two, a frame takes
  about half of that. libigl and Blender are compiled, too. The other methods are numpy and scipy with one thread:
  their times show the order of magnitude and no more.
- Of a scene with several tiles (arm) the first one is measured.
- *Bold*: the lowest figure among the methods that do not fold in that scene.

The paper's solver is this library's implementation of it (`solver="pbd"`, default settings);
[docs/quality.md](../../docs/quality.md#both-solvers-on-15-scenes) has it with more iterations.
"""


def report(rows: list[dict]) -> str:
    scenes = list(dict.fromkeys(key(r) for r in rows))
    of_scene = {scene: [r for r in rows if key(r) == scene] for scene in scenes}
    steps, window = next((r["motion"] for r in rows if "motion" in r), (24, 5))
    motion = f"in a motion from rest to the frame and back in {steps} frames, smooth in time"
    motion += f",\n  of which {window} in the middle of the way there were solved" if window else ", once around"
    parts = [HEAD.format(motion=motion + ", each by itself"), overview(of_scene), wins(of_scene)]
    parts += [table(scene, own) for scene, own in of_scene.items()]
    parts.append("## The methods\n\n| method | minimises | source | assumed |\n|---|---|---|---|")
    for m in METHODS.values():
        parts.append("| " + " | ".join(x.replace("|", "\\|") for x in (m.name, m.energy, m.source, m.assumed)) + " |")
    return "\n".join(parts) + "\n"


def key(row: dict) -> tuple:
    return row["scene"], row["frame"], row["grid"]


def name(row: dict) -> str:
    return NAMES.get(row["method"]) or METHODS[row["method"]].name


def best(rows: list[dict], figure: str) -> float:
    return min((r[figure] for r in rows if not r["folds"]), default=-1.0)


def marked(row: dict, rows: list[dict], figure: str, form: str) -> str:
    text = format(row[figure], form)
    return f"**{text}**" if not row["folds"] and row[figure] == best(rows, figure) else text


def overview(of_scene: dict) -> str:
    """Strain (RMS) of all methods in all scenes."""
    lines = ["## Strain, RMS, of all methods in all scenes\n"]
    lines.append("| method | " + " | ".join(f"{s[0]} {s[1]}" for s in of_scene) + " |")
    lines.append("|---" * (len(of_scene) + 1) + "|")
    run = {r["method"] for own in of_scene.values() for r in own}
    for method in (m for m in ("vrtm", "pbd", *METHODS) if m in run):
        cells = [NAMES.get(method) or METHODS[method].name]
        for own in of_scene.values():
            row = next((r for r in own if r["method"] == method), None)
            cells.append(marked(row, own, "rms", ".4f") + folds(row, ", ") if row else "-")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n\nA dash: no chart of the scene is a rectangle, which control maps need.\n"


def wins(of_scene: dict) -> str:
    """Scenes in which a method has a lower figure than vrtm."""
    strain, motion = [], []
    for scene, own in of_scene.items():
        ours = next(r for r in own if r["method"] == "vrtm")
        others = [r for r in own if r["method"] not in ("vrtm", "original")]
        for r in others:
            better = [
                f"{label} {against(r[figure], ours[figure], form)}"
                for figure, label, form in COMPARED
                if r[figure] < ours[figure]
            ]
            if better:
                strain.append(f"- {scene[0]} {scene[1]}, {name(r)}: {'; '.join(better)}{folds(r, ', with ')}")
        steadier = [f"{name(r)} {r['d2_rms']:.3f}" for r in others if "d2_rms" in ours and r["d2_rms"] < ours["d2_rms"]]
        if steadier:
            motion.append(f"- {scene[0]} {scene[1]}, {ours['d2_rms']:.3f} with vrtm: {'; '.join(steadier)}")
    lines = ["## Where another method is better than vrtm\n", *strain]
    if motion:
        lines += ["\nd2 (RMS) is lower with these, some of which hardly move the texture:\n", *motion]
    return "\n".join(lines) + "\n"


def against(theirs: float, ours: float, form: str) -> str:
    """Two figures, with more digits where they would look equal."""
    if format(theirs, form) == format(ours, form):
        form = ".6f"
    return f"{theirs:{form}} against {ours:{form}}"


def folds(row: dict, before: str) -> str:
    return f"{before}{row['folds']} fold{'s' * (row['folds'] > 1)}" if row["folds"] else ""


def table(scene: tuple, own: list[dict]) -> str:
    lines = [f"## {scene[0]}, frame {scene[1]}: {scene[2]} x {scene[2]} cells, {own[0]['features']} features\n"]
    lines.append("| method | " + " | ".join(COLUMNS) + " |\n" + "|---" * (len(COLUMNS) + 1) + "|")
    for r in own:
        cells = [name(r)] + [marked(r, own, figure, form) for figure, _, form in COMPARED[:3]]
        cells += [str(r["worse"]), marked(r, own, "over", "d"), str(r["folds"])]
        cells += [format(r[figure], ".3f") if figure in r else "-" for figure in ("d2_rms", "d2_p999", "d2_max")]
        cells.append(format(r["seconds"], ".2f") if r["method"] != "original" else "-")
        lines.append("| " + " | ".join(cells) + " |")
    notes = [f"{name(r)}: {r['note']}" for r in own if r.get("note")]
    notes += [f"{name(r)}: {r['lost']} segments are not covered by the new UVs, and left out" for r in own if r["lost"]]
    if notes:
        lines.append("\n" + "; ".join(notes) + ".")
    return "\n".join(lines) + "\n"
