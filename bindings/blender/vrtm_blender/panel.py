"""The panels in Properties > Object Data. They only show: drawing changes nothing and solves nothing."""

from __future__ import annotations

import bpy

from . import dilate, geometry, keep, nodes, results, session, tap


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type == "MESH"


class VRTM_PT_main(_Panel, bpy.types.Panel):
    bl_label = "Rigid Features (vrtm)"
    bl_idname = "VRTM_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        settings = obj.vrtm
        layout.use_property_split, layout.use_property_decorate = True, False
        draw_map(layout, obj, "rigidity")
        draw_map(layout, obj, "mask")
        column = layout.column()
        column.prop_search(settings, "uv_map", obj.data, "uv_layers")
        column.prop(settings, "rest_source")
        if settings.rest_source == "SHAPE_KEY":
            if obj.data.shape_keys:
                column.prop_search(settings, "rest_key", obj.data.shape_keys, "key_blocks")
            else:
                column.label(text="The mesh has no shape keys", icon="ERROR")
        elif settings.rest_source == "FRAME":
            column.prop(settings, "rest_frame")
        if settings.rest_source in {"FRAME", "CAPTURED"}:
            column.operator("vrtm.capture_rest")
            if geometry.REST_NAME in obj.data.attributes:
                column.label(text=f"Captured at frame {obj.data.get(geometry.REST_FRAME_NAME, '?')}")
        draw_topology(layout, obj)
        row = layout.row(align=True)
        row.prop(settings, "live", toggle=True, icon="PLAY")
        row.operator("vrtm.update", icon="FILE_REFRESH")
        layout.prop(settings, "in_renders")
        draw_state(layout, obj)


class VRTM_PT_quality(_Panel, bpy.types.Panel):
    bl_label = "Quality and Outputs"
    bl_parent_id = "VRTM_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.object.vrtm
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("quality", "grid", "map_size", "device", "measure"):
            layout.prop(settings, name)
        layout.prop(settings, "seams")
        layout.prop(settings, "open_borders")
        if settings.seams == "continue" or settings.open_borders == "slide":
            layout.prop(settings, "seam_reach")
        column = layout.column(heading="Write")
        column.prop(settings, "write_image")
        column.prop(settings, "write_uvs")
        if settings.write_image and settings.image is not None:
            layout.prop(settings, "image")


class VRTM_PT_material(_Panel, bpy.types.Panel):
    bl_label = "Material"
    bl_parent_id = "VRTM_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        row = layout.row(align=True)
        row.operator("vrtm.set_up_material", text="Set Up by Image").by = "image"
        row.operator("vrtm.set_up_material", text="By UV Map").by = "uv_map"
        if context.object.vrtm.seams == "continue":
            layout.operator("vrtm.dilate")
        layout.operator("vrtm.clear_material")


class VRTM_PT_bake(_Panel, bpy.types.Panel):
    bl_label = "Bake to Disk"
    bl_parent_id = "VRTM_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.vrtm_bake
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "directory")
        column = layout.column(align=True)
        for name in ("frame_start", "frame_end", "frame_step"):
            column.prop(settings, name)
        layout.prop(settings, "form")
        layout.prop(settings, "overwrite")
        layout.operator("vrtm.bake", icon="RENDER_ANIMATION")
        baked = context.object.vrtm.shows_baked
        layout.operator("vrtm.use_live" if baked else "vrtm.use_baked")


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


def draw_topology(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    first = geometry.first_topology_modifier(obj)
    if first is not None and tap.tap_of(obj) is None:
        box = layout.box()
        box.label(text=f"{first.name} changes the topology", icon="INFO")
        box.operator("vrtm.insert_tap")


def draw_state(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    scale = obj.scale
    if max(map(abs, scale)) > 1.001 * min(map(abs, scale)):
        layout.label(text="Scaled unevenly: apply the scale, which vrtm does not see", icon="INFO")
    if obj.vrtm.seams == "continue" and dilate.left_of(obj):
        layout.label(text="Textures end at seams: press Dilate Textures", icon="INFO")
    state = session.find_state(obj)
    if results.is_set_up(obj):
        for text in keep.unsaved_maps(obj):
            layout.label(text=text, icon="ERROR")
        # Also of a file that was just opened, in which nothing was solved yet.
        expected = (state is not None and state.shown) or obj.vrtm.image is not None or nodes.groups_of(obj)
        lost = results.missing(obj) if expected else None
        if lost is not None:
            layout.label(text=f"{lost}: press Update Now", icon="ERROR")
            if state is None or not state.error:
                return
    if state is None:
        return
    box = layout.box()
    if state.message:
        box.label(text=state.message, icon="ERROR" if state.error else "NONE")
    for label, value in state.figures:
        row = box.row()
        row.label(text=label)
        row.label(text=value)


CLASSES = (VRTM_PT_main, VRTM_PT_quality, VRTM_PT_material, VRTM_PT_bake)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
