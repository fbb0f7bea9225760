"""Writes results into Blender's data, on the main thread: an image of the redirection, and a UV map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import geometry, session
from .messages import Problem
from .session import Request, State

if TYPE_CHECKING:
    import vrtm

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
    image: np.ndarray | None  # (height, width, 4) float32
    uvs: np.ndarray | None  # (corners, 2) float32


def fetch(asset: vrtm.Asset, request: Request) -> Outputs:
    """Fetches the asset's last result. It may be called on any thread, while no solve is under way."""
    layout = layout_of(asset, request.name, request.map_size) if request.write_image else None
    image = redirection(asset, layout) if layout is not None else None
    return Outputs(layout, image, asset.corner_uvs() if request.write_uvs else None)


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


def redirection(asset: vrtm.Asset, layout: Layout) -> np.ndarray:
    """The image of the last result: (height, width, 4) float32, bottom row first; what to add to u and v in the first
    two channels, and 1 in the last one, so that no alpha mode changes the others."""
    image = np.zeros((layout.height, layout.width, 4), np.float32)
    image[..., 3] = 1
    for tile in asset.tiles:
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
    if settings.write_image:
        if not is_result(settings.image):
            return "The result image is not there"
        if not has_pixels(settings.image):
            return "The result image is empty"
        if nodes.stale_groups(obj):
            return "The material's node group has lost the result image"
    if settings.write_uvs and settings.uv_name not in obj.data.uv_layers:
        return "The result UV map is not there"
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


def publish(obj: bpy.types.Object, state: State, request: Request, outputs: Outputs) -> None:
    """Writes what was fetched of the asset's last result, which is that of `request`."""
    before, session.writing = session.writing, True
    try:
        if outputs.image is not None:
            write_image(obj, outputs.layout, outputs.image)
        if outputs.uvs is not None:
            write_uvs(obj, outputs.uvs)
    finally:
        session.writing = before
    state.shown = request.stamp
    state.figures = figures(state)
    behind = geometry.deforms_after_tap(obj)
    if behind is not None and geometry.has_tap(obj):
        state.say(
            f"modifier {behind.name!r} deforms behind the one that changes the topology: it is not in the pose", True
        )
    elif outputs.image is None and outputs.uvs is None:
        state.say("Solved, but no output is switched on", True)
    else:
        state.say("Up to date")


def write_image(obj: bpy.types.Object, layout: Layout, pixels: np.ndarray) -> None:
    image = own_image(obj, layout)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    # Tells viewport renders that the image has changed.
    image.update_tag()


def own_image(obj: bpy.types.Object, layout: Layout) -> bpy.types.Image:
    """The object's result image in the layout's size. A duplicate of an object begins with the original's: it gets
    one of its own."""
    from . import nodes

    settings = obj.vrtm
    image = settings.image
    uid = session.uid_of(obj)
    taken = image is not None and any(
        other.vrtm.image == image and session.uid_of(other) < uid for other in bpy.data.objects if other != obj
    )
    if not is_result(image) or taken or image.library is not None:
        image = bpy.data.images.new(
            f"vrtm {obj.name}", layout.width, layout.height, alpha=True, float_buffer=True, is_data=True
        )
        image.alpha_mode = "CHANNEL_PACKED"
        image.file_format = "OPEN_EXR"
        settings.image = image
    if not image.size[0]:
        # Its file is gone: it is one in memory again.
        image.source, image.use_generated_float = "GENERATED", True
        image.generated_width, image.generated_height = layout.width, layout.height
    elif tuple(image.size) != (layout.width, layout.height):
        image.scale(layout.width, layout.height)
    rebuild = list(image.get(LAYOUT, ())) != layout.numbers()
    if rebuild:
        image[LAYOUT] = layout.numbers()
    nodes.update_groups(obj, rebuild)
    return image


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


def own_layer(obj: bpy.types.Object) -> bpy.types.MeshUVLoopLayer:
    """The object's result among the mesh's UV maps. Objects that share a mesh have one each."""
    mesh, settings = obj.data, obj.vrtm
    uid = session.uid_of(obj)
    if any(
        other.data == mesh
        and other.vrtm.uv_name == settings.uv_name
        and session.uid_of(other) < uid
        and is_set_up(other)
        for other in bpy.data.objects
        if other != obj
    ):
        settings.uv_name = f"vrtm {obj.name}"[:60]
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


def figures(state: State) -> list[tuple[str, str]]:
    """What the panel shows of the last solve, as labels and values."""
    report = state.asset.report()
    tiles = [tile.report() for tile in state.asset.tiles]
    shown = [("Time", f"{report.ms_total:.0f} ms"), ("Folds", str(report.folds)), ("Tiles", str(len(tiles)))]
    edges = sum(tile.edges + tile.edges_fixed for tile in tiles)
    if edges:
        # Of all that is rigid, what cannot move too.
        fixed = sum(tile.edges_fixed * tile.strain_fixed**2 for tile in tiles)
        before, after = (
            ((sum(tile.edges * getattr(tile, side).rms ** 2 for tile in tiles) + fixed) / edges) ** 0.5
            for side in ("before", "after")
        )
        shown.append(("Strain", f"{before:.3f} before, {after:.3f} after"))
    if report.median_stretch and not 1 / 3 < report.median_stretch < 3:
        shown.append(("Warning", "the pose is in other units than the rest shape, or its vertices in another order"))
    return shown
