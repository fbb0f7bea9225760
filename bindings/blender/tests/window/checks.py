"""The checks in a window. See driver.py."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import bpy
import numpy as np
from driver import OUT, area, at, picture, press, until, window

from support import in_file, load, part, pixels


def sample_file() -> bpy.types.Object:
    """The sample, opened as an artist does."""
    bpy.ops.wm.open_mainfile(filepath="/tmp/arm.blend", load_ui=False)
    return bpy.data.objects["skin"]


def arrange() -> Iterator[float]:
    """The 3D view by the camera, and beside it Object Data from the top of the window to its bottom, with this add-on's
    panel alone open."""
    for kind in ("OUTLINER", "DOPESHEET_EDITOR"):
        with bpy.context.temp_override(window=window(), screen=window().screen, area=area(kind)):
            bpy.ops.screen.area_close()
    yield 0.2
    properties = area("PROPERTIES")
    properties.spaces.active.context = "DATA"
    space = area("VIEW_3D").spaces.active
    space.shading.type, space.overlay.show_overlays = "MATERIAL", False
    space.region_3d.view_perspective = "CAMERA"
    yield 1
    with at("VIEW_3D"):
        bpy.ops.view3d.view_center_camera()
    # The header of the panel: a click with Ctrl opens it and closes all others.
    summary, drawn = part("status").summary, []
    part("status").summary = lambda obj: drawn.append(obj) or summary(obj)
    for y in range(200, 900, 12):
        press("mousemove", str(area("PROPERTIES").x + 150), str(y))
        press("keydown", "ctrl", "click", "1", "keyup", "ctrl")
        yield 0.4
        if drawn:
            break
    else:
        raise AssertionError("the panel was not found")
    part("status").summary = summary
    press("mousemove", "500", "900")


def search(text: str) -> None:
    press("mousemove", "500", "500")
    press("key", "F3")
    press("sleep", "0.5", "type", text)


def headline(obj: bpy.types.Object) -> str:
    return part("status").headline(obj, window().scene).text


def solved(obj: bpy.types.Object) -> Iterator[float]:
    """Until the result of the present frame is shown."""
    yield from until(lambda: headline(obj) == "Up to date")


def says(obj: bpy.types.Object, text: str) -> Iterator[float]:
    """Waits until the headline begins with a text: the last change is heard, and no solve is under way."""
    yield 0.5
    yield from until(lambda: headline(obj).startswith(text))


def set_up(grid: int = 256) -> Iterator[float]:
    """The sample in a Solid view, after Set Up."""
    obj = sample_file()
    yield 0.5
    area("VIEW_3D").spaces.active.shading.type = "SOLID"
    settings = obj.vrtm
    settings.grid = settings.map_size = settings.render_grid = settings.render_map_size = grid
    with at("VIEW_3D"):
        bpy.ops.vrtm.set_up("INVOKE_DEFAULT")
    yield from solved(obj)
    return obj


def render(**options) -> Iterator[float]:
    """A render as F12 makes it: by a thread, while the window goes on."""
    done = []

    def complete(*_) -> None:
        done.append(True)

    bpy.app.handlers.render_complete.append(complete)
    with at("VIEW_3D"):
        bpy.ops.render.render("INVOKE_DEFAULT", **options)
    yield from until(lambda: done, 120)
    if complete in bpy.app.handlers.render_complete:
        bpy.app.handlers.render_complete.remove(complete)


def rendered(engine: str, name: str) -> Iterator[float]:
    """The pixels of a rendered picture."""
    scene, path = window().scene, f"{OUT}/{name}.exr"
    scene.render.engine, scene.render.filepath, scene.render.resolution_percentage = engine, path, 50
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    if engine.startswith("BLENDER_EEVEE"):
        scene.eevee.taa_render_samples, scene.eevee.use_shadows = 4, False
    yield from render(write_still=True)
    yield 0.5
    return load(path)


class Draws:
    """When the 3D view was drawn."""

    def __enter__(self):
        self.times = []
        self._handle = bpy.types.SpaceView3D.draw_handler_add(
            lambda: self.times.append(time.monotonic()), (), "WINDOW", "POST_PIXEL"
        )
        return self

    def __exit__(self, *_):
        bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")


def check_walk():
    """The README's walk."""
    obj = sample_file()
    yield 1
    yield from arrange()
    yield 4
    picture("1_opened")
    with at("PROPERTIES"):
        bpy.ops.vrtm.set_up("INVOKE_DEFAULT")
    yield from solved(obj)
    yield 3
    picture("2_set_up")
    # The menu of the rigidity map, and the settings of an operator that makes one, as F3 runs it.
    press("mousemove", str(area("PROPERTIES").x + 150), "491")
    yield 0.5
    press("click", "1")
    yield 3
    picture("3_menu")
    press("key", "Escape")
    yield 0.5
    rigidity = obj.vrtm.rigidity_image
    search("from texture")
    yield 0.5
    press("key", "Return")
    yield 2
    press("key", "Return")
    yield from until(lambda: obj.vrtm.rigidity_image != rigidity)
    yield from solved(obj)
    press("mousemove", "110", "955", "click", "1")
    yield 3
    picture("3_from_texture")
    press("mousemove", "110", "779", "click", "1")
    yield 3
    obj.vrtm.rigidity_image = rigidity


