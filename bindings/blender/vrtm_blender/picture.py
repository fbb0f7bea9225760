"""The picture, as the materials' nodes make it of the result. One question is asked of each material in use: is each
Image Texture that shows features looked up through the object's group, at Strength 1, at the right UV map?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import bpy
import numpy as np

from . import geometry, nodes, states
from .messages import Problem
from .tap import is_own

# The nodes of the artist's groups around a node, the outermost first.
Around = tuple[bpy.types.Node, ...]
# The custom property of a node that was made for a group.
MADE = "vrtm_made"
SET_UP, CHECK = "press Set Up by Image", "press Check the Picture"
# The largest distance from the result, as a share of the way, that a measured lookup has where it is right: an image
# shows a little less than corners have.
TOLERANCE = 0.3
# Modifiers that change UV maps.
MOVING_UVS = frozenset(("UV_PROJECT", "UV_WARP"))


@dataclass
class Answer:
    """Sentences on what is wrong, and on what nodes do not tell; and True if anything is redirected."""

    wrong: list[str] = field(default_factory=list)
    unsure: list[str] = field(default_factory=list)
    shows: bool = False


class Lookup(NamedTuple):
    """All that an Image Texture's UVs come from: groups of this add-on, and the mesh's UV maps beside these."""

    groups: dict[bpy.types.Node, Around]
    maps: dict[str, bpy.types.Node]


def ask(obj: bpy.types.Object) -> Answer:
    """The answer for all materials of the object that are in use."""
    answer = Answer()
    try:
        source = geometry.source_uv_layer(obj).name
    except Problem:
        # It is told where a solve is asked for.
        return answer
    slots, measured = slots_of(obj), measured_of(obj)
    for number, material in materials_of(obj, slots):
        # Names of images, by their reason and the remedy.
        found: dict[tuple[str, str], dict[str, None]] = {}
        elsewhere, shows = [], False
        for texture, around in textures(material):
            lookup = lookup_of(obj, texture, around)
            answer.wrong += [text for text in _lost(obj, lookup) if text not in answer.wrong]
            fault = None
            if lookup.groups or obj.vrtm.uv_name in lookup.maps:
                shows = True
                faults = [fault_of(obj, material, node, within, source) for node, within in lookup.groups.items()]
                if source in lookup.maps:
                    faults.append(("redirected in part alone", SET_UP))
                fault = next(filter(None, faults), None)
            elif source in lookup.maps:
                fault = "not redirected", SET_UP
            elif lookup.maps:
                elsewhere.append((texture.image.name, next(iter(lookup.maps))))
            share = measured.get((material.name, texture.name))
            if share is not None and (fault is None or fault[1] == CHECK):
                remedy = SET_UP if fault else "press Update Now, or look for what else changes its UVs"
                text = f"{100 * share:.0f} % of the way off the result, as measured"
                fault = None if share < TOLERANCE else (text, remedy)
            if fault is not None:
                found.setdefault(fault, {})[texture.image.name] = None
        if elsewhere and not shows and not found and _is_rigid(obj, slots == number):
            name, other = elsewhere[0]
            remedy = f"choose {other!r} as UV Map, or {source!r} in the material"
            found[f"looked up at UV map {other!r}, while what is rigid is on {source!r}", remedy] = {name: None}
        answer.shows |= shows
        for (reason, remedy), names in found.items():
            verb = "is" if len(names) == 1 else "are"
            text = f"{', '.join(map(repr, names))} {verb} {reason}: {remedy}"
            told = answer.unsure if remedy == CHECK else answer.wrong
            told += [text] if text not in told else []
    for modifier in obj.modifiers:
        if modifier.type in MOVING_UVS and (modifier.show_viewport or modifier.show_render):
            answer.wrong.append(f"Modifier {modifier.name!r} moves the UVs, which vrtm does not see: apply it")
    return answer


def _is_rigid(obj: bpy.types.Object, faces: np.ndarray) -> bool:
    """True if something is rigid on chosen faces, as far as the object was solved."""
    state = states.find_state(obj)
    if state is None or state.job is not None or state.asset is None:
        return False
    rigid = state.prepared.rigid_faces()
    return len(rigid) == len(faces) and bool((rigid & faces).any())


def measured_of(obj: bpy.types.Object) -> dict[tuple[str, str], float]:
    """The measured distances of lookups from the result, by the names of material and node."""
    return state.measured if (state := states.find_state(obj)) is not None else {}


def fault_of(
    obj: bpy.types.Object, material: bpy.types.Material, node: bpy.types.Node, around: Around, source: str
) -> tuple[str, str] | None:
    """A reason why a group's node does not hand out the redirection of UV map `source`, and the remedy."""
    by_image, settings = node.node_tree[nodes.KIND] == nodes.BY_IMAGE, obj.vrtm
    if material.library is not None and by_image and nodes.image_of(node.node_tree) != settings.image:
        return f"redirected as its own file has it, since material {material.name!r} is linked", SET_UP
    if not (settings.shows_baked or (settings.write_image if by_image else settings.write_uvs)):
        name = "Image" if by_image else "UV Map"
        return f"redirected by the result's {name}, which is not written", f"switch {name} on in Quality and Outputs"
    if node.mute:
        return f"redirected by a muted node, {node.name!r}", SET_UP
    uvs, strength = node.inputs["UV"], node.inputs["Strength"]
    if strength.is_linked:
        return f"redirected at a Strength that other nodes set ({node.name!r})", CHECK
    if strength.default_value != 1:
        return f"redirected at Strength {strength.default_value:.3g}", SET_UP
    before, maps = [link for link, _ in sources(uvs, around)], _maps(obj, uvs, around)
    if len(before) == 1 and len(maps) == 1 and before[0].from_node in maps.values():
        [name] = maps
        if name not in obj.data.attributes and _makes_maps(obj):
            return f"redirected at UV map {name!r}, which a modifier may make", CHECK
        remedy = f"choose {source!r} in node {before[0].from_node.name!r}, or {name!r} as UV Map"
        return None if name == source else (f"redirected at UV map {name!r} in place of {source!r}", remedy)
    if maps:
        return f"redirected at UVs out of other nodes ({before[0].from_node.name!r})", CHECK
    return f"redirected at no UV map ({node.name!r})", SET_UP


