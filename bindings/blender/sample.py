#!/usr/bin/env python3
"""Makes the sample file: the arm of a creature that bends, with studs in its colour and bump map, and the image that
says where it is rigid, all packed. It is made for the add-on, and does not need it.

    blender --background --python sample.py -- arm.blend
    python sample.py arm.blend                             # with Blender's Python module

The rigidity image is the same studs a little larger.
"""

from __future__ import annotations

import math
import os
import sys

import bpy
import numpy as np

SIZE = 1024
# The arm's length and the place of its elbow, along x.
LENGTH, ELBOW = 4.0, 1.75


def nodes_of(data: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """The node tree of a new material or world, which has to be asked for before Blender 5."""
    if bpy.app.version < (5, 0, 0):
        data.use_nodes = True
    return data.node_tree


def rgba(values: np.ndarray) -> np.ndarray:
    return np.stack([values, values, values, np.ones_like(values)], -1).astype(np.float32)


def radius(x: np.ndarray) -> np.ndarray:
    """A shoulder, an upper arm, an elbow, a forearm and a wrist."""
    stations = [0.0, 0.5, 1.1, 1.75, 2.3, 3.0, 3.7, 4.0]
    radii = [0.56, 0.60, 0.55, 0.44, 0.50, 0.42, 0.28, 0.27]
    # Smooth between the stations: a cubic through them.
    fine = np.interp(x, stations, radii)
    kernel = np.exp(-((np.arange(-40, 41) / 16.0) ** 2))
    kernel /= kernel.sum()
    padded = np.concatenate([np.repeat(fine[:1], 40), fine, np.repeat(fine[-1:], 40)])
    return np.convolve(padded, kernel, "valid")


def radius_at(x: float) -> float:
    at = np.linspace(0, LENGTH, 241)
    return float(np.interp(x, at, radius(at)))


def node_of(tree: bpy.types.NodeTree, kind: str) -> bpy.types.Node:
    """The first node of a kind."""
    return next(node for node in tree.nodes if node.bl_idname == kind)


def add_texture(image: bpy.types.Image, socket: bpy.types.NodeSocket) -> bpy.types.Node:
    """A new Image Texture node, whose colour goes into a socket."""
    tree = socket.id_data
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs["Color"], socket)
    return texture


def add_mesh(name: str, points, faces=(), uvs: np.ndarray | None = None) -> bpy.types.Object:
    """A mesh with the UVs of its corners, (corners, 2), in the scene; active, and selected."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(points).tolist(), [], np.asarray(faces).tolist())
    if uvs is not None:
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.ravel(uvs).astype(np.float32))
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    return obj


def tube(along: int, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The quads of rings of vertices behind one another, (faces, 4), and u along it and v around it at their corners,
    both from 0 to 1."""
    i, j = np.divmod(np.arange(along * around), around)
    first, after = i * around + j, i * around + (j + 1) % around
    faces = np.stack([first, first + around, after + around, after], -1)
    u, v = np.stack([i, i + 1, i + 1, i], -1) / along, np.stack([j, j, j + 1, j + 1], -1) / around
    return faces, u, v