def check_eevee():
    """EEVEE's drawing, in the view and in renders, takes nothing away that is saved, and what is opened again draws the
    same pixels."""
    obj = yield from set_up()
    area("VIEW_3D").spaces.active.shading.type = "RENDERED"
    yield 5
    before = yield from rendered("BLENDER_EEVEE_NEXT", "before")
    result, name = pixels(obj.vrtm.image), obj.vrtm.image.name
    assert np.abs(result).max() < 1.01 and result[..., :2].any()
    obj.vrtm.in_renders = obj.vrtm.live = False
    for round_ in range(2):
        with at("VIEW_3D"):
            bpy.ops.wm.save_as_mainfile(filepath=f"/tmp/saved.{round_}.blend")
        bpy.ops.wm.open_mainfile(filepath=f"/tmp/saved.{round_}.blend", load_ui=True)
        yield 3
        obj = bpy.data.objects["skin"]
        assert obj.vrtm.image is not None and obj.vrtm.image.name == name
        assert np.array_equal(pixels(obj.vrtm.image), in_file(result)), "the result is another one after saving"
        after = yield from rendered("BLENDER_EEVEE_NEXT", f"after.{round_}")
        # A tenth of a texel of the sample's texture, across its steepest edges.
        assert np.abs(after - before).max() < 0.07, np.abs(after - before).max()
        before = after if round_ == 0 else before
        assert np.abs(after - before).max() < 1e-5, np.abs(after - before).max()
    # Without the redirection the picture is another one.
    for node in obj.active_material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            node.inputs["Strength"].default_value = 0
    plain = yield from rendered("BLENDER_EEVEE_NEXT", "plain")
    assert (np.abs(plain - before).max(-1) > 0.05).mean() > 0.02


def check_frames():
    """A scrub keeps the window drawn, with Live and without; after a rendered animation the viewport has its frame."""
    obj = yield from set_up()
    scene = window().scene
    for live in (False, True):
        obj.vrtm.live = live
        with Draws() as draws:
            for frame in [*range(1, 21), *range(20, 0, -1)]:
                scene.frame_set(frame)
                yield 0.05
            if live:
                yield from solved(obj)
            yield 0.5
        assert len(draws.times) >= 20
    scene.frame_set(12)
    yield from solved(obj)
    twelve = pixels(obj.vrtm.image)
    # An animation: the viewport has its frame again.
    scene.frame_start, scene.frame_end, scene.render.filepath = 15, 17, f"{OUT}/frame."
    scene.render.engine = "BLENDER_WORKBENCH"
    yield from render(animation=True)
    yield from solved(obj)
    yield 0.5
    assert scene.frame_current == 12 and np.array_equal(pixels(obj.vrtm.image), twelve)