def _lost(obj: bpy.types.Object, lookup: Lookup) -> Iterator[str]:
    """Sentences on nodes that read a UV map which the mesh does not have."""
    if _makes_maps(obj):
        return
    named = {name: (node, node.id_data) for name, node in lookup.maps.items()}
    for node, around in lookup.groups.items():
        named |= {name: (of, of.id_data) for name, of in _maps(obj, node.inputs["UV"], around).items()}
        if node.node_tree[nodes.KIND] == nodes.BY_UV_MAP:
            named |= {of.uv_map: (node, node.node_tree) for of in node.node_tree.nodes if getattr(of, "uv_map", "")}
    for name, (node, tree) in named.items():
        if name not in obj.data.attributes:
            remedy = SET_UP if MADE in node or nodes.is_ours(node) else "choose another one there"
            yield f"Node {node.name!r} of {tree.name!r} reads UV map {name!r}, which the mesh does not have: {remedy}"


def _makes_maps(obj: bpy.types.Object) -> bool:
    """True if modifiers of the artist's may make UV maps."""
    return any(modifier.type == "NODES" and not is_own(modifier) for modifier in obj.modifiers)


def slots_of(obj: bpy.types.Object) -> np.ndarray:
    """The slot of each face."""
    last, index = max(len(obj.material_slots) - 1, 0), obj.data.attributes.get("material_index")
    if not last or index is None:
        return np.zeros(len(obj.data.polygons), np.int32)
    return geometry.read(index.data, "value", 1, np.int32).clip(0, last)


def materials_of(obj: bpy.types.Object, slots: np.ndarray) -> list[tuple[int, bpy.types.Material]]:
    """The slots that occur in `slots`, and their materials, which have nodes."""
    numbers = np.flatnonzero(np.bincount(slots, minlength=1)).tolist() if len(obj.material_slots) else []
    found = [(number, obj.material_slots[number].material) for number in numbers]
    return [(number, of) for number, of in found if of is not None and of.node_tree is not None]


def redirected(material: bpy.types.Material) -> list[bpy.types.Node]:
    """The Image Texture nodes that are looked up at UVs out of a group of this add-on."""
    found = {
        texture: None
        for texture, around in textures(material, drawn=False)
        for link, _ in upstream([texture.inputs["Vector"]], around)
        if nodes.is_ours(link.from_node)
    }
    return list(found)


