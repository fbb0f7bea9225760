"""Making, painting and changing the rigidity image."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

from .. import geometry, keep, live, maps, packed, status, textures, versions
from ..messages import Problem
from ..session import library
from .base import OnObject
from .material import set_up

Tiles = dict[int | None, np.ndarray]


def has_image(obj: bpy.types.Object) -> bool:
    return obj.vrtm.rigidity_source == "IMAGE" and obj.vrtm.rigidity_image is not None


def show(obj: bpy.types.Object, image: bpy.types.Image) -> None:
    """Makes an image the object's rigidity. The one before is left as it is, and saved with the file."""
    settings, scene = obj.vrtm, bpy.context.scene
    before = settings.rigidity_image
    settings.rigidity_source, settings.rigidity_image, settings.rigidity_channel = "IMAGE", image, "R"
    paint = scene.tool_settings.image_paint
    if before is not None and paint.canvas == before:
        paint.canvas = image
    if before is not None and before != image:
        keep.keep_image(before)
    live.touch(obj, mesh=False)


def made_of(obj: bpy.types.Object, source: bpy.types.Image, change: Callable[[Tiles], Tiles]) -> bpy.types.Image:
    """A new rigidity image out of the tiles of another image."""
    tiles = {}
    for udim, values in change(maps.read_image(source)).items():
        values = np.clip(values, 0, 1)
        tiles[udim or packed.WHOLE] = np.stack([values, values, values, np.ones_like(values)], -1).astype(np.float32)
    return packed.image(f"{obj.name} rigidity", tiles)


class _FromImage(OnObject):
    """An operator that makes the rigidity out of a picture."""

    on_selected = True

    image: StringProperty(name="Image", description="The picture to look at; empty: that of the active material")
    size: IntProperty(
        name="Size", description="Texels per side of the new image at most", min=64, max=8192, default=1024
    )
    smallest: FloatProperty(
        name="Smallest",
        description="Texels across the smallest feature: smaller ones are specks, and left out",
        min=0,
        max=512,
        default=3,
    )
    invert: BoolProperty(name="Invert", description="The other part is rigid")
    grow: IntProperty(name="Grow", description="Texels by which rigid parts grow, or shrink", min=-64, max=64)

    # As a step of Set Up.
    set_up: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    def own(self) -> tuple[str, ...]:
        """The names of the operator's own properties to be shown."""
        raise NotImplementedError

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop_search(self, "image", bpy.data, "images")
        for name in (*self.own(), "smallest", "invert", "grow", "size"):
            layout.prop(self, name)

    def source(self, obj: bpy.types.Object, found: bpy.types.Image | None, what: str) -> bpy.types.Image:
        if self.image:
            found = bpy.data.images.get(self.image)
            if found is None:
                raise Problem(f"there is no image {self.image!r}")
        if found is None:
            raise Problem(f"{obj.name}: its materials have no {what}: choose an image")
        return found

    def make(self, obj: bpy.types.Object, source: bpy.types.Image, change: Callable[[Tiles], Tiles]) -> str:
        of, features, specks = library().rigidity, 0, 0

        def made(tiles: Tiles) -> Tiles:
            nonlocal features, specks
            found = change({udim: of.smaller(pixels, self.size) for udim, pixels in tiles.items()})
            for udim, values in found.items():
                left, *counts = of.without_specks(of.changed(values, self.invert), self.smallest)
                features, specks = features + counts[0], specks + counts[1]
                found[udim] = of.changed(left, grow=self.grow)
            return found

        image = made_of(obj, source, made)
        show(obj, image)
        left_out = f", {specks} specks left out" if specks else ""
        text = f"{obj.name}: {image.name!r} is made of {source.name!r}: {features} features{left_out}"
        return f"{text}; {set_up(bpy.context, obj)}" if self.set_up else text


