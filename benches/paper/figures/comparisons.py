"""Figures 3 and 4: the torus beside a homogeneous sliding skin, and the jug beside four other parameterisations."""

import baseline
import numpy as np
import paint
import sheet
import stage
from scenes import torus

from figures import fig6
from figures.common import Subject

TORUS = stage.View((0.02, -0.02, 0), 3.15, azimuth=0, elevation=42, size=(430, 400))
JUG = stage.View((0.12, 1.55, 0), 3.75, azimuth=-22, elevation=13, size=(280, 340), floor=0.0)
GRID = 512
STEPS = 9  # poses of a smooth sequence, over which the roughness is measured


def sequence(model, frame):
    """Poses from rest to a frame, that begin and end softly."""
    share = (1 - np.cos(np.pi * np.arange(STEPS) / (STEPS - 1))) / 2
    return [model.rest + s * (model.frames[frame] - model.rest) for s in share]


def compared(it, folder, frame, view, names, frames, titles):
    """A panel for each method, and the table's rows; the original UVs count as one."""
    panels, rows = {}, []
    for name, outcome in baseline.run(folder, it.model, frame, GRID, names, frames):
        redirected = outcome.map is not None
        if redirected:
            zero = np.zeros_like(outcome.map[..., :1])
            paint.warp.write(it.folder / f"map{frame}.1001.exr", np.concatenate([outcome.map, zero], -1))
        panels[name] = (titles[name], it.panel(view, frame, redirected, uvs=outcome.corners))
        rows.append(outcome.row)
    return panels, rows


def fig3(options):
    model = torus.build()
    it = Subject(options, "torus", model, torus.stones(model, 2048), GRID, subdivide=3, roughness=0.45)
    folder = options.scenes / model.name
    model.write(folder)
    frame = torus.FRAMES // 2
    titles = {"original": "original UVs", "skin": "homogeneous sliding skin", "vrtm": "vrtm"}
    panels, rows = compared(it, folder, frame, TORUS, list(titles), model.frames[: frame + 1 : 2], titles)
    row = [("at rest", it.panel(TORUS)), *panels.values()]
    return {"paper_3.jpg": sheet.sheet([row])}, rows


def fig4(options):
    it = fig6.subject(options)
    folder, frame = options.scenes / "mug_to_jug", 3
    titles = {
        "vrtm": "vrtm",
        "control_axes": "Koniaris et al. 2013",
        "overlay": "Sheffer, de Sturler 2002",
        "mvc": "mean value coordinates",
        "original": "original UVs",
    }
    panels, rows = compared(it, folder, frame, JUG, list(titles), sequence(it.model, frame), titles)
    row = [*panels.values(), ("at rest", it.panel(JUG))]
    return {"paper_4.jpg": sheet.sheet([row])}, rows
