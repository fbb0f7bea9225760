"""One mesh of a USD stage: faces, UVs, rest, poses, and values per vertex."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from vrtm.bake.scene.obj import rest_from_file
from vrtm.bake.scene.posed import PosedMesh, PosedSource
from vrtm.bake.scene.refine import Cage
from vrtm.bake.scene.topology import check_faces, check_mesh, corner_elements, per_vertex, without_uvs
from vrtm.bake.scene.types import SceneError, Shape, frame_number
from vrtm.bake.scene.usd_skel import Skeletons
from vrtm.bake.scene.usd_stage import meters
from vrtm.bake.words import near

REST_NAMES = ("primvars:Pref", "primvars:pref", "primvars:rest", "Pref", "rest")
# Of three numbers, as Houdini has UVs, the first two are u and v.
_COORDINATES = tuple(f"texCoord{count}{kind}[]" for count in (2, 3) for kind in "fhd")
_PAIRS, _TRIPLES = (tuple(f"{kind}{count}[]" for kind in ("float", "half", "double")) for count in (2, 3))
_USUAL = ("st", "uv")
"""Names of UV sets: triples of another name may be anything."""
# The primvar that a bake writes.
REDIRECTED = "st_redirected"


class UsdMesh(PosedMesh):
    """A mesh, or the proxy of one in an instance."""

    def __init__(self, prim: Usd.Prim, skeletons: Skeletons, source: PosedSource) -> None:
        super().__init__(str(prim.GetPath()), source)
        self._prim = prim
        self._mesh = UsdGeom.Mesh(prim)
        self._skin, self._skeletons = skeletons.skin(prim, self.where), skeletons
        self._rest_unit = 1.0

    @cached_property
    def uv(self) -> UsdGeom.Primvar | None:
        """Its UVs; None if it has none. Raises SceneError as `find_uv` does."""
        return find_uv(self._prim, self._options.uv, self.where)

    def primvars(self) -> list[str]:
        return [primvar.GetPrimvarName() for primvar in authored(self._prim)]

    def other_uvs(self) -> str:
        """The end of a sentence about a missing UV set: its name, and that of one that is near."""
        there, names = authored(self._prim), self._options.uv
        found = (near(name, map(UsdGeom.Primvar.GetPrimvarName, there)) for name in names)
        odd = (f": {p.GetName()} is a {p.GetTypeName()}" for p in there if p.GetPrimvarName() in names)
        hint = next(filter(None, [*odd, *found]), "")
        sets = uv_sets(self._prim) if names else [p for p in there if p.GetTypeName() in _TRIPLES]
        further = ", ".join(sorted(map(UsdGeom.Primvar.GetPrimvarName, sets)))
        then = "" if names else " of three numbers, which --uv can name"
        return self._options.uv_text + (hint or (f", but {further}{then}" if further else ""))

    def identity(self) -> tuple[Any, ...]:
        """Equal for proxies of one mesh that are in the same pose in all frames and have the same UVs."""
        if not self._prim.IsInstanceProxy():
            return (self.path,)
        uv_prim = self.uv.GetAttr().GetPrim()
        uv_prim = uv_prim.GetPrimInPrototype() if uv_prim.IsInstanceProxy() else uv_prim
        moved_by = self._skin.identity() if self._skin else ""
        if self._options.world:
            moved_by += self.scaled_alike()
        return (str(self._prim.GetPrimInPrototype().GetPath()), str(uv_prim.GetPath()), moved_by)

    def shape(self, name: str, instances: tuple[str, ...]) -> Shape:
        first, options, further = self.read_faces(), self._options, {}
        why = "" if self.deforms else self._skeletons.why_still(self._prim)
        self._warnings += [f"{self.path}: no skeleton moves it: {why}"] if why else []
        uvs = self._uvs(self.uv, first)
        if options.texture_uv is not None:
            texture_uv = find_uv(self._prim, (options.texture_uv,), self.where)
            if texture_uv is None:
                hint = near(options.texture_uv, self.primvars())
                raise SceneError(f"{self.where}: has no UVs '{options.texture_uv}' for its textures{hint}")
            values, elements = self._uvs(texture_uv, first)
            further["texture_uvs"] = self._pairs(values), without_uvs(self._counts, elements)
            further["texture_uv_name"] = texture_uv.GetPrimvarName()
        shape = self._shape(
            name,
            instances,
            (self._counts, self._indices),
            uvs,
            np.array(self._mesh.GetHoleIndicesAttr().Get(first) or (), np.int64),
            [self._values(options.rigidity_primvar, first, 0.0), self._values(options.mask_primvar, first, 1.0)],
            self._cage if self._mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none else None,
            uv_name=self.uv.GetPrimvarName(),
            **further,
        )
        left_handed = self._mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
        return replace(shape, rest_unit=self._rest_unit, subsets=self._subsets(first), left_handed=left_handed)

    def read_faces(self) -> Usd.TimeCode:
        """Reads the faces at the first frame, which it returns."""
        first = self._code(self._frames[0])
        self._counts, self._indices = self._faces(first)
        self._points = len(self._read(self._mesh.GetPointsAttr(), first, "points"))
        check_mesh(self.where, self._counts, self._indices, self._points)
        return first

    def stays(self) -> bool:
        """True if it is at rest in all frames, as far as it can be read."""
        if self.deforms:
            return False
        try:
            self.read_faces()
            return np.array_equal(self.positions(self._frames[0]), self._rest()[0])
        except SceneError:
            return True

    def _subsets(self, time: Usd.TimeCode) -> dict[str, np.ndarray]:
        """The faces of each subset that a material may be bound to; of a refined mesh, those of the cage's faces."""
        found = {}
        of_corner = np.repeat(np.arange(len(self._counts)), self._counts)
        # The number of the subset that has a face first, from 1.
        taken = np.zeros(len(self._counts), np.int64)
        for subset in UsdShade.MaterialBindingAPI(self._prim).GetMaterialBindSubsets():
            name = subset.GetPrim().GetName()
            where = f"{self.path} subset {name}"
            kind = str(subset.GetElementTypeAttr().Get())
            if kind != UsdGeom.Tokens.face:
                self._warnings.append(f"{where}: it is of elements of the type {kind}, not face: it is not read")
                continue
            faces = np.array(subset.GetIndicesAttr().Get(time) or (), np.int64)
            is_face = (faces >= 0) & (faces < len(taken))
            if not is_face.all():
                entry = int(np.argmin(is_face))
                told = f"{where}: indices[{entry}] is {faces[entry]}, but the mesh has {len(taken)} faces: "
                self._warnings.append(f"{told}{_counted(np.count_nonzero(~is_face))} no face")
            faces = np.unique(faces[is_face])
            twice = faces[taken[faces] > 0]
            if len(twice):
                other = list(found)[taken[twice[0]] - 1]
                told = f"{where}: face {twice[0]} is in the subset {other}, too ({_counted(len(twice))} in several): "
                self._warnings.append(f"{told}--subsets bakes it with the first")
            taken[faces[taken[faces] == 0]] = len(found) + 1
            inside = np.zeros(len(taken), bool)
            inside[faces] = True
            if self._refined:
                inside = np.repeat(inside[of_corner], 4 ** (self._options.subdivide - 1))
            found[name] = np.flatnonzero(inside)
        return found

    @cached_property
    def deforms(self) -> bool:
        points = self._mesh.GetPointsAttr().ValueMightBeTimeVarying()
        return bool(points or (self._skin and self._skin.moves) or (self._options.world and self.is_moved))

    def _code(self, frame: float) -> Usd.TimeCode:
        return Usd.TimeCode(self._clock.time(frame))

    def samples(self) -> list[float]:
        """The time codes at which it has poses, ascending; none where they are in value clips, all of whose files would
        have to be opened."""
        points = self._mesh.GetPointsAttr()
        found: set[float] = set()
        if points.ValueMightBeTimeVarying():
            if points.GetResolveInfo(self._code(self._frames[0])).GetSource() == Usd.ResolveInfoSourceValueClips:
                return []
            found.update(points.GetTimeSamples())
        if self._skin:
            found.update(self._skin.samples())
        for xform in self._above() if self._options.world else ():
            found.update(xform.GetTimeSamples())
        return sorted(found)

    def _posed(self, frame: float) -> np.ndarray:
        time = self._code(frame)
        if any(attribute.ValueMightBeTimeVarying() for attribute in self._topology()):
            where = f"{self.where}: time code {time.GetValue():g}: the topology changes"
            check_faces(where, *self._faces(time), self._counts, self._indices)
        points = self._read(self._mesh.GetPointsAttr(), time, "points")
        if len(points) != self._points:
            told = f"time code {time.GetValue():g} has {len(points)} points, but the first frame has {self._points}"
            raise SceneError(f"{self.where}: {told}")
        return self._skin.posed(points, time) if self._skin else points

    @cached_property
    def _space(self) -> Usd.Prim:
        """The prim in whose space positions are."""
        return (self._skin.space if self._skin else None) or self._prim

    def _above(self) -> Iterator[UsdGeom.Xformable]:
        """The transforms above the space of positions, from below."""
        prim = self._space
        while prim and not prim.IsPseudoRoot():
            xform = UsdGeom.Xformable(prim)
            if xform:
                yield xform
            prim = None if xform and xform.GetResetXformStack() else prim.GetParent()

    @cached_property
    def is_moved(self) -> bool:
        return any(xform.TransformMightBeTimeVarying() for xform in self._above())

    def _matrix(self, frame: float) -> np.ndarray:
        return np.array(UsdGeom.Imageable(self._space).ComputeLocalToWorldTransform(self._code(frame)))

    def _topology(self) -> tuple[Usd.Attribute, Usd.Attribute]:
        return self._mesh.GetFaceVertexCountsAttr(), self._mesh.GetFaceVertexIndicesAttr()

    def _faces(self, time: Usd.TimeCode) -> tuple[np.ndarray, np.ndarray]:
        counts, indices = (self._read(of, time, of.GetName()).astype(np.int32) for of in self._topology())
        return counts, indices

    def _read(self, attribute: Usd.Attribute, time: Usd.TimeCode, what: str) -> np.ndarray:
        value = attribute.Get(time) if attribute else None
        if value is None or len(value) == 0:
            raise SceneError(f"{self.where}: no {what} at time code {time}")
        return np.array(value)

    def _elements(self, primvar: UsdGeom.Primvar, time: Usd.TimeCode) -> tuple[np.ndarray, np.ndarray]:
        """The values of a primvar, and which of them each entry has: -1 where none was authored."""
        name, found = primvar.GetName(), primvar.Get(time)
        # Some exporters write a sample per frame of what does not change.
        last = self._code(self._frames[-1])
        parts = (primvar.GetAttr(), primvar.GetIndicesAttr())
        if primvar.ValueMightBeTimeVarying() and any(of.Get(time) != of.Get(last) for of in parts if of):
            self._warnings.append(f"{self.path}: {name} changes over time; it is read at time code {time.GetValue():g}")
        if primvar.GetElementSize() != 1:
            raise SceneError(f"{self.where}: {name} has the elementSize {primvar.GetElementSize()}, not 1")
        values = np.array(() if found is None else found if primvar.GetTypeName().isArray else [found])
        if not primvar.IsIndexed():
            return values, np.arange(len(values))
        # In whatever integers they are.
        indices = np.array(primvar.GetIndicesAttr().Get(time) or (), np.int64)
        elements = np.where(indices == primvar.GetUnauthoredValuesIndex(), -1, indices)
        wrong = elements[(elements < -1) | (elements >= len(values))]
        if len(wrong):
            raise SceneError(f"{self.where}: {name}:indices has {wrong[0]}, but there are {len(values)} values")
        return values, elements

    def _uvs(self, uv: UsdGeom.Primvar, time: Usd.TimeCode) -> tuple[np.ndarray, np.ndarray]:
        values, elements = self._elements(uv, time)
        values = values.reshape(len(values), -1 if len(values) else 2)
        interpolation = str(uv.GetInterpolation())
        with self._naming(uv.GetName()):
            return values, corner_elements(interpolation, self._counts, self._indices, self._points, elements)

    def _values(self, name: str | None, time: Usd.TimeCode, missing: float) -> np.ndarray | None:
        """(vertices,) of a primvar, the mean where it has more values than one per vertex; None if it is missing.
        `missing`: the value of entries without one."""
        primvar = name and UsdGeom.PrimvarsAPI(self._prim).FindPrimvarWithInheritance(name.removeprefix("primvars:"))
        if not primvar or not primvar.HasAuthoredValue():
            return None
        values, elements = self._elements(primvar, time)
        if values.dtype.kind not in "fiub" or values.ndim > 2 or (values.ndim == 2 and values.shape[1] < 3):
            raise SceneError(f"{self.where}: {primvar.GetName()} is a {primvar.GetTypeName()}, not numbers or colours")
        without = np.count_nonzero(elements < 0)
        if without:
            told = f"{primvar.GetName()} has no value in {without} of {len(elements)} places"
            self._warnings.append(f"{self.path}: {told}: {missing:g} is taken there")
        # The last one, which -1 names.
        values = np.concatenate([values, np.full_like(values, missing, shape=(1, *values.shape[1:]))])
        interpolation = str(primvar.GetInterpolation())
        with self._naming(primvar.GetName()):
            return per_vertex(values[elements], interpolation, self._counts, self._indices, self._points)

    def _found_rest(self, wanted: str | None) -> tuple[np.ndarray, str]:
        first = self._code(self._frames[0])
        if wanted in (None, "pref"):
            pref, name = self._pref(first)
            if pref is not None:
                return self._skin.bound(pref) if self._skin else pref, name
            if wanted == "pref":
                raise SceneError(f"{self.where}: none of {', '.join(REST_NAMES)} holds a rest position per vertex")
        if wanted == "bind" and not self._skin:
            raise SceneError(f"{self.where}: not bound to a skeleton, so that it has no bind pose")
        if wanted == "bind" or (wanted is None and self._skin):
            return self._skin.bound(self._read(self._mesh.GetPointsAttr(), first, "points")), "bind pose"
        if wanted in (None, "first"):
            return self._posed(self._frames[0]), f"first frame {self._frames[0]}"
        if wanted.startswith("frame:"):
            return self._posed(frame_number(wanted)), wanted
        rest, unit = rest_from_file(wanted, self.path, self._counts, self._indices, self._points)
        self._compare_units(unit, first)
        return rest, wanted

    def _compare_units(self, of_rest: float | None, time: Usd.TimeCode) -> None:
        of_poses = meters(self._mesh.GetPointsAttr(), time)
        if of_rest and of_poses:
            self._rest_unit = of_rest / of_poses

    def _pref(self, time: Usd.TimeCode) -> tuple[np.ndarray | None, str]:
        for name in REST_NAMES:
            attribute = self._prim.GetAttribute(name)
            if not attribute or not attribute.HasAuthoredValue():
                continue
            if UsdGeom.Primvar.IsPrimvar(attribute):
                values, elements = self._elements(UsdGeom.Primvar(attribute), time)
                if (elements < 0).any():
                    raise SceneError(f"{self.where}: {name} has no value in {np.count_nonzero(elements < 0)} places")
                values = values[elements]
            else:
                values = np.array(attribute.Get(time) or ())
            if values.shape != (self._points, 3):
                raise SceneError(f"{self.where}: {name} has the shape {values.shape}, not ({self._points}, 3)")
            self._compare_units(meters(attribute, time), time)
            return values, name.removeprefix("primvars:")
        return None, ""

    def _cage(self) -> Cage:
        time = self._code(self._frames[0])

        def read(attribute: Usd.Attribute, kind: type) -> np.ndarray:
            return np.array(attribute.Get(time) or (), kind)

        mesh = self._mesh
        return Cage(
            where=self.where,
            scheme=str(mesh.GetSubdivisionSchemeAttr().Get()),
            counts=self._counts,
            indices=self._indices,
            points=self._points,
            boundary=str(mesh.GetInterpolateBoundaryAttr().Get()),
            face_varying=str(mesh.GetFaceVaryingLinearInterpolationAttr().Get()),
            crease_lengths=read(mesh.GetCreaseLengthsAttr(), np.int64),
            crease_indices=read(mesh.GetCreaseIndicesAttr(), np.int64),
            crease_sharpnesses=read(mesh.GetCreaseSharpnessesAttr(), np.float64),
            corner_indices=read(mesh.GetCornerIndicesAttr(), np.int64),
            corner_sharpnesses=read(mesh.GetCornerSharpnessesAttr(), np.float64),
            uv_per_vertex=str(self.uv.GetInterpolation()) == "vertex",
        )


