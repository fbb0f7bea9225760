"""Draws docs/images/head.jpg: a head with metal studs in Cycles, at rest, and in a pose without and with the redirection.

    figure.py FOLDER-OF-ASSETS OUT.jpg
"""

import math
import pathlib
import sys
import tempfile

import bpy
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import blender
import model
import studs
import warp
from checks import document

SIZE = 4096  # texels of the textures and the map, per side
GRID = 2048
FRAME = 1
PANEL = 560, 620
TITLES = "at rest", "mouth open: its own UVs", "mouth open: vrtm"


def clear_of_borders(place):
    """Points of the surface at which studs keep clear of chart borders, in a random order."""
    clear = ~np.isnan(place[..., 0])
    for _ in range(SIZE * 24 // 2048):
        clear[1:-1, 1:-1] &= clear[:-2, 1:-1] & clear[2:, 1:-1] & clear[1:-1, :-2] & clear[1:-1, 2:]
    return [place[y, x] for y, x in np.random.default_rng(3).permutation(np.argwhere(clear))[:6000]]


def material(tree, folder, redirect):
    """Metal studs with a rim on skin: colour, metal and a bump map, each looked up through the redirection."""
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.9, 0.06
    for name, data, socket in ("colour", False, shader.inputs["Base Color"]), ("metal", True, shader.inputs["Metallic"]), \
            ("height", True, bump.inputs["Height"]):
        # A bump follows the height's slope, which jumps at every texel unless the lookup is smooth: rims get teeth.
        interpolation = "Cubic" if name == "height" else "Linear"
        node = blender.image_texture(tree, folder / f"{name}.exr", data=data, interpolation=interpolation)
        if redirect:
            recipe = {}
            exec(document("Blender", "python"), recipe)
            recipe["redirect"](node, str(redirect))
        tree.links.new(node.outputs["Color"], socket)
    shader.inputs["Roughness"].default_value = 0.38
    tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    tree.links.new(shader.outputs[0], out.inputs["Surface"])


def panel(mesh, folder, redirect):
    # Blender's up is z, the head's is y.
    mesh = model.Mesh(mesh.triangles, mesh.uvs, mesh.pose[:, [0, 2, 1]] * [1, -1, 1], mesh.uv_triangles)
    low, high = mesh.pose.min(0), mesh.pose.max(0)
    span = high[2] - low[2]
    target = 0.02 * span, low[1] + 0.35 * span, high[2] - 0.73 * span
    place = target[0] + span, target[1] - 3 * span, target[2] + 0.1 * span
    tree = blender.start(mesh, PANEL, view=(place, target, 0.62 * span), samples=64, smooth=True)
    scene = bpy.context.scene
    scene.cycles.max_bounces, scene.cycles.use_denoising = 2, True
    scene.view_settings.view_transform = "Standard"
    world = bpy.data.worlds.new("world")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = 0.75, 0.78, 0.85, 1
    world.node_tree.nodes["Background"].inputs[1].default_value = 0.55
    scene.world = world
    for angles, energy in ((45, 0, 60), 2.6), ((70, 0, -50), 1.0):
        light = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
        light.data.energy, light.data.angle = energy, 0.2
        light.rotation_euler = [math.radians(a) for a in angles]
        scene.collection.objects.link(light)
    material(tree, folder, redirect)
    return blender.render()


def main(assets, out):
    source = pathlib.Path(assets) / "mh_face"
    mesh = model.asset(source, FRAME)
    rest = np.array([line.split()[1:4] for line in (source / "rest.obj").read_text().splitlines()
                     if line.startswith("v ")], float)
    place = studs.positions(mesh, rest, SIZE)
    scale = rest[:, 1].max() - rest[:, 1].min()
    radius = 0.021 * scale
    distance = studs.distances(place, studs.centres(clear_of_borders(place), 2.7 * radius), radius)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        warp.write(folder / "rigidity.1001.png", np.clip((1.08 - distance) * 8 + 0.5, 0, 1)[..., None])
        model.bake_asset(folder, source, mesh, folder / "rigidity.<UDIM>.png", "--size", GRID, "--map-size", SIZE)
        inside = np.clip((1 - distance) * 12 + 0.5, 0, 1)[..., None]
        # Flatter than a half sphere, whose rim is vertical: no texture resolves that.
        dome = 0.8 * np.maximum(1 - distance ** 2, 0)
        groove = 0.25 * np.exp(-((distance - 1.08) / 0.12) ** 2)
        skin, metal = np.array([0.32, 0.12, 0.075]), np.array([0.95, 0.75, 0.38])
        warp.write(folder / "colour.exr", skin * (1 - inside) * (1 - groove[..., None]) + metal * inside)
        warp.write(folder / "metal.exr", np.repeat(inside, 3, -1))
        warp.write(folder / "height.exr", np.repeat((dome - groove)[..., None], 3, -1))
        uv = warp.read(folder / "redirect.1001.exr")[..., :2]
        warp.write(folder / "map.exr", np.concatenate([uv, np.zeros_like(uv[..., :1])], -1))
        still = model.Mesh(mesh.triangles, mesh.uvs, rest, mesh.uv_triangles)
        panels = [panel(still, folder, None), panel(mesh, folder, None), panel(mesh, folder, folder / "map.exr")]
    shown = [np.clip(p[..., :3] + (1 - p[..., 3:]) * 0.8, 0, 1) for p in panels]
    shown = np.concatenate(shown, 1)
    shown = np.where(shown < 0.0031308, shown * 12.92, 1.055 * shown ** (1 / 2.4) - 0.055)
    strip = 48
    picture = Image.new("RGB", (shown.shape[1], shown.shape[0] + strip), "white")
    picture.paste(Image.fromarray(np.rint(shown * 255).astype(np.uint8)), (0, strip))
    draw = ImageDraw.Draw(picture)
    for i, title in enumerate(TITLES):
        draw.text((PANEL[0] * (i + 0.5), strip / 2), title, "black", ImageFont.load_default(28), anchor="mm")
    picture.save(out, quality=90)


if __name__ == "__main__":
    main(*sys.argv[1:])
