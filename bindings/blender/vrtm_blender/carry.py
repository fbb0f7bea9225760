"""The things that an object's skin carries: objects as a whole, and the points, hair curves and instances of others.
Each has its skin, and its state before, in its own properties (Object.vrtm_carry), so that the file keeps them."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, PointerProperty
from mathutils import Matrix

from . import carry_nodes, geometry, session
from .carriers import CarriedInput, Moved, Thing, rotation_of
from .messages import Problem

FITS = [
    ("feature", "Features", "Things on a rigid feature move with it as one body"),
    ("surface", "Surface", "All follows the redirected surface"),
    ("none", "Skin", "All follows the skin, as if nothing were redirected"),
]
# Default of the largest distance, as a share of the diagonal of the skin's bounding box.
FAR = 0.05
# Modifiers that may move things by the deformers of the skin.
MOVING = frozenset(
    "ARMATURE CLOTH CURVE HOOK LATTICE MESH_CACHE MESH_DEFORM MESH_SEQUENCE_CACHE SHRINKWRAP SOFT_BODY "
    "SURFACE_DEFORM".split()
)
# Marks the action of a bake.
BAKED = "vrtm_carried"
# The transform of an object in its parent's space.
CHANNELS = {"location": 3, "rotation_euler": 3, "rotation_quaternion": 4, "rotation_axis_angle": 4, "scale": 3}


class VrtmCarry(bpy.types.PropertyGroup):
    """Object.vrtm_carry"""

    skin: PointerProperty(name="Carried by", type=bpy.types.Object)
    kind: EnumProperty(items=[("NONE", "None", ""), ("OBJECT", "Object", ""), ("POINTS", "Points", "")])
    farthest: FloatProperty()
    fit: EnumProperty(items=FITS)
    skirt: FloatProperty()
    pieces: BoolProperty()
    # Its channels before, one behind the other.
    channels: FloatVectorProperty(size=sum(CHANNELS.values()))
    # An object as a whole at rest, in the skin's space, and its transform as it was carried last: with another one it
    # was moved by hand, or is new.
    rest: FloatVectorProperty(size=16)
    placed: FloatVectorProperty(size=16)


def carried_by(skin: bpy.types.Object) -> list[bpy.types.Object]:
    return [obj for obj in bpy.data.objects if obj.vrtm_carry.skin == skin and obj.library is None]


def carries_live(skin: bpy.types.Object) -> bool:
    """True if the things that it carries follow it, and show no bake."""
    return not skin.vrtm.carried_baked and bool(carried_by(skin))


def holder_of(obj: bpy.types.Object) -> bpy.types.Constraint | None:
    """The constraint by which a carried object follows its skin, unless it is a child of it: the viewport draws a line
    from each child to its parent."""
    own = [c for c in obj.constraints if c.type == "CHILD_OF" and c.target == obj.vrtm_carry.skin and not c.mute]
    return own[0] if own else None


def inverse_of(obj: bpy.types.Object) -> Matrix:
    """The transform that stands between an object's own and its skin's."""
    holder = holder_of(obj)
    return obj.matrix_parent_inverse if holder is None else holder.inverse_matrix


def in_skin(obj: bpy.types.Object) -> np.ndarray:
    """(4, 4) from an object's space to its skin's."""
    return np.array(inverse_of(obj) @ obj.matrix_basis)


def is_moved(obj: bpy.types.Object) -> bool:
    """True if a carried object was moved by hand, or is to be bound for the first time: where it is seen."""
    own = obj.vrtm_carry
    if own.kind == "POINTS":
        return carry_nodes.TO_REST not in obj.data.attributes
    return own.kind == "OBJECT" and not own.skin.vrtm.carried_baked and matrix_of(own.placed) != obj.matrix_basis


def matrix_of(values: Iterable[float]) -> Matrix:
    return Matrix(np.reshape(values, (4, 4)).tolist())


def scale_of(skin: bpy.types.Object) -> float:
    return abs(skin.matrix_world.determinant()) ** (1 / 3) or 1.0


def reason(obj: bpy.types.Object, skin: bpy.types.Object, kind: str) -> str | None:
    """The reason why an object cannot be carried, and the remedy, as the end of a sentence."""
    if obj.library is not None or obj.override_library is not None:
        return "is linked from another file: make it local"
    if obj.mode == "EDIT":
        return "is in Edit Mode: leave it first"
    if obj.type == "ARMATURE" or skin in obj.children_recursive:
        return f"moves {skin.name} itself"
    if obj.parent is not None and (obj.parent != skin or obj.parent_type != "OBJECT"):
        if obj.parent.vrtm_carry.skin == skin:
            return f"follows its parent {obj.parent.name}, which is carried"
        return f"is parented to {obj.parent.name}: clear the parent first (Alt P, Keep Transformation)"
    if any(not constraint.mute and constraint != holder_of(obj) for constraint in obj.constraints):
        return "has constraints, which move it: apply or mute them"
    if (moving := mover(obj)) is not None:
        return f"is deformed by its modifier {moving.name!r} already: remove or hide it, or apply it at rest"
    if kind == "OBJECT" and is_animated(obj):
        return "has keys or drivers of its own: clear them"
    return reason_of_points(obj) if kind == "POINTS" else None


def is_animated(obj: bpy.types.Object) -> bool:
    data = obj.animation_data
    return data is not None and bool(data.action or data.drivers or data.nla_tracks)


def reason_of_points(obj: bpy.types.Object) -> str | None:
    if obj.type not in {"MESH", "POINTCLOUD", "CURVES"}:
        return "has no points that can be carried: carry it as a whole"
    if obj.data.library is not None:
        return "has data that is linked from another file: make it local"
    if obj.data.users > 1 + obj.data.use_fake_user:
        return "shares its data with others: make it a single user (Object > Relations > Make Single User)"
    if not len(own_places(obj)):
        return (
            "has no points of its own, since its modifiers make them anew in each pose: turn them into points at rest "
            "(Object > Apply > Visual Geometry to Mesh)"
        )
    return None


def mover(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """A modifier that would move a carried object a second time."""
    for modifier in obj.modifiers:
        tree = modifier.node_group if modifier.type == "NODES" else None
        follows = tree is not None and any(n.bl_idname == "GeometryNodeDeformCurvesOnSurface" for n in tree.nodes)
        if (follows or modifier.type in MOVING) and (modifier.show_viewport or modifier.show_render):
            return modifier
    return None


def kind_of(obj: bpy.types.Object) -> str:
    """The kind of carrying that suits an object: by points if something is scattered over them, else as a whole."""
    if obj.type in {"POINTCLOUD", "CURVES"}:
        return "POINTS"
    if obj.type == "MESH":
        scattered = obj.instance_type in {"VERTS", "FACES"} or any(
            m.type == "NODES" and m.node_group is not None and _instances(m.node_group) for m in obj.modifiers
        )
        if scattered or not len(obj.data.polygons):
            return "POINTS"
    return "OBJECT"


def _instances(tree: bpy.types.NodeTree) -> bool:
    return any(
        node.bl_idname == "GeometryNodeInstanceOnPoints"
        or (node.bl_idname == "GeometryNodeGroup" and node.node_tree is not None and _instances(node.node_tree))
        for node in tree.nodes
    )


def domain_of(obj: bpy.types.Object) -> str:
    return "CURVE" if obj.type == "CURVES" else "POINT"


def own_places(obj: bpy.types.Object) -> np.ndarray:
    """The points of an object, or the roots of its curves, in its own space: (places, 3) float32."""
    if obj.type == "MESH":
        return geometry.positions(obj.data)
    attribute = obj.data.attributes.get("position")
    points = np.zeros((0, 3), np.float32) if attribute is None else geometry.read(attribute.data, "vector", 3)
    if obj.type == "CURVES":
        return points[geometry.read(obj.data.curves, "first_point_index", 1, np.int32)]
    return points


def attach(
    obj: bpy.types.Object, skin: bpy.types.Object, kind: str, farthest: float, fit: str, skirt: float, by_parts: bool
) -> None:
    """Makes an object one that is carried, where it is seen; one that is carried already gets these settings. Lengths
    are those of the world. `by_parts`: each connected part of a mesh as one body."""
    own, scale, known = obj.vrtm_carry, scale_of(skin), obj.vrtm_carry.skin == skin
    own.skin, own.kind, own.farthest, own.fit, own.skirt = skin, kind, farthest / scale, fit, skirt / scale
    own.pieces = by_parts and obj.type == "MESH"
    if known:
        return
    own.channels = [value for name in CHANNELS for value in getattr(obj, name)]
    if obj.parent != skin:
        holder = obj.constraints.new("CHILD_OF")
        holder.name, holder.target, holder.show_expanded = carry_nodes.GROUP.name, skin, False
        holder.inverse_matrix = skin.matrix_world.inverted_safe()
    if kind == "POINTS":
        # Instances are moved when they are there; what has faces, and hair, before it is refined.
        first = obj.type == "CURVES" or (obj.type == "MESH" and kind_of(obj) == "OBJECT")
        carry_nodes.GROUP.insert(obj, at=0 if first else None)


def release(obj: bpy.types.Object) -> None:
    """Lets an object go: its place, parent and data are as before."""
    own = obj.vrtm_carry
    clear_baked(obj)
    if (holder := holder_of(obj)) is not None:
        obj.constraints.remove(holder)
    if own.kind == "OBJECT":
        values = list(own.channels)
        for name, width in CHANNELS.items():
            setattr(obj, name, values[:width])
            del values[:width]
    else:
        carry_nodes.remove(obj)
        for name in carry_nodes.NAMES:
            if name in obj.data.attributes:
                obj.data.attributes.remove(obj.data.attributes[name])
    for name in own.bl_rna.properties.keys():
        if name not in ("rna_type", "name"):
            own.property_unset(name)


def clear_baked(obj: bpy.types.Object) -> None:
    """Removes the keys and files of a bake."""
    if obj.vrtm_carry.kind == "POINTS":
        carry_nodes.show_live(obj)
    elif (action := own_keys(obj)) is not None:
        obj.animation_data_clear()
        obj.matrix_basis = matrix_of(obj.vrtm_carry.placed)
        if not action.users:
            bpy.data.actions.remove(action)


def own_keys(obj: bpy.types.Object) -> bpy.types.Action | None:
    """The action that a bake has made."""
    action = obj.animation_data.action if obj.animation_data is not None else None
    return action if action is not None and BAKED in action else None


def read(skin: bpy.types.Object) -> CarriedInput:
    """The things that an object carries: at rest, or, where that is not known yet, as they are seen."""
    things = []
    for obj in carried_by(skin):
        own, moved = obj.vrtm_carry, is_moved(obj)
        parts = turned = off = None
        if whole := own.kind == "OBJECT":
            to_skin = in_skin(obj) if moved else np.reshape(own.rest, (4, 4)).astype(np.float64)
            places, off = to_skin[None, :3, 3], to_skin[None, 3, :3].copy()
            to_skin[3, :3] = 0
        else:
            to_skin = in_skin(obj)
            points = places = own_places(obj).astype(np.float64)
            if not moved:
                back = geometry.read(obj.data.attributes[carry_nodes.TO_REST].data, "value", 16).reshape(-1, 4, 4)
                # Of a new point it is 0, and in Edit Mode there is none.
                back = np.resize(back, (len(points), 4, 4)) if len(back) else np.zeros((len(points), 4, 4))
                back[~back.any((1, 2))] = np.eye(4)
                off, axes = back[:, 3, :3] @ to_skin[:3, :3].T, rotation_of(to_skin)
                places = np.einsum("nij,nj->ni", back[:, :3, :3], points) + back[:, :3, 3]
                turned = axes @ np.swapaxes(back[:, :3, :3], 1, 2) @ axes.T
            places = places @ to_skin[:3, :3].T + to_skin[:3, 3]
            if own.pieces:
                edges = geometry.read(obj.data.edges, "vertices", 2, np.int32)
                of = session.library("vrtm.bake.carry_parts")
                parts = of.connected(points, np.full(len(edges), 2), edges.ravel())
        if not np.isfinite(places).all():
            raise Problem(f"{obj.name}: a point of it has no place (NaN): mend or delete it")
        if len(places):
            uid, way = obj.session_uid, (own.farthest, own.fit, own.skirt)
            seen = places if moved else None
            things.append(Thing(uid, obj.name, places, to_skin, whole, *way, parts, seen, False, off, turned))
    told = repr([(thing.uid, thing.name, thing.way, thing.seen is None) for thing in things]).encode()
    each = [of for thing in things for of in (thing.places, thing.to_skin, thing.parts, thing.off, thing.turned)]
    arrays = [of for of in each if of is not None]
    return CarriedInput(things, scale_of(skin), geometry.stamp_of(*arrays) + told)


def place(skin: bpy.types.Object, moved: dict[int, Moved]) -> None:
    """Moves the things that an object carries, unless they show a bake."""
    if not moved or not carries_live(skin):
        return
    for obj in carried_by(skin):
        own = moved.get(obj.session_uid)
        if own is None:
            continue
        if obj.vrtm_carry.kind == "OBJECT":
            if own.rest is not None:
                obj.vrtm_carry.rest = own.rest.ravel().tolist()
            obj.matrix_basis = basis(obj, own)
            obj.vrtm_carry.placed = [value for row in obj.matrix_basis for value in row]
        elif obj.mode != "EDIT":
            _place_points(obj, own)


def basis(obj: bpy.types.Object, moved: Moved) -> Matrix:
    """The transform of an object that is carried as a whole."""
    return inverse_of(obj).inverted_safe() @ matrix_of(moved.matrix)


def _place_points(obj: bpy.types.Object, moved: Moved) -> None:
    roots = own_places(obj)
    if len(roots) != len(moved.places):
        # It was edited meanwhile, and is read again.
        return
    names = carry_nodes.ROOT, carry_nodes.PLACE, carry_nodes.TURN
    for name, values in zip(names, (roots, moved.places, moved.turns)):
        geometry.write(obj.data, name, domain_of(obj), "FLOAT_VECTOR", values)
    if moved.rest is not None:
        geometry.write(obj.data, carry_nodes.TO_REST, domain_of(obj), "FLOAT4X4", moved.rest)
    obj.data.update_tag()


def troubles(skin: bpy.types.Object) -> list[str]:
    """Problems of carried things, in sentences."""
    found = []
    if skin.hide_render and carries_live(skin):
        found.append("It is hidden in renders, where what it carries is not moved then: press Bake Carried")
    for obj in carried_by(skin):
        own, text = obj.vrtm_carry, None
        if obj.parent != skin and holder_of(obj) is None:
            text = f"does not follow {skin.name} any more: press Let Go, and carry it again"
        elif own.kind == "POINTS" and carry_nodes.GROUP.modifier_of(obj) is None:
            text = f"has lost its modifier {carry_nodes.GROUP.name!r}: press Let Go, and carry it again"
        elif own.kind == "OBJECT" and is_animated(obj) and own_keys(obj) is None:
            text = "has keys or drivers of its own, which carrying overrules: clear them, or press Let Go"
        elif (moving := mover(obj)) is not None:
            text = f"is deformed by its modifier {moving.name!r}, too: hide it"
        if text:
            found.append(f"{obj.name} {text}")
    return found


def register() -> None:
    bpy.utils.register_class(VrtmCarry)
    bpy.types.Object.vrtm_carry = PointerProperty(type=VrtmCarry)


def unregister() -> None:
    del bpy.types.Object.vrtm_carry
    bpy.utils.unregister_class(VrtmCarry)
