"""The groups in an artist's materials: putting them in, taking them out, and finding the textures behind them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import bpy

from . import geometry, nodes
from .messages import Problem
from .tap import is_own

# The custom property of a node that was made for a group.
MADE = "vrtm_made"


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
        _own_groups(copy.node_tree, lambda inner: inner in groups or inner.library is not None)
        copy.name = f"{name} {obj.name}"
        if slot.link == "DATA" and (obj.data.users > 1 or geometry.is_linked(obj)):
            slot.link = "OBJECT"
        slot.material = copy
        material = copy
    return material


def is_copied(obj: bpy.types.Object, material: bpy.types.Material) -> bool:
    """True if a material is another file's, as the object's mesh is: a copy of it stands in the object's slot."""
    return material.library is not None and geometry.is_linked(obj)


def _own_groups(tree: bpy.types.NodeTree, which: Callable[[bpy.types.NodeTree], bool]) -> None:
    """Gives a material copies of groups that it shares with another."""
    for node in [node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None]:
        if not nodes.is_ours(node) and which(node.node_tree):
            node.node_tree = node.node_tree.copy()
            _own_groups(node.node_tree, which)


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
        if any(is_others(node.node_tree) for node in _instances(slot.material.node_tree)):
            tree = own_material(obj, slot).node_tree
            _own_groups(tree, lambda inner: inner.users > 1 and bool(_instances(inner)))
            for node in _instances(tree):
                if is_others(node.node_tree):
                    node.node_tree = own(obj)


def of_others(obj: bpy.types.Object) -> list[bpy.types.NodeTree]:
    """The groups in the object's materials with other objects' redirections."""
    own = [material for material in materials_of(obj) if material.library is None]
    trees = {node.node_tree for material in own for node in _instances(material.node_tree)}
    return [tree for tree in trees if nodes.is_of_another(tree, obj)]


def of_other_files(obj: bpy.types.Object) -> list[bpy.types.Material]:
    """The object's linked materials that show the result of their own file, and not the object's."""
    return [
        material
        for material in materials_of(obj)
        if material.library is not None
        for tree in nodes.reach(material.node_tree, alone=False, linked=True)
        for node in tree.nodes
        if nodes.is_ours(node) and node.node_tree[nodes.KIND] == nodes.BY_IMAGE
        if nodes.image_of(node.node_tree) != obj.vrtm.image
    ]


def _instances(tree: bpy.types.NodeTree | None) -> list[bpy.types.Node]:
    return [node for inner in nodes.reach(tree, alone=False) for node in inner.nodes if nodes.is_ours(node)]


def insert(
    obj: bpy.types.Object,
    material: bpy.types.Material,
    source_uv: bpy.types.MeshUVLoopLayer,
    group: bpy.types.NodeTree,
) -> int:
    """Puts a group of the object behind the UVs that the material's Image Texture nodes read; returns the number of
    these nodes.

    The group goes directly behind the node that hands out the mesh's UVs, in front of Mapping nodes: a redirection is
    one of the mesh's UVs. What else is linked there, and textures with other coordinates, stay as they are.
    """
    trees, renders = nodes.reach(material.node_tree), source_uv.active_render
    for node in [node for tree in trees for node in tree.nodes]:
        if nodes.is_ours(node):
            node.node_tree = group
        elif node.get(MADE) and getattr(node, "uv_map", "") and node.uv_map not in obj.data.uv_layers:
            node.uv_map = source_uv.name
    instances: dict[bpy.types.NodeSocket, bpy.types.Node] = {}
    done = 0
    for texture in _flat_textures(obj, trees):
        socket = texture.inputs["Vector"]
        if not socket.is_linked:
            # Without a link a texture reads the UV map that renders.
            if renders:
                source = _uv_node(texture.id_data, obj.vrtm.uv_map, texture)
                texture.id_data.links.new(_instance(group, source, instances), socket)
                done += 1
            continue
        links = _uv_links(socket, source_uv.name, renders, trees)
        for link in links:
            link.from_node.id_data.links.new(_instance(group, link.from_socket, instances), link.to_socket)
        done += bool(links)
    return done


def check(obj: bpy.types.Object, material: bpy.types.Material, source_uv: bpy.types.MeshUVLoopLayer) -> None:
    """Raises a Problem if a material cannot be redirected."""
    tree, renders, copied = material.node_tree, source_uv.active_render, is_copied(obj, material)
    # Of a copy all groups are its own.
    trees = nodes.reach(tree, alone=not copied, linked=copied)
    if material.library is not None and not copied:
        raise Problem(f"material {material.name!r} is linked from another file: make it local")
    if tree is None:
        raise NoTexture(f"material {material.name!r} has no nodes")
    sockets = [texture.inputs["Vector"] for texture in _flat_textures(obj, trees)]
    if any(_uv_links(of, source_uv.name, renders, trees) if of.is_linked else renders for of in sockets):
        return
    if not any(nodes.is_ours(node) for inner in trees for node in inner.nodes):
        shared = [inner for inner in nodes.reach(tree, alone=False) if inner not in trees and nodes.own_textures(inner)]
        text = f"material {material.name!r} has no Image Texture that reads UV map {source_uv.name!r}"
        if shared:
            text += f": its textures are in group {shared[0].name!r}, which others use, too: make it a single user"
        raise NoTexture(text)


