"""The tables of benches/results/peers.md."""

from baselines import METHODS

NAMES = {"vrtm": "**vrtm, normal**", "pbd": "the paper's solver, in vrtm"}
COLUMNS = ("strain RMS", "95 % below", "largest", "worse", "over 0.05", "folds", "d2 RMS", "99.9 %", "largest", "s")

HEAD = """# Beside other methods

Strain inside rigid features on the deformed mesh, and how the texture moves over time, for vrtm and for the methods
that its paper compares with or names; [benches/peers](../peers/README.md) says how to run it and what each method is.

- *Strain*: |l / L - 1| over all painted segments: root mean square, 95 % quantile, largest.
- *Worse*: features whose error rose by more than 0.02 against the original UVs; *over 0.05*: features whose error is
  larger
  than that. A feature is a connected set of rigid nodes of a chart, its error the RMS over its edges.
- *Folds*: flipped triangles, of the mesh for methods that give new UVs (of {uv}), of the warped grid of 512 x 512
  cells, two
  per cell, for those that warp it.
- *d2*: the second difference over frames of the texture's point at 4,000 points fixed on the surface, in cells (a
  texel of a
  texture of 512 by 512): the pose goes from rest to the frame and back in {steps} frames, once around, and
  every frame is solved by itself.
- *s*: seconds for a frame, the median over the motion without the rest pose. vrtm used both cores, the others one
  (`OMP_NUM_THREADS=1`) of a shared virtual x86-64 server, two processes at a time; the others are numpy and scipy, so
  their times show the order of magnitude and no more. Blender's and libigl's are compiled.

The lowest figure of a column is bold among methods that do not fold. d2 is not compared: the original UVs have none.
"""


def report(rows: list[dict], steps: int = 12) -> str:
    parts = [HEAD.format(uv="which the rest of the table has few", steps=steps)]
    scenes = dict.fromkeys((r["scene"], r["frame"], r["grid"]) for r in rows)
    parts.append(wins(rows, scenes))
    for scene in scenes:
        own = [r for r in rows if (r["scene"], r["frame"], r["grid"]) == scene]
        parts.append(
            f"\n## {scene[0]}, frame {scene[1]}, {scene[2]} x {scene[2]} cells, {own[0]['features']} features\n"
        )
        parts.append("| method | " + " | ".join(COLUMNS) + " |\n" + "|---" * (len(COLUMNS) + 1) + "|")
        parts += [line(r, own) for r in own]
        missing = [METHODS[m].name for m in METHODS if m not in {r["method"] for r in own}]
        if missing:
            parts.append(f"\nNot applicable: {', '.join(missing)}: no chart is a rectangle.")
        notes = [f"{name(r)}: {r['note']}" for r in own if r.get("note")]
        lost = [f"{name(r)}: {r['lost']} segments not covered" for r in own if r["lost"]]
        if notes or lost:
            parts.append("\n" + "; ".join(notes + lost) + ".")
    return "\n".join(parts) + "\n"


def name(row: dict) -> str:
    return NAMES.get(row["method"]) or METHODS[row["method"]].name


def best(rows: list[dict], key: str) -> float:
    return min((r[key] for r in rows if not r["folds"]), default=-1.0)


def line(row: dict, rows: list[dict]) -> str:
    cells = [name(row)]
    for key, form in (("rms", ".4f"), ("p95", ".4f"), ("max", ".2f"), ("worse", "d"), ("over", "d")):
        text = format(row[key], form)
        same = not row["folds"] and row[key] == best(rows, key) and key not in ("worse",)
        cells.append(f"**{text}**" if same else text)
    cells.append(str(row["folds"]))
    cells += [format(row[key], ".3f") if key in row else "-" for key in ("d2_rms", "d2_p999", "d2_max")]
    cells.append(format(row["seconds"], ".2f") if row["method"] != "original" else "-")
    return "| " + " | ".join(cells) + " |"


def wins(rows: list[dict], scenes) -> str:
    """Where a baseline has a lower figure than vrtm, said first."""
    lines = ["\n## Where another method is better than vrtm\n"]
    for scene in scenes:
        own = [r for r in rows if (r["scene"], r["frame"], r["grid"]) == scene]
        ours = next(r for r in own if r["method"] == "vrtm")
        for r in own:
            if r["method"] == "vrtm":
                continue
            better = [
                f"{label} {r[key]:{form}} against {ours[key]:{form}}"
                for key, label, form in (
                    ("rms", "RMS", ".4f"),
                    ("p95", "95 %", ".4f"),
                    ("max", "largest", ".2f"),
                    ("worse", "features worse", "d"),
                    ("over", "features over 0.05", "d"),
                )
                if r[key] < ours[key]
            ]
            if better and r["method"] != "original":
                folds = f", with {r['folds']} folds" if r["folds"] else ""
                lines.append(f"- {scene[0]} {scene[1]}: {name(r)}: {'; '.join(better)}{folds}.")
    return "\n".join(lines)
