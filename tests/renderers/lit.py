"""Renders that show normals: as colours, and lit by a low sun."""

import math

import bpy
import numpy as np

import blender
import scene
from picture import Difference


def normals(build, osl=False):
    """World normals of the model, as vectors and the alpha of the pixels, with what `build(tree)` returns as normal."""
    tree = _start(osl)
    colour = blender.emission(tree)
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value = scale.inputs[2].default_value = 0.5, 0.5, 0.5
    tree.links.new(build(tree), scale.inputs[0])
    tree.links.new(scale.outputs[0], colour)
    return blender.render()


def lit(build, osl=False):
    tree = _start(osl)
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = 0.8, 0.8, 0.8, 1
    tree.links.new(shader.outputs[0], out.inputs["Surface"])
    tree.links.new(build(tree), shader.inputs["Normal"])
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.use_shadow = 3, False
    light = bpy.data.objects.new("sun", sun)
    light.rotation_euler = math.radians(55), 0, math.radians(-40)
    bpy.context.scene.collection.objects.link(light)
    return blender.render()


def _start(osl):
    tree = blender.start(scene.mesh(), scene.SIZE, samples=8, osl=osl, smooth=True)
    scene.corner_uvs(bpy.data.objects["mesh"].data)
    return tree


def normal_map(tree, colour=None, uv_map="UVMap"):
    node = tree.nodes.new("ShaderNodeNormalMap")
    node.uv_map = uv_map
    if colour:
        tree.links.new(colour, node.inputs["Color"])
    return node


class Truth:
    """The studs' normals as they have to be, from a texture that was warped and turned in f64."""

    def __init__(self, osl=False):
        # With OSL even nodes filter as they do there, so that the truth does, too.
        self.osl = osl
        build = lambda tree: normal_map(tree, scene.plain("normals_truth")(tree)).outputs[0]
        self.normals, self.lit = normals(build, osl), lit(build, osl)
        smooth = normals(lambda tree: tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"])
        # Where there is a stud. Skin without one has the same normals whatever is done, and would dilute the figures.
        self.stud = np.abs(self.normals - smooth)[..., :3].max(-1) > 0.01
        self.stud &= (self.normals[..., 3] > 0.999) & (smooth[..., 3] > 0.999)

    def compare(self, build):
        """Degrees between normals on studs, as mean, 99th percentile and largest; and the lit pictures' difference."""
        a, b = (x[..., :3][self.stud] * 2 - 1 for x in (normals(build, self.osl), self.normals))
        cosine = (a * b).sum(1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        degrees = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        figures = degrees.mean(), np.percentile(degrees, 99), degrees.max()
        return figures, Difference(lit(build, self.osl), self.lit)


def text(result):
    degrees, difference = result
    return "{:.2f} / {:.1f} / {:.1f} degrees".format(*degrees) + f", lit {difference} of 255"
