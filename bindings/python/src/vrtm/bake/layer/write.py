"""Writes the layer over a shot."""

import functools
import os
from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Sdf, Usd, UsdGeom, UsdShade

from vrtm.bake.layer.clips import author_clips, export, manifest_path, same_file, write_manifest
from vrtm.bake.layer.faces import author_layers, bound_parts, split
from vrtm.bake.layer.networks import MTLX_IMAGES, Redirector
from vrtm.bake.layer.plan import LayerPlan
from vrtm.bake.mark import mark
from vrtm.bake.scene import Scene, SceneOptions, Shape
from vrtm.bake.scene.usd_stage import assets, instances_above, marked
from vrtm.bake.words import others

# Metadata of a whole stage in its root layer. Layers with other time codes per second would be scaled in time.
STAGE_FIELDS = (
    "defaultPrim",
    "endTimeCode",
    "framesPerSecond",
    "kilogramsPerUnit",
    "metersPerUnit",
    "startTimeCode",
    "timeCodesPerSecond",
    "upAxis",
)


@dataclass(frozen=True)
class Written:
    """The result of writing a layer."""

    warnings: list[str]
    files: frozenset[str]
    """The files that it names over time, as it names them."""


def write_layer(out_path: str | os.PathLike[str], scene: Scene, plan: LayerPlan) -> Written:
    """Writes the layer of a plan over a scene from a USD file, and beside it the clips' manifest if there are corner
    UVs.

    Every mesh gets materials of its own, which specialize the shot's: other meshes with the same material stay as they
    are. Files that are there are replaced. Raises OSError.
    """
    out_path = os.fspath(out_path)
    manifest = manifest_path(out_path)
    layer, warnings, _ = redirected(out_path, scene, plan)
    files = {path for paths in named_files(layer).values() for path in paths}
    if plan.corner_path is not None:
        # Without a stage, which would look for the clips beside a layer that has no place yet.
        for shape in map(scene.shape, plan.shapes):
            files.update(path for path, _ in plan.values(functools.partial(plan.corner_path, shape.name)))
            for path in shape.instances:
                author_clips(Sdf.CreatePrimInLayer(layer, path), shape, plan, f"./{os.path.basename(manifest)}")
        write_manifest(manifest)
    mark(layer, "layer", [path for name in plan.shapes for path in scene.shape(name).instances])
    export(layer, out_path, Sdf.Layer.ExportToString)
    return Written(warnings, frozenset(files))


