"""The Pose modifier: a Geometry Nodes modifier that stores each vertex's position and number as attributes.

Put in front of a modifier that changes the topology, such as Subdivision Surface, it lets the pose of the mesh's own
vertices be read from the evaluated mesh, in the same evaluation that draws or renders the object. The attributes' names
begin with a dot: Blender does not list them.
"""

from __future__ import annotations

import bpy

from .messages import Problem

POSE_NAME = ".vrtm_pose"
INDEX_NAME = ".vrtm_index"
GROUP_NAME = ".vrtm pose"
MARK = "vrtm_pose_group"
# Modifiers that keep the mesh's own vertices first, with their attributes. What Geometry Nodes do cannot be known.
KEEPING = frozenset("ARRAY EDGE_SPLIT MIRROR NODES SCREW SOLIDIFY SUBSURF TRIANGULATE".split())


def group() -> bpy.types.NodeTree:
    """The node group of all Pose modifiers, made when it is first asked for."""
    for tree in bpy.data.node_groups:
        if tree.bl_idname == "GeometryNodeTree" and tree.get(MARK):
            return tree
    tree = bpy.data.node_groups.new(GROUP_NAME, "GeometryNodeTree")
    tree[MARK] = True
    # Not one that Blender offers to the artist among its modifiers.
    tree.is_modifier = False
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, link = tree.nodes, tree.links.new
    last = nodes.new("NodeGroupInput").outputs["Geometry"]
    for place, (name, kind, node) in enumerate(
        [(POSE_NAME, "FLOAT_VECTOR", "GeometryNodeInputPosition"), (INDEX_NAME, "INT", "GeometryNodeInputIndex")]
    ):
        store, value = nodes.new("GeometryNodeStoreNamedAttribute"), nodes.new(node)
        store.data_type, store.domain = kind, "POINT"
        store.inputs["Name"].default_value = name
        store.location, value.location = (250 + 250 * place, 0), (50 + 250 * place, -200)
        link(last, store.inputs["Geometry"])
        # There is a socket of this name for each type; the one of the chosen type is enabled.
        link(value.outputs[0], next(s for s in store.inputs if s.name == "Value" and s.enabled))
        last = store.outputs["Geometry"]
    output = nodes.new("NodeGroupOutput")
    output.location = (800, 0)
    link(last, output.inputs["Geometry"])
    return tree


def is_tap(modifier: bpy.types.Modifier) -> bool:
    return modifier.type == "NODES" and modifier.node_group is not None and bool(modifier.node_group.get(MARK))


def tap_of(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    return next((modifier for modifier in obj.modifiers if is_tap(modifier)), None)


def insert(obj: bpy.types.Object, before: bpy.types.Modifier) -> bpy.types.Modifier:
    """Puts the Pose modifier in front of another one."""
    tap, new = tap_of(obj), False
    if tap is None:
        tap, new = obj.modifiers.new("vrtm pose", "NODES"), True
        tap.node_group = group()
    tap.show_in_editmode = False
    source, target = obj.modifiers.find(tap.name), obj.modifiers.find(before.name)
    try:
        obj.modifiers.move(source, target if source > target else target - 1)
    except RuntimeError as error:
        # Multiresolution works on the mesh's own data, so that nothing may stand in front of it.
        if new:
            obj.modifiers.remove(tap)
        raise Problem(f"{obj.name}: nothing can stand in front of {before.name!r}: hide it, or apply it") from error
    return tap
