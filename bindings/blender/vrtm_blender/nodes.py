"""Node groups that redirect UVs, and their place in an artist's material."""

from __future__ import annotations

import bpy

from . import results
from .messages import Problem

# Custom properties that tell this add-on's node groups: the kind of the group.
KIND = "vrtm_kind"
BY_IMAGE, BY_UV_MAP = "image", "uv_map"
# A group's custom property: the result image that it is for.
RESULT = "vrtm_result"


def update_groups(obj: bpy.types.Object) -> None:
    """Builds the object's group by image anew, if there is one: after a change of the image's layout."""
    image = obj.vrtm.image
    if obj.vrtm.shows_baked:
        return
    for tree in bpy.data.node_groups:
        if tree.get(KIND) == BY_IMAGE and _image_of(tree) == image and tree.library is None:
            build_by_image(tree, image)


def group_by_image(obj: bpy.types.Object) -> bpy.types.NodeTree:
    """UV in, redirected UV out, by the object's result image."""
    image = obj.vrtm.image
    if image is None:
        raise Problem(f"{obj.name} has no result image yet: press Update Now with the Image output on")
    for tree in bpy.data.node_groups:
        if tree.get(KIND) == BY_IMAGE and _image_of(tree) == image:
            return tree
    tree = bpy.data.node_groups.new(f"vrtm redirection {obj.name}", "ShaderNodeTree")
    tree[KIND], tree[RESULT] = BY_IMAGE, image
    tree.interface.new_socket("UV", in_out="INPUT", socket_type="NodeSocketVector")
    tree.interface.new_socket("UV", in_out="OUTPUT", socket_type="NodeSocketVector")
    build_by_image(tree, image)
    return tree


def group_by_uv_map(obj: bpy.types.Object) -> bpy.types.NodeTree:
    """Redirected UV out, by the object's result UV map. Its input is left alone: so both groups can stand in the same
    place."""
    name = obj.vrtm.uv_name
    if name not in obj.data.uv_layers:
        raise Problem(f"{obj.name} has no result UV map yet: press Update Now with the UV Map output on")
    for tree in bpy.data.node_groups:
        if tree.get(KIND) == BY_UV_MAP and any(getattr(node, "uv_map", None) == name for node in tree.nodes):
            return tree
    tree = bpy.data.node_groups.new(f"vrtm UV map {name}", "ShaderNodeTree")
    tree[KIND] = BY_UV_MAP
    tree.interface.new_socket("UV", in_out="INPUT", socket_type="NodeSocketVector")
    tree.interface.new_socket("UV", in_out="OUTPUT", socket_type="NodeSocketVector")
    node, output = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("NodeGroupOutput")
    node.uv_map = name
    output.location = (250, 0)
    tree.links.new(node.outputs["UV"], output.inputs["UV"])
    return tree


def _image_of(tree: bpy.types.NodeTree) -> bpy.types.Image | None:
    """The result image that a group is for, also while it shows baked files."""
    return tree.get(RESULT)


def show_baked(obj: bpy.types.Object, path: str, first: int, number: int) -> None:
    """Has the object's group read a sequence of baked files, from the file of frame `first` on, in the place of the
    result image."""
    tree = group_by_image(obj)
    image = bpy.data.images.load(path)
    image.source = "SEQUENCE"
    image.colorspace_settings.name, image.alpha_mode = "Non-Color", "CHANNEL_PACKED"
    image.name = f"{obj.vrtm.image.name} baked"
    user = _lookup(tree).image_user
    _lookup(tree).image = image
    # So that each frame shows the file with its number.
    user.frame_start, user.frame_offset, user.frame_duration = first, first - 1, number
    user.use_cyclic, user.use_auto_refresh = False, True


def show_live(obj: bpy.types.Object) -> None:
    """Has the object's group read the result image again."""
    tree = group_by_image(obj)
    baked = _lookup(tree).image
    build_by_image(tree, obj.vrtm.image)
    if baked is not None and baked != obj.vrtm.image and not baked.users:
        bpy.data.images.remove(baked)


def _lookup(tree: bpy.types.NodeTree) -> bpy.types.Node:
    return next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage")


def build_by_image(tree: bpy.types.NodeTree, image: bpy.types.Image) -> None:
    """The nodes of a group by image: the UV's place in the image, what is to be added there, and the sum.

    The image holds differences, so that where there is nothing yet, and outside of all tiles, the UV stays what it
    is. It is looked up with Linear and Extend. Where tiles lie side by side, a lookup stays half a texel away from
    its tile's sides, which is what Extend does for one tile.
    """
    tree.nodes.clear()
    first_u, first_v, columns, rows, size = image[results.LAYOUT]
    link = tree.links.new
    begin = tree.nodes.new("NodeGroupInput")
    uv = begin.outputs["UV"]
    lookup = tree.nodes.new("ShaderNodeTexImage")
    lookup.image, lookup.interpolation, lookup.extension, lookup.projection = image, "Linear", "EXTEND", "FLAT"
    lookup.location = (900, -150)
    place = uv
    if (first_u, first_v, columns, rows) != (0, 0, 1, 1):
        place = _place(tree, uv, (first_u, first_v), (columns, rows), 0.5 / size)
    link(place, lookup.inputs["Vector"])
    add, output = tree.nodes.new("ShaderNodeVectorMath"), tree.nodes.new("NodeGroupOutput")
    add.operation = "ADD"
    add.location, output.location = (1200, 0), (1400, 0)
    link(uv, add.inputs[0])
    link(lookup.outputs["Color"], add.inputs[1])
    link(add.outputs["Vector"], output.inputs["UV"])