def redirected(out_path: str, scene: Scene, plan: LayerPlan) -> tuple[Sdf.Layer, list[str], bool]:
    """A layer with redirected materials, which is not written anywhere, less the clips of corner UVs; warnings, and
    whether a texture lookup is redirected, or the primvar is there. `out_path`: where it would be written."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    author = _Author(compose(layer, scene.path, scene.options, muted=out_path), plan)
    prims = Usd.PrimRange.Stage(author.stage, Usd.PrimAllPrimsPredicate)
    overs = [prim.GetPath() for prim in prims if prim.GetSpecifier() == Sdf.SpecifierOver]
    with Usd.EditContext(author.stage, layer):
        shapes = [(path, shape) for shape in map(scene.shape, plan.shapes) for path in shape.instances]
        changed = [author.redirect(path, shape) for path, shape in shapes]
    for spec in filter(None, map(layer.GetPrimAtPath, overs)):
        # A new prim makes a `def` of each one above it, which would show prototypes themselves.
        spec.specifier = Sdf.SpecifierOver
    for why, (first, *more) in author.without.items():
        author.warnings.append(f"{first[0]}{others(len(more))}: {why.format(first[1])}")
    return layer, author.warnings, plan.corner_path is not None or any(changed)


def named_files(layer: Sdf.Layer) -> dict[Sdf.Path, list[str]]:
    """The files that each attribute of a layer names over time, as it names them."""
    found: dict[Sdf.Path, list[str]] = {}

    def visit(path: Sdf.Path) -> None:
        spec = layer.GetAttributeAtPath(path) if path.IsPropertyPath() else None
        if spec is not None and spec.typeName == Sdf.ValueTypeNames.Asset:
            times = layer.ListTimeSamplesForPath(path)
            values = [spec.default, *(layer.QueryTimeSample(path, time) for time in times)]
            found[path] = [asset.path for asset in values if asset]

    layer.Traverse("/", visit)
    return found


def write_root(root: str | os.PathLike[str], layer: str, shot: str) -> None:
    """Writes a root layer, to be opened by itself: `layer` over the shot, with what the shot says of the whole stage.
    Raises OSError."""
    root = os.path.abspath(os.fspath(root))
    made = Sdf.Layer.CreateAnonymous(".usda")
    below = Sdf.Layer.FindOrOpen(shot)
    tell(below, made)
    made.subLayerPaths = [relative(path, os.path.dirname(root)) for path in (layer, shot)]
    mark(made, "root")
    export(made, root, Sdf.Layer.ExportToString)


def relative(path: str, folder: str) -> str:
    """A path as a layer in a folder names it."""
    path = os.path.abspath(path)
    try:
        found = os.path.relpath(path, folder).replace(os.sep, "/")
    except ValueError:
        # On another drive.
        return path.replace(os.sep, "/")
    return found if found.startswith("..") else f"./{found}"


def tell(shot: Sdf.Layer, target: Sdf.Layer, default: bool = True) -> None:
    """Copies the metadata of the whole stage from a shot to a layer; `default`: with the default prim."""
    for name in STAGE_FIELDS:
        if shot.pseudoRoot.HasInfo(name) and (default or name != "defaultPrim"):
            target.pseudoRoot.SetInfo(name, shot.pseudoRoot.GetInfo(name))


def compose(layer: Sdf.Layer, shot: str, options: SceneOptions, muted: str | None = None) -> Usd.Stage:
    """A stage of a layer over a shot, which is told to the layer, too: units, time, and the variants of the options."""
    below = Sdf.Layer.FindOrOpen(shot)
    root = Sdf.Layer.CreateAnonymous(".usda")
    for target in (layer, root):
        tell(below, target)
    for prim_path, name, variant in options.variants:
        Sdf.CreatePrimInLayer(layer, prim_path).variantSelections[name] = variant
    root.subLayerPaths = [layer.identifier, below.identifier]
    stage = Usd.Stage.Open(root)
    # A shot that has the layer of an earlier bake below it is taken without.
    for earlier in same_file(stage.GetUsedLayers(), muted) if muted else ():
        stage.MuteLayer(earlier.identifier)
    return stage


class _Author:
    """Gives meshes redirected materials on a stage, in the layer that is edited."""

    def __init__(self, stage: Usd.Stage, plan: LayerPlan) -> None:
        self.stage, self._plan = stage, plan
        self.warnings: list[str] = []
        self.without: dict[str, list[tuple[str, str]]] = {}
        """Reasons that meshes have no material, with the meshes and what the reason names."""
        self._made: dict[tuple[str, str, str, int], UsdShade.Material | None] = {}
        """The redirected materials by the original's path, the shape's name, the part of the shape and the layer; None
        where nothing could be redirected."""

    def redirect(self, path: str, shape: Shape) -> bool:
        """Gives a mesh redirected materials; tells whether one of them is the one that counts."""
        changes = False
        self._split_instances(Sdf.Path(path), self.warnings)
        mesh = self.stage.OverridePrim(path)
        author_layers(mesh, shape, self._plan)
        # All bindings are read before the first one changes, because others may inherit it.
        bound = [(part, list(bindings_of(part.prim))) for part in bound_parts(mesh, shape, self._plan)]
        gone = [str(target) for part, _ in bound for target in _missing(part.prim)]
        if gone:
            self.without.setdefault("material {} is not in the scene", []).append((path, gone[0]))
        elif not any(bindings for _, bindings in bound):
            self.without.setdefault("no material is bound to it", []).append((path, ""))
        for part, bindings in bound:
            if part.subset is None:
                continue
            found = {
                layer: [self._material(own, shape, part.subset, layer) if layer >= 0 else None for _, own in bindings]
                for layer in part.layers
            }
            if not any(material for materials in found.values() for material in materials):
                continue
            for layer, prim in split(mesh, part).items():
                for (purpose, original), material in zip(bindings, found[layer]):
                    # A subset of a layer has what its faces had.
                    if material or prim != part.prim:
                        own = self._bind(prim, purpose, material or original)
                        changes = changes or (own and material is not None)
        return changes

    def _bind(self, prim: Usd.Prim, purpose: str, material: UsdShade.Material) -> bool:
        """Binds a material, and tells whether it is the one that counts."""
        api = UsdShade.MaterialBindingAPI.Apply(prim)
        api.Bind(material, UsdShade.Tokens.fallbackStrength, purpose or UsdShade.Tokens.allPurpose)
        now = api.ComputeBoundMaterial(purpose)[0].GetPath()
        if now != material.GetPath():
            self.warnings.append(f"{prim.GetPath()}: a stronger binding keeps {now} instead of {material.GetPath()}")
        return now == material.GetPath()

    def _material(self, original: UsdShade.Material, shape: Shape, subset: str, layer: int) -> UsdShade.Material | None:
        """The material that specializes another one, for a part of a shape and a layer of it; None if nothing in it
        could be redirected."""
        stage, made = self.stage, self._made
        key = (str(original.GetPath()), shape.name, subset, layer)
        if key in made:
            return made[key]
        # Another layer's material has the same warnings.
        warnings = [] if any(other[:3] == key[:3] for other in made) else self.warnings
        if any(material and material.GetPath() == original.GetPath() for material in made.values()):
            return original
        self._split_instances(original.GetPath().GetParentPath(), warnings)
        name = "_".join(filter(None, [original.GetPrim().GetName(), shape.name, subset, "redirected"]))
        mark = f"_layer{layer}" if layer else ""
        path = original.GetPath().GetParentPath().AppendChild((name + mark).replace("-", "_"))
        material = UsdShade.Material.Define(stage, path)
        material.SetBaseMaterial(UsdShade.Material(stage.GetPrimAtPath(original.GetPath())))
        if material.GetPrim().IsInstanceable():
            material.GetPrim().SetInstanceable(False)
        said = len(warnings)
        if Redirector(material, shape, self._plan.of(subset, layer), warnings).redirect() == 0:
            if len(warnings) == said:
                warnings.append(f"{shape.path}: no texture of {original.GetPath()} could be redirected")
            edited = stage.GetEditTarget().GetLayer()
            del edited.GetPrimAtPath(path.GetParentPath()).nameChildren[path.name]
            material = None
        made[key] = material
        return material

    def _split_instances(self, path: Sdf.Path, warnings: list[str]) -> None:
        """Makes plain prims of the instances above a prim: an instance's parts cannot be changed one by one."""
        for instance in instances_above(self.stage, path):
            self.stage.OverridePrim(instance).SetInstanceable(False)
            warnings.append(f"{instance}: is no instance any more, since what is inside is redirected")


