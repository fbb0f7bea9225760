"""The tables of docs/paper.md from benches/results/paper.json."""

import tables as timings


def strains(rows):
    out = ["| pose | strain, RMS: original UVs | vrtm | folds |", "|---|---|---|---|"]
    return out + [f"| {r['case']} | {r['before']:.3f} | {r['after']:.4f} | {r['folds']} |" for r in rows]


def methods(rows):
    out = [
        "| | strain, RMS | features over 0.05 | worse than original by 0.02 | folds | CPU seconds per frame | d2 |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        seconds = f"{r['seconds']:.2f}" if r["seconds"] else "-"
        counts = f"{r['over']} of {r['features']} | {r['worse']} | {r['folds']}"
        out.append(f"| {r['method']} | {r['rms']:.4f} | {counts} | {seconds} | {r['d2']:.3f} |")
    return out


def fruit(rows):
    out = [
        "| rigidity | density rule | strain, RMS: original UVs | vrtm | width: strawberries | bananas | oranges | "
        "turned: dense rows | sparse rows |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        widths = " | ".join(f"{100 * r[kind]:.0f} %" for kind in ("strawberry", "banana", "orange"))
        turns = " | ".join(f"{turn:.1f}°" for turn in r["turns"])
        out.append(f"| {r['rigidity']} | {r['rule']} | {r['before']:.3f} | {r['after']:.3f} | {widths} | {turns} |")
    return out


FIGURES = {"figure 1": strains, "figure 3": methods, "figure 4": methods, "figure 5": fruit, "figure 6": strains,
           "figure 7": strains, "tables": timings.lines}  # fmt: skip


def tables(results):
    """All tables by the name of their mark in the page."""
    return {name: FIGURES[name](rows) for name, rows in results.items()}
