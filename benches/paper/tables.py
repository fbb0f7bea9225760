"""Tables 1 and 2: preparing, solving and inverting at the paper's sizes, on the models that stand for the paper's."""

import os
import platform
import statistics
import time
from pathlib import Path

import solve
import vrtm

RESULTS = Path(__file__).resolve().parents[1] / "results"
# The records of the one hardware GPU on which vrtm was timed.
GPU = "nvidia-h100-80gb-hbm3"

# The paper's times in milliseconds on an Intel Xeon X5550 and an NVIDIA GTX Titan: preprocess, warp; and rendering
# without the warp, inversion, rendering with it.
PAPER = {
    "Face-0": (2048, 1.20, 14.12, (5.05, 3.85, 5.32)),
    "Face-1": (4096, 4.52, 119.31, (5.10, 16.05, 5.34)),
    "Face-2": (2048, 1.17, 13.92, None),
    "Face-3": (2048, 1.14, 14.04, None),
    "MugJug": (2048, 1.17, 14.05, (4.44, 3.84, 4.54)),
    "Blowfish": (1024, 0.37, 3.87, (5.71, 1.11, 5.88)),
}
# Which frame, from 0, of which model stands for a row.
ROWS = {
    "Face-0": ("face", 0), "Face-1": ("face", 0), "Face-2": ("face", 5), "Face-3": ("face", 1),
    "MugJug": ("mug", 3), "Blowfish": ("fish", 0),
}  # fmt: skip


def timed(function, repeats):
    """The median of milliseconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def measured(device, model, frame, grid, repeats):
    """One row: medians in milliseconds, and the strain, RMS, before and after each quality."""
    udim, rest, pose = 1001, model.rest, model.frames[frame]
    with solve.opened(device, model, grid) as asset:
        tile, map = asset.tile(udim), model.rigidity[udim].astype("f4")
        # Two maps in turn: one that did not change would cost nothing.
        maps, times = (0.9 * map, map), []
        for k in range(2 * repeats):
            start = time.perf_counter()
            tile.set_rigidity(maps[k % 2])
            _ = tile.info
            times.append(1e3 * (time.perf_counter() - start))
        row = {"prepare": statistics.median(times)}
        start = time.perf_counter()
        asset.solve(pose)
        row["first"] = 1e3 * (time.perf_counter() - start)
        for quality in "draft", "normal":

            def warp(quality=quality):
                asset.solve(pose, quality=quality)

            times = []
            for _ in range(repeats):
                # An asset keeps its result for a pose that did not change.
                asset.solve(rest, quality=quality)
                times.append(timed(warp, 1))
            row[quality] = statistics.median(times)
            asset.solve(rest)
            asset.solve(pose, quality=quality, measure=True)
            row["before"], row[f"after_{quality}"] = tile.report().before.rms, tile.report().after.rms
        row["nodes"] = tile.report().nodes_active
        out = tile.fetch(size=grid)
        row["invert"] = timed(lambda: tile.fetch(size=grid, out=out), repeats)
    return row


def make(models, names, kept, repeats=7):
    """The rows `names`, beside those of an earlier run that are kept; `models` gives the model by name, or None where
    it is absent."""
    rows = {row["row"]: row for row in kept.get("rows", [])}
    with vrtm.Device("cpu") as device:
        for name in names:
            subject, frame = ROWS[name]
            model = models(subject)
            if model is None:
                print(f"{name} left out: the model {subject} is not there")
                continue
            row = {"row": name, "model": subject, "note": model.notes[frame], "grid": PAPER[name][0]}
            rows[name] = row | measured(device, model, frame, PAPER[name][0], repeats)
            rows[name]["load"] = round(os.getloadavg()[0], 1)
            print(rows[name], flush=True)
        threads = device.info.threads
    rows = [rows[name] for name in ROWS if name in rows]
    return {"machine": machine(), "threads": threads, "repeats": repeats, "rows": rows}


def machine():
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def recorded(table, *start):
    """The cells of the first row of benches/results/`table` that starts with the cells `start`."""
    for line in (RESULTS / table).read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if tuple(cells[: len(start)]) == start:
            return cells
    raise LookupError(f"{table} has no row that starts with {start}")


def on_gpu():
    """The face at the paper's size on a hardware GPU: lines in Markdown."""
    draft, normal = (recorded(f"gpu-{GPU}.md", "mh_face", "2048²", quality) for quality in ("draft", "normal"))
    strain = f"{draft[8].split()[0]}, {draft[8].split()[-1]}, {normal[8].split()[-1]}"
    return [
        "| ours, on an H100 | grid | warp: `draft` | `normal` | inversion and reading back | strain: original, "
        "`draft`, `normal` |",
        "|---|---|---|---|---|---|",
        f"| face, another expression | 2048² | {float(draft[5]):.1f} | {float(normal[5]):.1f} | "
        f"{float(normal[7]):.1f} | {strain} |",
    ]


def lines(result):
    """The tables in Markdown."""
    out = [
        "| paper's row | ours | grid | movable nodes | preprocess: paper, ours | first frame | warp: paper | "
        "ours, `draft` | ours, `normal` | strain: original, `draft`, `normal` |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in result["rows"]:
        _, prepare, warp, _ = PAPER[row["row"]]
        out.append(
            f"| {row['row']} | {row['model']}, {row['note']} | {row['grid']}² | {row['nodes'] / 1e6:.2f} M | "
            f"{prepare:.2f}, {row['prepare']:.0f} | {row['first']:.0f} | {warp:.2f} | {row['draft']:.0f} | "
            f"{row['normal']:.0f} | {row['before']:.3f}, {row['after_draft']:.4f}, {row['after_normal']:.4f} |"
        )
    out += [
        "",
        "| paper's row | ours | size | inversion: paper | ours | rendering, paper: without, with | ours, on an H100 |",
        "|---|---|---|---|---|---|---|",
    ]
    # The first rows of the record are the whole mesh's; it has the mug alone.
    drawn = ", ".join(recorded(f"render-{GPU}.md", way)[3] for way in ("original", "forward-implicit"))
    for row in result["rows"]:
        rendering = PAPER[row["row"]][3]
        if rendering:
            out.append(
                f"| {row['row']} | {row['model']}, {row['note']} | {row['grid']}² | {rendering[1]:.2f} | "
                f"{row['invert']:.0f} | {rendering[0]:.2f}, {rendering[2]:.2f} | "
                f"{drawn if row['model'] == 'mug' else '-'} |"
            )
    loads = [row["load"] for row in result["rows"]]
    return [
        *out,
        "",
        *on_gpu(),
        "",
        f"Milliseconds. The paper's: Intel Xeon X5550 and NVIDIA GTX Titan, on the GPU. Ours: {result['machine']}, "
        f"{result['threads']} threads, on the CPU; medians of {result['repeats']}. The machine was shared: its load "
        f"average after each row was {min(loads)} to {max(loads)}, of which up to {result['threads']} are ours. "
        f"On the H100: the solver (`benches/results/gpu-{GPU}.md`), with kernels that were rewritten since, and "
        f"drawing (`benches/results/render-{GPU}.md`) at 1920 x 1080 with the original UVs and through a map of 1024.",
    ]
