"""vrtm beside the baselines, on the same meshes and measured in the same way: see README.md."""

import argparse
import json
from pathlib import Path

import case as cases
import measure
import numpy as np
from baselines import METHODS, NotApplicable, Solution
from report import report

# Figures on the same mesh and edges, one from Rust and one from here, may differ by rounding, and by the choice of the
# triangle for a point on an edge.
AGREE = 2e-3
VRTM = {
    "vrtm": ("vrtm, normal", {}),
    "pbd": ("the paper's solver, in vrtm", {"solver": "pbd"}),
}


def row(case: cases.Case, name: str, solution: Solution | None, map_: dict, seconds: float, original) -> dict:
    errors = measure.features(case, **map_)
    result = {"method": name, "seconds": seconds, "folds": measure.folds(case, **map_)}
    result |= measure.strain(case, **map_) | measure.against(errors, original)
    result["errors"] = [round(float(x), 4) for x in errors]
    if solution is not None:
        result |= {"iterations": solution.iterations, "note": solution.note}
    return result


def agree(case: cases.Case) -> None:
    """Stops where the strain that is measured here is not the library's own."""
    for name, there in (("original UVs", case.facts["before"]), ("vrtm", case.facts["after"])):
        here = measure.strain(case, warped=name == "vrtm")["rms"]
        if abs(here - there) > AGREE * there:
            raise SystemExit(f"{case.facts['scene']}: strain of {name}: {here:.5f} here, {there:.5f} by vrtm")


def of_folder(folder: Path, frame: int, grid: int, methods: list[str], steps: int, window: int) -> list[dict]:
    """A frame of an asset, and the motion from rest to the frame and back, or `window` frames of it."""
    scene = cases.Scene(folder, grid)
    rest, pose = scene.mesh.positions, scene.pose(frame)
    # The motion is smooth in time and the same there and back, so that stateless methods solve each pose once. The last
    # pose is the frame itself.
    times = list(range(steps // 2)) if not window else [steps // 4 - window // 2 + k for k in range(window)]
    shares = [(1 - np.cos(2 * np.pi * k / steps)) / 2 for k in times] if steps else []
    shares.append(1.0)
    poses = [scene.case(frame, rest + share * (pose - rest), repeats=3) for share in shares]
    case = poses[-1]
    for other in poses[:-1]:
        other.cache = case.cache
    agree(case)
    original = measure.features(case)
    points = measure.surface_points(case)
    base = {"scene": scene.name, "frame": frame, "grid": grid, "motion": [steps, window]}
    rows = []

    def add(name: str, maps: list[dict], solution: Solution | None, seconds: list[float]):
        median = float(np.median(seconds[1:] if 0 in shares else seconds))
        rows.append(base | row(case, name, solution, maps[-1], median, original))
        if steps:
            track = [measure.texture_at(c, points, **map_) for c, map_ in zip(poses, maps)]
            # The whole motion is once around: rest, the frame, rest, and one step on.
            around = track[:-1] if window else track + track[-2::-1] + track[1:2]
            rows[-1] |= measure.second_difference(around)
        facts = {k: v for k, v in rows[-1].items() if k != "errors"}
        print(json.dumps(facts), flush=True)

    add("vrtm", [{"warped": True}] * len(poses), None, [c.facts["vrtm_seconds"] for c in poses])
    for name, (_, options) in list(VRTM.items())[1:]:
        solved = [scene.case(frame, rest + share * (pose - rest), **options) for share in shares]
        maps = [{"warp": c.displacement} for c in solved]
        add(name, maps, None, [c.facts["vrtm_seconds"] for c in solved])
    for name in methods:
        try:
            solutions = [METHODS[name].solve(c) for c in poses]
        except NotApplicable as reason:
            print(f"{scene.name}: {METHODS[name].name}: {reason}", flush=True)
            continue
        add(name, [s.map() for s in solutions], solutions[-1], [s.seconds for s in solutions])
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="assets as FOLDER or FOLDER:FRAME")
    parser.add_argument("--grid", type=int, default=512, help="cells along each side (512)")
    parser.add_argument("--steps", type=int, default=24, help="frames of the motion (24; 0: none)")
    parser.add_argument("--window", type=int, default=5, help="solve this many frames of its middle (5; 0: all)")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--out", type=Path, default=Path("benches/results"))
    parser.add_argument("--add", action="store_true", help="keep the rows of other scenes that peers.json has")
    args = parser.parse_args()
    if args.steps % 4:
        parser.error(f"--steps: {args.steps} is no multiple of 4")
    if args.steps and args.window and not 3 <= args.window <= args.steps // 2:
        parser.error(f"--window: {args.window} is not in 3..{args.steps // 2}")
    args.out.mkdir(parents=True, exist_ok=True)
    data = args.out / "peers.json"
    result = json.loads(data.read_text()) if args.add and data.exists() else []
    for argument in args.folders:
        name, _, frame = str(argument).partition(":")
        folder = Path(name)
        if frame and not (frame.isdigit() and int(frame) > 0):
            parser.error(f"{argument}: {frame} is no frame, which are numbered from 1")
        if not (folder / "asset.json").exists():
            parser.error(f"{folder}: asset.json is not there")
        window = args.window if args.steps else 0
        rows = of_folder(folder, int(frame or 1), args.grid, args.methods, args.steps, window)
        key = (rows[0]["scene"], rows[0]["frame"], rows[0]["grid"])
        result = [r for r in result if (r["scene"], r["frame"], r["grid"]) != key] + rows
        data.write_text("[\n" + ",\n".join(json.dumps(r) for r in result) + "\n]\n")
    (args.out / "peers.md").write_text(report(result))


if __name__ == "__main__":
    main()
