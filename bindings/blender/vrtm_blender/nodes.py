"""Node groups that redirect UVs: by an object's result image, by baked files, and by its result UV map."""

from __future__ import annotations

import re
from functools import partial

import bpy

from . import layers, packed, result_image, trees
from .messages import Problem

# The custom property that tells the kind of a node group of this add-on. No tree may hold a data-block in a custom
# property, registered or not: each time that EEVEE compiles such a tree the data-block loses a user, and Blender does
# not save what has none.
KIND = "vrtm_kind"
BY_IMAGE, BY_UV_MAP = "image", "uv_map"


def image_of(tree: bpy.types.NodeTree) -> bpy.types.Image | None:
    """The result image of a group, also while it shows baked files: that of one of its nodes, whatever it is called."""
    return next((image for image in _results_in(tree) if layers.LAYER not in image), None)


def baked_images() -> set[bpy.types.Image]:
    """The images of the baked files that groups read."""
    return {image for tree in _by_image() for image in _baked_of(tree)}


def groups_of(obj: bpy.types.Object) -> list[bpy.types.NodeTree]:
    """The object's groups by image: those with its result image, and those in its materials whose result image is gone
    or no object's, for example if the image was deleted or another one was chosen in the panel."""
    image, groups = obj.vrtm.image, [tree for tree in _by_image() if tree.library is None]
    found = [tree for tree in groups if image is not None and image_of(tree) == image]
    used = used_by(obj)
    others = [tree for tree in groups if tree in used and tree not in found]
    # All objects are looked at only where there may be something to mend.
    taken = {other.vrtm.image for other in bpy.data.objects} - {None} if others else set()
    return found + [tree for tree in others if image_of(tree) not in taken and _owner(tree) == obj]


def stale_groups(obj: bpy.types.Object) -> list[bpy.types.NodeTree]:
    """The object's groups by image that have lost the images of its result."""
    if obj.vrtm.shows_baked or not obj.vrtm.write_image:
        return []
    images = layers.images_of(obj.vrtm.image)
    names = {layers.attribute_name(obj.vrtm)} if len(images) > 1 else set()

    def is_whole(tree: bpy.types.NodeTree) -> bool:
        return _results_in(tree) == set(images) and names <= {getattr(of, "attribute_name", "") for of in tree.nodes}

    return [tree for tree in groups_of(obj) if not is_whole(tree)]


def update_groups(obj: bpy.types.Object, rebuild: bool) -> None:
    """Builds the object's groups by image that have lost it; with `rebuild` all of them, after a change of the image's
    layout."""
    if not obj.vrtm.shows_baked:
        for tree in groups_of(obj) if rebuild else stale_groups(obj):
            build_by_image(tree, obj)


def group_by_image(obj: bpy.types.Object) -> bpy.types.NodeTree:
    """UV in, redirected UV out, by the object's result image."""
    image = obj.vrtm.image
    if image is None:
        raise Problem(f"{obj.name} has no result image yet: press Update Now with the Image output on")
    # A linked group will do, too.
    if groups := [tree for tree in _by_image() if image_of(tree) == image] or groups_of(obj):
        return groups[0]
    tree = bpy.data.node_groups.new(f"vrtm redirection {obj.name}", "ShaderNodeTree")
    tree[KIND] = BY_IMAGE
    build_by_image(tree, obj)
    return tree


def _sockets(tree: bpy.types.NodeTree) -> None:
    """Makes the sockets of a new group: UV and strength in, UV out."""
    if len(tree.interface.items_tree):
        return
    tree.interface.new_socket("UV", in_out="OUTPUT", socket_type="NodeSocketVector")
    tree.interface.new_socket("UV", in_out="INPUT", socket_type="NodeSocketVector")
    socket = tree.interface.new_socket("Strength", in_out="INPUT", socket_type="NodeSocketFloat")
    socket.subtype, socket.min_value, socket.max_value, socket.default_value = "FACTOR", 0, 1, 1
    socket.description = "How much of the redirection is added: 0 shows the texture as the surface stretches it"


def _by_image() -> list[bpy.types.NodeTree]:
    return [tree for tree in bpy.data.node_groups if tree.get(KIND) == BY_IMAGE]


