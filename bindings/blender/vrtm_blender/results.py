"""Writes results into Blender's data, on the main thread: images of the redirection, and a UV map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import geometry, layers, overlay, session
from .messages import Problem
from .session import Request, State

if TYPE_CHECKING:
    import vrtm

    from .prepared import Prepared
    from .work import Outcome

# Where the layout of a result's image is kept: in the image, for the node group and for bakes.
LAYOUT = "vrtm_layout"


@dataclass(frozen=True)
class Layout:
    """How tiles lie in the image: side by side, as in the UV editor, each of `size` x `size` texels.

    Blender lets scripts write the first tile of a tiled image only. So a result of several tiles is one image without
    tiles, and the node group finds a UV's place in it.
    """

    first_u: int
    first_v: int
    columns: int
    rows: int
    size: int

    @staticmethod
    def of(udims: list[int], size: int) -> Layout:
        us, vs = [(udim - 1001) % 10 for udim in udims], [(udim - 1001) // 10 for udim in udims]
        return Layout(min(us), min(vs), max(us) - min(us) + 1, max(vs) - min(vs) + 1, size)

    @property
    def width(self) -> int:
        return self.columns * self.size

    @property
    def height(self) -> int:
        return self.rows * self.size

    def place(self, udim: int) -> tuple[slice, slice]:
        """Rows and columns of a tile in the image's array, whose first row is the bottom one."""
        x, y = (udim - 1001) % 10 - self.first_u, (udim - 1001) // 10 - self.first_v
        return slice(y * self.size, (y + 1) * self.size), slice(x * self.size, (x + 1) * self.size)

    def numbers(self) -> list[int]:
        return [self.first_u, self.first_v, self.columns, self.rows, self.size]


@dataclass(frozen=True)
class Outputs:
    """What is written of a result; None for what was not asked for."""

    layout: Layout | None
    images: list[np.ndarray] | None  # of each layer, (height, width, 4) float32
    layers: np.ndarray | None  # (faces,) uint32; None also where there is one layer alone
    uvs: np.ndarray | None  # (corners, 2) float32
    delta: np.ndarray | None  # (corners, 3) float32: what to add to u and v, and 0
    strain: np.ndarray | None  # (vertices, 4) float32: colours


def fetch(prepared: Prepared, request: Request) -> Outputs:
    """Fetches the asset's last result. It may be called on any thread, while no solve is under way."""
    asset = prepared.asset
    layout = layout_of(asset, request.name, request.map_size) if request.write_image else None
    images = None
    if layout is not None:
        images = [redirection(asset, layout, layer) for layer in range(layers.number_of(asset))]
    uvs = asset.corner_uvs() if request.write_uvs or request.write_delta else None
    delta = strain = None
    if request.write_delta:
        delta = np.pad(uvs - prepared.mesh.topology.uvs, ((0, 0), (0, 1)))
    if request.strain != "NONE":
        strain = overlay.colours(prepared, request.positions, request.strain == "AFTER")
    return Outputs(layout, images, prepared.layers, uvs if request.write_uvs else None, delta, strain)


def layout_of(asset: vrtm.Asset, name: str, map_size: int) -> Layout:
    """The layout of an object's image; `map_size` 0 is as many texels as the largest grid has cells."""
    tiles = asset.tiles
    if not tiles:
        raise Problem(f"{name} has no faces in any UDIM tile (u from 0 to 10, v from 0)")
    size = map_size or max(max(tile.info.grid_width, tile.info.grid_height) for tile in tiles)
    layout = Layout.of([tile.udim for tile in tiles], size)
    if max(layout.width, layout.height) > 65536:
        raise Problem(f"{name}: an image of {layout.width} x {layout.height} texels is too large: lower Map Size")
    return layout


def redirection(asset: vrtm.Asset, layout: Layout, layer: int) -> np.ndarray:
    """The image of a layer of the last result: (height, width, 4) float32, bottom row first; what to add to u and v in
    the first two channels, and 1 in the last one, so that no alpha mode changes the others."""
    image = np.zeros((layout.height, layout.width, 4), np.float32)
    image[..., 3] = 1
    for tile in [tile for tile in asset.tiles if tile.layer == layer]:
        rows, columns = layout.place(tile.udim)
        part = tile.fetch("redirection_delta", (layout.size, layout.size), channels=2, origin="bottom")
        image[rows, columns, :2] = part
    return image


