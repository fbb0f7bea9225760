"""Figure 7: more deformations of the face, the spiky fish, and the creature over six tiles."""

import sheet
import stage
from scenes import fish, lizard

from figures import fig1
from figures.common import Subject, record

SIZE = (400, 380)
FACE = stage.View((0.12, 6.50, 1.0), 1.92, azimuth=18, elevation=3, size=SIZE)
FISH = {
    0: stage.View((-0.22, 0.0, 0), 4.05, azimuth=38, elevation=10, size=SIZE),
    1: stage.View((-0.22, 0.08, 0.1), 4.25, azimuth=162, elevation=26, size=SIZE),
}
FAR = stage.View((0.35, 0.60, 0.25), 10.0, azimuth=58, elevation=36, size=(440, 280), floor=0.0)
NEAR = stage.View((0.35, 1.1, 0.9), 3.0, azimuth=58, elevation=40, size=(440, 310), floor=0.0)
FRAMES = {"face": 5, "creature": 3}


def spiky_fish(options, size=2048, grid=1024):
    model = fish.build()
    painted = fish.spikes(model, size)
    model.write(options.scenes / model.name)
    return Subject(options, "fish", model, painted, grid, subdivide=4, roughness=0.40, coat=0.25)


def creature(options, size=1024, grid=1024):
    model = lizard.build()
    painted = lizard.scales(model, size)
    model.write(options.scenes / model.name)
    return Subject(options, "creature", model, painted, grid, subdivide=2, roughness=0.42)


def face(options):
    it, frame = fig1.subject(options), FRAMES["face"]
    result = record("face: " + it.model.notes[frame], it.solve(frame))
    return {"paper_7_face.jpg": sheet.sheet([it.comparison(FACE, frame)])}, [result]


def fishes(options):
    it, rows, results = spiky_fish(options), [], []
    for frame, view in FISH.items():
        results.append(record("spiky fish: " + it.model.notes[frame], it.solve(frame)))
        rows.append(it.comparison(view, frame))
    return {"paper_7_fish.jpg": sheet.sheet(rows)}, results


def long(options):
    it, frame = creature(options), FRAMES["creature"]
    result = record("long creature: " + it.model.notes[frame], it.solve(frame))
    rows = [it.comparison(FAR, frame), it.comparison(NEAR, frame, ("closer", "", "", ""))]
    return {"paper_7_creature.jpg": sheet.sheet(rows)}, [result]


def make(options):
    pictures, results = {}, []
    for part in fishes, long, face:
        if part is face and not (options.assets / "mh_face").is_dir():
            print(f"figure 7: the face left out, {options.assets / 'mh_face'} is not there (option --assets)")
            continue
        made, lines = part(options)
        pictures, results = pictures | made, results + lines
    return pictures, results