def _textures(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    return [node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage"]


def _baked_of(tree: bpy.types.NodeTree) -> set[bpy.types.Image]:
    images = {node.image for node in _textures(tree)} - {None}
    return {image for image in images if not result_image.is_result(image)}


def _results_in(tree: bpy.types.NodeTree) -> set[bpy.types.Image]:
    return {node.image for node in _textures(tree) if result_image.is_result(node.image)}


def _owner(tree: bpy.types.NodeTree) -> bpy.types.Object | None:
    """The object of a group without a result: the first that writes an image and has a material with it."""
    owners = [obj for obj in bpy.data.objects if obj.vrtm.is_set_up and obj.vrtm.write_image and tree in used_by(obj)]
    return min(owners, key=lambda one: one.session_uid, default=None)


def used_by(obj: bpy.types.Object) -> set[bpy.types.NodeTree]:
    """The node groups in the object's materials, and in these groups."""
    own = [slot.material.node_tree for slot in obj.material_slots if slot.material is not None]
    trees = [inner for tree in own for inner in reach(tree, alone=False, linked=True)]
    groups = [node for tree in trees for node in tree.nodes if node.bl_idname == "ShaderNodeGroup"]
    return {node.node_tree for node in groups} - {None}


def group_by_uv_map(obj: bpy.types.Object) -> bpy.types.NodeTree:
    """UV in, redirected UV out, by the object's result UV map."""
    name = obj.vrtm.uv_name
    if name not in obj.data.uv_layers:
        raise Problem(f"{obj.name} has no result UV map yet: press Update Now with the UV Map output on")
    tree = next((tree for tree in bpy.data.node_groups if is_by_uv_map(tree, name)), None)
    if tree is not None:
        return tree
    tree = bpy.data.node_groups.new(f"vrtm UV map {name}", "ShaderNodeTree")
    tree[KIND] = BY_UV_MAP
    _sockets(tree)
    begin, uv = trees.node(tree, "NodeGroupInput", 0, 1), trees.node(tree, "ShaderNodeUVMap", 0, 0, uv_map=name)
    mixed = _mixed(tree, 1, 0, begin.outputs["Strength"], begin.outputs["UV"], uv.outputs["UV"])
    tree.links.new(mixed, trees.node(tree, "NodeGroupOutput", 2, 0).inputs["UV"])
    return tree


def _mixed(tree: bpy.types.NodeTree, x: float, y: float, *sources: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """The output of a new Mix node of a factor and two vectors."""
    mix = trees.node(tree, "ShaderNodeMix", x, y, data_type="VECTOR")
    for source, name in zip(sources, ("Factor", "A", "B")):
        tree.links.new(source, trees.enabled(mix.inputs, name))
    return trees.enabled(mix.outputs)


def show_baked(obj: bpy.types.Object, paths: list[str], first: int, number: int) -> None:
    """Has the object's group read sequences of baked files, one for each layer, from the files of frame `first` on,
    instead of the result images."""
    baked = []
    for layer, path in enumerate(paths):
        image = packed.from_file(path, "SEQUENCE")
        image.name = f"{obj.vrtm.image.name} baked" + (f" layer {layer}" if layer else "")
        baked.append(image)
    for node in rebuild(obj, baked):
        user = node.image_user
        # So that each frame shows the file with its number.
        user.frame_start, user.frame_offset, user.frame_duration = first, first - 1, number
        user.use_cyclic, user.use_auto_refresh = False, True


def rebuild(obj: bpy.types.Object, baked: list[bpy.types.Image] | None = None) -> list[bpy.types.Node]:
    """Has the object's group read images of baked files, or else the result image again; returns the texture nodes.
    Images of baked files that nothing reads any more are removed."""
    tree = group_by_image(obj)
    before = _baked_of(tree)
    made = build_by_image(tree, obj, baked)
    for image in before:
        if not image.users:
            bpy.data.images.remove(image)
    return made


def baked_frames(obj: bpy.types.Object) -> range | None:
    """The frames of the baked files that the object's material shows; None if it shows none."""
    for user in [node.image_user for node in _sequences(obj)]:
        return range(user.frame_start, user.frame_start + user.frame_duration)
    return None


def baked_files(obj: bpy.types.Object, frame: int) -> list[str]:
    """The baked files of a frame that the object's material reads."""
    images = [node.image for node in _sequences(obj)]
    paths = [bpy.path.abspath(image.filepath, library=image.library) for image in images]
    # Blender counts by the last number of a name.
    return [re.sub(r"\d+(?=\D*$)", lambda number: f"{frame:0{len(number[0])}d}", path) for path in paths]


def _sequences(obj: bpy.types.Object) -> list[bpy.types.Node]:
    """The nodes of baked files in the object's groups, if it shows them."""
    nodes = [node for tree in groups_of(obj) if obj.vrtm.shows_baked for node in _textures(tree)]
    return [node for node in nodes if node.image is not None and node.image.source == "SEQUENCE"]


def is_by_uv_map(tree: bpy.types.NodeTree, name: str) -> bool:
    return tree.get(KIND) == BY_UV_MAP and any(getattr(node, "uv_map", None) == name for node in tree.nodes)


def build_by_image(
    tree: bpy.types.NodeTree, obj: bpy.types.Object, baked: list[bpy.types.Image] | None = None
) -> list[bpy.types.Node]:
    """Makes the nodes of a group by image: the UV's place in the image, the difference there, and the sum. Returns the
    texture nodes, one for each layer: those of `baked`, if it is given.

    The image holds differences, so that where there is nothing yet, and outside of all tiles, the UV stays what it
    is. It is looked up with Linear and Extend. Where tiles lie side by side, a lookup stays half a texel away from
    its tile's sides, which is what Extend does for one tile.
    """
    _sockets(tree)
    tree.nodes.clear()
    images = layers.images_of(obj.vrtm.image)
    first_u, first_v, columns, rows, size = images[0][result_image.LAYOUT]
    begin, vector = trees.node(tree, "NodeGroupInput", 0, 0), partial(trees.operate, tree, "VectorMath")
    uv = place = begin.outputs["UV"]
    if baked is not None:
        # The result's node stays, without links: by it the group is known, and the image has a user.
        trees.texture(tree, images[0], 5, 1)
    if (first_u, first_v, columns, rows) != (0, 0, 1, 1):
        place = _place(tree, uv, (first_u, first_v), (columns, rows), 0.5 / size)
    lookups = [trees.texture(tree, image, 5, -1 - 2 * layer, place) for layer, image in enumerate(baked or images)]
    found = _of_layer(tree, lookups, layers.attribute_name(obj.vrtm))
    scaled = vector("MULTIPLY", 8, -1, found, begin.outputs["Strength"])
    tree.links.new(vector("ADD", 9, 0, uv, scaled), trees.node(tree, "NodeGroupOutput", 10, 0).inputs["UV"])
    return lookups


def _of_layer(tree: bpy.types.NodeTree, lookups: list[bpy.types.Node], name: str) -> bpy.types.NodeSocket:
    """The lookup in the layer of the face that is drawn, by the attribute of faces `name`."""
    found = lookups[0].outputs["Color"]
    if len(lookups) == 1:
        return found
    # An attribute of integers is handed out as a float.
    number = trees.node(tree, "ShaderNodeAttribute", 5, 3, attribute_name=name).outputs["Fac"]
    for layer, lookup in enumerate(lookups[1:], 1):
        equal = trees.operate(tree, "Math", "COMPARE", 6, -1 - 2 * layer, number, layer, 0.5)
        found = _mixed(tree, 7, -1 - 2 * layer, equal, found, lookup.outputs["Color"])
    return found


def _place(tree, uv, first, counts, margin):
    """The UV's place in an image of several tiles: (tile + place within the tile) / number of tiles."""
    vector = partial(trees.operate, tree, "VectorMath")
    local = vector("SUBTRACT", 1, 0, uv, (*first, 0))
    tile = vector("MAXIMUM", 2, -1, vector("FLOOR", 1, -1, local), (0, 0, 0))
    tile = vector("MINIMUM", 3, -1, tile, (counts[0] - 1, counts[1] - 1, 0))
    within = vector("MAXIMUM", 3, 1, vector("SUBTRACT", 2, 1, local, tile), (margin, margin, 0))
    within = vector("MINIMUM", 4, 1, within, (1 - margin, 1 - margin, 0))
    return vector("DIVIDE", 4, -1, vector("ADD", 4, 0, tile, within), (*counts, 1))


def remove_unused_groups() -> None:
    """Removes the groups of this add-on that nothing uses."""
    for tree in [tree for tree in bpy.data.node_groups if tree.get(KIND) and tree.library is None and not tree.users]:
        bpy.data.node_groups.remove(tree)


def reach(
    tree: bpy.types.NodeTree | None, alone: bool = True, linked: bool = False
) -> dict[bpy.types.NodeTree, bpy.types.Node | None]:
    """A material's tree and the artist's groups in it, and in these, with the node that each group is; `alone`: only
    groups that nothing else uses, which may be changed for the material; `linked`: other files' groups, too."""
    found: dict[bpy.types.NodeTree, bpy.types.Node | None] = {tree: None} if tree is not None else {}
    ahead = list(found)
    while ahead:
        for node in ahead.pop().nodes:
            inner = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
            if inner is None or inner in found or is_ours_tree(inner) or (inner.library is not None and not linked):
                continue
            if not alone or inner.users == 1:
                found[inner] = node
                ahead.append(inner)
    return found


def is_own_texture(node: bpy.types.Node) -> bool:
    return node.bl_idname == "ShaderNodeTexImage" and not result_image.is_result(node.image)


def is_of_another(tree: bpy.types.NodeTree, obj: bpy.types.Object) -> bool:
    """True if a group's redirection is the result of another object."""
    others = [other for other in bpy.data.objects if other != obj and other.type == "MESH" and other.vrtm.is_set_up]
    if tree[KIND] == BY_UV_MAP:
        names = {other.vrtm.uv_name for other in others if other.data == obj.data} - {obj.vrtm.uv_name}
        return any(is_by_uv_map(tree, name) for name in names)
    image = image_of(tree)
    return image not in (None, obj.vrtm.image) and any(other.vrtm.image == image for other in others)


def shows_uv_map(obj: bpy.types.Object) -> bool:
    """True if one of the object's materials looks up its result UV map."""
    return any(is_by_uv_map(tree, obj.vrtm.uv_name) for tree in used_by(obj))


def is_ours_tree(tree: bpy.types.NodeTree | None) -> bool:
    return tree is not None and bool(tree.get(KIND))


def is_ours(node: bpy.types.Node) -> bool:
    return node.bl_idname == "ShaderNodeGroup" and is_ours_tree(node.node_tree)