def are_there(obj: bpy.types.Object) -> bool:
    """Whether what was written before is still there: an undo, a file or the artist may have taken it away."""
    return missing(obj) is None


def missing(obj: bpy.types.Object) -> str | None:
    """What of the object's results is not there, in words."""
    from . import nodes

    settings = obj.vrtm
    if not is_set_up(obj):
        return None
    if settings.write_image:
        if not is_result(settings.image):
            return "The result image is not there"
        if not all(map(has_pixels, layers.images_of(settings.image))):
            return "The result image is empty"
        lost = layers.missing(obj)
        if lost is not None:
            return lost
        if nodes.stale_groups(obj):
            return "The material's node group has lost the result image"
        owner = owner_of_image(obj)
        if owner is not None:
            return f"The redirection that is shown is that of {owner.name!r}"
    if settings.write_uvs and settings.uv_name not in obj.data.uv_layers:
        return "The result UV map is not there"
    if settings.write_delta and delta_name(settings) not in obj.data.attributes:
        return "The result attribute is not there"
    return None


def is_result(image: bpy.types.Image | None) -> bool:
    """Whether an image was made for a result. The artist may choose another one in the panel, which is not written
    to."""
    return image is not None and LAYOUT in image


def has_pixels(image: bpy.types.Image) -> bool:
    """Whether an image holds anything. One that existed in memory only is there again when the file is opened, but
    empty: so it is with files that Blender saved on a timer, or without this add-on."""
    if image.is_dirty or image.packed_file is not None:
        return True
    return image.source != "GENERATED" and image.size[0] > 0


def publish(obj: bpy.types.Object, state: State, request: Request, outcome: Outcome) -> None:
    """Writes what a job came to."""
    outputs = outcome.outputs
    # What the artist has done until now is heard of as such, and what the writes cause as nothing new.
    _update()
    before, session.writing = session.writing, True
    try:
        own_name(obj)
        if outputs.images is not None:
            write_image(obj, outputs.layout, *outputs.images)
            layers.write(obj, outputs.layers)
        if outputs.uvs is not None:
            write_uvs(obj, outputs.uvs)
        if outputs.delta is not None:
            write_delta(obj, outputs.delta)
        if outputs.strain is not None:
            overlay.write(obj, outputs.strain)
        _update()
    finally:
        session.writing = before
    state.shown, state.figures, state.uvs, state.rewrite = request.stamp, outcome.figures, outputs.uvs, False
    state.notes = list(outcome.notes) if is_set_up(obj) else []
    still_right(state, request)
    behind = geometry.deforms_after_tap(obj)
    if behind is not None and geometry.has_tap(obj):
        state.notes.append(
            f"Modifier {behind.name!r} deforms behind the one that changes the topology: it is not in the pose"
        )
    if is_set_up(obj) and all(output is None for output in (outputs.images, outputs.uvs, outputs.delta)):
        state.notes.append("No output is switched on: see Quality and Outputs")
    state.say("")


def _update() -> None:
    """Has Blender evaluate what was changed, so that its handlers are called now."""
    layer = bpy.context.view_layer
    if layer is not None and not (session.rendering or session.baking or session.handling):
        layer.update()


def still_right(state: State, request: Request) -> None:
    """What is shown is the result of this request."""
    state.frame, state.fresh = request.frame, True
    if state.stamps == state.prepared.stamps:
        # What was read again is in the asset already.
        state.inputs.take()


def is_shown(obj: bpy.types.Object, state: State, request: Request) -> bool:
    """Whether the result of this request is what was written last, and is there."""
    return request.stamp == state.shown and are_there(obj)


def was_taken_back(obj: bpy.types.Object, state: State) -> bool:
    """Whether an undo has taken a UV map back that was written after the undo's step. Pixels of images stay."""
    if not state.rewrite or state.uvs is None or obj.vrtm.uv_name not in obj.data.uv_layers:
        return False
    return not np.array_equal(geometry.read(obj.data.uv_layers[obj.vrtm.uv_name].uv, "vector", 2), state.uvs)


