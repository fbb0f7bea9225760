"""Mirrored and stacked UVs in Cycles: a map per layer that faces pick, and a map of one UV set for textures of another.

The model is a sheet whose halves, and two decals on it, lie on the same UVs in one set, and on their own in another. The
truth is the same mesh with redirected corner UVs, which are exact on a mesh as fine as this one.
"""

import pathlib
import sys

import bpy
import numpy as np
import OpenImageIO as oiio

import blender
import picture
import vrtm
import warp
from checks import check, run, within
from picture import Difference

FOLDER = pathlib.Path(sys.argv[1])
SIZE = 640, 320
QUADS = 96
MAP = 256
STUDS = [(0.3, 0.3), (0.7, 0.3), (0.5, 0.5), (0.3, 0.7), (0.7, 0.7)]


class Model:
    """Two halves side by side, the right one mirrored, and under them two decals: four islands of one place."""

    def __init__(self):
        xs = np.linspace(0, 1, QUADS + 1)
        u, v = (part.ravel() for part in np.meshgrid(xs, xs))
        at = np.arange(QUADS)[None] + (QUADS + 1) * np.arange(QUADS)[:, None]
        quads = np.stack([at, at + 1, at + QUADS + 2, at + QUADS + 1], -1).reshape(-1, 4)
        rest, pose, shared, unique, faces = [], [], [], [], []
        for k, (x, y, size, sign) in enumerate([(0, 0, 1, -1), (0, 0, 1, 1), (-1, -0.35, 0.3, 1), (0.3, -0.35, 0.3, 1)]):
            faces.append(quads + k * len(u))
            rest.append(np.stack([x + sign * size * u, y + size * v, 0 * u], -1))
            bend = 0.22 * np.sin((2.1 + k) * u + k) * v, 0.2 * np.cos((3.3 - k) * v + k) * u + 0.1 * u * v
            pose.append(np.stack([x + sign * size * (u + bend[0]), y + size * (v + bend[1]), 0 * u], -1))
            shared.append(np.stack([0.05 + 0.9 * u, 0.05 + 0.9 * v], -1))
            unique.append(np.stack([0.02 + 0.5 * (k % 2) + 0.46 * u, 0.02 + 0.5 * (k // 2) + 0.46 * v], -1))
        self.rest, self.pose, self.shared, self.unique = map(np.concatenate, (rest, pose, shared, unique))
        self.faces = np.concatenate(faces)
        self.uvs, self.triangles, self.uv_triangles = self.shared, self.faces, self.faces

    def asset(self, device, **options):
        faces, corners = self.faces, self.faces.ravel()
        sets = [(self.unique, corners)]
        return vrtm.Asset(device, self.rest, faces, uvs=self.shared, uv_indices=corners, uv_sets=sets, **options)


def studs(scale, offset):
    """A rigidity map; a stud's place in it is scale * (its place on an island) + offset."""
    uv = warp.centres(MAP, MAP)
    rigid = np.zeros((MAP, MAP))
    for ox, oy in offset:
        for x, y in STUDS:
            place = uv - [ox + scale * x, oy + scale * y]
            rigid[np.hypot(place[..., 0], place[..., 1]) < 0.11 * scale] = 1
    return rigid


def write(name, pixels):
    """Rows from the top."""
    image = oiio.ImageBuf(np.ascontiguousarray(pixels.astype(np.float32)))
    image.write(str(FOLDER / name))


model = Model()
device = vrtm.Device("cpu")
islands = [(0.02, 0.02), (0.52, 0.02), (0.02, 0.52), (0.52, 0.52)]
texture = studs(0.9, [(0.05, 0.05)])


def solved(most):
    asset = model.asset(device, max_layers=most)
    asset.tile(1001).set_rigidity(texture)
    asset.tile(1001, uv_set=1).set_rigidity(studs(0.46, islands))
    asset.solve(model.pose, measure=True)
    return asset


fixed, asset = solved(0), solved(8)
write("layered.exr", picture.texture(texture, 512))


def show(build):
    tree = blender.start(model, SIZE, samples=8)
    data = bpy.data.objects["mesh"].data
    for name, uvs in (("unique", model.unique[model.faces]), ("exact", asset.corner_uvs().reshape(-1, 4, 2))):
        data.uv_layers.new(name=name).data.foreach_set("uv", uvs.astype(np.float32).ravel())
    layers = data.attributes.new("vrtm_layer", "INT", "FACE")
    layers.data.foreach_set("value", asset.face_layers().astype(np.int32))
    socket = blender.emission(tree)
    tree.links.new(build(tree), socket)
    return blender.render()


def uv_of(tree, name):
    node = tree.nodes.new("ShaderNodeUVMap")
    node.uv_map = name
    return node.outputs["UV"]


def texture_at(tree, uv, repeat=0):
    node = blender.image_texture(tree, FOLDER / "layered.exr", extension="REPEAT" if repeat else "EXTEND")
    if repeat:
        scale = tree.nodes.new("ShaderNodeVectorMath")
        scale.operation, scale.inputs[1].default_value = "MULTIPLY", [repeat] * 3
        tree.links.new(uv, scale.inputs[0])
        uv = scale.outputs["Vector"]
    tree.links.new(uv, node.inputs["Vector"])
    return node.outputs["Color"]


def looked_up(tree, tile):
    """The redirected UV of a layer's map."""
    write(f"redirect{tile.layer}.exr", tile.fetch("redirection", MAP, channels=3))
    lookup = blender.image_texture(tree, FOLDER / f"redirect{tile.layer}.exr")
    tree.links.new(uv_of(tree, "UVMap"), lookup.inputs["Vector"])
    return lookup.outputs["Color"]


def picked(tree, layers):
    """The redirected UV: of each layer's map, times whether the face has that layer, the sum."""
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "vrtm_layer"
    total = None
    for tile in layers:
        is_layer, times = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeVectorMath")
        is_layer.operation, times.operation = "COMPARE", "SCALE"
        is_layer.inputs[1].default_value, is_layer.inputs[2].default_value = tile.layer, 0.5
        tree.links.new(attribute.outputs["Fac"], is_layer.inputs[0])
        tree.links.new(looked_up(tree, tile), times.inputs[0])
        tree.links.new(is_layer.outputs[0], times.inputs["Scale"])
        if total is not None:
            add = tree.nodes.new("ShaderNodeVectorMath")
            tree.links.new(total, add.inputs[0])
            tree.links.new(times.outputs["Vector"], add.inputs[1])
            total = add.outputs["Vector"]
        else:
            total = times.outputs["Vector"]
    return total


def moved(tree, half=False):
    """The shared UV, plus what the map of the unique set says."""
    tile = asset.tile(1001, uv_set=1)
    pixels = tile.fetch("uv_set_delta", MAP, uv_set=0, channels=3, dtype=np.float16 if half else np.float32)
    write("delta.exr", pixels)
    lookup = blender.image_texture(tree, FOLDER / "delta.exr")
    add = tree.nodes.new("ShaderNodeVectorMath")
    tree.links.new(uv_of(tree, "unique"), lookup.inputs["Vector"])
    tree.links.new(uv_of(tree, "UVMap"), add.inputs[0])
    tree.links.new(lookup.outputs["Color"], add.inputs[1])
    return add.outputs["Vector"]


def strain(of):
    """RMS strain of all rigid edges, before and after."""
    reports = [tile.report() for tile in of.tiles if tile.uv_set == 0]
    edges = sum(r.segments + r.segments_fixed for r in reports)
    still = sum(r.segments_fixed * r.strain_fixed**2 for r in reports)
    return [
        ((sum(r.segments * getattr(r, when).rms ** 2 for r in reports) + still) / edges) ** 0.5
        for when in ("before", "after")
    ]


def islands_of_one_place():
    check("layers: four islands, four layers", [t.layer for t in asset.tiles if t.uv_set == 0] == [0, 1, 2, 3],
          f"{asset.tiles}")
    before, after = strain(asset)
    still = strain(fixed)
    check("layers: rigid edges keep their lengths", after < before / 4 and still[1] == still[0],
          f"RMS strain {before:.3f} -> {after:.3f}; without layers nothing moves")


def mirrored_and_decals():
    truth = show(lambda tree: texture_at(tree, uv_of(tree, "exact")))
    plain = Difference(show(lambda tree: texture_at(tree, uv_of(tree, "UVMap"))), truth)
    check("layers: they matter", plain.p99 > 40, f"{plain} of 255 with the original UVs")
    first = [tile for tile in asset.tiles if tile.uv_set == 0]
    found = Difference(show(lambda tree: texture_at(tree, picked(tree, first))), truth)
    within("layers: a map for each, picked by face", found, 0.3, 5, 50, f"; original UVs {plain}")
    wrong = Difference(show(lambda tree: texture_at(tree, looked_up(tree, first[0]))), truth)
    check("layers: one map does not serve all", wrong.p99 > 40, f"{wrong} of 255")


def another_set():
    """The unique set has a result of its own: its truth is its corner UVs, taken to the shared set in closed form."""
    redirected = asset.corner_uvs(uv_set=1).astype(np.float64).reshape(4, -1, 2)
    at = 0.05 + 0.9 / 0.46 * (redirected - np.array(islands)[:, None])

    def truth(tree, repeat=0):
        data = bpy.data.objects["mesh"].data
        data.uv_layers.new(name="truth").data.foreach_set("uv", at.astype(np.float32).ravel())
        return texture_at(tree, uv_of(tree, "truth"), repeat)

    shown = show(truth)
    plain = Difference(show(lambda tree: texture_at(tree, uv_of(tree, "UVMap"))), shown)
    for half in False, True:
        found = Difference(show(lambda tree: texture_at(tree, moved(tree, half))), shown)
        within(f"layers: a delta for another UV set{' in f16' * half}", found, 0.3, 4, 55, f"; original UVs {plain}")
    tiled = show(lambda tree: truth(tree, 3))
    found = Difference(show(lambda tree: texture_at(tree, moved(tree), 3)), tiled)
    within("layers: a texture that repeats", found, 0.6, 8, 80)


run(islands_of_one_place, mirrored_and_decals, another_set)
