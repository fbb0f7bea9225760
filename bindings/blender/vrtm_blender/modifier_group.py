"""Node groups of Geometry Nodes modifiers of this add-on: one group, which all of its modifiers share."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import bpy


class ModifierGroup(NamedTuple):
    # With a dot in front, Blender does not list the group.
    name: str
    # The custom property that tells the group from others, whatever it is called.
    mark: str
    # Types of the inputs beside the geometry, by their names.
    inputs: dict[str, str]
    # Makes the nodes.
    fill: Callable[[bpy.types.NodeTree], None]

    def tree(self) -> bpy.types.NodeTree:
        """The group, made when it is first asked for."""
        for tree in bpy.data.node_groups:
            if tree.bl_idname == "GeometryNodeTree" and tree.get(self.mark) and tree.library is None:
                return tree
        tree = bpy.data.node_groups.new(self.name, "GeometryNodeTree")
        tree[self.mark] = True
        # Not one that Blender offers to the artist among its modifiers.
        tree.is_modifier = False
        for in_out in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
        for name, kind in self.inputs.items():
            tree.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{kind}")
        self.fill(tree)
        return tree

    def is_of(self, modifier: bpy.types.Modifier) -> bool:
        tree = modifier.node_group if modifier.type == "NODES" else None
        return tree is not None and bool(tree.get(self.mark))

    def modifier_of(self, obj: bpy.types.Object) -> bpy.types.Modifier | None:
        return next(filter(self.is_of, obj.modifiers), None)

    def insert(self, obj: bpy.types.Object, at: int | None = None) -> bpy.types.Modifier:
        """A new modifier, at this place among the object's, or last."""
        made = obj.modifiers.new(self.name.removeprefix("."), "NODES")
        made.node_group, made.show_in_editmode = self.tree(), False
        if at is not None:
            obj.modifiers.move(len(obj.modifiers) - 1, at)
        return made

    def remove(self, obj: bpy.types.Object) -> None:
        """Takes the object's modifiers away, and the group with the last one."""
        for modifier in list(filter(self.is_of, obj.modifiers)):
            tree = modifier.node_group
            obj.modifiers.remove(modifier)
            if not tree.users and tree.library is None:
                bpy.data.node_groups.remove(tree)


def node(tree: bpy.types.NodeTree, kind: str, x: int, y: int, **settings: object) -> bpy.types.Node:
    """A new node, in a column and a row."""
    made = tree.nodes.new(kind)
    made.location = (220 * x, 180 * y)
    for name, value in settings.items():
        setattr(made, name, value)
    return made


def input_of(modifier: bpy.types.Modifier, name: str) -> object:
    return modifier.get(_identifier(modifier, name))


def set_input(modifier: bpy.types.Modifier, name: str, value: object) -> None:
    modifier[_identifier(modifier, name)] = value


def image_of(modifier: bpy.types.Modifier) -> bpy.types.Image | None:
    found = input_of(modifier, "Image")
    return found if isinstance(found, bpy.types.Image) else None


def _identifier(modifier: bpy.types.Modifier, name: str) -> str:
    sockets = modifier.node_group.interface.items_tree
    return next(one.identifier for one in sockets if one.name == name and one.in_out == "INPUT")