def write_image(obj: bpy.types.Object, layout: Layout, *pixels: np.ndarray) -> None:
    """Writes the images of all layers."""
    for image, values in zip(own_images(obj, layout, len(pixels)), pixels):
        image.pixels.foreach_set(values.ravel())
        image.update()
        # Tells viewport renders that the image has changed.
        image.update_tag()


def owner_of_image(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object whose result the object's image is, if it is another: a duplicate begins with the original's."""
    image, uid = obj.vrtm.image, session.uid_of(obj)
    if not is_result(image):
        return None
    others = [other for other in bpy.data.objects if other.vrtm.image == image and session.uid_of(other) < uid]
    return min(others, key=session.uid_of, default=None)


def separate(obj: bpy.types.Object) -> None:
    """Gives a duplicate images of its own, and materials that look them up."""
    from . import materials, nodes

    if owner_of_image(obj) is not None:
        before = obj.vrtm.image
        size, layout, number = before.size, list(before[LAYOUT]), before.get(layers.NUMBER, 1)
        obj.vrtm.image = _new_image(obj, *size)
        for image in layers.own_images(obj.vrtm.image, number, lambda layer: _new_image(obj, *size, layer)):
            image[LAYOUT] = layout
        materials.separate(obj, lambda tree: nodes.is_by_image(tree, before), nodes.group_by_image)


def _new_image(obj: bpy.types.Object, width: int, height: int, layer: int = 0) -> bpy.types.Image:
    name = f"vrtm {obj.name} layer {layer}" if layer else f"vrtm {obj.name}"
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True, is_data=True)
    image.alpha_mode = "CHANNEL_PACKED"
    image.file_format = "OPEN_EXR"
    return image


def own_images(obj: bpy.types.Object, layout: Layout, number: int) -> list[bpy.types.Image]:
    """The object's result images, one for each layer, in the layout's size."""
    from . import nodes

    settings = obj.vrtm
    separate(obj)
    size = layout.width, layout.height
    if not is_result(settings.image) or settings.image.library is not None:
        settings.image = _new_image(obj, *size)
    images = layers.own_images(settings.image, number, lambda layer: _new_image(obj, *size, layer))
    rebuild = False
    for image in images:
        if not image.size[0]:
            # Its file is gone: it is one in memory again.
            image.source, image.use_generated_float = "GENERATED", True
            image.generated_width, image.generated_height = size
        elif tuple(image.size) != size:
            image.scale(*size)
        if list(image.get(LAYOUT, ())) != layout.numbers():
            image[LAYOUT] = layout.numbers()
            rebuild = True
    nodes.update_groups(obj, rebuild)
    layers.remove_unused()
    return images


def write_uvs(obj: bpy.types.Object, uvs: np.ndarray) -> None:
    mesh = obj.data
    layer = own_layer(obj)
    # A write makes Blender evaluate the mesh again: only if there is something to write.
    if np.array_equal(geometry.read(layer.uv, "vector", 2), uvs):
        return
    layer.uv.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())
    if not session.rendering:
        mesh.update_tag()
    # In a render a tag would have the mesh evaluated again with the shape keys' values of the frame that the viewport
    # is at. The render engine copies the mesh after this in any case; the viewport gets its tag when the render is
    # over.


def delta_name(settings: bpy.types.PropertyGroup) -> str:
    """The attribute for Geometry Nodes. It has three components, since Blender takes two for a UV map."""
    return f"{settings.uv_name}_delta"


def names_of(settings: bpy.types.PropertyGroup) -> set[str]:
    """What is written to the mesh of an object's results."""
    return {settings.uv_name, delta_name(settings), layers.attribute_name(settings)}


def write_delta(obj: bpy.types.Object, values: np.ndarray) -> None:
    mesh = obj.data
    geometry.write(mesh, delta_name(obj.vrtm), "CORNER", "FLOAT_VECTOR", values)
    if not session.rendering:
        mesh.update_tag()


def own_name(obj: bpy.types.Object) -> None:
    """Sees to the name of what is written to the mesh: objects that share a mesh have one each."""
    from . import materials, nodes

    mesh, settings, uid = obj.data, obj.vrtm, session.uid_of(obj)
    before = settings.uv_name
    others = [other for other in bpy.data.objects if other != obj and other.data == mesh and is_set_up(other)]
    if any(other.vrtm.uv_name == before and session.uid_of(other) < uid for other in others):
        settings.uv_name = f"vrtm {obj.name}"[:60]
        if settings.write_uvs:
            own_layer(obj)
            materials.separate(obj, lambda tree: nodes.is_by_uv_map(tree, before), nodes.group_by_uv_map)


def own_layer(obj: bpy.types.Object) -> bpy.types.MeshUVLoopLayer:
    """The object's result among the mesh's UV maps."""
    mesh, settings = obj.data, obj.vrtm
    layer = mesh.uv_layers.get(settings.uv_name)
    if layer is None:
        active = mesh.uv_layers.active_index
        layer = mesh.uv_layers.new(name=settings.uv_name, do_init=False)
        if layer is None:
            raise Problem(f"{obj.name} has eight UV maps already: delete one, or switch the UV Map output off")
        settings.uv_name = layer.name
        mesh.uv_layers.active_index = active
    return layer


def is_set_up(obj: bpy.types.Object) -> bool:
    return obj.type == "MESH" and obj.vrtm.rigidity_source != "NONE"


def is_followed(obj: bpy.types.Object) -> bool:
    """Whether there is something to be computed for its poses: a redirection, or strain alone."""
    return obj.type == "MESH" and (is_set_up(obj) or obj.vrtm.strain != "NONE")


def figures(prepared: Prepared) -> list[tuple[str, str]]:
    """What the panel shows of the last solve, as labels and values."""
    report = prepared.asset.report()
    tiles = [tile.report() for tile in prepared.asset.tiles]
    number = layers.number_of(prepared.asset)
    shown = [
        ("Time", f"{report.ms_total:.0f} ms"),
        ("Folds", str(report.folds)),
        ("Rigid", percent(prepared.rigid_share()[0])),
        ("Tiles", str(len({tile.udim for tile in prepared.asset.tiles}))),
    ]
    if number > 1:
        shown.append(("Layers", str(number)))
    edges = sum(tile.edges + tile.edges_fixed for tile in tiles)
    if edges:
        # Of all that is rigid, what cannot move too.
        fixed = sum(tile.edges_fixed * tile.strain_fixed**2 for tile in tiles)
        before, after = (
            ((sum(tile.edges * getattr(tile, side).rms ** 2 for tile in tiles) + fixed) / edges) ** 0.5
            for side in ("before", "after")
        )
        shown.append(("Strain", f"{before:.3f} before, {after:.3f} after"))
    return shown


def percent(share: float) -> str:
    """A share in words that are never 0 or 100 % unless it is."""
    if 0 < share < 0.001:
        return "under 0.1 %"
    if 0.999 < share < 1:
        return "over 99.9 %"
    return f"{100 * share:.{1 if 0 < share < 0.1 or 0.9 < share < 1 else 0}f} %"


def notes(prepared: Prepared) -> list[str]:
    """What is likely not as it is meant, in sentences."""
    found = _of_rigidity(*prepared.rigid_share())
    return found or _of_overlaps(prepared)


def _of_overlaps(prepared: Prepared) -> list[str]:
    """Whether most of what is rigid does not move because islands share the texture there. All layers count."""
    tiles = prepared.asset.tiles
    rigid, overlapped = (sum(getattr(tile.info, f"rigid_{of}") for tile in tiles) for of in ("nodes", "overlapped"))
    if 2 * overlapped <= rigid or tiles[0].settings.overlap == "first_face":
        return []
    found = f"{percent(overlapped / rigid)} of what is rigid does not move, since islands share the texture there"
    if prepared.mesh.max_layers:
        return [f"{found}: there are over {layers.MOST} of them, or one lies over itself. Unwrap them side by side"]
    return [f"{found}: set Overlaps, in Quality and Outputs, to Each"]


def _of_rigidity(share: float, least: float, most: float) -> list[str]:
    # Half a step of 8 bits.
    if most < 0.5 / 255:
        return ["Nothing is rigid: the map is 0 everywhere. Is it the right image, channel or group?"]
    if least > 1 - 0.5 / 255:
        return ["All is rigid: the map is 1 everywhere, so that nothing can give way. Paint black between features"]
    if share == 0:
        return [f"The map is {most:.2f} at most: what is to keep its shape as well as it can is 1, white"]
    if share == 1:
        return [f"The map is {least:.2f} at least: what is to give way is 0, black"]
    return []
