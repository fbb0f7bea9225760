"""Making, painting and changing the rigidity image."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty

from .. import geometry, keep, live, maps, packed, states, textures, versions
from ..messages import Problem
from ..session import library
from .base import OnObject

Tiles = dict[int | None, np.ndarray]


def has_image(obj: bpy.types.Object) -> bool:
    return obj.vrtm.rigidity_source == "IMAGE" and obj.vrtm.rigidity_image is not None


def show(obj: bpy.types.Object, image: bpy.types.Image) -> None:
    """Makes an image the object's rigidity. The one before is left as it is, and saved with the file, unless it was
    made and not painted on."""
    settings, scene = obj.vrtm, bpy.context.scene
    before = settings.rigidity_image
    settings.rigidity_source, settings.rigidity_image, settings.rigidity_channel = "IMAGE", image, "R"
    paint = scene.tool_settings.image_paint
    if before is not None and paint.canvas == before:
        paint.canvas = image
    keep.replace_image(before, image)
    live.touch(obj, mesh=False)


def made_of(obj: bpy.types.Object, found: Tiles) -> bpy.types.Image:
    """A new rigidity image of an object out of its tiles."""
    image = packed.image(f"{obj.name} rigidity", {udim or packed.WHOLE: rgba(values) for udim, values in found.items()})
    maps.mark_made(image)
    return image


def rgba(values: np.ndarray) -> np.ndarray:
    """Greys, (height, width), as colours; a picture as it is."""
    values = np.clip(values, 0, 1).astype(np.float32)
    return values if values.ndim > 2 else np.stack([values, values, values, np.ones_like(values)], -1)


class _OnImage(OnObject):
    """An operator on the rigidity image."""

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        return super().why_not(context) or (None if has_image(context.object) else "The rigidity is no image")


def rigid_tiles(obj: bpy.types.Object) -> Tiles:
    """The object's rigidity image, by tiles."""
    channel = "RGBA".index(obj.vrtm.rigidity_channel)
    return {udim: pixels[..., channel] for udim, pixels in maps.read_image(obj.vrtm.rigidity_image).items()}


class VRTM_OT_change_rigidity(_OnImage, bpy.types.Operator):
    """Change the rigidity image as a whole. A new image is made; the one before stays as it is"""

    bl_idname = "vrtm.change_rigidity"
    bl_label = "Change Rigidity"

    how: EnumProperty(
        name="How",
        items=[
            ("invert", "Invert", "Rigid parts become elastic, and the rest rigid"),
            ("grow", "Grow", "Rigid parts become larger"),
            ("shrink", "Shrink", "Rigid parts become smaller"),
        ],
    )
    texels: IntProperty(name="Texels", description="By how much it becomes larger or smaller", min=1, max=64, default=2)

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        tiles, name = rigid_tiles(obj), obj.vrtm.rigidity_image.name
        grow = {"invert": 0, "grow": self.texels, "shrink": -self.texels}[self.how]
        changed = library().rigidity.changed
        image = made_of(obj, {udim: changed(values, self.how == "invert", grow) for udim, values in tiles.items()})
        show(obj, image)
        kept = f"; {name!r} is as it was" if image.name != name else ""
        return f"{obj.name}: {image.name!r} is the rigidity now{kept}"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "how")
        if self.how != "invert":
            self.layout.prop(self, "texels")


