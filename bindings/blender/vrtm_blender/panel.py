"""The panels in Properties > Object Data and in 3D views, and the menus. They only show: drawing changes nothing and
solves nothing."""

from __future__ import annotations

import bpy

from . import geometry, keep, session, status, tap
from .operators.objects import PRESETS, preset_of


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type == "MESH"


class _Part(_Panel):
    bl_parent_id = "VRTM_PT_main"
    bl_options = {"DEFAULT_CLOSED"}


class VRTM_PT_main(_Panel, bpy.types.Panel):
    bl_label = "Rigid Features (vrtm)"
    bl_idname = "VRTM_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        settings = obj.vrtm
        layout.use_property_split, layout.use_property_decorate = True, False
        if not obj.vrtm.is_set_up:
            layout.operator("vrtm.set_up", icon="PLAY")
        draw_map(layout, obj, "rigidity")
        layout.menu("VRTM_MT_rigidity", icon="TPAINT_HLT")
        draw_map(layout, obj, "mask")
        column = layout.column()
        column.prop_search(settings, "uv_map", obj.data, "uv_layers")
        column.prop(settings, "rest_source")
        if settings.rest_source == "SHAPE_KEY":
            if obj.data.shape_keys:
                column.prop_search(settings, "rest_key", obj.data.shape_keys, "key_blocks")
            else:
                column.label(text="The mesh has no shape keys", icon="ERROR")
        elif settings.rest_source == "CAPTURED":
            column.operator("vrtm.capture_rest")
            kept = geometry.rest_keeper(obj)
            if geometry.REST_NAME in kept.attributes:
                column.label(text=f"Captured at frame {kept.get(geometry.REST_FRAME_NAME, '?')}")
        draw_topology(layout, context)
        draw_solve(layout, context)


class VRTM_PT_view(bpy.types.Panel):
    """In the sidebar of 3D views: buttons for posing and painting."""

    bl_label = "Rigid Features (vrtm)"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "vrtm"
    poll = _Panel.poll

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.object.vrtm
        if not settings.is_set_up:
            layout.operator("vrtm.set_up", icon="PLAY")
        layout.menu("VRTM_MT_rigidity", icon="TPAINT_HLT")
        draw_solve(layout, context)
        layout.label(text="Show Strain")
        layout.row().prop(settings, "strain", expand=True)
        for line in status.notes(context.object, context.scene):
            status.draw(layout, context, line)
        draw_remedies(layout, context.object)


class VRTM_PT_quality(_Part, bpy.types.Panel):
    bl_label = "Quality and Outputs"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.object.vrtm
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("quality", "grid", "map_size"):
            column = layout.column(align=True)
            # Longer words are cut at the panel's usual width.
            column.prop(settings, name)
            column.prop(settings, f"render_{name}", text="Render")
        for name in ("device", "measure", "overlaps", "seams", "open_borders"):
            layout.prop(settings, name)
        if settings.seams in ("auto", "continue") or settings.open_borders in ("auto", "slide"):
            layout.prop(settings, "seam_reach")
        column = layout.column(heading="Write")
        for name in ("write_image", "write_uvs", "write_strain"):
            row = column.row()
            # A linked mesh takes nothing.
            row.enabled = name == "write_image" or not geometry.is_linked(context.object)
            row.prop(settings, name)
        if settings.write_image and settings.image is not None:
            layout.prop(settings, "image")


class VRTM_PT_advanced(_Part, bpy.types.Panel):
    bl_label = "Advanced"

    def draw(self, context: bpy.types.Context) -> None:
        # Names stand within the fields: beside them the longest is cut at the panel's usual width.
        layout = self.layout
        for name, text in (
            ("harm", "Leave it: no feature looks worse than before"),
            ("calm", "Up: no jitter in films. Down: rounder features"),
            ("keep_direction", "Up: scales and lettering turn less"),
            ("room", "Leave it, unless skin is crushed"),
            ("scale", "Follow: under a scale control features grow, too"),
            ("weld", "Vertices at one place: Weld for imported files, Cut for lips"),
        ):
            column = layout.column(align=True)
            column.prop(context.object.vrtm, name)
            status.draw(column, context, status.Line(text))


