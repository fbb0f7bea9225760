"""Basis maps that `vrtm bake --basis` has written, as a node group: UV + sum of weights times maps. Drivers take the
weights from shape keys with the names of the rig's controls; without controls they are keyframes."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import bpy

from . import nodes, packed, trees
from .messages import Problem

BASIS = "basis"
"""The kind of the group."""
LONGEST = 255
"""The most characters of a driver's expression."""


@dataclass(frozen=True)
class Basis:
    """The file of weights, `basis.json`, as far as it is needed."""

    path: str
    document: dict

    @property
    def maps(self) -> int:
        return self.document["maps"]

    @property
    def controls(self) -> list[str]:
        driver = self.document["driver"]
        return [] if driver is None else driver["controls"]

    def terms(self, number: int) -> list[str]:
        """The terms of a map's weight: expressions of the controls, v0, v1 and so on, in words that Blender evaluates
        without Python."""
        driver, found = self.document["driver"], []
        coefficients = [row[number] for row in driver["coefficients"]]
        if driver["form"] == "products":
            for factor, row in zip(coefficients, driver["centres"]):
                found.append("*".join([_text(factor), *(f"v{k}" for k, has in enumerate(row) if has)]))
            return found
        ranges, centres = driver["ranges"], driver["centres"]
        for factor, centre in zip(coefficients, centres):
            away = "+".join(f"pow(v{k}/{_text(r)}{-at:+.9g},2)" for k, (r, at) in enumerate(zip(ranges, centre)))
            found.append(f"{_text(factor)}*sqrt({away})")
        linear = coefficients[len(centres) :]
        found += [f"{_text(factor)}*v{k}/{_text(r)}" for k, (factor, r) in enumerate(zip(linear, ranges))]
        return [*found, _text(linear[-1])]

    def keys(self) -> list[tuple[float, list[float]]]:
        """Frames with the weights of all maps, where no control drives them."""
        rows = [*self.document["frames"], *self.document["held_out"]]
        return sorted((float(row["frame"]), row["weights"]) for row in rows)


