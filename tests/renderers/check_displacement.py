"""Cycles with nodes: vector displacement in tangent space under the redirection, on a mesh that is finer than its studs."""

import bpy
import numpy as np

import blender
import fixture
import model
import scene
import warp
from checks import check, document, run

recipe = {}
exec(document("Blender", "python"), recipe)
exec(document("Normal maps and vector displacement in Blender", "python"), recipe)


def displaced(name=None, redirected=False, turned=False):
    """Point of the surface that each pixel sees: UVs and height z, with alpha. The camera looks along z."""
    tree = blender.start(scene.mesh(192), scene.SIZE, samples=4, smooth=True)
    colour = blender.emission(tree)
    bpy.data.materials["material"].displacement_method = "DISPLACEMENT"
    node, target = scene.texture(tree, name or "displacement"), tree.nodes.new("ShaderNodeVectorDisplacement")
    target.inputs["Midlevel"].default_value, target.inputs["Scale"].default_value = 0, 1
    tree.links.new(node.outputs["Color"], target.inputs["Vector"])
    if redirected:
        recipe["redirect"](node, str(scene.FOLDER / "udim.<UDIM>.exr"))
    if turned:
        recipe["turn"](node, target, str(scene.FOLDER / "jacobian.<UDIM>.exr"))
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    if name:
        tree.links.new(target.outputs[0], output.inputs["Displacement"])
    place, split, join = (tree.nodes.new("ShaderNode" + kind) for kind in ("NewGeometry", "SeparateXYZ", "CombineXYZ"))
    uv, parts = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(uv.outputs["UV"], parts.inputs[0])
    tree.links.new(place.outputs["Position"], split.inputs[0])
    for i, socket in enumerate((parts.outputs["X"], parts.outputs["Y"], split.outputs["Z"])):
        tree.links.new(socket, join.inputs[i])
    tree.links.new(join.outputs[0], colour)
    return blender.render()


def vectors():
    """In percent of the longest displacement, at pixels that see a stud. What leans hides a few pixels' worth of surface
    behind it, which is seen or not: hence no bound on the largest."""
    most = max(np.linalg.norm(fixture.displacement(warp.centres(256, 256), tile), axis=-1).max()
               for tile in model.STUDS)
    truth, flat = displaced("displacement_truth"), displaced()
    inside = (truth[..., 3] > 0.999) & (flat[..., 3] > 0.999)
    stud = inside & (np.abs(truth - flat)[..., :3].max(-1) > 0.1 * most)

    def figures(picture):
        off = np.linalg.norm((picture - truth)[..., :3][stud & (picture[..., 3] > 0.999)], axis=-1) / most * 100
        return off.mean(), np.percentile(off, 99), off.max()

    def text(values):
        return "{:.2f} / {:.1f} / {:.1f} % of the longest".format(*values)

    before = figures(displaced("displacement", True))
    after = figures(displaced("displacement", True, True))
    original = figures(displaced("displacement"))
    check("displacement: studs lean wrongly as they are", before[0] > 3, f"{text(before)}; original UVs {text(original)}")
    check("displacement: turned by the Jacobian map", after[0] < before[0] / 5 and after[1] < 5, text(after))


run(vectors)
