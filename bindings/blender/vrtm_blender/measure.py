"""The picture, measured: Cycles evaluates the UVs that the materials look their textures up at, at all face corners,
where the answer cannot be read from nodes. They are compared with those that the same nodes make of the result's UVs in
place of the mesh's, without this add-on's groups."""

from __future__ import annotations

import bpy
import numpy as np

from . import geometry, materials, nodes, picture, rendered, solve, states
from .messages import Problem, text_of

# The attribute that Cycles writes.
NAME = "vrtm looked up"


def measure(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> int:
    """Measures the lookups of the present pose's result; picture.ask() tells what was found. Returns their number.
    Raises a Problem."""
    # The asset may have solved for something else since, as for a bake.
    states.state_of(obj).rewrite = True
    state = solve.run(obj, depsgraph)
    state.measured = {}
    own, expected = state.prepared.mesh.topology.uvs, state.asset.corner_uvs()
    way = np.linalg.norm(expected - own, axis=1)
    if way.max(initial=0) < 1e-4:
        raise Problem(f"{obj.name}: nothing is redirected at this frame: go to one where it bends, and press it again")
    # Where much is redirected.
    corners = way > 0.25 * way.max()
    slots = np.repeat(picture.slots_of(obj), state.prepared.mesh.topology.face_counts)
    lookups = {
        number: [of for of in picture.textures(material) if picture.lookup_of(obj, *of).groups]
        for number, material in picture.materials_of(obj, slots[corners])
    }
    found, probe = {}, _Probe(obj, depsgraph)
    try:
        for turn in range(max(map(len, lookups.values()), default=0)):
            shown = {number: of[turn] for number, of in lookups.items() if turn < len(of)}
            with_groups = probe.looked_up(shown, False, own)
            without, right = (probe.looked_up(shown, True, uvs) for uvs in (own, expected))
            for number, (texture, _) in shown.items():
                here = corners & (slots == number)
                off, moved = (np.linalg.norm((one - right)[here]) for one in (with_groups, without))
                # Textures that do not follow the mesh's UVs are not redirected by them.
                if moved > 1e-5 * np.sqrt(here.sum()):
                    name = obj.material_slots[number].material.name, texture.name
                    found[name] = max(found.get(name, 0), float(off / moved))
    finally:
        probe.close()
    state.measured = found
    return len(found)


def told(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> list[str]:
    """Sentences on what the materials do not show of the result; measured only where nodes do not tell."""
    if picture.ask(obj).unsure:
        try:
            measure(obj, depsgraph)
        except Problem as problem:
            return [text_of(problem)]
    answer = picture.ask(obj)
    return [f"{obj.name}: {text}" for text in answer.wrong + answer.unsure]


class _Probe:
    """A copy of the object's mesh, in a scene of its own, which shows the looked-up UVs as colours."""

    def __init__(self, obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
        self.obj = obj
        # With what modifiers make of UV maps and attributes, as long as they keep the corners.
        evaluated = obj.evaluated_get(depsgraph)
        same = geometry.counts(evaluated.data) == geometry.counts(obj.data)
        self.mesh = bpy.data.meshes.new_from_object(evaluated) if same else obj.data.copy()
        self.probe = bpy.data.objects.new("vrtm probe", self.mesh)
        self.scene = bpy.data.scenes.new("vrtm probe")
        self.scene.collection.objects.link(self.probe)
        # Sequences of baked files go by the frame.
        self.scene.frame_current = depsgraph.scene.frame_current
        self.scene.render.engine, self.scene.cycles.samples, self.scene.cycles.device = "CYCLES", 1, "CPU"
        colours = self.mesh.color_attributes
        colours.active_color = colours.new(NAME, "FLOAT_COLOR", "CORNER")
        while len(self.mesh.materials) < len(obj.material_slots):
            self.mesh.materials.append(None)
        self.made: list[bpy.types.ID] = []

    def looked_up(self, shown: dict[int, tuple[bpy.types.Node, picture.Around]], muted: bool, uvs: np.ndarray):
        """The UVs that the textures of some slots are looked up at, (corners, 3), if these are the mesh's."""
        names = {geometry.source_uv_layer(self.obj).name, *([self.obj.vrtm.uv_name] if muted else [])}
        for name in names & set(self.mesh.uv_layers.keys()):
            self.mesh.uv_layers[name].uv.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())
        for number in range(len(self.mesh.materials)):
            self.mesh.materials[number] = self._copy(number, *shown[number], muted) if number in shown else None
        self.mesh.update()
        rendered.bake(self.scene, self.scene.view_layers[0], self.probe)
        return geometry.read(self.mesh.color_attributes[NAME].data, "color", 4)[:, :3]

    def _copy(self, number: int, texture: bpy.types.Node, around: picture.Around, muted: bool) -> bpy.types.Material:
        """A copy of a slot's material that shows the UVs of a texture."""
        copy = self.obj.material_slots[number].material.copy()
        self.made.append(copy)
        materials.own_groups(copy.node_tree, lambda inner: True)
        trees = [copy.node_tree]
        self.made += [tree for tree in nodes.reach(copy.node_tree, alone=False) if tree != copy.node_tree]
        for node in around:
            trees.append(trees[-1].nodes[node.name].node_tree)
        if muted:
            for node in materials.instances(copy.node_tree):
                node.mute = True
        socket = trees[-1].nodes[texture.name].inputs["Vector"].links[0].from_socket
        for tree, inner, node in zip(reversed(trees[:-1]), reversed(trees[1:]), reversed(around)):
            end = inner.interface.new_socket(NAME, in_out="OUTPUT", socket_type="NodeSocketVector")
            for output in [one for one in inner.nodes if one.bl_idname == "NodeGroupOutput"]:
                inner.links.new(socket, next(one for one in output.inputs if one.identifier == end.identifier))
            socket = next(one for one in tree.nodes[node.name].outputs if one.identifier == end.identifier)
        tree = copy.node_tree
        for output in [one for one in tree.nodes if one.bl_idname == "ShaderNodeOutputMaterial"]:
            tree.nodes.remove(output)
        shader, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial"))
        tree.links.new(socket, shader.inputs["Color"])
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return copy

    def close(self) -> None:
        """Nothing of it is left in the file."""
        bpy.data.scenes.remove(self.scene)
        bpy.data.meshes.remove(self.mesh)
        for one in dict.fromkeys(self.made):
            (bpy.data.materials if isinstance(one, bpy.types.Material) else bpy.data.node_groups).remove(one)
