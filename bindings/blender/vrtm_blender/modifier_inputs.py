"""Inputs of Geometry Nodes modifiers, by their names."""

from __future__ import annotations

import bpy


def identifier(modifier: bpy.types.Modifier, name: str) -> str:
    sockets = modifier.node_group.interface.items_tree
    return next(one.identifier for one in sockets if one.name == name and one.in_out == "INPUT")


def set_input(modifier: bpy.types.Modifier, name: str, value: object) -> None:
    modifier[identifier(modifier, name)] = value


def image_of(modifier: bpy.types.Modifier) -> bpy.types.Image | None:
    found = modifier.get(identifier(modifier, "Image"))
    return found if isinstance(found, bpy.types.Image) else None
