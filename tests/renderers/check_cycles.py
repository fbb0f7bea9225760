"""Cycles with nodes: the lookup through each form of the map, and what goes wrong without the recipe.

Three differences from the truth set the scale: that of the original UVs; that of the same texture at the truth's
resolution, which is no error; and between them that of the lookup through a map of 256 texels, which by bilinear reading
is a little off where the warp bends. Renders are equal in everything but the lookup, so that noise cancels.
"""

import shutil

import bpy

import blender
import scene
from checks import check, document, run, within
from picture import Difference

recipe = {}
exec(document("Blender", "python"), recipe)


def through(form, delta=False, change=None):
    """The recipe's nodes; `change` spoils one thing."""
    def build(tree):
        node = scene.texture(tree, "texture.<UDIM>.png")
        lookup = recipe["redirect"](node, str(scene.FOLDER / f"{form}.<UDIM>.exr"), delta)
        if change:
            change(lookup)
        return node.outputs["Color"]
    return build


def repeat(lookup):
    lookup.extension = "REPEAT"


def closest(lookup):
    lookup.interpolation = "Closest"


truth = scene.show(scene.plain("truth"))
before = Difference(scene.show(scene.plain("texture.<UDIM>.png")), truth)
floor = Difference(scene.show(scene.plain("again")), scene.show(scene.plain("texture.<UDIM>.png")))
beside = f"; original UVs {before}, resampling alone {floor}"


def after(*arguments, **options):
    return Difference(scene.show(through(*arguments, **options)), truth)


def lookups():
    # Twice what is measured: it is 0.2 / 1.6 / 12, and an error of half a texel gives more than 5 at p99.
    check("cycles: the redirection matters", before.p99 > 50, f"{before} of 255 with the original UVs")
    within("cycles: UDIM-absolute", after("udim"), 0.4, 3, 25, beside)
    within("cycles: delta, one add node", after("delta", delta=True), 0.4, 3, 25, beside)
    within("cycles: RGBA, A = 0 outside of charts", after("udim_alpha"), 0.4, 3, 25)
    within("cycles: delta in f16", after("delta_half", delta=True), 0.4, 3, 25)


def sockets():
    """Checks that the plug of the texture's Vector goes on to the map's: here, UVs that are not the active ones."""
    def build(tree, delta):
        data = bpy.data.objects["mesh"].data
        data.uv_layers.new(name="other").data.foreach_set("uv", [0.3] * (2 * len(data.loops)))
        data.uv_layers["other"].active = data.uv_layers["other"].active_render = True
        node, uv = scene.texture(tree, "texture.<UDIM>.png"), tree.nodes.new("ShaderNodeUVMap")
        uv.uv_map = "UVMap"
        tree.links.new(uv.outputs["UV"], node.inputs["Vector"])
        recipe["redirect"](node, str(scene.FOLDER / ("delta.<UDIM>.exr" if delta else "udim.<UDIM>.exr")), delta)
        return node.outputs["Color"]

    for delta in False, True:
        after = Difference(scene.show(lambda tree: build(tree, delta)), truth)
        within(f"cycles: what was plugged in is kept, {'delta' if delta else 'UDIM-absolute'}", after, 0.4, 3, 25)


def wrong_ways():
    """Checks that the document's warnings are true: one that is not true any more has to go."""
    far = after("two_channels")
    check("cycles: two channels are misread", far.mean > 20, f"{far} of 255")
    far = after("redirect")
    check("cycles: within the tile, tile 1002 shows tile 1001", far.mean > 10, f"{far} of 255")
    line = after("udim", change=repeat)
    check("cycles: Repeat draws a line", line.max > 50, f"{line} of 255")
    within("cycles: the delta has no such line", after("delta", delta=True, change=repeat), 0.4, 3, 25)
    stairs = after("udim", change=closest)
    check("cycles: Closest makes stairs", stairs.p99 > 10, f"{stairs} of 255")
    half = after("udim_half")
    check("cycles: absolute f16 is coarser", half.mean > 1.5 * after("udim").mean, f"{half} of 255")


def colour_spaces():
    """A project whose working space is ACEScg: a map that is not marked as data is converted as a colour."""
    def render(form, space):
        def build(tree):
            with blender.quiet():
                bpy.ops.wm.set_working_color_space(working_space="ACEScg")
            node = scene.texture(tree, "texture.<UDIM>.png")
            lookup = scene.texture(tree, form, data=False)
            if space:
                lookup.image.colorspace_settings.name = space
            tree.links.new(lookup.outputs["Color"], node.inputs["Vector"])
            return node.outputs["Color"]
        return Difference(scene.show(build), truth)

    far = render("untagged", None)
    check("cycles: ACEScg bends a map that says nothing", far.mean > 20, f"{far} of 255")
    within("cycles: Non-Color set by hand", render("untagged", "Non-Color"), 0.4, 3, 25)
    within("cycles: colorInteropID = data sets it", render("udim", None), 0.4, 3, 25)


def sequences():
    """The number that Blender counts on is the last one of a name."""
    folder = scene.FOLDER / "sequence"
    folder.mkdir(exist_ok=True)
    for frame in 1, 2:
        # Frame 1 is another map, so that a frame that is not found cannot look right.
        source = scene.FOLDER / ("delta.1001.exr" if frame == 1 else "redirect.1001.exr")
        shutil.copy(source, folder / f"redirect.1001.{frame:04}.exr")
        shutil.copy(source, folder / f"redirect.{frame:04}.1001.exr")

    def render(name):
        def build(tree):
            bpy.context.scene.frame_set(2)
            node = scene.texture(tree, "texture.<UDIM>.png")
            lookup = recipe["redirect"](node, str(folder / name))
            lookup.image.source = "SEQUENCE"
            lookup.image_user.frame_duration = 2
            lookup.image_user.use_auto_refresh = True
            return node.outputs["Color"]
        return scene.show(build)

    # Without <UDIM> there is one tile: the map's UVs are those of 1001, and only the picture's left half counts.
    left = slice(0, scene.SIZE[0] * 2 // 5)
    good = Difference(render("redirect.1001.0001.exr")[:, left], truth[:, left])
    within("cycles: a sequence, frame last", good, 0.4, 3, 25)
    bad = Difference(render("redirect.0001.1001.exr")[:, left], truth[:, left])
    check("cycles: a sequence, UDIM last, is not found", bad.mean > 20, f"{bad} of 255")


def tiles_over_time():
    """Blender has no sequences of tiled images: a handler opens each frame's files."""
    def build(tree):
        node = scene.texture(tree, "texture.<UDIM>.png")
        lookup = recipe["redirect"](node, str(scene.FOLDER / "delta.<UDIM>.exr"))

        def open_frame(current, *_):
            if current.frame_current == 2:
                lookup.image.filepath = str(scene.FOLDER / "udim.<UDIM>.exr")

        bpy.app.handlers.frame_change_pre.append(open_frame)
        bpy.context.scene.frame_set(2)
        return node.outputs["Color"]

    within("cycles: tiles over time, by a handler", Difference(scene.show(build), truth), 0.4, 3, 25)


run(lookups, sockets, wrong_ways, colour_spaces, sequences, tiles_over_time)
