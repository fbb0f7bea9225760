"""Each figure's data path at small sizes, with what has to hold of it: (name, whether it holds, figures)."""

import tempfile
from pathlib import Path

import numpy as np
import solve
import stage
from figures import fig1, fig5
from figures.common import Options, Subject
from scenes import face, fish, lizard, square, torus


def better(name, solved, share):
    text = f"strain {solved.before:.3f} with the original UVs, {solved.after:.3f} redirected, {solved.folds} folds"
    return name, solved.after < share * solved.before and solved.folds == 0, text


def creature():
    model = lizard.build()
    painted = lizard.scales(model, 128)
    tiles, rigid = model.udims(), sorted(model.rigidity)
    yield "creature over six tiles", tiles == [1001, 1002, 1003, 1004, 1005, 1006], f"tiles {tiles}"
    held = len(rigid) == 4 and all(map.max() > 0.9 for map in model.rigidity.values())
    yield "four of them with rigidity", held and len(painted.colour) == 6, f"rigidity in {rigid}"
    yield better("creature", solve.solved(model, model.frames[3], 128), 0.7)


def spiky_fish():
    model = fish.build()
    painted = fish.spikes(model, 256)
    peak = max(float(map.max()) for map in painted.height.values())
    yield "spikes stand out of the skin", peak > 0.2, f"highest {peak:.2f}"
    for frame in 0, 1:
        yield better(f"fish {model.notes[frame]}", solve.solved(model, model.frames[frame], 256), 0.5)


def fruit():
    _, _, masks, columns = fig5.data(quick=True)
    full, half, quarter = (fig5.width(masks["banana"], pair[1].maps[1001]) for _, pair in columns)
    text = f"{full:.2f}, {half:.2f}, {quarter:.2f} of their width at rest, {square.WIDTH} with the original UVs"
    yield "bananas of rigidity 100, 50, 25 %", full > half > quarter > square.WIDTH, text
    rigidity, pair = columns[0]
    (ruled, _), (free, _) = (fig5.turns(rigidity, solved.maps[1001]) for solved in pair)
    yield "the density rule turns dense fruit less", ruled < 0.8 * free, f"{ruled:.1f} degrees instead of {free:.1f}"
    for title, (_, pair) in zip(("all", "half", "quarter"), columns):
        yield better(f"fruit, {title}", pair[1], 0.6)
        yield better(f"fruit, {title}, density rule", pair[0], 0.9)


def overlap(options):
    model = torus.build()
    it = Subject(options, "torus", model, torus.stones(model, 256), 256, subdivide=0)
    frame = torus.FRAMES // 2
    yield better("torus", it.solve(frame), 0.4)
    view = stage.View((0.02, -0.02, 0), 3.15, azimuth=0, elevation=42, size=(120, 110))
    for redirected in True, False:
        red, green, blue = np.moveaxis(np.asarray(it.panel(view, frame, redirected, stage.overlap), float), -1, 0)
        seen = np.maximum(np.maximum(red, green), blue) - np.minimum(np.minimum(red, green), blue) > 60
        shares = {
            "red": (seen & (green < 0.6 * red)).mean(),
            "green": (seen & (red < 0.75 * green)).mean(),
            "yellow": (seen & (green >= 0.6 * red) & (red >= 0.75 * green)).mean(),
        }
        text = ", ".join(f"{name} {100 * share:.1f} %" for name, share in shares.items())
        if redirected:
            yield "overlap in three colours", min(shares.values()) > 0.01, text
        else:
            yield "overlap with the original UVs alone", shares["yellow"] > 0.05 and shares["green"] < 0.002, text
    before, after = (np.asarray(it.panel(view, frame, r), float) for r in (False, True))
    difference = np.abs(before - after).mean()
    yield "a panel changes with the redirection", difference > 2, f"mean difference {difference:.1f} of 255"


def head(options):
    model = face.load(options.assets / "mh_face")
    face.stones(model, 512)
    yield better("face", solve.solved(model, model.frames[fig1.FRAME], 512), 0.5)


def checks(assets):
    """All of them, one after the other."""
    with tempfile.TemporaryDirectory() as folder:
        options = Options(Path(folder), Path(folder), Path(assets), samples=4)
        yield from creature()
        yield from spiky_fish()
        yield from fruit()
        yield from overlap(options)
        if (options.assets / "mh_face").is_dir():
            yield from head(options)
        else:
            yield "face", None, f"{options.assets / 'mh_face'} is not there"
