"""Reads meshes into arrays: topology, UVs, the rest shape and the pose. All of it on the main thread, none of it
changes anything."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import bpy
import numpy as np

from . import session
from .messages import Problem
from .tap import GROUP as POSE_GROUP
from .tap import INDEX_NAME, POSE_NAME, TOPOLOGY, place, topology_modifiers

# The attribute with a captured rest shape: of the mesh, which is saved with the file, or of a mesh of its own.
REST_NAME = "vrtm_rest"
# The custom property of the mesh with the frame of that shape.
REST_FRAME_NAME = "vrtm_rest_frame"


@dataclass(frozen=True)
class Topology:
    """A mesh's faces and the UVs of one UV map."""

    corner_vertices: np.ndarray  # (corners,) uint32
    face_counts: np.ndarray  # (faces,) uint32: corners of each face
    uvs: np.ndarray  # (corners, 2) float32
    vertices: int
    stamp: bytes

    @property
    def triangles(self) -> np.ndarray:
        """The faces as the package splits them, (triangles, 3): corners."""
        return session.library("vrtm.bake.scene.topology").fans(self.face_counts)


def stamp_of(*arrays: np.ndarray) -> bytes:
    """A hash of the arrays' bits and shapes, by which changes are noticed."""
    hashed = hashlib.blake2b(digest_size=16)
    for array in arrays:
        hashed.update(repr((array.shape, array.dtype.str)).encode())
        hashed.update(np.ascontiguousarray(array).data)
    return hashed.digest()


def read(collection, name: str, width: int, dtype=np.float32) -> np.ndarray:
    """A property of all elements of a Blender collection: (n, width), or (n,) for width 1."""
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def write(mesh: bpy.types.Mesh, name: str, domain: str, kind: str, values: np.ndarray) -> None:
    """Writes an attribute of vectors, colours, integers or transforms, which is made if it is not there or of another
    kind."""
    attribute = mesh.attributes.get(name)
    if attribute is not None and (attribute.domain, attribute.data_type) != (domain, kind):
        mesh.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = mesh.attributes.new(name, kind, domain)
    key = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color"}.get(kind, "value")
    values = np.ascontiguousarray(values, np.int32 if kind == "INT" else np.float32)
    attribute.data.foreach_set(key, values.ravel())


def corner_vertices(mesh: bpy.types.Mesh) -> np.ndarray:
    """The vertex of each face corner, (corners,) int32."""
    # A hundred times as fast as the loops, which Blender makes of this attribute one by one.
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is None:
        return read(mesh.loops, "vertex_index", 1, np.int32)
    return read(attribute.data, "value", 1, np.int32)


def positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """(vertices, 3) float32."""
    attribute = mesh.attributes.get("position")
    return read(mesh.vertices, "co", 3) if attribute is None else read(attribute.data, "vector", 3)


def is_linked(obj: bpy.types.Object) -> bool:
    """True if the mesh is another file's: nothing can be written to it, and the result is an image alone."""
    return obj.data is not None and obj.data.library is not None


def source_uv_layer(obj: bpy.types.Object) -> bpy.types.MeshUVLoopLayer:
    """The UV map of the texture: the one that is named, or else the one that renders, but never a result."""
    mesh, settings = obj.data, obj.vrtm
    if settings.uv_map:
        layer = mesh.uv_layers.get(settings.uv_map)
        if layer is None:
            raise Problem(f"{obj.name} has no UV map {settings.uv_map!r}: choose another in the panel")
        if layer.name == settings.uv_name:
            raise Problem(f"{obj.name}: {layer.name!r} is the result; choose the UV map of the texture")
        return layer
    layers = [layer for layer in mesh.uv_layers if layer.name not in result_names(mesh)]
    if not layers:
        raise Problem(f"{obj.name} has no UV map: unwrap it first")
    return next((layer for layer in layers if layer.active_render), layers[0])


def result_names(mesh: bpy.types.Mesh) -> set[str]:
    """Names of the UV maps that results of the objects with this mesh are written to."""
    return {obj.vrtm.uv_name for obj in bpy.data.objects if obj.data == mesh}


def counts(mesh: bpy.types.Mesh) -> tuple[int, int, int]:
    return len(mesh.vertices), len(mesh.loops), len(mesh.polygons)


def topology(obj: bpy.types.Object) -> Topology:
    mesh = obj.data
    if not len(mesh.polygons):
        raise Problem(f"{obj.name} has no faces")
    corners = corner_vertices(mesh).view(np.uint32)
    faces = read(mesh.polygons, "loop_total", 1, np.int32).view(np.uint32)
    uvs = read(source_uv_layer(obj).uv, "vector", 2)
    return Topology(corners, faces, uvs, len(mesh.vertices), stamp_of(corners, faces, uvs))


