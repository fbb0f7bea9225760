"""Makes the pictures of the add-on's README out of the walk's screenshots, which are 1600 x 1000 pixels.

VRTM_PICTURES=FOLDER sh run.sh walk && python pictures.py FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

IMAGES = Path(__file__).resolve().parents[4] / "docs" / "images"
PAPER, INK = (255, 255, 255), (20, 20, 20)
# Left, top, right, bottom: the window without its title and its status bar.
WINDOW = (0, 50, 1600, 970)


def titled(*parts: tuple[str, Image.Image]) -> Image.Image:
    """Pictures side by side, each under its title."""
    strip, gap = 44, 12
    width = sum(picture.width for _, picture in parts) + gap * (len(parts) - 1)
    out = Image.new("RGB", (width, strip + max(picture.height for _, picture in parts)), PAPER)
    draw, left = ImageDraw.Draw(out), 0
    for title, picture in parts:
        draw.text((left + picture.width / 2, strip / 2), title, INK, ImageFont.load_default(22), anchor="mm")
        out.paste(picture, (left, strip))
        left += picture.width + gap
    return out


def main(folder: str) -> None:
    def cut(name: str, box: tuple[int, int, int, int], width: int | None = None) -> Image.Image:
        picture = Image.open(Path(folder, f"{name}.png")).convert("RGB").crop(box)
        height = round(picture.height * (width or picture.width) / picture.width)
        return picture.resize((width or picture.width, height), Image.Resampling.LANCZOS)

    # Text is never made smaller where it is to be read.
    made = {
        "opened": cut("1_opened", WINDOW, 1120),
        "set_up": cut("2_set_up", WINDOW, 1120),
        "rigidity": titled(
            ("the menu Rigidity Map", cut("3_menu", (1150, 385, 1592, 705))),
            ("Adjust Last Operation", cut("3_from_texture", (50, 650, 500, 970))),
        ),
    }
    for name, picture in made.items():
        picture.save(IMAGES / f"blender_{name}.jpg", quality=88, optimize=True, progressive=True)
        print(name, picture.size)


if __name__ == "__main__":
    main(*sys.argv[1:])
