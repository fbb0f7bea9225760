"""Draws docs/images/seams.jpg: studs on seams in Cycles, at rest, in a pose with its own UVs, with seams that are shut, and with
charts that go on beyond them.

    seams.py FOLDER-OF-ASSETS OUT.jpg
"""

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

SIZE = 2048  # texels of the textures and the map, per side
PANEL = 280, 280
TITLES = "at rest", "own UVs", "seams shut", "seams continued"
SKIN, STUD = np.array([0.30, 0.13, 0.085]), np.array([0.85, 0.72, 0.42])
# An asset, the frame, the tile, the studs' radius in parts of the mesh's extent, the vertex on a seam that is looked at, and
# the width of the view.
VIEWS = (
    ("cesium_man", 3, 1001, 0.014, 2101, 0.12),
    ("fox", 3, 1001, 0.018, 228, 0.16),
    ("ict_inner", 5, 1004, 0.005, 4418, 0.04),
)


def on_seams(mesh):
    """The vertices that have several UVs, in a random order."""
    pairs = np.unique(np.stack([mesh.triangles.ravel(), mesh.uv_triangles.ravel()], -1), axis=0)
    vertices, counts = np.unique(pairs[:, 0], return_counts=True)
    return np.random.default_rng(5).permutation(vertices[counts > 1])


def material(tree, colour, redirect):
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    node = blender.image_texture(tree, colour, data=False)
    if redirect is not None:
        recipe = {}
        exec(document("Blender", "python"), recipe)
        recipe["redirect"](node, str(redirect))
    shader.inputs["Roughness"].default_value = 0.6
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(shader.outputs[0], out.inputs["Surface"])


def panel(mesh, view, tile, colour, redirect):
    vertex, width = view
    at = mesh.pose[vertex]
    corners = mesh.pose[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    near = np.linalg.norm(corners.mean(1) - at, axis=1) < 0.3 * width
    near |= (mesh.triangles == vertex).any(1)
    normal = normals[near].sum(0)
    uvs = mesh.uvs[mesh.uv_triangles] - [(tile - 1001) % 10, (tile - 1001) // 10]
    of_tile = ((uvs.mean(1) > 0) & (uvs.mean(1) < 1)).all(1)
    own = model.Mesh(mesh.triangles[of_tile], mesh.uvs - [(tile - 1001) % 10, (tile - 1001) // 10], mesh.pose,
                     mesh.uv_triangles[of_tile])
    place = at + 2 * width * normal / np.linalg.norm(normal)
    tree = blender.start(own, PANEL, view=(place, at, width), samples=32, smooth=True)
    scene = bpy.context.scene
    scene.cycles.max_bounces, scene.cycles.use_denoising = 1, True
    scene.view_settings.view_transform = "Standard"
    world = bpy.data.worlds.new("world")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = 0.9, 0.92, 1, 1
    scene.world = world
    material(tree, colour, redirect)
    return blender.render()


def row(assets, folder, name, frame, tile, radius, vertex, width):
    source = pathlib.Path(assets) / name
    mesh = model.asset(source, frame)
    rest = np.array([line.split()[1:4] for line in (source / "rest.obj").read_text().splitlines()
                     if line.startswith("v ")], float)
    span = np.ptp(rest, axis=0).max()
    radius *= span
    # First on seams, then all over the surface.
    vertices = np.concatenate([[vertex], on_seams(mesh), np.random.default_rng(6).permutation(len(rest))])
    centres = studs.centres(rest[vertices], 3.2 * radius)
    for path in source.glob("rigidity.*.png"):
        udim = int(path.name.split(".")[1])
        distance = studs.distances(studs.positions(mesh, rest, SIZE, udim), centres, radius)
        warp.write(folder / path.name, np.clip((1.08 - distance) * 8 + 0.5, 0, 1)[..., None])
        inside = np.clip((1 - distance) * 12 + 0.5, 0, 1)[..., None]
        warp.write(folder / f"colour.{udim}.exr", SKIN * (1 - inside) + STUD * inside)
    maps = []
    for seams in ("shut", "continue"):
        out = folder / seams
        out.mkdir()
        model.bake_asset(out, source, mesh, folder / "rigidity.<UDIM>.png", "--size", 1024, "--map-size", SIZE,
                         "--seams", seams)
        maps.append(out / f"redirect.{tile}.exr")
        uv = warp.read(maps[-1])[..., :2]
        warp.write(maps[-1], np.concatenate([uv, np.zeros_like(uv[..., :1])], -1))
    model.run("dilate", source / "rest.obj", "--texture", folder / "colour.<UDIM>.exr", "--out", folder / "dilated")
    still = model.Mesh(mesh.triangles, mesh.uvs, rest, mesh.uv_triangles)
    plain, dilated = folder / f"colour.{tile}.exr", folder / "dilated" / f"colour.{tile}.exr"
    shown = ((still, plain, None), (mesh, plain, None), (mesh, plain, maps[0]), (mesh, dilated, maps[1]))
    return np.concatenate([panel(m, (vertex, width * span), tile, c, r) for m, c, r in shown], 1)


def main(assets, out, views=VIEWS):
    rows = []
    for view in views:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row(assets, pathlib.Path(folder), *view))
    shown = np.concatenate(rows, 0)
    shown = np.clip(shown[..., :3] + (1 - shown[..., 3:]) * 0.8, 0, 1)
    shown = np.where(shown < 0.0031308, shown * 12.92, 1.055 * shown ** (1 / 2.4) - 0.055)
    strip = 40
    picture = Image.new("RGB", (shown.shape[1], shown.shape[0] + strip), "white")
    picture.paste(Image.fromarray(np.rint(shown * 255).astype(np.uint8)), (0, strip))
    draw = ImageDraw.Draw(picture)
    for i, title in enumerate(TITLES):
        draw.text((PANEL[0] * (i + 0.5), strip / 2), title, "black", ImageFont.load_default(24), anchor="mm")
    picture.save(out, quality=90)


if __name__ == "__main__":
    main(*sys.argv[1:])
