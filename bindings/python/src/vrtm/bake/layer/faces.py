"""The maps that each face takes, and the GeomSubsets by which renderers tell the faces of different layers apart: no
renderer needs a choice between maps in its shaders."""

from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from vrtm.bake.layer.plan import LAYER, LayerPlan
from vrtm.bake.scene import Shape
from vrtm.bake.scene.topology import corner_starts

_EARLIEST = Usd.TimeCode.EarliestTime()


@dataclass(frozen=True, eq=False)
class Bound:
    """The mesh, for its faces in no subset, or one of its subsets: what materials are bound to."""

    prim: Usd.Prim
    subset: str | None
    """The part of the mesh whose maps it takes, "" if the mesh was baked as a whole; None if it has none."""
    layers: dict[int, np.ndarray]
    """Its faces by their layers, none of them empty. The first layer keeps the prim; if it is the only one, all is as
    in the shot."""


def bound_parts(mesh: Usd.Prim, shape: Shape, plan: LayerPlan) -> list[Bound]:
    """The prims of a mesh that materials are bound to: itself first, then its subsets."""
    every = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    subsets = [subset for subset in every if subset.GetElementTypeAttr().Get() == UsdGeom.Tokens.face]
    names = plan.parts.get(shape.name)

    def part_of(name: str) -> str | None:
        return "" if names is None else names.get(name)

    layers = face_layers(mesh, shape, plan)
    if layers is None or plan.corner_path is not None:
        one = {0: np.empty(0)}
        prims = [subset.GetPrim() for subset in subsets]
        return [Bound(mesh, part_of(""), one), *(Bound(prim, part_of(prim.GetName()), one) for prim in prims)]
    rest = np.ones(len(layers), bool)
    found = []
    for subset in subsets:
        faces = np.array(subset.GetIndicesAttr().Get(_EARLIEST) or (), np.int64)
        faces = faces[(faces >= 0) & (faces < len(layers))]
        rest[faces] = False
        prim = subset.GetPrim()
        found.append(Bound(prim, part_of(prim.GetName()), _by_layer(faces, layers)))
    return [Bound(mesh, part_of(""), _by_layer(np.flatnonzero(rest), layers)), *found]


def _by_layer(faces: np.ndarray, layers: np.ndarray) -> dict[int, np.ndarray]:
    of = layers[faces]
    return {int(layer): faces[of == layer] for layer in np.unique(of)} or {0: faces}


def face_layers(mesh: Usd.Prim, shape: Shape, plan: LayerPlan) -> np.ndarray | None:
    """(faces,) of the mesh as the shot has it: the layer of each; None if all are in the first."""
    layers = plan.face_layers.get(shape.name)
    if layers is None or shape.cage_corners is None:
        return layers
    # Refined faces have four corners each, and lie in the layer of their cage's face.
    counts = np.array(UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get(_EARLIEST) or ())
    first = np.minimum(corner_starts(counts), len(shape.cage_corners) - 1)
    return layers[shape.cage_corners[first] // 4]


def author_layers(mesh: Usd.Prim, shape: Shape, plan: LayerPlan) -> None:
    """Writes the primvar that says which layer each face is in, if there are several."""
    layers = face_layers(mesh, shape, plan)
    if layers is not None:
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(LAYER, Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.uniform)
        primvar.Set(_integers(layers))


def split(mesh: Usd.Prim, part: Bound) -> dict[int, Usd.Prim]:
    """The prim of each layer: subsets are made of all but the first, and what was a subset keeps the first alone."""
    first, *others = part.layers
    prims = {first: part.prim}
    for layer in others:
        name = f"{'' if part.prim == mesh else part.prim.GetName() + '_'}vrtm_layer{layer}"
        while mesh.GetChild(name):
            name += "_"
        api = UsdShade.MaterialBindingAPI.Apply(mesh)
        prims[layer] = api.CreateMaterialBindSubset(name, _integers(part.layers[layer])).GetPrim()
    if others and part.prim != mesh:
        UsdGeom.Subset(part.prim).GetIndicesAttr().Set(_integers(part.layers[first]))
    return prims


def _integers(values: np.ndarray) -> Vt.IntArray:
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, np.int32))
