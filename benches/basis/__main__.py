"""Basis maps against other ways to store the redirections of a rig: bytes, errors, strain, texture look-ups.

    cargo run --release --example scene -- arm /tmp/scenes/arm
    cargo run --release --example scene -- creature /tmp/scenes/creature
    python benches/basis /tmp/scenes/arm:256 /tmp/scenes/creature:256 ../shared/assets/mh_face:512

What follows a folder is the number of texels of the maps, and of cells, per side. Needs pip install
'./bindings/python[bake]' pillow. Writes benches/results/basis.md.

A folder's frames are the shapes of its rig. A scene with up to four of them is a motion from shape to shape, of which
every third frame is held out; else all methods get each shape alone and mixtures of them, and are measured on others.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from scene import Scene
from skinning import Skin
from vrtm.basis.controls import drive
from vrtm.basis.fit import fit, summed

TEXTURE = 2048
FRAMES, MIXTURES, HELD = 24, 16, 8
BOUNDS = (1.0, 4.0, 16.0)
EVERY = 3
"""Strain is measured in each third frame of those fitted."""
HEAD = "| scene | method | maps | MB | look-ups | {0} | {1} |\n|---|---|---|---|---|---|---|\n"
ABOUT = f"""# Basis maps, beside other ways

Maps of 256 x 256 texels per tile, of `mh_face` 512 x 512, on as many cells; `benches/basis` says how to run it.

- *Errors* are distances from the redirection of the frame, at the texels that move at all in some frame.
- *Strain* is the root mean square over rigid features on the mesh, its mean over frames (of those fitted, every third).
- *Folds* are frames whose sum folds in more places than their own map.
- *MB* are those in memory, uncompressed. *Seconds* of fits are those of two cores that were busy with other work.
- `arm` and `creature` are motions of {FRAMES} frames, of which every third is held out: weights are interpolated there.
  Of `mh_face` {MIXTURES} mixtures of its expressions are fitted beside each alone, and {HELD} others held out: weights
  are functions of the expressions.

"""


def samples(scene: Scene) -> tuple[np.ndarray, np.ndarray, bool]:
    """Controls that are fitted, controls that are held out, and whether they are a motion."""
    count, random = len(scene.shapes), np.random.default_rng(5)
    if count > 4:
        mixtures = np.where(
            random.random((MIXTURES + HELD, count)) < 0.4, random.uniform(0.2, 0.9, (MIXTURES + HELD, count)), 0
        )
        return np.vstack([np.eye(count), mixtures[:MIXTURES]]), mixtures[MIXTURES:], False
    time_ = np.linspace(0, count, FRAMES)
    whole = np.minimum(time_.astype(int), count - 1)
    keys = np.vstack([np.zeros(count), np.eye(count)])
    share = (time_ - whole)[:, None]
    controls = keys[whole] * (1 - share) + keys[whole + 1] * share
    held = np.arange(FRAMES) % 3 == 1
    return controls[~held], controls[held], True


class Runtime:
    """Weights that are known where a method was fitted, anywhere else."""

    def __init__(self, fitted: np.ndarray, held: np.ndarray, motion: bool) -> None:
        self.fitted, self.held, self.motion = fitted, held, motion

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(held, ...) of (fitted, ...): linear between frames, or the driver's function of controls."""
        flat = values.reshape(len(values), -1)
        if self.motion:
            # Frames 0, 2, 3, 5, 6 ... are fitted; 1, 4, 7 ... lie between two of them.
            k = np.arange(len(self.held))
            found = (flat[2 * k] + flat[np.minimum(2 * k + 1, len(flat) - 1)]) / 2
        else:
            names = tuple(f"shape{k}" for k in range(self.fitted.shape[1]))
            found = drive(names, self.fitted, flat)(self.held)
        return found.reshape(-1, *values.shape[1:])


