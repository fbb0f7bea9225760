"""An object's status in words: the state of the result that is shown, and what is to be mended. Telling changes nothing
and solves nothing."""

from __future__ import annotations

import os
import textwrap
from dataclasses import dataclass

import blf
import bpy
import numpy as np

from . import borders, carry, dilate, geometry, keep, nodes, picture, result_image, results, states, tap
from .features import Features


@dataclass(frozen=True)
class Line:
    text: str
    icon: str = "NONE"


def headline(obj: bpy.types.Object, scene: bpy.types.Scene) -> Line:
    """One short line, which is always there, on the result that is shown."""
    state, settings = states.find_state(obj), obj.vrtm
    if state is not None and (state.job is not None or state.wanted):
        return Line(state.progress, "SORTTIME")
    if state is not None and state.error:
        return Line("Not solved: see Status", "ERROR")
    if not obj.vrtm.is_set_up:
        return Line("Nothing is rigid yet", "INFO")
    if settings.shows_baked:
        frames = nodes.baked_frames(obj)
        if frames is None:
            return Line("The baked files are not read", "ERROR")
        inside = not_baked(obj, scene, frames) is None
        return Line("Shows baked files" if inside else "Frame is not baked: see Status", "FILE" if inside else "ERROR")
    if state is None or not (state.shown or state.figures):
        # A file that was just opened shows what was saved.
        kept = result_image.is_result(settings.image) and result_image.has_pixels(settings.image)
        return Line("As it was saved" if kept else "Not solved yet: press Update Now", "INFO")
    if results.missing(obj) is not None:
        return Line("Result is missing: see Status", "ERROR")
    if obj.mode == "EDIT":
        return Line("In Edit Mode", "INFO")
    if not (state.shown and state.fresh):
        if state.frame != scene.frame_current:
            return Line(f"Out of date: shows frame {state.frame}", "ERROR")
        return Line("Out of date: press Update Now", "ERROR")
    answer = picture.ask(obj)
    if answer.wrong or wrong(obj):
        return Line("Not what it should be: see Status", "ERROR")
    if answer.unsure:
        return Line("Not known to be right: see Status", "ERROR")
    if dict(state.figures).get("Rigid") == "0 %":
        return Line("Nothing is rigid yet: see Status", "INFO")
    noted = state.notes or state.features.are_many_worse or not answer.shows
    return Line("Up to date", "INFO" if noted else "CHECKMARK")


def summary(obj: bpy.types.Object) -> str:
    """One line of figures, which is always there."""
    found = dict(figures(obj))
    if not found:
        return "-"
    return f"{found['Time']}, {found['Folds']} folds, {found['Rigid']} rigid"


def figures(obj: bpy.types.Object) -> list[tuple[str, str]]:
    """Labels and values of the result that is shown, if there is one."""
    return state.figures if (state := shown(obj)) else []


def features(obj: bpy.types.Object) -> Features:
    """Painted features of that result."""
    return state.features if (state := shown(obj)) else Features()


def shown(obj: bpy.types.Object) -> states.State | None:
    """The object's state, unless an error is told in place of its result."""
    state = states.find_state(obj)
    return None if state is None or state.error or not obj.vrtm.is_set_up else state


def wrong(obj: bpy.types.Object) -> list[str]:
    """Reasons beside the materials' nodes why the picture differs from the result, in sentences."""
    found = []
    if (rendered := picture.rendered(obj)) in geometry.result_names(obj.data):
        found.append(f"UV map {rendered!r}, which is a result, is the one that renders: have the texture's render")
    lengths = np.linalg.svd(np.array(obj.matrix_world)[:3, :3], compute_uv=False)
    if lengths[0] > 1.001 * lengths[2]:
        uneven = max(obj.scale) > 1.001 * min(obj.scale) or obj.parent is None
        whose = "" if uneven else f" by its parents or constraints ({obj.parent.name})"
        found.append(
            f"Scaled unevenly{whose}, which vrtm does not see, so that round features are ovals: apply the scale"
        )
    if (behind := tap.deforms_behind(obj)) is not None:
        ways = "hide or apply what is in front of it" if tap.place(obj) is None else "press Read Pose"
        found.append(f"Modifier {behind.name!r} deforms behind the one that stores the pose: {ways}")
    return found