def read(path: str) -> Basis:
    """Raises a Problem."""
    path = bpy.path.abspath(path)
    try:
        with open(path, encoding="utf-8") as file:
            document = json.load(file)
        basis = Basis(path, document)
        if not isinstance(document["files"], list) or basis.maps != len(document["ranges"]):
            raise ValueError
        basis.controls, basis.keys()
    except OSError as error:
        raise Problem(f"{path}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise Problem(f"{path} is no basis.json of vrtm bake --basis, of this version") from error
    if any(tile["layer"] for tile in document["files"]):
        raise Problem(f"{path}: its mesh has faces that share UVs, in layers, which one node group cannot tell apart")
    folder = os.path.dirname(path)
    for tile in document["files"]:
        for name in tile["maps"]:
            if not os.path.isfile(os.path.join(folder, name)):
                raise Problem(f"{os.path.join(folder, name)} is missing, which {os.path.basename(path)} names")
    return basis


def group(obj: bpy.types.Object, basis: Basis) -> bpy.types.NodeTree:
    """A new node group with the maps, driven by the object's shape keys. Raises a Problem if it lacks one."""
    keys = obj.data.shape_keys
    missing = [name for name in basis.controls if keys is None or name not in keys.key_blocks]
    if missing:
        raise Problem(f"{obj.name} has no shape key {missing[0]!r}, a control of {os.path.basename(basis.path)}")
    sums = [list(_chunks(basis.terms(k), basis.path)) for k in range(basis.maps)] if basis.controls else []
    tree = bpy.data.node_groups.new(f"vrtm basis {obj.name}", "ShaderNodeTree")
    tree[nodes.KIND] = BASIS
    tree.interface.new_socket("UV", in_out="OUTPUT", socket_type="NodeSocketVector")
    tree.interface.new_socket("UV", in_out="INPUT", socket_type="NodeSocketVector")
    begin, end = trees.node(tree, "NodeGroupInput", -1, 1), trees.node(tree, "NodeGroupOutput", 6, 1)
    if basis.controls:
        weights = [_driven(tree, k, expressions, basis, keys) for k, expressions in enumerate(sums)]
    else:
        weights = [_keyed(tree, k, basis) for k in range(basis.maps)]
    total = begin.outputs["UV"]
    tiles = basis.document["files"]
    for row, tile in enumerate(tiles):
        # Tile 1001 alone is looked up as it is, and clamped: what is at its border goes on beyond it.
        is_alone = len(tiles) == 1 and tile["udim"] == 1001
        of_tile = _tile(
            tree, begin.outputs["UV"], tile, basis, weights, row, None if is_alone else _place(tile["udim"])
        )
        if of_tile is not None:
            total = trees.operate(tree, "VectorMath", "ADD", 5, 1 - 6 * row, total, of_tile)
    tree.links.new(total, end.inputs["UV"])
    return tree


def _tile(
    tree: bpy.types.NodeTree,
    uv: bpy.types.NodeSocket,
    tile: dict,
    basis: Basis,
    weights: Sequence[bpy.types.NodeSocket],
    row: int,
    place: tuple[float, float, float] | None,
) -> bpy.types.NodeSocket | None:
    """The sum of a tile's maps for UVs in it, and 0 for others; `place`: the tile's corner, None for all UVs."""
    vector, down = partial(trees.operate, tree, "VectorMath"), -6 * row
    at = uv if place is None else vector("SUBTRACT", 0, down, uv, place)
    total = None
    for number, name in enumerate(tile["maps"]):
        path, y = os.path.join(os.path.dirname(basis.path), name), down - 2 * number
        found = trees.texture(tree, packed.from_file(path, check_existing=True), 2, y, at).outputs["Color"]
        of = basis.document["ranges"][number]
        if basis.document["format"] != "half":
            scale, offset = ((*of[name], 0.0) for name in ("scale", "offset"))
            found = vector("MULTIPLY_ADD", 3, y, found, scale, offset)
        total = vector("MULTIPLY_ADD", 4, y, found, weights[number], (0.0, 0.0, 0.0) if total is None else total)
    if total is None or place is None:
        return total
    # Of UVs in the tile, whole numbers are the tile's.
    apart = vector("LENGTH", 1, down + 1, vector("FLOOR", 0, down + 1, at))
    return vector("MULTIPLY", 5, down, total, trees.operate(tree, "Math", "LESS_THAN", 2, down + 1, apart, 0.5))


def _driven(
    tree: bpy.types.NodeTree, number: int, expressions: Sequence[str], basis: Basis, keys: bpy.types.Key
) -> bpy.types.NodeSocket:
    """The weight of a map: one value per expression, and their sum."""
    total = None
    for part, expression in enumerate(expressions):
        node = _value(tree, number, part)
        driver = node.outputs[0].driver_add("default_value").driver
        driver.type, driver.expression = "SCRIPTED", expression
        for k in sorted({int(name) for name in re.findall(r"\bv(\d+)\b", expression)}):
            variable = driver.variables.new()
            variable.name, variable.type = f"v{k}", "SINGLE_PROP"
            target = variable.targets[0]
            target.id_type, target.id = "KEY", keys
            target.data_path = f'key_blocks["{bpy.utils.escape_identifier(basis.controls[k])}"].value'
        weight = node.outputs[0]
        total = weight if total is None else trees.operate(tree, "Math", "ADD", 1, -2 - number, total, weight)
    return total


def _keyed(tree: bpy.types.NodeTree, number: int, basis: Basis) -> bpy.types.NodeSocket:
    """The weight of a map, with a keyframe per frame."""
    socket = _value(tree, number, 0).outputs[0]
    for frame, weights in basis.keys():
        socket.default_value = weights[number]
        socket.keyframe_insert("default_value", frame=frame)
    return socket


def _value(tree: bpy.types.NodeTree, number: int, part: int) -> bpy.types.Node:
    node = trees.node(tree, "ShaderNodeValue", 0, -2 - number - 0.3 * part)
    node.name = node.label = f"weight {number}" + (f" part {part}" if part else "")
    return node


def _chunks(terms: Sequence[str], path: str) -> Iterator[str]:
    """Sums of the terms, none longer than an expression may be."""
    found = ""
    for term in terms:
        if len(term) > LONGEST:
            raise Problem(f"{path}: it has more controls than the expression of a driver holds, {LONGEST} characters")
        # A minus stands for itself.
        joined = f"{found}{'' if term.startswith('-') or not found else '+'}{term}"
        if len(joined) > LONGEST:
            yield found
            joined = term
        found = joined
    yield found or "0"


def _place(udim: int) -> tuple[float, float, float]:
    return float((udim - 1001) % 10), float((udim - 1001) // 10), 0.0


def _text(number: float) -> str:
    return f"{number:.9g}"