def _place(tree, uv, first, counts, margin):
    """The UV's place in an image of several tiles: (tile + place within the tile) / number of tiles."""
    link = tree.links.new

    def vector(operation, at, *inputs):
        node = tree.nodes.new("ShaderNodeVectorMath")
        node.operation, node.location = operation, at
        for socket, value in zip(node.inputs, inputs):
            if isinstance(value, tuple):
                socket.default_value = value
            else:
                link(value, socket)
        return node.outputs["Vector"]

    local = vector("SUBTRACT", (150, 0), uv, (*map(float, first), 0.0))
    tile = vector("FLOOR", (300, -150), local)
    tile = vector("MAXIMUM", (450, -150), tile, (0.0, 0.0, 0.0))
    tile = vector("MINIMUM", (600, -150), tile, (counts[0] - 1.0, counts[1] - 1.0, 0.0))
    within = vector("SUBTRACT", (300, 100), local, tile)
    within = vector("MAXIMUM", (450, 100), within, (margin, margin, 0.0))
    within = vector("MINIMUM", (600, 100), within, (1 - margin, 1 - margin, 0.0))
    both = vector("ADD", (750, 0), tile, within)
    return vector("DIVIDE", (750, -250), both, (float(counts[0]), float(counts[1]), 1.0))


def own_material(obj: bpy.types.Object, slot: bpy.types.MaterialSlot) -> bpy.types.Material:
    """The slot's material, for this object alone: a redirection belongs to one object's pose."""
    material = slot.material
    others = [
        other for other in bpy.data.objects if other != obj and material in [s.material for s in other.material_slots]
    ]
    if others:
        copy = material.copy()
        copy.name = f"{material.name} {obj.name}"
        if slot.link == "DATA" and obj.data.users > 1:
            slot.link = "OBJECT"
        slot.material = copy
        material = copy
    return material


def insert(obj: bpy.types.Object, material: bpy.types.Material, source_uv: bpy.types.MeshUVLoopLayer, by: str) -> int:
    """Puts the object's group behind the UVs that the material's Image Texture nodes read; returns for how many of
    them.

    The group goes directly behind the node that hands out the mesh's UVs, in front of Mapping nodes: a redirection is
    one of the mesh's UVs. What else is linked there, and textures with other coordinates, stay as they are.
    """
    tree = material.node_tree
    if tree is None:
        raise Problem(f"material {material.name!r} has no nodes")
    group = group_by_image(obj) if by == BY_IMAGE else group_by_uv_map(obj)
    renders = source_uv.active_render
    textures = [
        node
        for node in tree.nodes
        if node.bl_idname == "ShaderNodeTexImage" and node.projection == "FLAT" and node.image != obj.vrtm.image
    ]
    present = [node for node in tree.nodes if is_ours(node)]
    for node in present:
        node.node_tree = group
    instances: dict[bpy.types.NodeSocket, bpy.types.Node] = {}
    done = 0
    for texture in textures:
        socket = texture.inputs["Vector"]
        if not socket.is_linked:
            # Without a link a texture reads the UV map that renders.
            if renders:
                tree.links.new(_instance(tree, group, _uv_node(tree, source_uv.name, texture), instances), socket)
                done += 1
            continue
        changed = False
        for link in _uv_links(socket, source_uv.name, renders):
            tree.links.new(_instance(tree, group, link.from_socket, instances), link.to_socket)
            changed = True
        done += changed
    if not done and not present:
        raise Problem(f"material {material.name!r} has no Image Texture that reads UV map {source_uv.name!r}")
    return done


def remove(material: bpy.types.Material) -> int:
    """Takes the groups out again and links what they stood between."""
    tree, removed = material.node_tree, 0
    for node in [node for node in tree.nodes if is_ours(node)] if tree else []:
        before = node.inputs["UV"].links
        source = before[0].from_socket if before else None
        for link in list(node.outputs["UV"].links):
            if source is not None:
                tree.links.new(source, link.to_socket)
        tree.nodes.remove(node)
        removed += 1
    return removed


def is_ours(node: bpy.types.Node) -> bool:
    return node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and bool(node.node_tree.get(KIND))


def _uv_node(tree, name, texture):
    node = next((n for n in tree.nodes if n.bl_idname == "ShaderNodeUVMap" and n.uv_map == name), None)
    if node is None:
        node = tree.nodes.new("ShaderNodeUVMap")
        node.uv_map = name
        node.location = (texture.location.x - 450, texture.location.y)
    return node.outputs["UV"]


def _instance(tree, group, source, instances):
    """The output of the group's node behind a socket: one for all that is linked to that socket."""
    node = instances.get(source)
    if node is None:
        node = next((link.to_node for link in source.links if is_ours(link.to_node)), None)
    if node is None:
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.width = 200
        node.location = (source.node.location.x + 200, source.node.location.y)
        tree.links.new(source, node.inputs["UV"])
    instances[source] = node
    return node.outputs["UV"]


def _uv_links(socket, name, renders, seen=None):
    """The links, upstream of a socket, that begin at the mesh's UV map `name`."""
    seen = set() if seen is None else seen
    found = []
    for link in socket.links:
        node = link.from_node
        if is_ours(node):
            continue
        if _hands_out(node, link.from_socket, name, renders):
            found.append(link)
        elif node not in seen:
            seen.add(node)
            for upstream in node.inputs:
                found += _uv_links(upstream, name, renders, seen)
    return found


def _hands_out(node, socket, name, renders):
    if node.bl_idname == "ShaderNodeUVMap":
        return node.uv_map == name or (not node.uv_map and renders)
    if node.bl_idname == "ShaderNodeTexCoord":
        return socket.name == "UV" and renders
    if node.bl_idname == "ShaderNodeAttribute":
        return node.attribute_type == "GEOMETRY" and node.attribute_name == name and socket.name == "Vector"
    return False
