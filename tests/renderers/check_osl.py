"""Cycles with Open Shading Language: the document's shaders."""

import bpy
import numpy as np

import blender
import scene
from checks import check, document, run, skip, within
from lit import Truth, text
from picture import Difference

# Blender's own code that gives a Script node its sockets asks a module that its Python module lacks: `oslquery.py` here.
import cycles.osl


def script(source, **values):
    """A Script node with that source; returns its first output. UVs come from the mesh."""
    def build(tree):
        node, text = tree.nodes.new("ShaderNodeScript"), bpy.data.texts.new("shader")
        text.write(source)
        node.script = text
        messages = []
        with blender.quiet():
            cycles.osl.update_script_node(node, lambda kind, message: messages.append(message))
        if "at" not in node.inputs:
            raise ValueError(f"the shader does not compile: {messages}")
        uv = tree.nodes.new("ShaderNodeUVMap")
        tree.links.new(uv.outputs["UV"], node.inputs["at"])
        for name, value in values.items():
            node.inputs[name].default_value = str(scene.FOLDER / value)
        return node.outputs[0]
    return build


def lookups():
    source = document("Open Shading Language", "c")
    # The same texture calls without the redirection.
    direct = source.replace("color uv = texture(redirection, at[0], 1 - at[1],", "color uv = at; // ")
    assert direct != source
    truth = scene.show(script(direct, picture="truth.<UDIM>.exr"), osl=True)
    original = scene.show(script(direct, picture="texture.<UDIM>.png"), osl=True)
    again = scene.show(script(direct, picture="again.<UDIM>.exr"), osl=True)
    before, floor = Difference(original, truth), Difference(again, original)
    after = Difference(scene.show(script(source, redirection="udim.<UDIM>.exr", picture="texture.<UDIM>.png"),
                                  osl=True), truth)
    check("osl: the redirection matters", before.p99 > 50, f"{before} of 255 with the original UVs")
    # The truth has twice the texels, of which the filter takes another level: that alone is the second figure.
    within("osl: UDIM-absolute", after, 2, 12, 40, f"; original UVs {before}, resampling alone {floor}")
    flipped = source.replace("1 - at[1]", "at[1]")
    far = Difference(scene.show(script(flipped, redirection="udim.<UDIM>.exr", picture="texture.<UDIM>.png"),
                                osl=True), truth)
    check("osl: t runs down", far.mean > 15, f"{far} of 255 if v is not turned round")


def normals():
    files = {"redirection": "udim.<UDIM>.exr", "picture": "normals.<UDIM>.exr"}
    degrees, difference = result = Truth(osl=True).compare(script(document("Normal maps in OSL", "c"), **files))
    # As with nodes: turned wrongly it is 10 degrees at p99 and more.
    check("osl: normals from derivatives", degrees[1] < 2 and difference.p99 < 3, text(result))


def filter_scale():
    """Checks lookups with the original UV's derivatives times the filter scale, for hosts without the redirected UV's.

    The picture is noise of single texels, of which a pixel covers about a dozen; each pixel has one sample, and what it
    should show is the mean of 32 that the redirected UV's derivatives filter. Only places where the redirection draws texels together are looked at: there the
    original UV's derivatives alone leave noise.
    """
    files = {"redirection": "udim.<UDIM>.exr", "picture": "noise.<UDIM>.png"}
    source = document("Filter scale", "c")

    def show(source, samples=1, **more):
        return scene.show(script(source, **files, **more), osl=True, samples=samples)

    size = show(source.replace("Color = texture(", "Color = wide / 4; // "), scale="filter.<UDIM>.exr")[..., 0] * 4
    exact = document("Open Shading Language", "c")
    truth = scene.show(script(exact, **files), osl=True, samples=32)
    pictures = [show(source, scale="filter.<UDIM>.exr"),
                show(source.replace('"width", wide', '"width", 1.0'), scale="filter.<UDIM>.exr"), show(exact)]
    seen = [picture[..., 3] > 0.999 for picture in (truth, *pictures)]
    inside = np.logical_and.reduce(seen) & (size > 1.3)
    scaled, plain, derivatives = (np.sqrt(((picture - truth)[..., 0][inside] ** 2).mean()) * 255 for picture in pictures)
    check("osl: filter scale", scaled < 0.75 * plain and inside.mean() > 0.1,
          f"noise {scaled:.1f} of 255, with the original UV's derivatives alone {plain:.1f}, "
          f"with the redirected UV's {derivatives:.1f}")


def materialx():
    """The shader that check_materialx.py generated from the document's graph."""
    path = scene.FOLDER / "materialx.osl"
    if not path.exists():
        return skip("osl: from MaterialX", "no shader has been generated")
    source = path.read_text()

    def show(redirection, picture):
        return scene.show(script(source, redirected_file=redirection, albedo_file=picture), osl=True)

    # A map that does not redirect shows the truth and the original in the same way.
    truth = show("identity.<UDIM>.exr", "truth.<UDIM>.exr")
    before = Difference(show("identity.<UDIM>.exr", "texture.<UDIM>.png"), truth)
    after = Difference(show("udim.<UDIM>.exr", "texture.<UDIM>.png"), truth)
    within("osl: generated from MaterialX", after, 2, 12, 40, f"; original UVs {before}")


run(lookups, normals, filter_scale, materialx)
