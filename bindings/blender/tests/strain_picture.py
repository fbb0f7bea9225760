"""Makes docs/images/blender_strain.jpg: the sample arm as rendered and by Show Strain, with its own UVs and with vrtm.

VRTM_PICTURES=FOLDER python -m pytest strain_picture.py     # conftest.py installs the add-on
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import sample
from PIL import Image, ImageDraw, ImageFont
from support import Case, bpy, part

WIDTH, HEIGHT, STRIP, GAP, FOOT = 560, 400, 46, 10, 64
INK, BACK = (20, 20, 20), (56, 58, 61, 255)


class TestPicture(Case):
    def test_picture(self):
        self.folder = Path(os.environ["VRTM_PICTURES"])
        obj = self.arm()
        self.draw("own")
        bpy.ops.vrtm.set_up()
        settings = obj.vrtm
        settings.live, settings.grid, settings.render_grid, settings.quality = False, 1024, 1024, "normal"
        self.update()
        self.draw("vrtm")
        flat = bpy.data.materials.new("flat")
        tree = sample.nodes_of(flat)
        shader = sample.node_of(tree, "ShaderNodeBsdfPrincipled")
        shader.inputs["Roughness"].default_value = 0.6
        node = tree.nodes.new("ShaderNodeVertexColor")
        node.layer_name = part("overlay").NAME
        tree.links.new(node.outputs[0], shader.inputs["Base Color"])
        skin = obj.data.materials[0]
        for settings.strain in ("BEFORE", "AFTER"):
            self.update()
            obj.data.materials[0] = flat
            self.draw(settings.strain)
            obj.data.materials[0] = skin
        self.compose().save(self.folder / "blender_strain.jpg", quality=88, optimize=True, progressive=True)

    def arm(self):
        """Finer than the sample's, so that the colours of vertices follow the studs."""
        coarse, sample.skin = sample.skin, lambda: coarse(480, 192)
        obj, sample.skin = sample.make(), coarse
        scene = bpy.context.scene
        scene.frame_set(20)
        scene.render.resolution_x, scene.render.resolution_y, scene.render.film_transparent = WIDTH, 430, True
        scene.cycles.samples, scene.cycles.use_denoising, scene.camera.data.lens = 12, True, 100
        return obj

    def draw(self, name):
        bpy.context.scene.render.filepath = str(self.folder / f"{name}.png")
        bpy.ops.render.render(write_still=True)

    def compose(self):
        width = 2 * WIDTH + GAP
        out = Image.new("RGB", (width, STRIP + 2 * HEIGHT + GAP + FOOT), (255, 255, 255))
        draw, large, small, tiny = ImageDraw.Draw(out), *map(ImageFont.load_default, (24, 20, 15))
        for column, (title, *names) in enumerate((("its own UVs", "own", "BEFORE"), ("vrtm", "vrtm", "AFTER"))):
            left = column * (WIDTH + GAP)
            draw.text((left + WIDTH / 2, STRIP / 2), title, INK, large, anchor="mm")
            for row, (name, label) in enumerate(zip(names, ("as rendered", "Show Strain"), strict=True)):
                drawn, top = Image.open(self.folder / f"{name}.png").convert("RGBA"), STRIP + row * (HEIGHT + GAP)
                whole = Image.new("RGBA", drawn.size, BACK)
                whole.alpha_composite(drawn)
                out.paste(whole.convert("RGB").crop((0, 18, WIDTH, 18 + HEIGHT)), (left, top))
                draw.text((left + WIDTH - 14, top + HEIGHT - 18), label, (225, 225, 225), small, anchor="rm")
        strain = part("strain")
        shown = strain.colours(np.linspace(-strain.FULL, strain.FULL, 360))[:, :3]
        shown = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
        bar = Image.fromarray(np.rint(np.tile(shown, (22, 1, 1)) * 255).astype(np.uint8))
        left, y = (width - 360) // 2, STRIP + 2 * HEIGHT + GAP + FOOT // 2
        out.paste(bar, (left, y - 11))
        draw.text((left - 14, y), "squeezed by a fifth", INK, small, anchor="rm")
        draw.text((left + 374, y), "stretched by a quarter", INK, small, anchor="lm")
        draw.text((left + 180, y + 23), "as at rest", (90, 90, 90), tiny, anchor="mm")
        return out
