"""EEVEE with the same nodes, where there is a driver, of which Mesa's software one will do."""

import scene
from checks import check, recipes, run, within
from picture import Difference

recipe = recipes("Blender")


def through(tree):
    node = scene.texture(tree, "texture.<UDIM>.png")
    recipe["redirect"](node, str(scene.FOLDER / "udim.<UDIM>.exr"))
    return node.outputs["Color"]


def lookups():
    def show(build):
        return scene.show(build, engine="BLENDER_EEVEE")
    truth = show(scene.plain("truth"))
    # From here on a crash is a failure; before, it says that there is no driver.
    print("eevee draws", flush=True)
    before, after = Difference(show(scene.plain("texture.<UDIM>.png")), truth), Difference(show(through), truth)
    check("eevee: the redirection matters", before.p99 > 50, f"{before} of 255 with the original UVs")
    # A map that is read Closest gives 1.9 / 9.6 / 28. EEVEE draws its samples otherwise than Cycles.
    within("eevee: UDIM-absolute", after, 1.5, 8, 40, f"; original UVs {before}")


run(lookups)
