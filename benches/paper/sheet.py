"""Panels with titles, put together to a picture."""

import io

import numpy as np
from PIL import Image, ImageDraw, ImageFont

STRIP, GAP = 34, 8


def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear < 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


def flat(panel):
    """A rendered panel (linear RGBA, premultiplied) as an image over white."""
    shown = srgb(panel[..., :3] + (1 - panel[..., 3:]))
    return Image.fromarray(np.rint(shown * 255).astype(np.uint8))


def write(image, centre, words, size, width=None):
    """Writes words around a point, smaller if they are longer than `width` (the image's)."""
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size)
    while draw.textlength(words, font) > (width or image.width) and font.size > 9:
        font = ImageFont.load_default(font.size - 1)
    draw.text(centre, words, "black", font, anchor="mm")


def sheet(rows, size=19):
    """Rows of (title, image) to one picture; titles stand over their images, rows are centred."""
    widths = [sum(image.width for _, image in row) + GAP * (len(row) - 1) for row in rows]
    heights = [max(image.height for _, image in row) + (STRIP if any(t for t, _ in row) else GAP) for row in rows]
    picture = Image.new("RGB", (max(widths), sum(heights)), "white")
    top = 0
    for row, width, height in zip(rows, widths, heights):
        left = (picture.width - width) // 2
        strip = STRIP if any(title for title, _ in row) else GAP
        for title, image in row:
            if title:
                write(picture, (left + image.width / 2, top + strip / 2), title, size, image.width)
            picture.paste(image.convert("RGB"), (left, top + strip))
            left += image.width + GAP
        top += height
    return picture


def frame(image, box, colour, width=3):
    """The image with a box (left, top, right, bottom) drawn on it, for a closeup."""
    image = image.copy()
    ImageDraw.Draw(image).rectangle(box, outline=colour, width=width)
    return image


def save(picture, path, limit=300_000):
    """As JPEG, of the best quality that fits into `limit` bytes."""
    for quality in range(92, 40, -4):
        data = io.BytesIO()
        picture.save(data, "JPEG", quality=quality, optimize=True, progressive=True)
        if data.tell() < limit:
            break
    path.write_bytes(data.getvalue())
    return data.tell()
