"""Rigidity images out of pictures: From Texture and From Geometry, and their dialog."""

from __future__ import annotations

import textwrap
from collections.abc import Callable

import bpy
import bpy.utils.previews
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

from .. import maps, textures
from ..messages import Problem, text_of
from ..outcome import MUCH_RIGID, percent
from ..session import library
from .base import OnObject
from .material import set_up
from .rigidity import Tiles, made_of, rgba, show

IS_SKIN = "Is it the skin, which is to give way? Then choose another color, Bright, Dark or Invert"
# The pictures of dialogs.
previews = bpy.utils.previews.new()


def preview(name: str, tiles: Tiles) -> int:
    """An icon that shows tiles side by side, as the dialog's pictures are."""
    icon = previews.get(name) or previews.new(name)
    picture = np.concatenate([rgba(maps.nearest(values, (256, 256))) for values in tiles.values()], 1)
    icon.image_size = picture.shape[1::-1]
    icon.image_pixels_float = picture.ravel()
    return icon.icon_id


class _FromImage(OnObject):
    """An operator that makes the rigidity out of a picture."""

    on_selected = True

    # It is not that of the next object.
    image: StringProperty(
        name="Image",
        description="The picture to look at; empty: that of the active material",
        options={"SKIP_SAVE"},
    )
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

    # As a step of Set Up.
    set_up: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    def own(self) -> tuple[str, ...]:
        """The names of the operator's own properties to be shown."""
        raise NotImplementedError

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        row = layout.row()
        for name, icon in self._shown.items():
            column = row.column()
            column.template_icon(icon_value=icon, scale=8)
            column.label(text=name)
        # As wide as the dialog is.
        for line in textwrap.wrap(self._told, 60):
            layout.label(text=line)
        layout.prop_search(self, "image", bpy.data, "images")
        for name in (*self.own(), "smallest", "invert", "size"):
            layout.prop(self, name)

    def source(self, obj: bpy.types.Object, found: bpy.types.Image | None, what: str) -> bpy.types.Image:
        if self.image:
            found = bpy.data.images.get(self.image)
            if found is None:
                raise Problem(f"there is no image {self.image!r}")
        if found is None:
            raise Problem(f"{obj.name}: its materials have no {what}: choose an image")
        return found

    def given(self, obj: bpy.types.Object) -> tuple[bpy.types.Image, Callable[[Tiles], Tiles], str]:
        """The picture of an object, the way from its tiles to rigidity, and a remark."""
        raise NotImplementedError

    def work(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        source, change, remark = self.given(obj)
        found, told = self.made(self.tiles(source), change)
        image = made_of(obj, found)
        show(obj, image)
        text = f"{obj.name}: {image.name!r} is made of {source.name!r}: {told}{remark}"
        return f"{text}; {set_up(bpy.context, obj)}" if self.set_up else text

    def tiles(self, source: bpy.types.Image) -> Tiles:
        smaller = library().rigidity.smaller
        return {udim: smaller(pixels, self.size) for udim, pixels in maps.read_image(source).items()}

    def made(self, tiles: Tiles, change: Callable[[Tiles], Tiles]) -> tuple[Tiles, str]:
        """The rigidity of a picture's tiles, and what it has, in words."""
        of, features, specks, large = library().rigidity, 0, 0, False
        found = change(tiles)
        for udim, values in found.items():
            found[udim], *counts = of.without_specks(of.changed(values, self.invert), self.smallest)
            features, specks = features + counts[0], specks + counts[1]
        rigid = sum((values > 0.5).sum() for values in found.values())
        if features > 1:
            # A disc of half of all that is rigid.
            width = (2 * rigid / np.pi) ** 0.5
            large = any(of.without_specks(values, width)[1] for values in found.values())
        share = rigid / sum(values.size for values in found.values())
        text = f"{features} features, {percent(share)} of the texture"
        text += f", {specks} specks left out" * (specks > 0)
        asked = f". {IS_SKIN}" if share > MUCH_RIGID else ""
        return found, text + (asked or f". One is larger than all others together. {IS_SKIN}" * large)

    # The dialog shows the texture, and what would be rigid.
    _shown: dict[str, int] = {}
    _told = ""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self.check(context)
        return context.window_manager.invoke_props_dialog(self, width=420)

    def check(self, context: bpy.types.Context) -> bool:
        """Called by the dialog when a setting was changed, too."""
        try:
            source, change, _ = self.given(context.object)
            tiles = self.tiles(source)
            found, self._told = self.made(tiles, change)
            pictures = {"The texture": tiles, "White keeps its shape": found}
            self._shown = {name: preview(name, picture) for name, picture in pictures.items()}
        except Exception as error:  # told in place of the pictures.
            self._shown, self._told = {}, text_of(error)
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        # Adjust Last Operation has no pictures: the scene is there.
        self._shown, self._told = {}, ""
        return super().execute(context)


class VRTM_OT_rigidity_from_texture(_FromImage, bpy.types.Operator):
    """Make the rigidity image out of the texture: texels of about a color, or what is bright or dark"""

    bl_idname = "vrtm.rigidity_from_texture"
    bl_label = "Rigidity from Texture"

    by: EnumProperty(
        name="Keeps Its Shape",
        items=[
            ("colour", "This Color", "Texels of about the color"),
            ("bright", "Bright", "Texels brighter than the threshold"),
            ("dark", "Dark", "Texels darker than the threshold"),
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
        name="Color",
        description="As the texture's image has it. Click on it, and take it from the texture with the pipette",
        subtype="COLOR_GAMMA",
        min=0,
        max=1,
        default=(1,) * 3,
    )
    # The image of which the color was taken; a color of another one is not.
    proposed_for: StringProperty(options={"HIDDEN"})
    tolerance: FloatProperty(
        name="Tolerance",
        description="Largest distance from the color",
        min=0.001,
        max=2,
        default=0.2,
        subtype="FACTOR",
    )

    def given(self, obj: bpy.types.Object) -> tuple[bpy.types.Image, Callable[[Tiles], Tiles], str]:
        source = self.source(obj, textures.colour_image(obj), "Image Texture")
        unset = not self.properties.is_property_set("colour") or self.proposed_for not in ("", source.name)
        if self.by == "colour" and unset and obj == bpy.context.object:
            self.colour, self.proposed_for = rarer_colour(self.tiles(source)), source.name
        return source, self.change, ""

    def change(self, tiles: Tiles) -> Tiles:
        of = library().rigidity
        if self.by == "colour":
            return of.of_colour(tiles, self.colour, self.tolerance)
        found = of.of_brightness(tiles, self.threshold)
        return {udim: of.changed(values, self.by == "dark") for udim, values in found.items()}

    def own(self) -> tuple[str, ...]:
        return ("by", "colour", "tolerance") if self.by == "colour" else ("by", "threshold")


def rarer_colour(tiles: Tiles) -> np.ndarray:
    """The middle color of the bright or the dark texels, whichever are fewer."""
    pixels = np.concatenate([values[..., :3].reshape(-1, 3) for values in tiles.values()])
    bright = library().rigidity.brightness(pixels[None])[0]
    over = bright > library().rigidity.otsu(bright)
    return np.median(pixels[over if over.any() and 2 * over.sum() <= len(over) else ~over], axis=0).clip(0, 1)


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

    def given(self, obj: bpy.types.Object) -> tuple[bpy.types.Image, Callable[[Tiles], Tiles], str]:
        found, down = (None, False) if self.image else textures.height_image(obj)
        source = self.source(obj, found, "texture behind the height of a Bump or Displacement node")
        sunken = self.sunken != down
        remark = "; what is dark in it is high, as its nodes have it" * down

        def change(tiles: Tiles) -> Tiles:
            return library().rigidity.of_heights(tiles, self.feature, self.threshold, sunken)

        return source, change, remark

    def own(self) -> tuple[str, ...]:
        return "feature", "threshold", "sunken"


CLASSES = (VRTM_OT_rigidity_from_texture, VRTM_OT_rigidity_from_heights)
