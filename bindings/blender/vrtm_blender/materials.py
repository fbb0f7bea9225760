"""The groups in an artist's materials: putting them in, taking them out, and finding the textures behind them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import bpy

from . import geometry, nodes, picture
from .messages import Problem


class NoTexture(Problem):
    """A material has nothing that could be redirected."""


def materials_of(obj: bpy.types.Object) -> list[bpy.types.Material]:
    """The object's materials with nodes, the active one first."""
    found = [obj.active_material, *(slot.material for slot in obj.material_slots)]
    return [material for material in dict.fromkeys(found) if material is not None and material.node_tree is not None]


def own_material(obj: bpy.types.Object, slot: bpy.types.MaterialSlot) -> bpy.types.Material:
    """The slot's material, for this object alone: a redirection belongs to one object's pose."""
    material = slot.material
    others = [
        other for other in bpy.data.objects if other != obj and material in [s.material for s in other.material_slots]
    ]
    if others or is_copied(obj, material):
        groups, name = nodes.reach(material.node_tree), material.name
        copy = material.copy()
        own_groups(copy.node_tree, lambda inner: inner in groups or inner.library is not None)
        copy.name = f"{name} {obj.name}"
        if slot.link == "DATA" and (obj.data.users > 1 or geometry.is_linked(obj)):
            slot.link = "OBJECT"
        slot.material = copy
        material = copy
    return material


def is_copied(obj: bpy.types.Object, material: bpy.types.Material) -> bool:
    """True if a material is another file's, as the object's mesh is: a copy of it stands in the object's slot."""
    return material.library is not None and geometry.is_linked(obj)


def own_groups(tree: bpy.types.NodeTree, which: Callable[[bpy.types.NodeTree], bool]) -> None:
    """Gives a material copies of groups that it shares with another."""
    for node in [node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None]:
        if not nodes.is_ours(node) and which(node.node_tree):
            node.node_tree = node.node_tree.copy()
            own_groups(node.node_tree, which)


def separate(
    obj: bpy.types.Object,
    is_others: Callable[[bpy.types.NodeTree], bool],
    own: Callable[[bpy.types.Object], bpy.types.NodeTree],
) -> None:
    """Gives the materials of a duplicate its own groups in place of the original's; a material that other objects use
    is copied."""
    for slot in obj.material_slots:
        if slot.material is None or slot.material.library is not None:
            continue
        if any(is_others(node.node_tree) for node in instances(slot.material.node_tree)):
            tree = own_material(obj, slot).node_tree
            own_groups(tree, lambda inner: inner.users > 1 and bool(instances(inner)))
            for node in instances(tree):
                if is_others(node.node_tree):
                    node.node_tree = own(obj)


def of_others(obj: bpy.types.Object) -> list[bpy.types.NodeTree]:
    """The groups in the object's materials with other objects' redirections."""
    own = [material for material in materials_of(obj) if material.library is None]
    trees = {node.node_tree for material in own for node in instances(material.node_tree)}
    return [tree for tree in trees if nodes.is_of_another(tree, obj)]


def instances(tree: bpy.types.NodeTree | None) -> list[bpy.types.Node]:
    return [node for inner in nodes.reach(tree, alone=False) for node in inner.nodes if nodes.is_ours(node)]


def insert(
    obj: bpy.types.Object,
    material: bpy.types.Material,
    source_uv: bpy.types.MeshUVLoopLayer,
    group: bpy.types.NodeTree,
) -> None:
    """Puts a group of the object behind the UVs that the material's Image Texture nodes read, anew where nodes keep its
    redirection from them.

    The group goes directly behind the node that hands out the mesh's UVs, in front of Mapping nodes: a redirection is
    one of the mesh's UVs. What else is linked there, and textures with other coordinates, stay as they are.
    """
    trees = nodes.reach(material.node_tree)
    for node in [node for tree in trees for node in tree.nodes]:
        if nodes.is_ours(node):
            node.node_tree = group
        elif node.get(picture.MADE) and getattr(node, "uv_map", "") and node.uv_map not in obj.data.uv_layers:
            node.uv_map = source_uv.name
    broken, measured = set(), picture.measured_of(obj)
    for texture, around in picture.textures(material, drawn=False):
        for link in texture.inputs["Vector"].links if texture.id_data in trees else ():
            link.is_muted = False
        for node, within in picture.lookup_of(obj, texture, around).groups.items():
            _, remedy = picture.fault_of(obj, material, node, within, source_uv.name) or ("", "")
            off = measured.get((material.name, texture.name), 0) >= picture.TOLERANCE
            if node.id_data in trees and (remedy == picture.SET_UP or (remedy == picture.CHECK and off)):
                broken.add(node)
    remove(broken)
    made: dict[bpy.types.NodeSocket, bpy.types.Node] = {}
    for socket, source in _places(obj, material, source_uv.name, trees):
        tree = socket.node.id_data
        source = source or _uv_node(tree, obj.vrtm.uv_map, socket.node)
        tree.links.new(_instance(group, source, made), socket)


