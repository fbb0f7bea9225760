"""vrtm beside other parameterisers, on the same meshes, measured in the same way: see README.md."""

import argparse
import json
import statistics
from pathlib import Path

import case as cases
import numpy as np
from solvers import blender, slim
from strain import measure

REPEATS = 3
# Figures on the same mesh and edges, one from Rust and one from here, may differ by rounding, and by the choice of the
# triangle for a point on an edge.
AGREE = 2e-3


def solve(solver, case, iterations: int):
    runs = [solver(case, iterations) for _ in range(REPEATS)]
    return runs[0][0], statistics.median(seconds for _, seconds in runs)


def rows(folder: Path) -> list[dict]:
    case = cases.load(folder)
    facts = case.facts
    base = {"scene": facts["scene"], "frame": facts["frame"], "grid": case.grid}
    original, warped = measure(case), measure(case, warped=True)
    for name, here, there in (("before", original, facts["before"]), ("after", warped, facts["after"])):
        difference = abs(here["rms"] / there["rms"] - 1)
        print(f"{facts['scene']}: strain {name}: {here['rms']:.5f} here, {there['rms']:.5f} by vrtm, "
              f"{here['edges']} and {facts['edges']} edges")
        if difference > AGREE:
            raise SystemExit(f"{facts['scene']}: strain {name} differs by {100 * difference:.2f} % from the library's")
    result = [base | {"solver": "original UVs", "seconds": None} | original]
    result.append(base | {"solver": "vrtm, normal", "seconds": facts["vrtm_seconds"]} | warped)
    for name, solver, counts in (("SLIM, libigl 2.6.3", slim, (5, 50)), ("minimum stretch, Blender 5.0.1", blender, (10, 50))):
        for iterations in counts:
            uv, seconds = solve(solver, case, iterations)
            moved = float(np.abs(uv - case.uv)[case.border].max())
            figures = measure(case, uv=uv) | {"border_moved": moved}
            result.append(base | {"solver": f"{name}, {iterations} iterations", "seconds": seconds} | figures)
            print(result[-1], flush=True)
    return result


def table(result: list[dict]) -> str:
    lines = ["| scene | grid | solver | strain RMS | 95 % below | largest | triangles flipped | edges lost | seconds |", "|---|---|---|---|---|---|---|---|---|"]
    for row in result:
        seconds = "-" if row["seconds"] is None else f"{row['seconds']:.3f}"
        lines.append(
            f"| {row['scene']} {row['frame']} | {row['grid']}² | {row['solver']} | {row['rms']:.4f} | {row['p95']:.4f} | "
            f"{row['max']:.2f} | {row.get('flipped', 0)} | {row['lost']} | {seconds} |"
        )
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path, help="the folder that the bench exported to")
    parser.add_argument("--out", type=Path, default=Path("benches/results"))
    args = parser.parse_args()
    result = [row for folder in sorted(args.cases.iterdir()) if folder.is_dir() for row in rows(folder)]
    head = (
        "# Beside other parameterisers\n\n"
        "Strain inside rigid features on the deformed mesh, measured in the same way for all (`benches/peers/strain.py`), "
        "and the seconds of the solver call alone, medians; vrtm on all cores of the same machine. The peers keep chart "
        "borders where they were, as vrtm does, and minimise the distortion of whole charts against the deformed mesh: they "
        "do not know what is rigid, nor do they match the distortion that the texture had at rest. Flipped triangles are "
        "folds; lost edges lie where the new UVs do not cover the texture (Blender reports islands that it could not "
        "solve); they are left out.\n\n"
    )
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "peers.md").write_text(head + table(result) + "\n")
    (args.out / "peers.json").write_text(json.dumps(result, indent=1) + "\n")
    print(table(result))


if __name__ == "__main__":
    main()
