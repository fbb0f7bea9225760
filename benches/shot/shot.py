"""A plot, a close-up and a film of shots that the bench `shot` wrote: see README.md."""

import argparse
import csv
import json
import shlex
import shutil
import subprocess
from pathlib import Path

PANELS = (
    ("warp", "W: d2, cells"),
    ("positions", "pose: d2 of positions, cells"),
    ("edges", "pose: d2 of lengths of edges, over rest"),
)
SIZES = (("largest", "tab:red"), ("99.9 %", "tab:orange"), ("RMS", "tab:blue"))


def load(folder: Path) -> tuple[dict, dict[str, list[float]]]:
    facts = json.loads((folder / "shot.json").read_text())
    with (folder / "shot.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return facts, {name: [float(row[name]) for row in rows] for name in rows[0]}


def label(facts: dict) -> str:
    start = f"warm, {facts['temporal_weight']:g}" if facts["warm"] else "stateless"
    return f"{facts['quality']}, {start}, {facts['grid']}²"


def plot(folder: Path, beside: Path | None) -> Path:
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    shots = [(load(folder), "-")] + ([(load(beside), ":")] if beside else [])
    facts, peak = shots[0][0][0], shots[0][0][0]["peak"]
    figure, axes = plt.subplots(len(PANELS), 1, figsize=(11, 8), sharex=True, layout="constrained")
    for axis, (kind, title) in zip(axes, PANELS):
        # The pose is the same in both.
        for (own, columns), style in shots if kind == "warp" else shots[:1]:
            for size, colour in SIZES:
                name = f"{size}: {label(own)}" if kind == "warp" else size
                axis.plot(columns["frame"], columns[f"{kind} {size}"], style, color=colour, linewidth=1.2, label=name)
        for key in facts["keys"]:
            axis.axvline(key, color="0.8", linewidth=0.8, zorder=0)
        axis.set_yscale("log")
        axis.set_title(title, fontsize=10, loc="left")
        axis.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))
    where = f"tile {peak['tile']}, UV {peak['uv'][0]:.3f} {peak['uv'][1]:.3f}"
    axes[0].annotate(where, (peak["frame"], peak["largest"]), (6, -3), textcoords="offset points", fontsize=7)
    axes[-1].set_xlabel("frame; grey: rest, and the asset's own frames")
    figure.suptitle(f"{facts['scene']}: second differences over frames")
    figure.savefig(folder / "plot.svg")
    plt.close(figure)
    return folder / "plot.svg"


def bake(folder: Path, program: str, out: Path, more: list[str]):
    facts = json.loads((folder / "shot.json").read_text())
    command = shlex.split(program) + ["--asset", str(folder / "asset"), *facts["bake"], *more, "--out", str(out)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def sheets(folder: Path, program: str, view: str | None) -> Path:
    out = folder / "sheets"
    bake(folder, program, out, [f"--view={view}"] if view else [])
    # The maps of all frames are many times as large as the pictures.
    for file in out.glob("*.exr"):
        file.unlink()
    return out


def near(folder: Path, program: str, node: str | None, reach: float) -> Path:
    """A close-up of a node, by default that of the peak."""
    import closeup

    facts = json.loads((folder / "shot.json").read_text())
    peak = facts["peak"]
    frame, tile, *uv = node.split(",") if node else (peak["frame"], peak["tile"], *peak["uv"])
    frame, tile = min(max(int(frame), 3), facts["frames"] - 2), int(tile)
    maps, path = folder / "maps", folder / f"closeup.{frame:04}.{tile}.png"
    # A warm start needs all frames before.
    bake(folder, program, maps, ["--frames", f"{1 if facts['warm'] else frame - 2}-{frame + 2}"])
    closeup.strip(folder / "asset", maps, path, facts["grid"], (frame, tile, *map(float, uv)), reach)
    shutil.rmtree(maps)
    return path


def film(sheets: Path, rate: int, width: int) -> Path:
    import imageio.v2 as imageio
    import numpy as np
    from PIL import Image

    path = sheets.with_name("film.mp4")
    with imageio.get_writer(path, fps=rate, codec="libx264", quality=7, macro_block_size=2) as writer:
        for sheet in sorted(sheets.glob("sheet.*.png")):
            with Image.open(sheet) as image:
                height = round(image.height * width / image.width / 2) * 2
                writer.append_data(np.asarray(image.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)))
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", help="folders of shots, as the bench wrote them")
    parser.add_argument("--beside", type=Path, help="an output folder of the bench; its shots are dotted in the plots")
    parser.add_argument("--no-film", action="store_true", help="no film: it takes longest")
    parser.add_argument("--view", help="the film's camera as YAW,PITCH, see bake")
    parser.add_argument("--node", help="FRAME,TILE,U,V of the close-up; by default where d2 is largest")
    parser.add_argument("--reach", type=float, default=24, help="from the middle to the side of the close-up, in cells")
    parser.add_argument("--bake", default="cargo run --release --example bake --", help="how to call the bake program")
    parser.add_argument("--rate", type=int, default=24, help="frames per second")
    parser.add_argument("--width", type=int, default=1280, help="of the film, in pixels; even")
    args = parser.parse_args()
    for folder in args.folders:
        print(plot(folder, args.beside / folder.name if args.beside else None))
        print(near(folder, args.bake, args.node, args.reach))
        if not args.no_film:
            print(film(sheets(folder, args.bake, args.view), args.rate, args.width))


if __name__ == "__main__":
    main()