def add_key(obj: bpy.types.Object, name: str, moved: np.ndarray, first: int, last: int) -> None:
    """A shape key, from 0 in the first frame to 1 in the last one."""
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name=name)
    key.data.foreach_set("co", moved.astype(np.float32).ravel())
    for frame, value in ((first, 0.0), (last, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def skin(along: int = 240, around: int = 96) -> bpy.types.Object:
    """The arm at rest, along x; u runs along it, and v around it, with the seam underneath."""
    x = np.linspace(0, LENGTH, along + 1)
    angle = np.linspace(-np.pi, np.pi, around + 1)[:-1]
    r = radius(x)[:, None]
    # Muscles: wider at the side of the bend.
    swell = 1 + 0.12 * np.exp(-(((x[:, None] - 1.0) / 0.55) ** 2)) * np.cos(angle[None] - 0.6)
    points = np.stack(
        [np.broadcast_to(x[:, None], (along + 1, around)), r * swell * np.sin(angle), r * swell * np.cos(angle)], -1
    )
    faces, u, v = tube(along, around)
    obj = add_mesh("skin", points.reshape(-1, 3), faces, np.stack([u, 0.03 + 0.94 * v], -1))
    obj.data.shade_smooth()
    return obj


def bones(
    obj: bpy.types.Object, name: str, elbow: float, length: float, lower: np.ndarray, bends: dict[int, float]
) -> bpy.types.Object:
    """Two bones along x, with the weight of the lower one at each vertex; `bends` has its degrees by frames."""
    armature = bpy.data.armatures.new(name)
    holder = bpy.data.objects.new(name, armature)
    bpy.context.collection.objects.link(holder)
    bpy.context.view_layer.objects.active = holder
    bpy.ops.object.mode_set(mode="EDIT")
    first, second = armature.edit_bones.new("upper"), armature.edit_bones.new("lower")
    first.head, first.tail, second.head, second.tail = (0, 0, 0), (elbow, 0, 0), (elbow, 0, 0), (length, 0, 0)
    second.parent = first
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone, weights in (("upper", 1 - lower), ("lower", lower)):
        group = obj.vertex_groups.new(name=bone)
        for index, value in enumerate(weights.tolist()):
            group.add([index], value, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = holder
    bone = holder.pose.bones["lower"]
    bone.rotation_mode = "XYZ"
    for frame, degrees in bends.items():
        # The bone's own z is across the bend.
        bone.rotation_euler[2] = math.radians(degrees)
        bone.keyframe_insert("rotation_euler", frame=frame)
    return holder


def rig(obj: bpy.types.Object) -> None:
    """Bones with soft weights, and a biceps that swells; frame 1 at rest, frame 20 bent."""
    rest = np.array([vertex.co[:] for vertex in obj.data.vertices])
    t = np.clip((rest[:, 0] - ELBOW + 0.75) / 1.5, 0, 1)
    bones(obj, "rig", ELBOW, LENGTH, t * t * (3 - 2 * t), {1: 0, 20: 88})
    # On the inner side of the bend, and smooth all around.
    side = 0.5 + 0.5 * np.sin(np.arctan2(rest[:, 1], rest[:, 2]) + 0.25)
    bulge = np.exp(-(((rest[:, 0] - 0.9) / 0.5) ** 2)) * side**2
    moved = rest.copy()
    moved[:, 1:] *= 1 + 0.7 * bulge[:, None]
    add_key(obj, "biceps", moved, 1, 20)


def paint() -> dict[str, np.ndarray]:
    """Height, colour and rigidity of the skin: rows of round studs, bottom row first."""
    # What is painted is round on the arm at rest: v is as wide as the arm is there.
    circumference = 2 * np.pi * 0.45
    rng = np.random.default_rng(3)
    rows, columns = 12, round(12 * LENGTH / circumference)
    jitter = rng.uniform(-0.1, 0.1, (columns + 2, rows, 2))
    size = rng.uniform(0.85, 1.15, (columns + 2, rows))
    grain = rng.normal(size=(SIZE // 4, SIZE // 4))
    grain = np.kron(grain, np.ones((4, 4)))
    for _ in range(6):
        grain = (grain + np.roll(grain, 3, 0) + np.roll(grain, 3, 1) + np.roll(grain, (-2, 2), (0, 1))) / 4
    at = (np.arange(SIZE) + 0.5) / SIZE
    u, v = np.meshgrid(at * LENGTH, (at - 0.03) / 0.94 * circumference)
    nearest = np.full((SIZE, SIZE), 9.0)
    for i in range(columns):
        for j in range(rows):
            centre = (
                (i + 0.5 + jitter[i, j, 0]) * LENGTH / columns,
                (j + 0.5 + 0.5 * (i % 2) + jitter[i, j, 1]) % rows * circumference / rows,
            )
            # A stud keeps away from the seam, where nothing can move.
            if not 0.2 < centre[1] < circumference - 0.2:
                continue
            near = slice(*np.clip(np.searchsorted(u[0], [centre[0] - 0.25, centre[0] + 0.25]), 0, SIZE))
            across = slice(*np.clip(np.searchsorted(v[:, 0], [centre[1] - 0.3, centre[1] + 0.3]), 0, SIZE))
            wide = radius_at(centre[0]) / 0.45
            # Smaller where the arm is thin, or they would touch.
            scale = size[i, j] * min(wide, 1.1)
            distance = np.hypot(u[across, near] - centre[0], (v[across, near] - centre[1]) * wide) / scale
            nearest[across, near] = np.minimum(nearest[across, near], distance)
    inside = np.clip(1 - (nearest / 0.092) ** 2, 0, 1)
    height = 0.5 * np.sqrt(inside) + 0.008 * grain
    edge = np.clip((0.092 - nearest) * 90 + 0.5, 0, 1)
    ring = np.exp(-(((nearest - 0.1) / 0.014) ** 2))
    base, stud = np.array([0.16, 0.27, 0.17]), np.array([0.78, 0.62, 0.33])
    stripes = 0.5 + 0.5 * np.sin(v * 2 * np.pi / circumference * 3 + np.sin(u * 2.4) * 0.6)
    base = base[None, None] * (0.75 + 0.5 * stripes[..., None]) * (1 + 0.06 * grain[..., None])
    colour = base * (1 - edge[..., None]) + stud * edge[..., None] * (0.8 + 0.3 * inside[..., None])
    colour *= 1 - 0.55 * ring[..., None]
    alpha = np.ones((SIZE, SIZE, 1))
    return {
        "height": rgba(np.clip(height + 0.2, 0, 1)),
        "colour": np.concatenate([np.clip(colour, 0, 1), alpha], -1).astype(np.float32),
        "rigidity": rgba(np.clip((0.104 - nearest) * 90 + 0.5, 0, 1)),
    }


def image(name: str, pixels: np.ndarray) -> bpy.types.Image:
    """A packed image: heights as floats, since a bump map shows the steps of 8 bits."""
    made = bpy.data.images.new(name, SIZE, SIZE, float_buffer=name == "height", is_data=name != "colour")
    made.pixels.foreach_set(pixels.ravel())
    made.pack()
    return made


def material(obj: bpy.types.Object, colour: bpy.types.Image, height: bpy.types.Image) -> None:
    made = bpy.data.materials.new("skin")
    tree = nodes_of(made)
    shader = node_of(tree, "ShaderNodeBsdfPrincipled")
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.9, 0.09
    shader.inputs["Roughness"].default_value = 0.42
    for picture, socket in ((colour, shader.inputs["Base Color"]), (height, bump.inputs["Height"])):
        add_texture(picture, socket).extension = "EXTEND"
    tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    obj.data.materials.append(made)


def stage() -> None:
    """Camera, three lights and a floor."""
    from mathutils import Vector

    scene = bpy.context.scene

    def aim(obj, place, target):
        obj.location = place
        obj.rotation_euler = (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
        bpy.context.collection.objects.link(obj)

    centre = (1.2, 0.72, 0.0)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.lens = 82
    aim(camera, (3.4, -2.6, 7.2), centre)
    scene.camera = camera
    for name, place, energy, size, colour in (
        ("key", (-2.5, -3.0, 5.0), 650, 2.0, (1.0, 0.95, 0.88)),
        ("fill", (6.0, 1.0, 4.0), 160, 4.0, (0.8, 0.9, 1.0)),
        ("rim", (0.5, 5.5, 2.5), 420, 2.0, (1.0, 0.9, 0.8)),
    ):
        light = bpy.data.lights.new(name, "AREA")
        light.energy, light.size, light.color = energy, size, colour
        aim(bpy.data.objects.new(name, light), place, centre)
    world = bpy.data.worlds.new("world")
    scene.world = world
    node_of(nodes_of(world), "ShaderNodeBackground").inputs["Color"].default_value = (0.045, 0.05, 0.06, 1)
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 48
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 3
    scene.render.resolution_x, scene.render.resolution_y = 900, 675
    scene.render.image_settings.file_format = "PNG"


def make() -> bpy.types.Object:
    """The scene, before the add-on is used."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    obj = skin()
    rig(obj)
    painted = paint()
    material(obj, image("colour", painted["colour"]), image("height", painted["height"]))
    stage()
    # Nothing uses it until the add-on does.
    image("rigidity", painted["rigidity"]).use_fake_user = True
    bpy.context.view_layer.objects.active = obj
    bpy.context.scene.frame_end = 20
    return obj


def save(path: str) -> None:
    """As the file is to be opened: at the bent frame, with Object Data shown, in Material Preview."""
    bpy.context.scene.frame_set(20)
    for screen in bpy.data.screens:
        for space in (area.spaces.active for area in screen.areas):
            if space.type == "VIEW_3D":
                space.shading.type = "MATERIAL"
                space.region_3d.view_perspective = "CAMERA"
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)


def main(arguments: list[str]) -> None:
    if len(arguments) != 1:
        sys.exit("sample.py: name the file to be written")
    make()
    save(os.path.abspath(arguments[0]))


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