def rest_positions(obj: bpy.types.Object) -> np.ndarray:
    """The rest shape, (vertices, 3) float32 in the object's own space."""
    mesh, settings = obj.data, obj.vrtm
    if settings.rest_source == "MESH":
        return positions(mesh)
    if settings.rest_source == "SHAPE_KEY":
        keys = mesh.shape_keys.key_blocks if mesh.shape_keys else {}
        key = keys.get(settings.rest_key)
        if key is None:
            raise Problem(f"{obj.name} has no shape key {settings.rest_key!r}: choose another as rest")
        return read(key.data, "co", 3)
    kept = rest_keeper(obj)
    attribute = kept.attributes.get(REST_NAME)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type != "FLOAT_VECTOR":
        raise Problem(f"{obj.name} has no captured rest shape: press Capture Rest")
    found = read(attribute.data, "vector", 3)
    if len(found) != len(mesh.vertices):
        raise Problem(f"{obj.name}: its captured rest shape has another number of vertices: press Capture Rest")
    return found


def rest_keeper(obj: bpy.types.Object) -> bpy.types.Mesh:
    """The mesh that has the captured rest shape as an attribute."""
    return obj.vrtm.rest_mesh or obj.data


def store_rest(obj: bpy.types.Object, positions: np.ndarray, frame: int) -> None:
    """Keeps a rest shape, the evaluated one of a frame: in the mesh, or, where that is linked, in one of vertices
    alone."""
    remove_rest_mesh(obj)
    kept = obj.data
    if is_linked(obj):
        kept = obj.vrtm.rest_mesh = bpy.data.meshes.new(f"vrtm {obj.name} rest")
        kept.vertices.add(len(positions))
    write(kept, REST_NAME, "POINT", "FLOAT_VECTOR", positions)
    kept[REST_FRAME_NAME] = frame


def remove_rest_mesh(obj: bpy.types.Object) -> None:
    """Removes the mesh that keeps an object's rest shape, if nothing else uses it."""
    before, obj.vrtm.rest_mesh = obj.vrtm.rest_mesh, None
    if before is not None and not before.users and before.library is None:
        bpy.data.meshes.remove(before)


def pose(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> np.ndarray:
    """The evaluated shape of all vertices of the mesh, (vertices, 3) float32 in the object's own space.

    Modifiers must not be switched off and on in a handler. So where the evaluated mesh has other vertices than the
    mesh, the pose is what the Pose modifier of this add-on stored as an attribute: most modifiers that change them keep
    the mesh's own vertices first, with their attributes as they are.
    """
    mesh = obj.data
    evaluated = obj.evaluated_get(depsgraph).data
    number = len(mesh.vertices)
    if counts(evaluated) == counts(mesh) and same_faces(obj, evaluated):
        return positions(evaluated)
    stored, index = evaluated.attributes.get(POSE_NAME), evaluated.attributes.get(INDEX_NAME)
    if stored is None or index is None:
        if (tap := POSE_GROUP.modifier_of(obj)) is not None and tap.show_viewport:
            raise Problem(f"{obj.name}: {culprit(obj)} keeps no attributes of the vertices: hide it, or apply it")
        ways = "hide it, or apply it" if place(obj) is None else "press Read Pose, or hide it"
        raise Problem(f"{obj.name}: {culprit(obj)} changes the topology: {ways}")
    indices = read(index.data, "value", 1, np.int32)
    if len(indices) < number or not np.array_equal(indices[:number], np.arange(number, dtype=np.int32)):
        raise Problem(f"{obj.name}: {culprit(obj)} does not keep the mesh's vertices: hide it, or apply it")
    return read(stored.data, "vector", 3)[:number].copy()


def same_faces(obj: bpy.types.Object, evaluated: bpy.types.Mesh) -> bool:
    """True if a mesh with as many vertices and corners has the same faces. Deforming modifiers are trusted."""
    if not any(modifier.type in TOPOLOGY for modifier in obj.modifiers):
        return True
    return np.array_equal(corner_vertices(obj.data), corner_vertices(evaluated))


def culprit(obj: bpy.types.Object) -> str:
    """The modifier that most likely changes the topology, as an artist knows it."""
    found = topology_modifiers(obj)
    return f"modifier {found[0].name!r}" if found else "a modifier"
