"""A real mesh in Cycles: the head that lies beside the checkout, where it does, with one tile and the map of bake's default
form."""

import pathlib
import sys

import blender
import model
import picture
import warp
from checks import ASSETS, check, recipes, run, skip, within

recipe = recipes("Blender")
folder = pathlib.Path(sys.argv[1])


def head():
    source = ASSETS / "mh_face"
    if not source.is_dir():
        return skip("asset: mh_face", f"{source} is not there")
    place = folder / "mh_face"
    place.mkdir(exist_ok=True)
    mesh = model.asset(source, 1)
    model.bake_asset(place, source, mesh, source / "rigidity.<UDIM>.png", "--size", 512)
    exact = warp.Warp(place / "warp.1001.exr")
    warp.write(place / "texture.png", picture.texture(warp.read(source / "rigidity.1001.png")[..., :1], 1024))
    warp.write(place / "truth.exr", exact.texture(warp.read(place / "texture.png")))

    def show(name, redirected=False):
        tree = blender.start(mesh, (400, 440), samples=8)
        node = blender.image_texture(tree, place / name)
        if redirected:
            recipe["redirect"](node, str(place / "redirect.1001.exr"))
        tree.links.new(node.outputs["Color"], blender.emission_of(tree))
        return blender.render()

    truth = show("truth.exr")
    before = picture.Difference(show("texture.png"), truth)
    after = picture.Difference(show("texture.png", True), truth)
    check("asset: the redirection matters", before.p99 > 20, f"{before} of 255 with the original UVs")
    # Texels are larger than pixels here, so that the resampling of the truth shows more than on the model, and there are
    # seams, at which the truth's texels of one chart blend with those outside of it.
    within("asset: mh_face, frame 1", after, 0.6, 5, 50, f"; original UVs {before}")


run(head)
