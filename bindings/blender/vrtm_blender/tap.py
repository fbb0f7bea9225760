"""The Pose modifier: a Geometry Nodes modifier that stores each vertex's position and number as attributes.

Put behind the last modifier that deforms, where others such as Subdivision Surface make more vertices, it lets the pose
of the mesh's own vertices be read from the evaluated mesh, in the same evaluation that draws or renders the object. The
attributes' names begin with a dot: Blender does not list them.
"""

from __future__ import annotations

from functools import partial

import bpy

from . import layer_nodes, trees

POSE_NAME = ".vrtm_pose"
INDEX_NAME = ".vrtm_index"
# Modifiers that make other vertices than the mesh has, and of these the ones that keep the mesh's own vertices first,
# with their attributes. What counts is the evaluated mesh itself. What Geometry Nodes do cannot be known.
TOPOLOGY = frozenset(
    "ARRAY BEVEL BOOLEAN BUILD DECIMATE EDGE_SPLIT EXPLODE MASK MIRROR MULTIRES NODES OCEAN PARTICLE_INSTANCE REMESH "
    "SCREW SKIN SOLIDIFY SUBSURF TRIANGULATE VOLUME_TO_MESH WELD WIREFRAME".split()
)
KEEPING = frozenset("ARRAY EDGE_SPLIT MIRROR NODES SCREW SOLIDIFY SUBSURF TRIANGULATE".split())
# Modifiers that make copies, which go their own ways where something deforms them.
COPYING = frozenset("ARRAY MIRROR SCREW".split())
DEFORMING = frozenset(
    "ARMATURE CAST CLOTH CORRECTIVE_SMOOTH CURVE DISPLACE DYNAMIC_PAINT HOOK LAPLACIANDEFORM LAPLACIANSMOOTH LATTICE "
    "MESH_CACHE MESH_DEFORM MESH_SEQUENCE_CACHE SHRINKWRAP SIMPLE_DEFORM SMOOTH SOFT_BODY SURFACE_DEFORM WARP "
    "WAVE".split()
)


def _fill(tree: bpy.types.NodeTree) -> None:
    link, node = tree.links.new, partial(trees.node, tree)
    last = node("NodeGroupInput", 0, 0).outputs["Geometry"]
    for place, (name, kind, source) in enumerate(
        [(POSE_NAME, "FLOAT_VECTOR", "GeometryNodeInputPosition"), (INDEX_NAME, "INT", "GeometryNodeInputIndex")]
    ):
        store = node("GeometryNodeStoreNamedAttribute", 1 + place, 0, data_type=kind, domain="POINT")
        store.inputs["Name"].default_value = name
        link(last, store.inputs["Geometry"])
        link(node(source, place, -1).outputs[0], trees.enabled(store.inputs, "Value"))
        last = store.outputs["Geometry"]
    link(last, node("NodeGroupOutput", 3, 0).inputs["Geometry"])


GROUP = trees.ModifierGroup(".vrtm pose", "vrtm_pose_group", {}, _fill)


def is_own(modifier: bpy.types.Modifier) -> bool:
    """True of the modifiers of this add-on that store attributes, and change nothing else."""
    return GROUP.is_of(modifier) or layer_nodes.GROUP.is_of(modifier)


def working(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The modifiers that are on in viewports or renders, in their order."""
    return [modifier for modifier in obj.modifiers if modifier.show_viewport or modifier.show_render]


def changes_topology(modifier: bpy.types.Modifier) -> bool:
    return modifier.type in TOPOLOGY and not is_own(modifier)


def topology_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The modifiers that change the topology, first those that keep no vertices: messages name the first one."""
    return sorted(filter(changes_topology, working(obj)), key=_keeps)


def _keeps(modifier: bpy.types.Modifier) -> bool:
    if modifier.type == "MIRROR":
        return not any(modifier.use_bisect_axis)
    if modifier.type == "SOLIDIFY":
        return modifier.solidify_mode == "EXTRUDE" and not modifier.use_rim_only
    return modifier.type in KEEPING


def place(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """The modifier in front of which the Pose modifier has to stand, or the last one if it has to stand behind that;
    None where the pose cannot be read so."""
    others = [modifier for modifier in working(obj) if not is_own(modifier)]
    changing = [number for number, modifier in enumerate(others) if changes_topology(modifier)]
    if not changing or not all(_keeps(others[number]) for number in changing):
        return None
    deforming = [number for number, modifier in enumerate(others) if modifier.type in DEFORMING]
    at = deforming[-1] + 1 if deforming else changing[0]
    # Changes by Geometry Nodes in front of it would not be noticed.
    if any(others[number].type == "NODES" for number in changing if number < at):
        return None
    return others[min(at, len(others) - 1)]


def insert(obj: bpy.types.Object, at: bpy.types.Modifier) -> bpy.types.Modifier:
    """Puts the Pose modifier to its place()."""
    tap = GROUP.modifier_of(obj) or GROUP.insert(obj)
    tap.show_in_editmode, tap.show_viewport, tap.show_render = False, True, True
    source, target = obj.modifiers.find(tap.name), obj.modifiers.find(at.name)
    behind = at.type in DEFORMING
    obj.modifiers.move(source, target + behind - (source < target))
    return tap


def deforms_behind(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """The first modifier behind the Pose modifier that deforms: its deformation is not in the pose."""
    on = working(obj)
    at = next((number for number, modifier in enumerate(on) if GROUP.is_of(modifier)), len(on))
    needed = any(map(changes_topology, on))
    return next((modifier for modifier in on[at:] if needed and modifier.type in DEFORMING), None)


def copies(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """The first modifier that makes copies in front of one that deforms."""
    on = working(obj)
    last = max((number for number, modifier in enumerate(on) if modifier.type in DEFORMING), default=0)
    return next((modifier for modifier in on[:last] if modifier.type in COPYING), None)
