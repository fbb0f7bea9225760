"""A stage in Blender's Cycles: a model in a pose, its textures looked up through maps, light, a camera."""

import math
from dataclasses import dataclass

import blender
import bpy
import numpy as np
from checks import recipes
from mathutils import Vector

recipe = recipes("Blender")


@dataclass
class View:
    """A camera that looks at `target` (y up) from an azimuth (0 = from +z, 90 = from +x) and an elevation in degrees;
    `width` is what it sees across at the target."""

    target: tuple
    width: float
    azimuth: float = 30
    elevation: float = 15
    size: tuple = (480, 420)
    floor: float | None = None


def upright(points):
    """From y up to Blender's z up."""
    return np.asarray(points)[..., [0, 2, 1]] * [1, -1, 1]


def start(model, points, view, samples, uvs=None, subdivide=0, scale=1.0, rounded=False):
    """An empty scene with the model, camera and lights; returns the tree of its material."""
    with blender.quiet():
        bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    data = bpy.data.meshes.new("mesh")
    points = upright(points)
    polygons = np.split(model.indices, np.cumsum(model.counts)[:-1])
    data.from_pydata(points.tolist(), [], [polygon.tolist() for polygon in polygons])
    layer = data.uv_layers.new(name="UVMap")
    uvs = model.uvs[model.uv_indices] if uvs is None else uvs  # per corner
    layer.data.foreach_set("uv", uvs.astype(np.float32).ravel())
    data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
    data.update()
    body = bpy.data.objects.new("mesh", data)
    scene.collection.objects.link(body)
    if subdivide:
        # Simple: the surface that the warp was solved for, only finer. `rounded` hides the facets of a coarse mesh.
        modifier = body.modifiers.new("finer", "SUBSURF")
        modifier.subdivision_type, modifier.uv_smooth = "CATMULL_CLARK" if rounded else "SIMPLE", "NONE"
        modifier.levels = modifier.render_levels = subdivide
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    material.displacement_method = "BOTH"
    data.materials.append(material)
    camera_and_light(scene, view)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = samples, 3
    scene.cycles.use_denoising, scene.cycles.adaptive_threshold = True, 0.03
    scene.cycles.seed = 7
    scene.render.resolution_x, scene.render.resolution_y = (round(n * scale) for n in view.size)
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.view_settings.view_transform = "Raw"
    return material.node_tree


def camera_and_light(scene, view):
    target, distance = Vector(upright(view.target)), 4 * view.width
    azimuth, elevation = math.radians(view.azimuth), math.radians(view.elevation)

    def around(turn, up, far):
        a, e = azimuth + math.radians(turn), math.radians(up)
        return target + far * Vector(upright([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)]))

    def aim(thing, place):
        thing.location = place
        thing.rotation_euler = (target - place).to_track_quat("-Z", "Y").to_euler()
        scene.collection.objects.link(thing)

    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.sensor_width, camera.data.lens = 36, 36 * distance / view.width
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.clip_end = 100 * distance
    aim(camera, around(0, math.degrees(elevation), distance))
    scene.camera = camera
    # Key from the upper left, fill from the right, rim from behind.
    for turn, up, energy, size in (-50, 48, 17, 0.8), (55, 15, 3, 2.5), (160, 50, 10, 1.2):
        light = bpy.data.objects.new("light", bpy.data.lights.new("light", "AREA"))
        light.data.size = size * view.width
        light.data.energy = energy * (2.2 * view.width) ** 2
        aim(light, around(turn, up, 2.6 * view.width))
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = 0.92, 0.96, 1, 1
    world.node_tree.nodes["Background"].inputs[1].default_value = 0.36
    scene.world = world
    if view.floor is not None:
        data = bpy.data.meshes.new("floor")
        far = 20 * view.width
        corners = [(x, view.floor, z) for x, z in ((-far, -far), (far, -far), (far, far), (-far, far))]
        data.from_pydata(upright(corners).tolist(), [], [[3, 2, 1, 0]])
        floor = bpy.data.objects.new("floor", data)
        floor.is_shadow_catcher = True
        scene.collection.objects.link(floor)


# Neither, original UVs, redirected, both.
OVERLAP = (0.42, 0.44, 0.47, 1), (0.75, 0.03, 0.02, 1), (0.06, 0.52, 0.06, 1), (0.95, 0.72, 0.03, 1)


def texture(tree, path, data, redirect, smooth=False):
    node = blender.image_texture(tree, path, data=data, interpolation="Cubic" if smooth else "Linear", tiled=True)
    if redirect:
        recipe["redirect"](node, str(redirect))
    return node.outputs["Color"]


def lit(tree, folder, redirect, roughness=0.45, coat=0.0):
    """Colour and height of a folder, through the redirection if there is one."""
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(texture(tree, folder / "colour.<UDIM>.exr", True, redirect), shader.inputs["Base Color"])
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Coat Weight"].default_value, shader.inputs["Coat Roughness"].default_value = coat, 0.15
    height = texture(tree, folder / "height.<UDIM>.exr", True, redirect, smooth=True)
    node = tree.nodes.new("ShaderNodeDisplacement")
    node.inputs["Midlevel"].default_value, node.inputs["Scale"].default_value = 0, 1
    tree.links.new(node.outputs[0], out.inputs["Displacement"])
    tree.links.new(height, node.inputs["Height"])
    tree.links.new(shader.outputs[0], out.inputs["Surface"])


def overlap(tree, folder, redirect, colours=OVERLAP):
    """Red where the original UVs put what is rigid, green where the redirection does, yellow where both do."""
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    grey, here, there, both = colours
    rigid = [texture(tree, folder / "rigid.<UDIM>.exr", True, map) for map in (None, redirect)]

    def mix(weight, low, high):
        node = tree.nodes.new("ShaderNodeMix")
        node.data_type = "RGBA"
        tree.links.new(weight, node.inputs["Factor"])
        for socket, value in zip([s for s in node.inputs if s.type == "RGBA"], (low, high)):
            if isinstance(value, tuple):
                socket.default_value = value
            else:
                tree.links.new(value, socket)
        return next(s for s in node.outputs if s.type == "RGBA")

    colour = mix(rigid[1], mix(rigid[0], grey, here), mix(rigid[0], there, both))
    tree.links.new(colour, shader.inputs["Color"])
    tree.links.new(shader.outputs[0], out.inputs["Surface"])


def marked(tree, folder, redirect):
    """Rigid features in one colour."""
    overlap(tree, folder, redirect, colours=[OVERLAP[0], OVERLAP[0], OVERLAP[0], (0.04, 0.25, 0.70, 1)])


def render(model, points, view, folder, redirect=None, look=lit, samples=20, subdivide=2, uvs=None, scale=1.0, **how):
    """A panel, linear RGBA. `redirect` is the path of the maps, with <UDIM>."""
    rounded = how.pop("rounded", False)
    tree = start(model, points, view, samples, uvs, subdivide if look is lit else 2 * rounded, scale, rounded)
    look(tree, folder, redirect, **how)
    return blender.render()
