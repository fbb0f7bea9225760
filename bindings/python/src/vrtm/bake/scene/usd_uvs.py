"""Which primvar holds the UVs of a USD mesh."""

from __future__ import annotations

from pxr import Usd, UsdGeom

from vrtm.bake.scene.types import SceneError

UV_TYPES = ("texCoord2f[]", "texCoord2h[]", "texCoord2d[]")
PLAIN_UV_TYPES = ("float2[]", "half2[]", "double2[]")
# The primvar that a bake writes.
REDIRECTED = "st_redirected"


def find_uv(prim: Usd.Prim, names: tuple[str, ...], where: str) -> UsdGeom.Primvar | None:
    """The primvar of a mesh's UVs, inherited ones included: the first of these names that it has; None if it has none.
    Raises SceneError if none is named, there are several, and none of them is `st`, or if a named one does not hold
    pairs."""
    api = UsdGeom.PrimvarsAPI(prim)
    for name in names:
        primvar = api.FindPrimvarWithInheritance(name.removeprefix("primvars:"))
        if not primvar or not primvar.HasAuthoredValue():
            continue
        if str(primvar.GetTypeName()) not in UV_TYPES + PLAIN_UV_TYPES:
            raise SceneError(f"{where}: {primvar.GetName()} is a {primvar.GetTypeName()}, not a texCoord2f[]")
        return primvar
    if names:
        return None
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
    """The primvars of texture coordinates that a mesh has; if it has none, those that hold pairs."""
    found = {kind: [] for kind in UV_TYPES + PLAIN_UV_TYPES}
    for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name = primvar.GetPrimvarName()
        # What an earlier bake wrote is no UV set of the artist's.
        if name != REDIRECTED and primvar.HasAuthoredValue() and str(primvar.GetTypeName()) in found:
            found[str(primvar.GetTypeName())].append(primvar)
    of = ([primvar for kind in kinds for primvar in found[kind]] for kinds in (UV_TYPES, PLAIN_UV_TYPES))
    return next(filter(None, of), [])
