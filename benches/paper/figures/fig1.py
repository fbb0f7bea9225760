"""Figure 1: rigid features on an animated face."""

import sheet
import stage
from scenes import face

from figures.common import Subject, record

FRAME = 0  # the mouth open
SIZE, GRID = 4096, 2048
FAR = stage.View((0, 6.80, 0.9), 1.95, azimuth=25, elevation=4, size=(330, 400))
NEAR = stage.View((0.17, 6.31, 1.3), 1.04, azimuth=28, elevation=3, size=(330, 400))


def subject(options):
    model = face.load(options.assets / "mh_face")
    painted = face.stones(model, SIZE)
    return Subject(options, "face", model, painted, GRID, subdivide=4, rounded=True, roughness=0.55)


def make(options):
    it = subject(options)
    solved = it.solve(FRAME)
    row = [
        ("(a) mouth open, vrtm", it.panel(FAR, FRAME, True)),
        ("(b) at rest", it.panel(NEAR)),
        ("(c) rigid features", it.panel(NEAR, look=stage.marked)),
        ("(d) mouth open, original UVs", it.panel(NEAR, FRAME)),
        ("(e) mouth open, vrtm", it.panel(NEAR, FRAME, True)),
    ]
    return {"paper_1.jpg": sheet.sheet([row])}, [record("face: " + it.model.notes[FRAME], solved)]
