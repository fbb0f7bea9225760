"""The settings of an object. They are Blender properties, so that they are saved with the file, undone and animated."""

from __future__ import annotations

from functools import partial

import bpy

from . import live, overlay, session, versions

SOURCES = [
    ("NONE", "None", "No map"),
    ("IMAGE", "Image", "An image over the UV map, UDIM tiles too, as it is painted at present, saved or not"),
    ("VERTEX_GROUP", "Vertex Group", "The weights of a vertex group"),
    ("ATTRIBUTE", "Color Attribute", "A colour attribute or a float attribute of the mesh"),
]
CHANNELS = [(name, name, f"The {word} channel") for name, word in zip("RGBA", ("red", "green", "blue", "alpha"))]

QUALITY = {
    "name": "Quality",
    "items": [("draft", "Draft", "A preview"), ("normal", "Normal", "The whole solve")],
    "default": "normal",
}
GRID = {
    "name": "Grid",
    "description": "Cells per side of a tile; 0: 20 across the narrowest rigid features, as Status tells",
    "min": 0,
    "max": 16384,
}
MAP_SIZE = {
    "name": "Map Size",
    "description": "Texels per side of a tile in the resulting image; 0: as many as the grid has cells. "
    "A quarter of the texture's size does for most",
    "min": 0,
    "max": 16384,
}


def _changed(settings: VrtmSettings, context: bpy.types.Context) -> None:
    """A setting that a solve depends on was changed by hand: if the object is live, its result follows."""
    live.touch(settings.id_data)


# Settings of linked objects that are overridden are kept in the file, too. No solve depends on those without `update`.
BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty = (
    partial(getattr(bpy.props, f"{kind}Property"), override={"LIBRARY_OVERRIDABLE"}, update=_changed)
    for kind in ("Bool", "Enum", "Float", "Int", "Pointer", "String")
)


def _live_changed(settings: VrtmSettings, context: bpy.types.Context) -> None:
    if settings.live:
        live.touch(settings.id_data)
    else:
        live.stop(settings.id_data)


def _strain_changed(settings: VrtmSettings, context: bpy.types.Context) -> None:
    obj = settings.id_data
    on = settings.strain != "NONE"
    overlay.show(on)
    if not on:
        overlay.remove(obj)
    elif not session.synchronous():
        live.want(obj)