def _counted(count: int) -> str:
    return f"{count} {'is' if count == 1 else 'are'}"


def find_uv(prim: Usd.Prim, names: tuple[str, ...], where: str) -> UsdGeom.Primvar | None:
    """The primvar of a mesh's UVs, inherited ones included: the first of these names that it has; None if it has none.
    Raises SceneError if none is named, there are several, and none of them is `st`."""
    if names:
        there = {p.GetName(): p for p in authored(prim) if p.GetTypeName() in _COORDINATES + _PAIRS + _TRIPLES}
        found = (there.get(f"primvars:{name.removeprefix('primvars:')}") for name in names)
        return next(filter(None, found), None)
    candidates = uv_sets(prim)
    default = [primvar for primvar in candidates if primvar.GetPrimvarName() == "st"]
    if not default and len(candidates) > 1:
        there = sorted(primvar.GetPrimvarName() for primvar in candidates)
        raise SceneError(
            f"{where}: several UV sets ({', '.join(there)}), none of them 'st': name the one to take, and after it "
            f"those of other meshes, of which each takes the first that it has: --uv {there[0]} st"
        )
    return next(iter(default or candidates), None)


def uv_sets(prim: Usd.Prim) -> list[UsdGeom.Primvar]:
    """The primvars of texture coordinates that a mesh has; if it has none, those that hold pairs, or triples of a usual
    name."""
    # A primvar of an earlier bake is no UV set of the artist's.
    there = [primvar for primvar in authored(prim) if primvar.GetPrimvarName() != REDIRECTED]
    usual = [*_PAIRS, *_TRIPLES]
    return [p for p in there if p.GetTypeName() in _COORDINATES] or [
        p for p in there if p.GetTypeName() in (usual if p.GetPrimvarName() in _USUAL else _PAIRS)
    ]


def authored(prim: Usd.Prim) -> list[UsdGeom.Primvar]:
    """The primvars of a prim that have a value, inherited ones included."""
    return [p for p in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance() if p.HasAuthoredValue()]