def notes(obj: bpy.types.Object, scene: bpy.types.Scene) -> list[Line]:
    """Notes and remedies, in sentences."""
    state, settings = states.find_state(obj), obj.vrtm
    found = []
    if state is not None and state.message:
        found.append(Line(state.message, "ERROR" if state.error else "INFO"))
    if not obj.vrtm.is_set_up:
        return found
    # Also of a file that was just opened, in which nothing was solved yet.
    expected = (state is not None and state.shown) or settings.image is not None or nodes.groups_of(obj)
    lost = results.missing(obj) if expected else None
    if lost is not None:
        found.append(Line(f"{lost}: press Update Now", "ERROR"))
    answer = picture.ask(obj)
    found += [Line(text, "ERROR") for text in answer.wrong + answer.unsure + wrong(obj)]
    if not (answer.shows or answer.wrong):
        found.append(Line("No material shows the result: press Set Up by Image once one has an Image Texture", "INFO"))
    frames = nodes.baked_frames(obj)
    if settings.shows_baked and (text := not_baked(obj, scene, frames)) is not None:
        found.append(Line(text, "ERROR"))
    ways = borders.chosen(obj)
    if ways.why:
        found.append(Line(ways.why, "INFO"))
    if (copying := tap.copies(obj)) is not None:
        text = f"{copying.name} makes copies in front of what deforms: they show the redirection of the mesh's own part"
        found.append(Line(text, "INFO"))
    for modifier in tap.working(obj):
        if modifier.show_viewport != modifier.show_render and modifier.type in tap.DEFORMING | {"NODES"}:
            where = "renders and bakes" if modifier.show_render else "the viewport"
            told = f"Modifier {modifier.name!r} is on in {where} alone, so the pose is another there"
            found.append(Line(told, "INFO"))
    if on_seams := dict(figures(obj)).get("On seams"):
        text = f"{on_seams} on seams, which do not continue: set Seams to Auto, and press Dilate Textures"
        found.append(Line(text, "INFO"))
    if (of := features(obj)).worse:
        told = f"{of.worse} of {of.painted} feature{'s' * (of.painted > 1)} {'is' if of.worse == 1 else 'are'} worse"
        found.append(Line(f"{told} than without vrtm: press Show Worst Feature", "INFO"))
    if number := len(of.squeezed):
        text = f"Skin is squeezed or stretched more than twice at {number} place{'s' * (number > 1)} beside features: "
        text += "press Show Squeezed Skin. Keep Detail, in Rigidity Map, spares what is drawn there"
        found.append(Line(text, "INFO"))
    if settings.seams in ("continue", borders.AUTO) and not all(
        dilate.is_dilated(node.image, settings.seam_reach) for node in dilate.textures_of(obj)
    ):
        found.append(Line("Textures end at seams: press Dilate Textures", "INFO"))
    if geometry.is_linked(obj):
        found.append(Line("The mesh is linked from another file: the result is an image alone", "INFO"))
    found += [Line(text, "ERROR") for text in carry.troubles(obj)]
    if settings.carried_baked:
        found.append(Line("What it carries shows a bake: press Carry Live to have it follow the skin", "INFO"))
    found += [Line(text, "ERROR") for text in keep.unsaved_maps(obj)]
    if state is not None and not state.error:
        found += [Line(text, "INFO") for text in state.notes + state.questions]
    return found


def not_baked(obj: bpy.types.Object, scene: bpy.types.Scene, frames: range | None) -> str | None:
    """The reason why this frame's baked file is not shown, in words; None if it is."""
    if not frames:
        return "The material reads no baked files: press Use Live Result, or bake and press Use Baked Files"
    frame = min(max(scene.frame_current, frames[0]), frames[-1])
    for path in [path for path in nodes.baked_files(obj, frame) if not os.path.isfile(path)]:
        return f"{path} is not there: bake again, or press Use Live Result"
    if frame != scene.frame_current:
        text = f"Frame {scene.frame_current} is not in the baked files of frames {frames[0]} to {frames[-1]}"
        return f"{text}: frame {frame} is shown"
    return None


def draw(layout: bpy.types.UILayout, context: bpy.types.Context, line: Line) -> None:
    """A line as long as it is: Blender cuts labels at the width of the panel."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, text in enumerate(_wrapped(line.text, context)):
        column.label(text=text, icon="BLANK1" if number and line.icon != "NONE" else line.icon)


def _wrapped(text: str, context: bpy.types.Context) -> list[str]:
    region = getattr(context, "region", None)
    if region is None:
        return [text]
    # 0 without a window.
    scale = context.preferences.system.ui_scale or 1
    blf.size(0, 11 * scale)
    # Borders, a box and the icon take the rest, and in sidebars the tabs.
    free = region.width - (100 if region.type == "UI" else 75) * scale
    width, _ = blf.dimensions(0, text)
    if width <= free:
        return [text]
    return textwrap.wrap(text, max(int(len(text) * free / width), 12))