class VRTM_OT_keep_detail(_OnImage, bpy.types.Operator):
    """Make a mask in which what the texture shows beside rigid parts, such as brows and lips, is dark: it stays as the
    pose has it, and plain skin gives way to features"""

    bl_idname = "vrtm.keep_detail"
    bl_label = "Keep Detail"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        settings, texture, before = obj.vrtm, textures.colour_image(obj), obj.vrtm.mask_image
        if texture is None:
            raise Problem(f"{obj.name}: its materials have no Image Texture")
        rigid, shown = rigid_tiles(obj), maps.read_image(texture)
        # An image without tiles is repeated on all of them.
        pictures = {udim: shown.get(udim, shown.get(None)) for udim in rigid}
        if missing := [udim for udim, pixels in pictures.items() if pixels is None]:
            raise Problem(f"image {texture.name!r} has no tile {missing[0] or 'that is not a UDIM tile'}")
        # Detail is as fine as half of the grid: on a face that is small in the UV map, more is kept between features.
        asset = states.state_of(obj).asset
        cells = max([256, *(max(tile.grid) // 2 for tile in (asset.tiles if asset else ()))])
        found = library().rigidity.of_detail(pictures, rigid, linear=texture.is_float, ceiling=1.0, cells=cells)
        image = made_of(obj, {udim: 1 - values for udim, values in found.items()})
        image.name, kept = f"{obj.name} mask", ""
        settings.mask_source, settings.mask_image, settings.mask_channel = "IMAGE", image, "R"
        if not keep.replace_image(before, image) and before is not None:
            kept = "; the one before is as it was"
        live.touch(obj, mesh=False)
        return f"{obj.name}: {image.name!r} is the mask now{kept}"


class VRTM_OT_new_rigidity(OnObject, bpy.types.Operator):
    """Make a black rigidity image, in which nothing is rigid yet, to be painted on"""

    bl_idname = "vrtm.new_rigidity"
    bl_label = "New Rigidity Image"

    size: IntProperty(name="Size", description="Texels per side", min=64, max=8192, default=1024)

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        image = new_image(obj, self.size)
        return f"{obj.name}: {image.name!r} is made: paint white on it what keeps its shape"


def new_image(obj: bpy.types.Object, size: int) -> bpy.types.Image:
    """A black rigidity image with the tiles that the mesh's UVs lie in."""
    uvs = geometry.topology(obj).uvs
    tiles = np.unique(np.floor(np.clip(uvs, 1e-4, None) - 1e-4).astype(int), axis=0)
    udims = [1001 + int(u) + 10 * int(v) for u, v in tiles if u < 10] or [1001]
    image = made_of(obj, dict.fromkeys(udims if udims != [1001] else [None], np.zeros((size, size), np.float32)))
    show(obj, image)
    return image


class VRTM_OT_paint(_OnImage, bpy.types.Operator):
    """Paint on the rigidity image: makes it the canvas of Texture Paint mode, and the UV map of the texture the active
    one"""

    bl_idname = "vrtm.paint"
    bl_label = "Paint It"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        return f"{obj.name}: {paint(context, obj)}"


def paint(context: bpy.types.Context, obj: bpy.types.Object) -> str:
    """Begins to paint on the rigidity image of the active object; returns a sentence."""
    if not has_image(obj):
        raise Problem(f"{obj.name}: its rigidity is no image")
    image, source = obj.vrtm.rigidity_image, geometry.source_uv_layer(obj)
    obj.data.uv_layers.active = source
    settings = context.scene.tool_settings.image_paint
    settings.mode, settings.canvas = "IMAGE", image
    if obj.mode != "TEXTURE_PAINT":
        bpy.ops.object.mode_set(mode="TEXTURE_PAINT")
        # Blender's own colour is black.
        for of in (versions.unified_paint_settings(context.scene), settings.brush):
            if of is not None:
                of.color, of.secondary_color = (1, 1, 1), (0, 0, 0)
    return f"{image.name!r} is painted on: white keeps its shape"


class VRTM_OT_pack_maps(OnObject, bpy.types.Operator):
    """Pack the painted rigidity and mask into the file, so that they are saved with it"""

    bl_idname = "vrtm.pack_maps"
    bl_label = "Pack"

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        settings, done = obj.vrtm, []
        for image in dict.fromkeys((settings.rigidity_image, settings.mask_image)):
            if image is not None and image.library is None and (image.is_dirty or image.source == "GENERATED"):
                image.pack()
                done.append(repr(image.name))
        return f"{obj.name}: {', '.join(done) or 'nothing'} packed: it is saved with the file"


CLASSES = (
    VRTM_OT_new_rigidity,
    VRTM_OT_paint,
    VRTM_OT_change_rigidity,
    VRTM_OT_keep_detail,
    VRTM_OT_pack_maps,
)