class VRTM_PT_strain(_Part, bpy.types.Panel):
    bl_label = "Show Strain"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.enabled = not geometry.is_linked(context.object)
        layout.row().prop(context.object.vrtm, "strain", expand=True)
        layout.row().prop(context.object.vrtm, "strain_of", expand=True)
        layout.label(text="Red: stretched. Blue: squeezed", icon="INFO")


class VRTM_PT_material(_Part, bpy.types.Panel):
    bl_label = "Material"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        row = layout.row(align=True)
        row.operator("vrtm.set_up_material", text="Set Up by Image").by = "image"
        row.operator("vrtm.set_up_material", text="By UV Map").by = "uv_map"
        layout.operator("vrtm.dilate")
        layout.operator("vrtm.check")
        layout.operator("vrtm.clear_material")


class VRTM_PT_carry(_Part, bpy.types.Panel):
    bl_label = "Carry"

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        if obj.vrtm_carry.skin is not None:
            layout.label(text=f"Carried by {obj.vrtm_carry.skin.name}", icon="LINKED")
        row = layout.row(align=True)
        row.operator("vrtm.carry")
        row.operator("vrtm.wrap")
        layout.operator("vrtm.carry_live" if obj.vrtm.carried_baked else "vrtm.carry_bake")
        layout.operator("vrtm.carry_remove")


class VRTM_PT_bake(_Part, bpy.types.Panel):
    bl_label = "Bake to Disk"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.vrtm_bake
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "directory")
        column = layout.column(align=True)
        for name in ("frame_start", "frame_end", "frame_step"):
            column.prop(scene, name, text=name.removeprefix("frame_").capitalize())
        layout.prop(settings, "overwrite")
        layout.operator("vrtm.bake", icon="RENDER_ANIMATION")
        baked = context.object.vrtm.shows_baked
        layout.operator("vrtm.use_live" if baked else "vrtm.use_baked")
        column = layout.column()
        column.separator()
        column.label(text="For games: a few maps, and a glb")
        column.prop(settings, "poses")
        column.prop(settings, "error")
        column.operator("vrtm.bake_basis", icon="EXPORT")


class VRTM_PT_status(_Panel, bpy.types.Panel):
    """The last one, so that nothing below it moves."""

    bl_label = "Status"
    bl_parent_id = "VRTM_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        notes = status.notes(obj, context.scene)
        for line in notes:
            status.draw(layout, context, line)
        if obj.vrtm.is_set_up and keep.unsaved_maps(obj):
            layout.operator("vrtm.pack_maps", icon="PACKAGE")
        draw_remedies(layout, obj)
        if not notes:
            layout.label(text="Nothing to be mended", icon="CHECKMARK")
        for label, value in status.figures(obj):
            row = layout.row()
            row.label(text=label)
            row.label(text=value)
        layout.operator("vrtm.remove_all", icon="TRASH")


class VRTM_MT_rigidity(bpy.types.Menu):
    bl_label = "Rigidity Map"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator("vrtm.new_rigidity", text="New Image", icon="FILE_NEW")
        layout.operator("vrtm.paint", icon="BRUSH_DATA")
        layout.separator()
        layout.operator("vrtm.rigidity_from_texture", text="From Texture", icon="TEXTURE")
        layout.operator("vrtm.rigidity_from_heights", text="From Geometry (Bump, Displacement)", icon="RNDCURVE")
        layout.separator()
        for how in ("invert", "grow", "shrink"):
            layout.operator("vrtm.change_rigidity", text=how.capitalize()).how = how
        layout.operator("vrtm.keep_detail")
        layout.separator()
        layout.operator("vrtm.pack_maps", icon="PACKAGE")


class VRTM_MT_begin(bpy.types.Menu):
    """The question of Set Up if nothing tells what is rigid."""

    bl_label = "What keeps its shape?"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        # The first one lies under the mouse, where a double click on Set Up presses it.
        for name, text, icon in (("texture", "From Texture", "TEXTURE"), ("heights", "From Geometry", "RNDCURVE")):
            layout.operator(f"vrtm.rigidity_from_{name}", text=text, icon=icon).set_up = True
        layout.operator("vrtm.set_up", text="Paint It", icon="BRUSH_DATA").paint = True


