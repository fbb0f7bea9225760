"""Figure 6: a model that is edited again and again."""

import shapes
import sheet
import stage
from PIL import Image
from scenes import mug

from figures.common import Subject, record

STEPS = 1, 2, 3, 4  # belly, neck, spout, twist
VIEW = stage.View((0.12, 1.5, 0), 4.1, azimuth=-22, elevation=13, size=(300, 330), floor=0.0)
SCALE, BOX = 1.7, (0.26, 0.40, 0.66, 0.80)  # closeups: of pictures twice as large, this part


def subject(options, size=2048, grid=1024):
    folder = options.scenes / "mug_to_jug"
    model = shapes.read(folder)
    return Subject(
        options, "mug", model, mug.glaze(model, size), grid, subdivide=3, rounded=True, roughness=0.30, coat=0.5
    )


def legend(size):
    """Legend of the rows."""
    image = Image.new("RGB", size, "white")
    lines = (
        "rows, from the top:",
        "closer, original UVs",
        "closer, vrtm",
        "original UVs",
        "vrtm",
        "rigid with original UVs (red),",
    )
    for k, line in enumerate((*lines, "with vrtm (green), both (yellow)")):
        sheet.write(image, (size[0] / 2, 70 + 30 * k), line, 17)
    return image


def make(options):
    it, results = subject(options), []
    wide, high = VIEW.size
    box = [round(x * side * SCALE) for x, side in zip(BOX, (wide, high, wide, high))]

    def pair(image, colour):
        """The whole and the closeup."""
        near = image.crop(box).resize((wide, round(wide * (box[3] - box[1]) / (box[2] - box[0]))), Image.LANCZOS)
        return sheet.frame(image, box, colour, 4).resize((wide, high), Image.LANCZOS), near

    rows = [[], [], [], [], []]
    whole, near = pair(it.panel(VIEW, scale=SCALE), (60, 60, 60))
    marked = it.panel(VIEW, look=stage.marked)
    for row, image in zip(rows, (near, legend(near.size), whole, whole, marked)):
        row.append(("" if row is not rows[0] else "at rest", image))
    for frame in STEPS:
        results.append(record("mug to jug: " + it.model.notes[frame], it.solve(frame)))
        before, ours = (it.panel(VIEW, frame, redirected, scale=SCALE) for redirected in (False, True))
        (whole, near), (ours, closer) = pair(before, (200, 30, 20)), pair(ours, (20, 130, 20))
        over = it.panel(VIEW, frame, True, stage.overlap)
        for row, image in zip(rows, (near, closer, whole, ours, over)):
            row.append((it.model.notes[frame] if row is rows[0] else "", image))
    return {"paper_6.jpg": sheet.sheet(rows)}, results