def check(obj: bpy.types.Object, material: bpy.types.Material, source_uv: bpy.types.MeshUVLoopLayer) -> None:
    """Raises a Problem if a material cannot be redirected."""
    tree, copied = material.node_tree, is_copied(obj, material)
    # Of a copy all groups are its own.
    trees = nodes.reach(tree, alone=not copied, linked=copied)
    if material.library is not None and not copied:
        raise Problem(f"material {material.name!r} is linked from another file: make it local")
    if tree is None:
        raise NoTexture(f"material {material.name!r} has no nodes")
    if _places(obj, material, source_uv.name, trees) or any(nodes.is_ours(node) for of in trees for node in of.nodes):
        return
    shared = [of.id_data for of, _ in picture.textures(material, drawn=False) if of.id_data not in trees]
    text = f"material {material.name!r} has no Image Texture that reads UV map {source_uv.name!r}"
    if shared:
        text += f": its textures are in group {shared[0].name!r}, which others use, too: make it a single user"
    raise NoTexture(text)


def _places(
    obj: bpy.types.Object, material: bpy.types.Material, source: str, trees: Iterable[bpy.types.NodeTree]
) -> list[tuple[bpy.types.NodeSocket, bpy.types.NodeSocket | None]]:
    """The inputs in `trees` that UV map `source` goes into on its way to textures, without a group; and the output that
    it comes from, or None for textures without a link, which read the UV map that renders."""
    found = {}
    for texture, around in picture.textures(material, drawn=False):
        socket = texture.inputs["Vector"]
        if texture.projection != "FLAT":
            continue
        if not socket.is_linked and picture.rendered(obj) == source:
            found[socket] = None
        for link, _ in picture.upstream([socket], around):
            if picture.map_of(obj, link) == source:
                found[link.to_socket] = link.from_socket
    return [(socket, output) for socket, output in found.items() if socket.node.id_data in trees]


def clear(material: bpy.types.Material) -> int:
    """Removes the groups from a material; returns their number."""
    return remove(instances(material.node_tree))


def remove(instances: Iterable[bpy.types.Node]) -> int:
    """Removes groups, and links the nodes before and behind them; returns their number."""
    removed = 0
    for node in instances:
        tree = node.id_data
        before = node.inputs["UV"].links
        source = before[0].from_socket if before else None
        # A UV node that was made for the group goes with it.
        made = source is not None and bool(source.node.get(picture.MADE))
        for link in list(node.outputs["UV"].links):
            if source is not None and not made:
                tree.links.new(source, link.to_socket)
        tree.nodes.remove(node)
        if made and not source.links:
            tree.nodes.remove(source.node)
        removed += 1
    return removed


def _uv_node(tree, name, texture):
    """The socket with a UV map's UVs; without a name with those of the map that renders, also after it was renamed."""
    kind = "ShaderNodeUVMap" if name else "ShaderNodeTexCoord"
    same = [n for n in tree.nodes if n.bl_idname == kind and not n.from_instancer and getattr(n, "uv_map", "") == name]
    node = same[0] if same else tree.nodes.new(kind)
    if not same:
        node[picture.MADE] = True
        node.location = (texture.location.x - 450, texture.location.y)
        if name:
            node.uv_map = name
    return node.outputs["UV"]


def _instance(group, source, instances):
    """The output of the group's node behind a socket: one for all that is linked to that socket."""
    node = instances.get(source)
    if node is None:
        node = next((link.to_node for link in source.links if nodes.is_ours(link.to_node)), None)
    if node is None:
        tree = source.node.id_data
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.width = 200
        node.location = (source.node.location.x + 200, source.node.location.y)
        tree.links.new(source, node.inputs["UV"])
    instances[source] = node
    return node.outputs["UV"]