class VRTM_MT_object(bpy.types.Menu):
    """In Object menus, and so in the search of operators."""

    bl_label = "Rigid Features (vrtm)"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        # Menus of objects run operators without asking; ours ask where they take long.
        layout.operator_context = "INVOKE_DEFAULT"
        for names in (
            ("set_up", "update", "worst_feature", "capture_rest"),
            ("set_up_material", "dilate", "check", "clear_material"),
            ("carry", "wrap", "carry_bake", "carry_live", "carry_remove"),
            ("bake", "bake_basis", "use_baked", "use_live", "remove_all"),
        ):
            for name in names:
                made = layout.operator(f"vrtm.{name}")
                if name == "set_up_material":
                    made.by = "image"
            layout.separator()
        layout.menu("VRTM_MT_rigidity")


def draw_solve(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draws the buttons for solves, and two rows on the last one."""
    obj, settings = context.object, context.object.vrtm
    row, present = layout.row(align=True), preset_of(settings)
    for name in PRESETS:
        row.operator("vrtm.preset", text=name.capitalize(), depress=name == present).name = name
    column = layout.column(heading="Solve")
    column.prop(settings, "live")
    column.prop(settings, "in_renders")
    layout.operator("vrtm.update", icon="FILE_REFRESH")
    # Always two rows, so that no button moves while things are solved. All else is told in Status.
    line = status.headline(obj, context.scene)
    column = layout.column(align=True)
    column.label(text=line.text, icon=line.icon)
    column.label(text=status.summary(obj), icon="BLANK1")
    if settings.is_set_up and settings.strain == "NONE" and not session.shows_materials():
        text = "Solid view does not show the result: see it in Material Preview (press Z)"
        status.draw(layout, context, status.Line(text, "INFO"))


def draw_remedies(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    """Draws the buttons that notes name, below them."""
    found, told = status.features(obj), dict(status.figures(obj))
    if "On seams" in told:
        layout.operator("vrtm.dilate")
    if "Doubles" in told:
        layout.row().prop(obj.vrtm, "weld", expand=True)
    for skin, text in ((False, "Show Worst Feature"), (True, "Show Squeezed Skin")):
        if found.places(skin):
            layout.operator("vrtm.worst_feature", text=text, icon="ZOOM_SELECTED").skin = skin


def object_menu(self, context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu("VRTM_MT_object")


def draw_map(layout: bpy.types.UILayout, obj: bpy.types.Object, which: str) -> None:
    settings = obj.vrtm
    column = layout.column()
    column.prop(settings, f"{which}_source")
    source = getattr(settings, f"{which}_source")
    if source == "IMAGE":
        column.template_ID(settings, f"{which}_image", new="image.new", open="image.open")
        column.prop(settings, f"{which}_channel")
    elif source == "VERTEX_GROUP":
        column.prop_search(settings, f"{which}_name", obj, "vertex_groups", text="Group")
    elif source == "ATTRIBUTE":
        column.prop_search(settings, f"{which}_name", obj.data, "color_attributes", text="Attribute")


def draw_topology(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    obj = context.object
    changing = tap.topology_modifiers(obj)
    if not changing or (tap.GROUP.modifier_of(obj) is not None and tap.deforms_behind(obj) is None):
        return
    box, name = layout.box(), changing[0].name
    if tap.place(obj) is not None:
        status.draw(box, context, status.Line(f"{name} changes the topology", "INFO"))
        box.operator("vrtm.insert_tap")
    else:
        text = f"{name} makes other vertices than the mesh has: hide it in the viewport and in renders, or apply it"
        status.draw(box, context, status.Line(text, "ERROR"))


register_classes, unregister_classes = bpy.utils.register_classes_factory(
    (
        VRTM_PT_main,
        VRTM_PT_quality,
        VRTM_PT_advanced,
        VRTM_PT_strain,
        VRTM_PT_material,
        VRTM_PT_carry,
        VRTM_PT_bake,
        VRTM_PT_status,
        VRTM_PT_view,
        VRTM_MT_rigidity,
        VRTM_MT_begin,
        VRTM_MT_object,
    )
)


def register() -> None:
    register_classes()
    bpy.types.VIEW3D_MT_object.append(object_menu)


def unregister() -> None:
    bpy.types.VIEW3D_MT_object.remove(object_menu)
    unregister_classes()
