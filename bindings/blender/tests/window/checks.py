"""What is checked in a window. See driver.py."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
from driver import area, at, part, picture, press, until, window


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


def headline(obj: bpy.types.Object) -> str:
    return part("status").headline(obj, window().scene).text


def check_panel():
    """Before and after one click on the sample."""
    obj = sample_file()
    yield 1
    yield from arrange()
    yield 3
    picture("1_opened")
    with at("PROPERTIES"):
        bpy.ops.vrtm.set_up("INVOKE_DEFAULT")
    yield from until(lambda: headline(obj) == "Up to date")
    yield 3
    picture("2_set_up")
