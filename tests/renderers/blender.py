"""Scenes and renders in Blender, as a Python module."""

import os
import pathlib
import sys
import tempfile

import bpy
import numpy as np

import warp


class quiet:
    """Blender prints on the process's stdout whatever Python does; kept apart from the checks' lines."""

    def __enter__(self):
        sys.stdout.flush()
        self.kept = os.dup(1)
        sink = os.open(os.devnull, os.O_WRONLY)
        os.dup2(sink, 1)
        os.close(sink)

    def __exit__(self, *_):
        sys.stdout.flush()
        os.dup2(self.kept, 1)
        os.close(self.kept)


def start(mesh, size, samples=16, engine="CYCLES", osl=False, smooth=False):
    """An empty scene with the mesh, a camera without perspective that sees all of it, and no view transform."""
    with quiet():
        bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    data = bpy.data.meshes.new("mesh")
    data.from_pydata(mesh.pose.tolist(), [], mesh.triangles.tolist())
    layer = data.uv_layers.new(name="UVMap")
    layer.data.foreach_set("uv", mesh.uvs[mesh.uv_triangles].astype(np.float32).ravel())
    data.polygons.foreach_set("use_smooth", [smooth] * len(data.polygons))
    data.update()
    shape = bpy.data.objects.new("mesh", data)
    scene.collection.objects.link(shape)
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    data.materials.append(material)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    scene.collection.objects.link(camera)
    scene.camera = camera
    low, high = mesh.pose.min(0), mesh.pose.max(0)
    centre, extent = (low + high) / 2, high - low
    camera.location = (centre[0], centre[1], high[2] + 1)
    camera.data.ortho_scale = extent[0] * 1.02
    camera.data.clip_end = 1000
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.engine = engine
    scene.view_settings.view_transform = "Raw"
    if engine == "CYCLES":
        scene.cycles.samples = samples
        scene.cycles.use_adaptive_sampling = False
        scene.cycles.use_denoising = False
        scene.cycles.max_bounces = 0
        scene.cycles.shading_system = osl
    return material.node_tree


def emission(tree):
    """An empty tree that shows a colour as it is; returns the socket that takes it."""
    tree.nodes.clear()
    return emission_of(tree)


def emission_of(tree):
    """As `emission`, in a tree that keeps its other nodes."""
    shader, out = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    out.is_active_output = True
    tree.links.new(shader.outputs[0], out.inputs["Surface"])
    return shader.inputs["Color"]


def image_texture(tree, path, data=True, extension="EXTEND", interpolation="Linear", tiled=False):
    """An Image Texture node of a file; a UDIM set if `tiled` (the path with <UDIM>)."""
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = load(path, tiled)
    if data:
        node.image.colorspace_settings.name = "Non-Color"
    node.extension, node.interpolation = extension, interpolation
    return node


def load(path, tiled=False):
    image = bpy.data.images.load(str(path).replace("<UDIM>", "1001"))
    if tiled:
        image.source = "TILED"
        image.filepath = str(path)
    return image


def render():
    """The picture as f64 RGBA, as linear values."""
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(pathlib.Path(folder) / "picture.exr")
        with quiet():
            bpy.ops.render.render(write_still=True)
        return warp.read(scene.render.filepath)
