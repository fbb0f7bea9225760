"""Basis maps against other ways to store the redirections of a rig: bytes, errors, strain, texture look-ups.

    cargo run --release --example scene -- arm /tmp/scenes/arm
    cargo run --release --example scene -- creature /tmp/scenes/creature
    python benches/basis /tmp/scenes/arm:256 /tmp/scenes/creature:256 ../shared/assets/mh_face:512 \\
        cesium_man.gltf,../shared/assets/cesium_man/rigidity.1001.png:512 \\
        Fox.glb,../shared/assets/fox/rigidity.1001.png:512

A scene is a folder, or a skinned character of glTF 2.0 and the rigidity map of its tile; then the number of texels of
the maps, and of cells, per side. Of scenes that are not there it says so. CesiumMan and Fox are in
https://github.com/KhronosGroup/glTF-Sample-Assets; no file of them is part of this project. Needs pip install
'./bindings/python[bake]' pillow scipy. Writes benches/results/basis.md.

A folder's frames are the shapes of its rig. A scene with up to four of them, or with one clip, is a motion of which
every third frame is held out. Else all methods get each shape alone and mixtures of them, and are measured on others;
or all clips but the last, which is held out.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from blocks import bc5
from scene import FRAMES, HELD, MIXTURES, Character, Samples, Scene, Shapes
from skinning import Skin
from vrtm.basis.controls import drive
from vrtm.basis.fit import Basis, fit, fitted_weights, summed
from vrtm.basis.stored import FORMATS, HALF, Range, numbers

TEXTURE = 2048
BOUNDS = (1.0, 4.0, 16.0)
MIDDLE = 4.0
"""The bound at which all formats are tried."""
EVERY = 3
"""Strain is measured in each third frame of those fitted."""
HEAD = "| scene | method | maps | MB | look-ups | {0} | {1} |\n|---|---|---|---|---|---|---|\n"
ABOUT = f"""# Basis maps, beside other ways

Maps of 256 x 256 texels per tile, of `mh_face`, `cesium_man` and `Fox` 512 x 512, on as many cells; `benches/basis`
says how to run it.

- *Errors* are distances from the redirection of the frame, at the texels that move at all in some frame.
- *Strain* is the root mean square over rigid features on the mesh, its mean over frames (of those fitted, every third).
- *Folds* are frames whose sum folds in more places than their own map.
- *MB* are those in memory, uncompressed but for BC5. *Seconds* of fits are those of two cores that were busy with other
  work.
- `arm` and `creature` are motions of {FRAMES} frames, of which every third is held out: weights are interpolated there.
  Of `mh_face` {MIXTURES} mixtures of its expressions are fitted beside each alone, and {HELD} others held out: weights
  are functions of the expressions.
- [`cesium_man`](https://github.com/KhronosGroup/glTF-Sample-Assets) (Cesium, CC BY 4.0) and `Fox` (PixelMannen, CC0;
  rig by tomkranis and glTF by AsoboStudio and scurest, CC BY 4.0) are skinned. Of the former's walk, {FRAMES} frames,
  every third is held out. Of the latter {FRAMES} frames of two clips are fitted, and {HELD} of the third held out:
  weights are functions of its 24 joints' rotations, so many numbers that a new clip is far from each pose. Rows that
  begin with dots have the weights that suit these frames best, as the bake finds them with `--held-out` and without
  `--controls`.
- Both have fewer cells than the library asks for ("1024 x 1024 resolve its rigid features").

"""


class Runtime:
    """Weights that are known where a method was fitted, anywhere else."""

    def __init__(self, samples: Samples) -> None:
        self.fitted, self.held, self.motion = samples.fitted, samples.held, samples.motion

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(held, ...) of (fitted, ...): linear between frames, or the driver's function of controls."""
        if not values.size:
            # Of no map: PCA has the mean alone.
            return np.zeros((len(self.held), *values.shape[1:]))
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


def compressed(scene: Scene, maps: np.ndarray, of: Range) -> np.ndarray:
    """(texels, 2): a map of 8 bits after BC5."""
    tiles = [bc5(image) for image in scene.images(numbers(maps, of, "unorm8"))]
    return of.offset + of.scale * np.concatenate([tile.reshape(-1, 2) for tile in tiles]) / 255