class VRTM_OT_rigidity_from_texture(_FromImage, bpy.types.Operator):
    """Make the rigidity image out of the texture: texels brighter than a threshold, or of about a colour"""

    bl_idname = "vrtm.rigidity_from_texture"
    bl_label = "Rigidity from Texture"

    by: EnumProperty(
        name="By",
        items=[
            ("brightness", "Brightness", "Texels brighter than the threshold"),
            ("colour", "Color", "Texels of about the colour"),
        ],
    )
    threshold: FloatProperty(
        name="Threshold",
        description="0: the brightness that parts dark and bright best",
        min=0,
        max=1,
        subtype="FACTOR",
    )
    colour: FloatVectorProperty(
        name="Color", description="As the texture's image has it", subtype="COLOR_GAMMA", min=0, max=1, default=(1,) * 3
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="Largest distance from the colour",
        min=0.001,
        max=2,
        default=0.2,
        subtype="FACTOR",
    )

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        source = self.source(obj, textures.colour_image(obj), "Image Texture")
        return self.make(obj, source, self.change)

    def change(self, tiles: Tiles) -> Tiles:
        if self.by == "colour":
            return library().rigidity.of_colour(tiles, self.colour, self.tolerance)
        return library().rigidity.of_brightness(tiles, self.threshold)

    def own(self) -> tuple[str, ...]:
        return ("by", "colour", "tolerance") if self.by == "colour" else ("by", "threshold")


class VRTM_OT_rigidity_from_heights(_FromImage, bpy.types.Operator):
    """Make the rigidity image out of a bump or displacement map: the islands that stand out of their surroundings"""

    bl_idname = "vrtm.rigidity_from_heights"
    bl_label = "Rigidity from Geometry"

    feature: FloatProperty(
        name="Feature", description="The width of the largest feature, in UV", min=0.002, max=0.5, default=0.06
    )
    threshold: FloatProperty(
        name="Threshold",
        description="Least height above the surroundings, as a part of the largest; 0: the height that parts them best",
        min=0,
        max=1,
        subtype="FACTOR",
    )
    sunken: BoolProperty(name="Sunken", description="Parts deeper than their surroundings are rigid")

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        found, down = (None, False) if self.image else textures.height_image(obj)
        source = self.source(obj, found, "texture behind the height of a Bump or Displacement node")
        sunken = self.sunken != down
        text = self.make(
            obj, source, lambda tiles: library().rigidity.of_heights(tiles, self.feature, self.threshold, sunken)
        )
        return text + "; what is dark in it is high, as its nodes have it" * down

    def own(self) -> tuple[str, ...]:
        return "feature", "threshold", "sunken"


class _OnImage(OnObject):
    """An operator on the rigidity image."""

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        return super().why_not(context) or (None if has_image(context.object) else "The rigidity is no image")


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
        source, channel = obj.vrtm.rigidity_image, "RGBA".index(obj.vrtm.rigidity_channel)
        grow = {"invert": 0, "grow": self.texels, "shrink": -self.texels}[self.how]

        def change(tiles: Tiles) -> Tiles:
            changed = library().rigidity.changed
            return {udim: changed(pixels[..., channel], self.how == "invert", grow) for udim, pixels in tiles.items()}

        image = made_of(obj, source, change)
        show(obj, image)
        return f"{obj.name}: {image.name!r} is the rigidity now; {source.name!r} is as it was"

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
        channel, shown = "RGBA".index(settings.rigidity_channel), maps.read_image(texture)

        def change(tiles: Tiles) -> Tiles:
            rigid = {udim: pixels[..., channel] for udim, pixels in tiles.items()}
            # An image without tiles is repeated on all of them.
            pictures = {udim: shown.get(udim, shown.get(None)) for udim in rigid}
            if missing := [udim for udim, pixels in pictures.items() if pixels is None]:
                raise Problem(f"image {texture.name!r} has no tile {missing[0] or 'that is not a UDIM tile'}")
            found = library().rigidity.of_detail(pictures, rigid, linear=texture.is_float, ceiling=1.0)
            return {udim: 1 - values for udim, values in found.items()}

        image = made_of(obj, settings.rigidity_image, change)
        image.name = f"{obj.name} mask"
        settings.mask_source, settings.mask_image, settings.mask_channel = "IMAGE", image, "R"
        keep.keep_image(before)
        live.touch(obj, mesh=False)
        return f"{obj.name}: {image.name!r} is the mask now; the one before is as it was"


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
    black = np.zeros((size, size, 4), np.float32)
    black[..., 3] = 1
    image = packed.image(f"{obj.name} rigidity", {udim: black for udim in udims} if udims != [1001] else {0: black})
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
    lacking = f". {status.NO_BRUSH}" if settings.brush is None else ""
    return f"{image.name!r} is painted on: white keeps its shape{lacking}"


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
    VRTM_OT_rigidity_from_texture,
    VRTM_OT_rigidity_from_heights,
    VRTM_OT_change_rigidity,
    VRTM_OT_keep_detail,
    VRTM_OT_pack_maps,
)