def check_large():
    """Update Now of a million faces, and Esc, which ends it."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield 1
    with at("VIEW_3D"):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=1000, y_subdivisions=1000, size=2)
    obj = window().view_layer.objects.active
    yield 1
    modifier = obj.modifiers.new("Twist", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.angle = "TWIST", 1.0
    group = obj.data.attributes.new("stiff", "FLOAT", "POINT")
    values = np.zeros(len(obj.data.vertices), np.float32)
    values[::3] = 1
    group.data.foreach_set("value", values)
    obj.vrtm.rigidity_source, obj.vrtm.rigidity_name = "ATTRIBUTE", "stiff"
    yield 2
    state = part("states").state_of(obj)
    for ended in (True, False, True):
        shown = state.shown
        with at("PROPERTIES"):
            assert bpy.ops.vrtm.update("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
            assert not bpy.ops.vrtm.update.poll()
        yield 0.5
        if ended:
            press("mousemove", "500", "500")
            press("key", "Escape")
            yield from until(lambda: not state.wanted and state.job is None)
            assert state.shown == shown
            # What was up to date before is so still.
            yield 2
            assert (headline(obj) == "Up to date") == bool(shown), headline(obj)
        else:
            yield from solved(obj)


def check_bake():
    """Esc ends a bake between frames."""
    obj = yield from set_up()
    scene = window().scene
    scene.frame_start, scene.frame_end = 1, 400
    scene.vrtm_bake.directory = "/tmp/baked/"
    files = []
    for ended in (True, False):
        with at("VIEW_3D"):
            assert bpy.ops.vrtm.bake("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
        yield 3
        if ended:
            press("mousemove", "500", "500")
            press("key", "Escape")
        yield from until(lambda: not part("session").baking, 120)
        yield 0.3
        files.append(len(os.listdir("/tmp/baked")))
        assert scene.frame_current == 20 and headline(obj) == "Up to date", headline(obj)
        scene.frame_end = 20
    assert 2 <= files[0] < 400, files


def check_begin():
    """Set Up asks where nothing tells what is rigid."""
    obj = sample_file()
    yield 1
    bpy.data.images.remove(bpy.data.images["rigidity"])
    press("mousemove", "500", "400")
    yield 1
    with at("VIEW_3D"):
        bpy.ops.vrtm.set_up("INVOKE_DEFAULT")
    yield 1
    assert not obj.vrtm.is_set_up
    picture("begin")
    # The second one: From Texture, whose dialog shows what would be rigid.
    press("key", "f")
    yield 2
    picture("from_texture")
    press("key", "Return")
    yield from until(lambda: obj.vrtm.is_set_up)
    yield from solved(obj)


def check_paint():
    """A stroke of the brush on a black rigidity image is followed, and so is its undo."""
    obj = yield from set_up()
    with at("VIEW_3D"):
        bpy.ops.view3d.view_camera()
        bpy.ops.vrtm.new_rigidity("INVOKE_DEFAULT", size=256)
    yield from says(obj, "Nothing is rigid yet")
    assert part("status").summary(obj).endswith("0 % rigid")
    assert not pixels(obj.vrtm.image)[..., :2].any()
    with at("VIEW_3D"):
        bpy.ops.vrtm.paint("INVOKE_DEFAULT")
        # Operators out of scripts make no undo step.
        bpy.ops.ed.undo_push(message="Paint It")
    yield 1
    scene = window().scene
    scene.tool_settings.unified_paint_settings.color = (1, 1, 1)
    if scene.tool_settings.image_paint.brush is None:
        # Debian's Blender comes without brushes.
        brush = bpy.data.brushes.new("white", mode="TEXTURE_PAINT")
        brush.asset_mark()
        with at("VIEW_3D"):
            bpy.ops.brush.asset_activate(asset_library_type="LOCAL", relative_asset_identifier="Brush/white")
            bpy.ops.ed.undo_push(message="brush")
    press("mousemove", "560", "480")
    yield 0.3
    press("mousedown", "1")
    for x in range(570, 640, 10):
        press("mousemove", str(x), "490")
        yield 0.1
    press("mouseup", "1")
    yield 1
    painted = pixels(obj.vrtm.rigidity_image)[..., 0]
    picture("paint")
    assert painted.max() > 0.5, "the stroke did not paint"
    yield from until(lambda: pixels(bpy.data.objects["skin"].vrtm.image)[..., :2].any())
    yield from solved(obj)
    picture("paint")
    assert not part("status").summary(obj).endswith(" 0 % rigid")
    # What is painted is not in the file yet.
    assert part("keep").unsaved_maps(obj)
    press("key", "ctrl+z")
    yield 1
    obj = bpy.data.objects["skin"]
    yield from says(obj, "Nothing is rigid yet")
    assert not pixels(obj.vrtm.image)[..., :2].any(), "the undo of the stroke is not followed"