def textures(material: bpy.types.Material, drawn: bool = True) -> list[tuple[bpy.types.Node, Around]]:
    """The artist's Image Texture nodes with an image, and the groups around each: those that the material's output
    shows, or all of them."""
    tree = material.node_tree
    if drawn:
        ends = {tree.get_output_node(of) for of in ("CYCLES", "EEVEE")} - {None}
        found = ((link.from_node, around) for end in ends for link, around in upstream(end.inputs))
    else:
        found = _within(tree)
    textures = dict.fromkeys((node, around) for node, around in found if nodes.is_own_texture(node))
    return [(node, around) for node, around in textures if node.image is not None]


def _within(tree: bpy.types.NodeTree, around: Around = ()) -> Iterator[tuple[bpy.types.Node, Around]]:
    """All nodes of a tree, and of the artist's groups in it."""
    for node in tree.nodes:
        yield node, around
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and not nodes.is_ours(node):
            yield from _within(node.node_tree, (*around, node))


def lookup_of(obj: bpy.types.Object, texture: bpy.types.Node, around: Around) -> Lookup:
    socket = texture.inputs["Vector"]
    if texture.projection != "FLAT":
        return Lookup({}, {})
    found = upstream([socket], around)
    groups = {link.from_node: within for link, within in found if nodes.is_ours(link.from_node)}
    if all(link.is_muted for link in socket.links):
        return Lookup({}, {rendered(obj): texture})
    return Lookup(groups, _maps(obj, socket, around))


def _maps(obj: bpy.types.Object, socket: bpy.types.NodeSocket, around: Around) -> dict[str, bpy.types.Node]:
    """The mesh's UV maps upstream of an input, up to groups of this add-on, and the node that reads each."""
    found = [(map_of(obj, link), link.from_node) for link, _ in upstream([socket], around)]
    return {name: node for name, node in found if name is not None}


def rendered(obj: bpy.types.Object) -> str:
    return next((layer.name for layer in obj.data.uv_layers if layer.active_render), "")


def map_of(obj: bpy.types.Object, link: bpy.types.NodeLink) -> str | None:
    """The UV map that a link begins at."""
    node, output = link.from_node, link.from_socket.name
    if node.bl_idname == "ShaderNodeUVMap":
        return node.uv_map or rendered(obj)
    if node.bl_idname == "ShaderNodeTexCoord" and output == "UV":
        return rendered(obj)
    if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY" and output == "Vector":
        return node.attribute_name
    return None


def upstream(
    sockets: Iterable[bpy.types.NodeSocket], around: Around = ()
) -> Iterator[tuple[bpy.types.NodeLink, Around]]:
    """All links upstream of inputs, up to groups of this add-on, and the groups around the nodes where they begin."""
    ahead, seen = [(socket, around) for socket in sockets], set()
    while ahead:
        for link, within in sources(*ahead.pop()):
            yield link, within
            if (link.from_node, within) not in seen and not nodes.is_ours(link.from_node):
                seen.add((link.from_node, within))
                ahead += [(socket, within) for socket in link.from_node.inputs]


def sources(socket: bpy.types.NodeSocket, around: Around = ()) -> Iterator[tuple[bpy.types.NodeLink, Around]]:
    """The links, most often one, that an input has its value from, and the groups around the nodes where they begin:
    through reroutes and muted nodes, and into the artist's groups and out of them."""
    for link in [link for link in socket.links if not link.is_muted]:
        node, output, within = link.from_node, link.from_socket, around
        if node.bl_idname == "NodeGroupInput":
            inputs, within = around[-1].inputs if around else (), around[:-1]
            inputs = [one for one in inputs if one.identifier == output.identifier]
        elif node.bl_idname == "NodeReroute":
            inputs = node.inputs
        elif nodes.is_ours(node):
            inputs = None
        elif node.mute:
            inputs = [one.from_socket for one in node.internal_links if one.to_socket == output]
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            ends = [one for one in node.node_tree.nodes if one.bl_idname == "NodeGroupOutput" and one.is_active_output]
            inputs = [one for end in ends for one in end.inputs if one.identifier == output.identifier]
            within = (*around, node)
        else:
            inputs = None
        if inputs is None:
            yield link, around
        for one in inputs or ():
            yield from sources(one, within)