def bindings_of(prim: Usd.Prim) -> list[tuple[str, UsdShade.Material]]:
    """(purpose, material) of all bindings that a renderer may take. A subset that says nothing takes those of its
    mesh."""
    api, found = UsdShade.MaterialBindingAPI(prim), []
    for purpose in (UsdShade.Tokens.allPurpose, UsdShade.Tokens.full, UsdShade.Tokens.preview):
        material, relationship = api.ComputeBoundMaterial(purpose)
        # A purpose without a binding of its own falls back to the first.
        if material and (purpose == UsdShade.Tokens.allPurpose or relationship.GetName().endswith(f":{purpose}")):
            found.append((purpose, material))
    return found


def _missing(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    """Materials that a prim is bound to, or one above it, and that do not exist."""
    above = prim
    while above:
        for relationship in above.GetRelationships():
            if (
                relationship.GetName().split(":")[:2] == ["material", "binding"]
                and "collection" not in relationship.GetName()
            ):
                yield from (target for target in relationship.GetTargets() if not prim.GetStage().GetPrimAtPath(target))
        above = above.GetParent()


def looked_up(scene: Scene, shape: Shape, mode: str) -> list[str]:
    """The files of all textures of a shape's materials that copies do not replace, whatever UVs they take: those of
    MaterialX, which are looked up through the maps, and with redirected corner UVs (`mode`) all. Layers of earlier
    bakes do not count."""
    stage = scene.source.stage
    names = MTLX_IMAGES if mode == "texture" else (*MTLX_IMAGES, "UsdUVTexture")
    ours = marked(stage)
    found: dict[str, None] = {}
    with scene.listening():
        for path in shape.instances:
            mesh = stage.GetPrimAtPath(path)
            subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
            prims = [mesh, *(s.GetPrim() for s in subsets if s.GetElementTypeAttr().Get() == UsdGeom.Tokens.face)]
            materials = {material.GetPath(): material for prim in prims for _, material in bindings_of(prim)}
            for material in materials.values():
                for prim in Usd.PrimRange(material.GetPrim(), Usd.TraverseInstanceProxies()):
                    shader = UsdShade.Shader(prim)
                    plug = shader.GetInput("file") if shader else None
                    if plug and (shader.GetIdAttr().Get() or "").startswith(names):
                        for attribute in UsdShade.Utils.GetValueProducingAttributes(plug)[:1]:
                            found |= dict.fromkeys(_files(attribute, ours))
    return list(found)


def _files(attribute: Usd.Attribute, ours: set[str]) -> list[str]:
    files = list(assets(attribute, ours))
    specs = attribute.GetPropertyStack()
    named = attribute.Get() if not files and specs and specs[0].layer.identifier not in ours else None
    # One that is not there may be where it is rendered.
    return files or ([named.path] if named else [])