def measured(scene: Scene, controls: np.ndarray, deltas: np.ndarray, sums: np.ndarray) -> str:
    off = np.linalg.norm(sums - deltas, axis=-1)[deltas.any(axis=(0, 2))[None].repeat(len(deltas), 0)] * TEXTURE
    every = EVERY if len(controls) > 2 * HELD - 1 else 1
    strain = np.mean([scene.strain(pose, total) for pose, total in zip(controls[::every], sums[::every])])
    folding = sum(scene.folds(total) > scene.folds(own) for total, own in zip(sums, deltas))
    folded = f", {folding} fold" if folding else ""
    return f"{off.mean():.2f} / {np.quantile(off, 0.99):.2f} / {off.max():.1f}; {strain:.4f}{folded}"


def rows(given: str) -> list[str]:
    folder, size = given.rsplit(":", 1)
    scene = Scene(Path(folder), int(size))
    fitted, held, motion = samples(scene)
    start = time.perf_counter()
    deltas, others = (np.array([scene.solve(c) for c in controls]) for controls in (fitted, held))
    print(f"{scene.name}: solved in {time.perf_counter() - start:.0f} s", flush=True)
    runtime, texels = Runtime(fitted, held, motion), deltas.shape[1]
    found = []

    def row(
        method: str, maps: str, size: float, lookups: str, own: np.ndarray | None, other: np.ndarray | None
    ) -> None:
        cells = [
            "" if sums is None else measured(scene, controls, wanted, sums)
            for controls, wanted, sums in ((fitted, deltas, own), (held, others, other))
        ]
        found.append(f"| {scene.name} | {method} | {maps} | {size / 1e6:.2f} | {lookups} | {cells[0]} | {cells[1]} |")
        print(found[-1], flush=True)

    row("original UVs", "0", 0, "0", np.zeros_like(deltas), np.zeros_like(others))
    half = deltas.astype(np.float16).astype(float)
    between = np.array(runtime(half)) if motion else None
    lookups = "2" if motion else "1"
    row("a map per frame, f16", str(len(deltas)), 4 * texels * len(deltas), lookups, half, between)
    for bound in BOUNDS:
        start = time.perf_counter()
        own = [scene.folds(delta) for delta in deltas]

        def holds(basis, own=own) -> bool:
            sums = summed(basis.maps, basis.weights)
            return all(scene.folds(total) <= most for total, most in zip(sums, own))

        basis = fit(deltas, bound / TEXTURE, holds)
        seconds, count = time.perf_counter() - start, len(basis)
        other = summed(basis.maps, runtime(basis.weights.astype(float)))
        own_sums = summed(basis.maps, basis.weights)
        name = f"`--basis`, {bound:g} texel{'s' * (bound != 1)}, fitted in {seconds:.0f} s"
        row(name, str(count), 4 * texels * count, str(count), own_sums, other)
        mean = deltas.mean(axis=0)
        flat = (deltas - mean).reshape(len(deltas), -1)
        left, values, right = np.linalg.svd(flat.astype(float), full_matrices=False)
        weights = left[:, : count - 1] * values[: count - 1]
        maps = right[: count - 1].reshape(count - 1, texels, 2).astype(np.float16)
        stored = mean.astype(np.float16).astype(float)
        sums = [stored + summed(maps, w) for w in (weights, runtime(weights))]
        row("PCA, one of the maps the mean", str(count), 4 * texels * count, str(count), *sums)
    skin = Skin(deltas.astype(float), scene.at, scene.features)
    sums = [np.array([skin.sum(pose) for pose in poses]) for poses in (skin.poses, runtime(skin.poses))]
    row(f"linear blend skinning, {len(skin.centres)} features", "2", skin.bytes, "2, and 4 bones", *sums)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", metavar="FOLDER:SIZE")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results" / "basis.md")
    given = parser.parse_args()
    lines = [row for folder in given.folders for row in rows(folder)]
    what = f"mean / 99 % / largest error in texels of {TEXTURE}; strain"
    given.out.write_text(ABOUT + HEAD.format(f"fitted: {what}", f"held out: {what}") + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