def opened(given: str) -> Scene | None:
    """The scene of an argument; None, after a word, where a file of it is missing."""
    paths, size = given.rsplit(":", 1)
    named = [Path(path) for path in paths.split(",")]
    missing = [str(path) for path in named if not path.exists()]
    if missing:
        print(f"{given}: left out, since {', '.join(missing)} is not there", flush=True)
        return None
    return Shapes(named[0], int(size)) if len(named) == 1 else Character(named[0], named[1], int(size))


def rows(scene: Scene) -> list[str]:
    samples = scene.samples()
    fitted, held, motion = samples.fitted, samples.held, samples.motion
    start = time.perf_counter()
    deltas, others = (np.array([scene.solve(c) for c in controls]) for controls in (fitted, held))
    print(f"{scene.name}: solved in {time.perf_counter() - start:.0f} s", flush=True)
    runtime, texels = Runtime(samples), deltas.shape[1]
    found = []

    def row(
        method: str, maps: str, size: float, lookups: str, own: np.ndarray | None, other: np.ndarray | None
    ) -> None:
        cells = [
            "" if sums is None else measured(scene, controls, wanted, sums)
            for controls, wanted, sums in ((fitted, deltas, own), (held, others, other))
        ]
        megabytes = f"{size / 1e6:.2f}" if maps else ""
        found.append(f"| {scene.name} | {method} | {maps} | {megabytes} | {lookups} | {cells[0]} | {cells[1]} |")
        print(found[-1], flush=True)

    row("original UVs", "0", 0, "0", np.zeros_like(deltas), np.zeros_like(others))
    half = deltas.astype(np.float16).astype(float)
    between = np.array(runtime(half)) if motion else None
    lookups = "2" if motion else "1"
    row("a map per frame, f16", str(len(deltas)), 4 * texels * len(deltas), lookups, half, between)
    own = [scene.folds(delta) for delta in deltas]

    def holds(basis: Basis) -> bool:
        return all(
            scene.folds(summed(basis.maps, weights[None])[0]) <= most for weights, most in zip(basis.weights, own)
        )

    def based(bound: float, form: str) -> Basis | None:
        """Adds the row of a basis."""
        start = time.perf_counter()
        basis = fit(deltas, bound / TEXTURE, holds, form)
        seconds = time.perf_counter() - start
        name = f"`--basis`, {bound:g} texel{'s' * (bound != 1)}, {form}"
        if basis is None:
            row(f"{name}: no number of maps holds", "", 0, "", None, None)
            return None
        other = summed(basis.maps, runtime(basis.weights.astype(float)))
        size = 2 * np.dtype(FORMATS[form]).itemsize * texels * len(basis)
        own_sums = summed(basis.maps, basis.weights)
        row(f"{name}, fitted in {seconds:.0f} s", str(len(basis)), size, str(len(basis)), own_sums, other)
        return basis

    for bound in BOUNDS:
        basis = based(bound, HALF)
        if basis is None:
            continue
        count = len(basis)
        if bound == MIDDLE:
            based(bound, "unorm16")
            small = based(bound, "unorm8")
            if small is not None:
                maps = np.array([compressed(scene, one, of) for one, of in zip(small.maps, small.ranges)])
                sums = [summed(maps, w) for w in (small.weights, runtime(small.weights.astype(float)))]
                row("the same maps as BC5", str(len(small)), 2 * texels * len(small) / 2, str(len(small)), *sums)
            if not motion:
                best = summed(basis.maps, fitted_weights(basis.maps, others))
                row("... with the weights that suit what is held out best", "", 0, "", None, best)
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
    parser.add_argument("scenes", nargs="+", metavar="SCENE:SIZE")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results" / "basis.md")
    given = parser.parse_args()
    scenes = [scene for one in given.scenes if (scene := opened(one)) is not None]
    if not scenes:
        parser.error("no scene is left")
    lines = [row for scene in scenes for row in rows(scene)]
    what = f"mean / 99 % / largest error in texels of {TEXTURE}; strain"
    given.out.write_text(ABOUT + HEAD.format(f"fitted: {what}", f"held out: {what}") + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