class VrtmSettings(bpy.types.PropertyGroup):
    """Object.vrtm"""

    live: BoolProperty(
        name="Live", description="Follow the pose while frames are scrubbed and poses are edited", update=_live_changed
    )
    in_renders: BoolProperty(
        name="In Renders", description="Solve each frame that is rendered, also without Live", default=True, update=None
    )
    rigidity_source: EnumProperty(
        name="Rigidity", description="The source of rigidity: painted parts keep their shape", items=SOURCES
    )
    rigidity_image: PointerProperty(
        name="Image", description="White keeps its shape, black is elastic", type=bpy.types.Image
    )
    rigidity_channel: EnumProperty(name="Channel", items=CHANNELS)
    rigidity_name: StringProperty(
        name="Name", description="The vertex group or attribute: 1 keeps its shape, 0 is elastic"
    )
    mask_source: EnumProperty(
        name="Mask", description="The source of the mask: masked parts do not move in the UVs", items=SOURCES
    )
    mask_image: PointerProperty(name="Image", description="Parts darker than half do not move", type=bpy.types.Image)
    mask_channel: EnumProperty(name="Channel", items=CHANNELS)
    mask_name: StringProperty(name="Name", description="The vertex group or attribute: what is under 0.5 does not move")
    uv_map: StringProperty(name="UV Map", description="The UV map of the texture; empty: the one that renders")
    rest_source: EnumProperty(
        name="Rest",
        description="The shape on which the texture looks as it was painted",
        items=[
            ("MESH", "Mesh", "The mesh as it is in Edit Mode, without modifiers (the Basis of its shape keys)"),
            ("SHAPE_KEY", "Shape Key", "One of the mesh's shape keys, at its full value"),
            ("CAPTURED", "Captured", "The evaluated shape at the moment when Capture was pressed"),
        ],
    )
    rest_key: StringProperty(name="Shape Key", description="The shape key that is the rest shape")
    # The captured shape, where the object's mesh is linked and cannot keep it.
    rest_mesh: PointerProperty(name="Captured Rest", type=bpy.types.Mesh, update=None)
    # Two values each, as of Subdivision Surface: the viewport's, and that of renders and bakes.
    quality: EnumProperty(**QUALITY)
    render_quality: EnumProperty(**QUALITY, update=None)
    grid: IntProperty(**GRID)
    render_grid: IntProperty(**GRID, update=None)
    map_size: IntProperty(**MAP_SIZE)
    render_map_size: IntProperty(**MAP_SIZE, update=None)
    overlaps: EnumProperty(
        name="Overlaps",
        description="Treatment of islands that lie over one another in the UV map, as mirrored halves do",
        items=[
            ("each", "Each", "Every island is solved as if it were alone: each layer of islands has its own result"),
            ("fixed", "Fixed", "Nothing moves where islands share the texture"),
            ("first_face", "First Face", "The island with the first face moves all of them: for those that bend alike"),
        ],
        default="each",
    )
    seams: EnumProperty(
        name="Seams",
        description="Treatment of features at the seams of the UV map",
        items=[
            ("auto", "Auto", "Continue where all textures are dilated; else Shut or Keep, whichever is better"),
            ("shut", "Shut", "Nothing moves at a seam: a feature on one keeps its width there"),
            ("keep", "Keep", "A feature that touches a border stays as it is, whole"),
            ("continue", "Continue", "Features keep their shape across seams. Press Dilate Textures for that"),
        ],
        default="shut",
    )
    open_borders: EnumProperty(
        name="Open Borders",
        description="Treatment of textures at the ends of the mesh",
        items=[
            ("auto", "Auto", "Slide where all textures are dilated, and no other mesh begins there"),
            ("fixed", "Fixed", "Nothing moves there, as is right where another mesh begins"),
            ("slide", "Slide", "Textures slide along the border, so that features there keep their shape"),
        ],
        default="fixed",
    )
    seam_reach: FloatProperty(
        name="Reach",
        description="Width of the surface beyond seams and open borders that counts, in UV: the radius of the largest "
        "feature there",
        min=0.001,
        max=0.5,
        default=1 / 32,
        precision=4,
    )
    weld: EnumProperty(
        name="Doubles",
        description="Vertices that lie at one place, as meshes from glTF and games have them along seams",
        items=[
            ("auto", "Auto", "One vertex where all of them lie on seams of the UV map, and else as Cut"),
            ("weld", "Weld", "One vertex: features continue there, except in poses that pull them apart"),
            ("cut", "Cut", "As many as the mesh has, as between lips: features end there"),
        ],
    )
    scale: EnumProperty(
        name="Scale",
        description="The size of features on a body that is larger or smaller than at rest",
        items=[
            ("keep", "Keep", "Features keep their size, as on a body that swells"),
            ("follow", "Follow", "Features grow and shrink with the pose as a whole, as under a scale control"),
        ],
    )
    device: EnumProperty(
        name="Device",
        items=[
            ("auto", "Automatic", "A GPU if there is one, and the CPU otherwise"),
            ("cpu", "CPU", "The processor"),
            ("gpu", "GPU", "The first GPU; an error if the machine has no GPU"),
        ],
        default="auto",
    )
    measure: BoolProperty(
        name="Measure Strain",
        description="Also measure how much the features are strained, and which are worse than without vrtm. Slow",
    )
    # In artists' words; solve.py has the library's.
    harm: FloatProperty(
        name="No Harm",
        description="How much stiffer a feature gets where it would look worse than without vrtm. At 0 all give way "
        "alike, and in a crowd some look worse",
        min=0,
        max=16,
        default=7,
    )
    calm: FloatProperty(
        name="Calm",
        description="Over time: raise it where features jitter in a film, which leaves more strain. Lower, down to -1, "
        "features are rounder, and the skin between them is squeezed harder",
        min=-1,
        max=1,
    )
    keep_direction: FloatProperty(
        name="Keep Direction",
        description="Features turn less where they are dense, such as scales and lettering: 0.15 is a beginning, 0.5 "
        "is much. It leaves more strain, and does not go with seams that continue",
        min=0,
        max=2,
        soft_max=1,
    )
    room: FloatProperty(
        name="Room",
        description="How much the skin between features resists being crushed. Nearly always 0.3 is best: lower or "
        "higher leaves more strain",
        min=0,
        max=10,
        soft_max=3,
        default=0.3,
    )
    write_image: BoolProperty(name="Image", description="Write an image of what to add to each UV", default=True)
    write_uvs: BoolProperty(
        name="UV Map",
        description="Write the redirected UVs of the face corners to a UV map. They recover less than the image where "
        "faces are larger than features",
        default=True,
    )
    write_strain: BoolProperty(
        name="Strain",
        description="Write how much the surface is stretched and squashed to a vector attribute of the vertices, for "
        "wrinkles, redness or dirt in shaders: the UV map's name with _strain. X is 0.2 where it is a fifth longer "
        "than at rest, Y where it is a fifth shorter",
    )
    strain_of: EnumProperty(
        name="Strain of",
        description="The part of the texture whose strain is shown",
        items=[
            ("FEATURES", "Features", "What is rigid"),
            ("SKIN", "Skin", "What gives way between features. Full colours are twice or half as long as at rest"),
            ("ALL", "All", "All of the texture"),
        ],
    )
    strain: EnumProperty(
        name="Show Strain",
        description="Show in Solid viewports how much what is painted is stretched (red) or squeezed (blue): full "
        "colours are a quarter longer or a fifth shorter than at rest",
        items=[
            ("NONE", "Off", "Show what was shown before"),
            ("BEFORE", "Before", "With the mesh's own UVs: it shows where features need to be rigid"),
            ("AFTER", "After", "With the redirection"),
        ],
        update=_strain_changed,
    )
    # Findings of Auto: the better one of Shut and Keep, its reason, and True if other vertices lie at the ends of the
    # mesh.
    seams_found: EnumProperty(items=[("shut", "Shut", ""), ("keep", "Keep", "")], update=None)
    seams_why: StringProperty(update=None)
    goes_on: BoolProperty(update=None)
    # The outputs. A pointer follows renaming, undo and saving; a UV map has no pointer, so its name is kept.
    image: PointerProperty(name="Redirection", type=bpy.types.Image, update=None)
    uv_name: StringProperty(name="Redirected UV Map", default="vrtm", update=None)
    # Set by the operators that switch between the result image and baked files.
    shows_baked: BoolProperty(name="Shows Baked Files", update=None)
    # Set by those that bake what is carried, and have it live again.
    carried_baked: BoolProperty(name="Carried Things Show a Bake", update=None)

    @property
    def is_set_up(self) -> bool:
        """True if the object has a rigidity, so that something is redirected."""
        return self.id_data.type == "MESH" and self.rigidity_source != "NONE"

    @property
    def is_followed(self) -> bool:
        """True if something is computed for the object's poses: a redirection, or strain alone."""
        return self.id_data.type == "MESH" and (self.is_set_up or self.strain != "NONE")


