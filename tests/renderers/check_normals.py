"""Cycles with nodes: normal maps under the redirection, and bump."""

import bpy
import numpy as np

import scene
from checks import check, recipes, run
from lit import Truth, normal_map, text

recipe = recipes("Blender", "Normal maps and vector displacement in Blender")


def redirected(tree, name):
    node = scene.texture(tree, name)
    recipe["redirect"](node, str(scene.FOLDER / "udim.<UDIM>.exr"))
    return node


def as_it_is(tree):
    return normal_map(tree, redirected(tree, "normals").outputs["Color"]).outputs[0]


def turned(tree):
    node = normal_map(tree)
    recipe["turn"](redirected(tree, "normals"), node, str(scene.FOLDER / "jacobian.<UDIM>.exr"))
    return node.outputs[0]


def other_active_uvs(tree):
    """As `turned`, on a mesh whose active UVs are not those of the redirection."""
    data, uv = bpy.data.objects["mesh"].data, tree.nodes.new("ShaderNodeUVMap")
    data.uv_layers.new(name="other").data.foreach_set("uv", [0.3] * (2 * len(data.loops)))
    data.uv_layers["other"].active_render = True
    uv.uv_map = "UVMap"
    texture, node = scene.texture(tree, "normals"), normal_map(tree)
    tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    recipe["redirect"](texture, str(scene.FOLDER / "udim.<UDIM>.exr"))
    recipe["turn"](texture, node, str(scene.FOLDER / "jacobian.<UDIM>.exr"), uv.outputs["UV"])
    return node.outputs[0]


def other_tangents(tree):
    return normal_map(tree, redirected(tree, "normals").outputs["Color"], "redirected").outputs[0]


def bump(tree):
    node = tree.nodes.new("ShaderNodeBump")
    node.inputs["Distance"].default_value = node.inputs["Strength"].default_value = 1
    tree.links.new(redirected(tree, "height").outputs["Color"], node.inputs["Height"])
    return node.outputs[0]


def normals():
    angle = np.concatenate([np.load(path) for path in sorted(scene.FOLDER.glob("angle.*.npy"))])
    print("the studs are turned by {:.1f} degrees in the median, 95 % less than {:.1f}, at most {:.1f}".format(
        *np.percentile(angle, [50, 95, 100])))
    truth = Truth()
    before = truth.compare(as_it_is)
    check("normals: as they are, studs are lit wrongly", before[0][1] > 5, text(before))
    # What is left is the strain that is left in the studs, and the map's 256 texels.
    ways = {"turned by the Jacobian map": turned, "the same with other active UVs": other_active_uvs,
            "with tangents of redirected corner UVs": other_tangents}
    for name, build in ways.items():
        degrees, difference = result = truth.compare(build)
        held = degrees[0] < before[0][0] / 5 and degrees[1] < 2 and difference.p99 < 3
        check(f"normals: {name}", held, f"{text(result)} (as they are: {text(before)})")
    # A bump map is the height's derivative on the surface, whatever the UVs. It also sees the strain that is left, and
    # Blender takes the derivative over a pixel, which is why it stays further from the truth than the others.
    degrees, difference = result = truth.compare(bump)
    check("normals: bump is right as it is", degrees[0] < 1.5 and difference.p99 < 8, text(result))


run(normals)
