"""The artist's textures: the one that is most likely the colour, and that of the height."""

from __future__ import annotations

import bpy
import numpy as np

from . import materials, nodes, picture, session

HEIGHTS = ("ShaderNodeBump", "ShaderNodeDisplacement")


def textures_of(obj: bpy.types.Object) -> list[bpy.types.Node]:
    """The Image Texture nodes of the object's materials, the active one's first, without this add-on's images."""
    # Also those in other files' groups, which are only read.
    return [node for of in materials.materials_of(obj) for node, _ in picture.textures(of, drawn=False)]


def colour_image(obj: bpy.types.Object) -> bpy.types.Image | None:
    """The texture that is most likely meant: one that goes into a colour."""
    found = textures_of(obj)
    into_colours = [
        node for node in found if any("Color" in link.to_socket.name for link in node.outputs["Color"].links)
    ]
    return next((node.image for node in into_colours + found), None)


def height_image(obj: bpy.types.Object) -> tuple[bpy.types.Image | None, bool]:
    """The texture behind a Bump or Displacement node's height, whatever nodes lie between them; and True if its dark
    parts are high, as far as the nodes tell."""
    for material in materials.materials_of(obj):
        for end in [node for node in material.node_tree.nodes if node.bl_idname in HEIGHTS]:
            down = getattr(end, "invert", False) != any(
                name in end.inputs and not end.inputs[name].is_linked and end.inputs[name].default_value < 0
                for name in ("Strength", "Distance", "Scale")
            )
            if found := _behind(end.inputs["Height"], down, set()):
                return found
    return None, False


def _behind(socket: bpy.types.NodeSocket, down: bool, seen: set) -> tuple[bpy.types.Image, bool] | None:
    """The first texture upstream of a socket, and True if heights are upside down there."""
    for link in socket.links:
        node = link.from_node
        if nodes.is_own_texture(node) and node.image is not None:
            return node.image, down
        if node not in seen and node.bl_idname != "ShaderNodeTexImage":
            seen.add(node)
            for upstream in node.inputs:
                if found := _behind(upstream, down != _turns(node, upstream), seen):
                    return found
    return None


def _turns(node: bpy.types.Node, socket: bpy.types.NodeSocket) -> bool:
    """True if a node's output falls as its input rises: for the nodes of which that is likely."""
    if node.bl_idname == "ShaderNodeInvert":
        return True
    if node.bl_idname == "ShaderNodeMath":
        if node.operation == "SUBTRACT":
            return socket == node.inputs[1]
        fixed = [other.default_value for other in node.inputs[:2] if not other.is_linked]
        return node.operation in ("MULTIPLY", "DIVIDE") and any(value < 0 for value in fixed)
    if node.bl_idname == "ShaderNodeValToRGB":
        first, last = session.library().rigidity.brightness(
            np.array([[node.color_ramp.evaluate(at)[:3] for at in (0.0, 1.0)]])
        )[0]
        return bool(first > last)
    if node.bl_idname == "ShaderNodeMapRange":
        low, high, to_low, to_high = (
            node.inputs[name].default_value for name in ("From Min", "From Max", "To Min", "To Max")
        )
        return (high < low) != (to_high < to_low)
    return False