def _flat_textures(obj: bpy.types.Object, trees: Iterable[bpy.types.NodeTree]) -> list[bpy.types.Node]:
    textures = [node for tree in trees for node in nodes.own_textures(tree)]
    return [node for node in textures if node.projection == "FLAT" and node.image != obj.vrtm.image]


def remove(material: bpy.types.Material) -> int:
    """Removes the groups, and links the nodes before and behind them; returns their number."""
    removed = 0
    for node in _instances(material.node_tree):
        tree = node.id_data
        before = node.inputs["UV"].links
        source = before[0].from_socket if before else None
        # A UV node that was made for the group goes with it.
        made = source is not None and bool(source.node.get(MADE))
        for link in list(node.outputs["UV"].links):
            if source is not None and not made:
                tree.links.new(source, link.to_socket)
        tree.nodes.remove(node)
        if made and not source.links:
            tree.nodes.remove(source.node)
        removed += 1
    return removed


def redirected(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """The Image Texture nodes with an image that are looked up at UVs out of a group of this add-on."""
    trees = nodes.reach(tree, alone=False)
    textures = [node for inner in trees for node in nodes.own_textures(inner) if node.image is not None]
    ahead = [(node, _upstream(node.inputs["Vector"], trees, set())) for node in textures]
    return [node for node, links in ahead if any(nodes.is_ours(link.from_node) for link in links)]


def _upstream(
    socket: bpy.types.NodeSocket, trees: dict[bpy.types.NodeTree, bpy.types.Node | None], seen: set[bpy.types.Node]
) -> Iterator[bpy.types.NodeLink]:
    """The links upstream of a socket, within the artist's groups and out of them, up to groups of this add-on."""
    for link in socket.links:
        yield link
        node = link.from_node
        if node.bl_idname == "NodeGroupInput":
            before = _outside(link, trees)
        else:
            before = [] if node in seen or nodes.is_ours(node) else list(node.inputs)
            seen.add(node)
        for other in before:
            yield from _upstream(other, trees, seen)


def _outside(link: bpy.types.NodeLink, trees: dict[bpy.types.NodeTree, bpy.types.Node | None]) -> list:
    """The socket of a group's node that a link within the group begins at."""
    node = trees[link.from_node.id_data]
    return [socket for socket in node.inputs if socket.identifier == link.from_socket.identifier] if node else []


def lost_maps(obj: bpy.types.Object) -> list[tuple[bpy.types.Node, str]]:
    """Nodes of the object's materials that read a UV map which the mesh does not have, and its name."""
    if any(modifier.type == "NODES" and not is_own(modifier) for modifier in obj.modifiers):
        # These may make UV maps of their own.
        return []
    trees = [material.node_tree for material in materials_of(obj)]
    found = [node for tree in (*trees, *nodes.used_by(obj)) for node in tree.nodes]
    named = [(node, node.uv_map) for node in found if getattr(node, "uv_map", "")]
    for node in [node for tree in trees for node in _instances(tree)]:
        for before in [link.from_node for link in node.inputs["UV"].links]:
            if before.bl_idname == "ShaderNodeAttribute" and before.attribute_type == "GEOMETRY":
                named.append((before, before.attribute_name))
    return [(node, name) for node, name in named if name not in obj.data.attributes]


def _uv_node(tree, name, texture):
    """The socket with a UV map's UVs; without a name with those of the map that renders, also after it was renamed."""
    kind = "ShaderNodeUVMap" if name else "ShaderNodeTexCoord"
    same = [n for n in tree.nodes if n.bl_idname == kind and not n.from_instancer and getattr(n, "uv_map", "") == name]
    node = same[0] if same else tree.nodes.new(kind)
    if not same:
        node[MADE] = True
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


def _uv_links(socket, name, renders, trees):
    """The links, upstream of a socket, that begin at the mesh's UV map `name`."""
    ahead = _upstream(socket, trees, set())
    return [link for link in ahead if _hands_out(link.from_node, link.from_socket, name, renders)]


def _hands_out(node, socket, name, renders):
    if node.bl_idname == "ShaderNodeUVMap":
        return node.uv_map == name or (not node.uv_map and renders)
    if node.bl_idname == "ShaderNodeTexCoord":
        return socket.name == "UV" and renders
    if node.bl_idname == "ShaderNodeAttribute":
        return node.attribute_type == "GEOMETRY" and node.attribute_name == name and socket.name == "Vector"
    return False