class VrtmBakeSettings(bpy.types.PropertyGroup):
    """Scene.vrtm_bake"""

    directory: StringProperty(
        name="Folder",
        description="The folder of baked files; // is that of the file",
        subtype="DIR_PATH",
        default="//vrtm/",
        update=None,
        **versions.PATH_OPTIONS,
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Replace files of these names that are not from a bake, too. What this file reads, such as "
        "textures and caches, is never replaced",
        update=None,
    )
    poses: EnumProperty(
        name="Poses",
        description="The poses that Bake for Games fits its maps to",
        items=[
            ("KEYS", "Shape Keys", "Each shape key at its full value: the weights of shape keys drive the maps"),
            ("FRAMES", "Frames", "The frames of the bake: an animation drives the maps"),
        ],
        update=None,
    )
    error: FloatProperty(
        name="Largest Error",
        description="By how much a sum of the maps may miss a pose's own redirection, in texels of a texture of 4096: "
        "less takes more maps",
        min=0.1,
        max=256,
        default=8,
        update=None,
    )


def register() -> None:
    bpy.utils.register_class(VrtmSettings)
    bpy.utils.register_class(VrtmBakeSettings)
    bpy.types.Object.vrtm = PointerProperty(type=VrtmSettings, update=None)
    bpy.types.Scene.vrtm_bake = PointerProperty(type=VrtmBakeSettings, update=None)
    # Of a result image: that of the next layer, if there is one.
    bpy.types.Image.vrtm_next = PointerProperty(name="Next Layer", type=bpy.types.Image, update=None)
    # Of a dilated copy: the image that it was made of, which is saved with it.
    bpy.types.Image.vrtm_original = PointerProperty(name="Original", type=bpy.types.Image, update=None)


def unregister() -> None:
    del bpy.types.Image.vrtm_original
    del bpy.types.Image.vrtm_next
    del bpy.types.Scene.vrtm_bake
    del bpy.types.Object.vrtm
    bpy.utils.unregister_class(VrtmBakeSettings)
    bpy.utils.unregister_class(VrtmSettings)
