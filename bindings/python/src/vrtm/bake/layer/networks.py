"""Texture lookups in a material's network, and how they are redirected.

UsdPreviewSurface has no node that makes a texture coordinate of a texture's colour: there the texture is replaced by
warped copies, or the UVs by the primvar. MaterialX looks a map up in an image node, whose result is the next one's
coordinate.
"""

from collections.abc import Iterator

import numpy as np
from pxr import Sdf, Usd, UsdShade

from vrtm.bake.layer.plan import PRIMVAR, LayerPlan
from vrtm.bake.mark import is_marked
from vrtm.bake.scene.types import Shape

FLOAT2 = Sdf.ValueTypeNames.Float2
READERS = ("UsdPrimvarReader_float2",)
# Nodes of MaterialX that hand out the mesh's UVs, and the input that names the set.
MTLX_READERS = {
    "ND_geompropvalue_vector2": "geomprop",
    "ND_UsdPrimvarReader_vector2": "varname",
    "ND_texcoord_vector2": None,
}
MTLX_IMAGES = ("ND_image_", "ND_tiledimage_", "ND_gltf_image_", "ND_gltf_colorimage", "ND_UsdUVTexture", "ND_hextiled")
MTLX_COORDINATES = ("texcoord", "st")


class Redirector:
    """Redirects the lookups of one material, of which the edited layer may hold opinions, for one shape."""

    def __init__(self, material: UsdShade.Material, shape: Shape, plan: LayerPlan, warnings: list[str]) -> None:
        self._material = material
        self._shape = shape
        self._plan = plan
        self._warnings = warnings
        self._uv_name = shape.texture_uv_name or shape.uv_name
        """The UVs that textures are looked up by."""
        self._inserted: dict[tuple[str, str], UsdShade.Output] = {}
        self._reached: set[str] = set()
        self._copies: dict[str, tuple[Usd.Attribute, list[tuple[str, float | None]]]] = {}
        """Textures that are replaced by warped copies: what names the file, and the copies over time."""
        self._refused: dict[str, str] = {}
        """Reasons that other textures do not take their copies."""

    def redirect(self) -> int:
        """Rewires all lookups by the shape's UVs. Returns how many textures are redirected now."""
        done: set[str] = set()
        normals: list[UsdShade.Input] = []
        # Before prims are added.
        shaders = [UsdShade.Shader(prim) for prim in Usd.PrimRange(self._material.GetPrim())]
        named = [(shader, shader.GetIdAttr().Get() or "") for shader in shaders if shader]
        if self._plan.corner_path is None and self._plan.warped_path is not None:
            found = ((shader, self._copy(shader)) for shader, name in named if name == "UsdUVTexture")
            self._copies = {str(shader.GetPath()): copy for shader, copy in found if copy is not None}
        for shader, name in named:
            prim = shader.GetPrim()
            if name == "UsdUVTexture":
                # Warped copies of normal maps are turned by whoever warps them.
                if self._preview(shader) and str(prim.GetPath()) not in self._copies:
                    done.add(str(prim.GetPath()))
            elif name.startswith(MTLX_IMAGES):
                if self._materialx(shader):
                    done.add(str(prim.GetPath()))
            elif name == "UsdPreviewSurface":
                normals.append(shader.GetInput("normal"))
            elif name.startswith("ND_normalmap"):
                normals.append(shader.GetInput("in"))
        for plug in normals:
            if plug and done & {str(node.GetPath()) for node in self._upstream(plug)}:
                told = f"{plug.GetPrim().GetPath()} takes a normal map, which the layer looks up redirected"
                self._warnings.append(f"{self._shape.path}: {told}, but does not turn")
        return len(done | self._copies.keys())

    # UsdPreviewSurface

    def _preview(self, texture: UsdShade.Shader) -> bool:
        path = str(texture.GetPath())
        if path in self._copies:
            _set_files(*self._copies[path])
            return True
        if self._plan.corner_path is None:
            if path in self._refused:
                self._warn(texture, f"{self._refused[path]}: it stays as it is")
            elif self._is_looked_up(texture):
                self._warn(texture, "has neither a warped copy nor redirected corner UVs: it stays as it is")
            return False
        found = False
        for reader in self._readers(texture.GetInput("st")):
            value = _producer(reader.GetInput("varname"))
            if value is None or value.Get() not in (self._uv_name, PRIMVAR):
                continue
            if not self._inside(value.GetPrim()):
                self._warn(texture, f"takes its UVs by {value.GetPath()}, outside of the material: it stays as it is")
                continue
            value.Set(PRIMVAR)
            found = True
        if not found:
            self._is_looked_up(texture)
        return found

    def _is_looked_up(self, texture: UsdShade.Shader) -> bool:
        """True if a texture is looked up by the shape's UVs; otherwise warns."""
        readers = self._readers(texture.GetInput("st"))
        values = [_producer(reader.GetInput("varname")) for reader in readers]
        # Without a reader, renderers take the UVs by default.
        names = {str(value.Get()) for value in values if value} if readers else {"st"}
        if names & {self._uv_name, PRIMVAR}:
            return True
        by = " and ".join(repr(name) for name in sorted(names)) or "nothing"
        self._warn(texture, f"is looked up by {by}, not by the UVs '{self._uv_name}': it stays as it is")
        return False

    def _copy(self, texture: UsdShade.Shader) -> tuple[Usd.Attribute, list[tuple[str, float | None]]] | None:
        """The attribute that names a texture's file, and the copies that it can take; None if there are none."""
        file = _producer(texture.GetInput("file"))
        asset = file.Get() if file else None
        if not asset:
            return None
        source = _resolved(file, asset)
        paths = self._plan.values(lambda frame: self._plan.warped_path(self._shape.name, frame, source))
        if any(path is None for path, _ in paths):
            return None
        why = self._between(texture) or self._wrapped(texture, asset)
        if why is None and not self._is_looked_up(texture):
            return None
        if why is None and not self._inside(file.GetPrim()):
            why = f"is named by {file.GetPath()}, outside of the material"
        if why is None and _is_animated(file):
            why = "is another file from frame to frame, of which there is one copy"
        if why is not None:
            self._refused[str(texture.GetPath())] = why
            return None
        return file, paths

    def _between(self, texture: UsdShade.Shader) -> str | None:
        """The node or value between the mesh's UVs and the lookup for which a copy does not fit, as the end of a
        sentence; None if one fits."""
        plug = texture.GetInput("st")
        while plug:
            outputs = UsdShade.Utils.GetValueProducingAttributes(plug, shaderOutputsOnly=True)
            if not outputs:
                # Without a value, renderers take the UVs by default.
                return None if _producer(plug) is None else "is looked up at one place"
            node = UsdShade.Shader(outputs[0].GetPrim())
            name = node.GetIdAttr().Get()
            if name in READERS:
                return None
            if name != "UsdTransform2d" or not _is_identity(node):
                return f"is looked up through {node.GetPath()} ({name}), and copies are made for UVs as they are"
            plug = node.GetInput("in")
        return None

    def _wrapped(self, texture: UsdShade.Shader, asset: Sdf.AssetPath) -> str | None:
        """The wrapping for which a copy does not fit; None if one fits."""
        if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            return None
        tiles = self._plan.tiles.get(self._shape.name, (1001,))
        for name, places in (("wrapS", [(t - 1001) % 10 for t in tiles]), ("wrapT", [(t - 1001) // 10 for t in tiles])):
            value = _producer(texture.GetInput(name))
            if value is not None and value.Get() == "mirror" and any(place % 2 for place in places):
                return f"is mirrored by its {name}, and copies are made for UVs as they are"
        return None

    def _readers(self, coordinate: UsdShade.Input) -> list[UsdShade.Shader]:
        return [shader for shader in self._upstream(coordinate) if shader.GetIdAttr().Get() in READERS]

    def _upstream(self, plug: UsdShade.Input | UsdShade.Output | None) -> Iterator[UsdShade.Shader]:
        """All shaders upstream of a plug."""
        if not plug:
            return
        for value in UsdShade.Utils.GetValueProducingAttributes(plug):
            shader = UsdShade.Shader(value.GetPrim())
            if UsdShade.Utils.GetType(value.GetName()) != UsdShade.AttributeType.Output or not shader:
                continue
            yield shader
            for further in shader.GetInputs():
                yield from self._upstream(further)

    # MaterialX

    def _materialx(self, image: UsdShade.Shader) -> bool:
        if self._plan.map_path is None and self._plan.corner_path is None:
            self._warn(image, "has no redirection maps: it stays as it is")
            return False
        plug = next(filter(None, map(image.GetInput, MTLX_COORDINATES)), None)
        unplugged = plug is None or (not plug.HasConnectedSource() and plug.Get() is None)
        if unplugged and self._is_default:
            # MaterialX takes the mesh's default UVs then.
            name = "st" if image.GetIdAttr().Get().startswith("ND_UsdUVTexture") else "texcoord"
            plug = image.CreateInput(name, FLOAT2)
            plug.ConnectToSource(self._insert(image.GetPrim().GetParent(), None))
            return True
        if not unplugged and self._rewire(plug):
            return True
        self._warn(image, f"is not looked up by the UVs '{self._uv_name}': it stays as it is")
        return False

    def _rewire(self, plug: UsdShade.Input | UsdShade.Output) -> bool:
        """Puts the lookup of the map between the mesh's UVs and what they are first plugged into, so that transforms of
        UVs keep their place behind it. True if the UVs of the shape come this way."""
        if str(plug.GetAttr().GetPath()) in self._reached:
            return True
        found = False
        for source in plug.GetConnectedSources()[0]:
            node = UsdShade.Shader(source.source.GetPrim())
            name = node.GetIdAttr().Get() if node else None
            if name in MTLX_READERS:
                if not self._is_uv(node, MTLX_READERS[name]):
                    continue
                prim = plug.GetPrim()
                inside = isinstance(plug, UsdShade.Output)
                container = prim if inside else prim.GetParent()
                plug.ConnectToSource(self._insert(container, node.GetOutput(source.sourceName)))
                found = True
            elif node:
                # A list, since rewiring one input must not keep the others from it.
                found = any([self._rewire(further) for further in node.GetInputs()]) or found
            else:
                interface = source.source
                kind = source.sourceType == UsdShade.AttributeType.Input
                further = interface.GetInput(source.sourceName) if kind else interface.GetOutput(source.sourceName)
                found = self._rewire(further) or found
        if found:
            self._reached.add(str(plug.GetAttr().GetPath()))
        return found

    def _is_uv(self, node: UsdShade.Shader, named_by: str | None) -> bool:
        if named_by is None:
            index = node.GetInput("index")
            return self._is_default and (not index or not index.Get())
        value = _producer(node.GetInput(named_by))
        return value is not None and value.Get() == self._uv_name

    @property
    def _is_default(self) -> bool:
        """True if nodes that name no UVs take the redirected ones."""
        return not self._shape.texture_uv_name or self._uv_name == "st"

    def _insert(self, container: Usd.Prim, uvs: UsdShade.Output | None) -> UsdShade.Output:
        """The redirected UVs inside of a material or node graph; `uvs` are the mesh's, None those by default."""
        key = (str(container.GetPath()), str(uvs.GetAttr().GetPath()) if uvs else "")
        if key not in self._inserted:
            number = len(self._inserted)
            name = "vrtm_redirected" + (f"_{number}" if number else "")
            path = container.GetPath().AppendChild(name)
            insert = self._insert_map if self._plan.corner_path is None else self._insert_primvar
            self._inserted[key] = insert(container.GetStage(), path, uvs)
        return self._inserted[key]

    def _insert_primvar(self, stage: Usd.Stage, path: Sdf.Path, uvs: UsdShade.Output | None) -> UsdShade.Output:
        reader = _node(stage, path, "ND_geompropvalue_vector2")
        reader.CreateInput("geomprop", Sdf.ValueTypeNames.String).Set(PRIMVAR)
        return reader.CreateOutput("out", FLOAT2)

    def _insert_map(self, stage: Usd.Stage, path: Sdf.Path, uvs: UsdShade.Output | None) -> UsdShade.Output:
        image = _node(stage, path, "ND_image_vector2")
        file = image.CreateInput("file", Sdf.ValueTypeNames.Asset)
        _set_files(file.GetAttr(), self._plan.values(lambda frame: self._plan.map_of(self._shape.name, frame)))
        # UVs are data, which must not be converted as colours.
        file.GetAttr().SetColorSpace("raw")
        for name, value in (("uaddressmode", "clamp"), ("vaddressmode", "clamp"), ("filtertype", "linear")):
            image.CreateInput(name, Sdf.ValueTypeNames.String).Set(value)
        if uvs is None and self._plan.form == "delta":
            uvs = _node(stage, Sdf.Path(f"{path}_uv"), "ND_texcoord_vector2").CreateOutput("out", FLOAT2)
        by = uvs
        if self._shape.texture_uv_name:
            # The map is looked up by the UVs that it was solved in, whatever set its values belong to.
            reader = _node(stage, Sdf.Path(f"{path}_by"), "ND_geompropvalue_vector2")
            reader.CreateInput("geomprop", Sdf.ValueTypeNames.String).Set(self._shape.uv_name)
            by = reader.CreateOutput("out", FLOAT2)
        if by is not None:
            image.CreateInput("texcoord", FLOAT2).ConnectToSource(by)
        found = image.CreateOutput("out", FLOAT2)
        if self._plan.form != "delta":
            return found
        total = _node(stage, Sdf.Path(f"{path}_sum"), "ND_add_vector2")
        total.CreateInput("in1", FLOAT2).ConnectToSource(uvs)
        total.CreateInput("in2", FLOAT2).ConnectToSource(found)
        return total.CreateOutput("out", FLOAT2)

    # Both

    def _inside(self, prim: Usd.Prim) -> bool:
        return prim.GetPath().HasPrefix(self._material.GetPath())

    def _warn(self, shader: UsdShade.Shader, what: str) -> None:
        warning = f"{self._shape.path}: the texture {shader.GetPath()} {what}"
        # As the shot names them, and not as the copy of the material does.
        warning = warning.replace(f"{self._material.GetPath()}/", f"{self._material.GetBaseMaterialPath()}/")
        if warning not in self._warnings:
            self._warnings.append(warning)


def _node(stage: Usd.Stage, path: Sdf.Path, name: str) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(name)
    return shader


def _set_files(attribute: Usd.Attribute, paths: list[tuple[str, float | None]]) -> None:
    """Names files over time, or one at all times."""
    for path, code in paths:
        attribute.Set(Sdf.AssetPath(path), Usd.TimeCode.Default() if code is None else code)


def _is_identity(transform: UsdShade.Shader) -> bool:
    """True if a UsdTransform2d leaves UVs as they are, as exporters write it."""
    for name, neutral in (("rotation", 0), ("scale", (1, 1)), ("translation", (0, 0))):
        plug = transform.GetInput(name)
        value = _producer(plug)
        if value is None:
            continue
        if UsdShade.Utils.GetType(value.GetName()) == UsdShade.AttributeType.Output or value.ValueMightBeTimeVarying():
            return False
        found = value.Get()
        if found is not None and not np.allclose(found, neutral, atol=1e-6):
            return False
    return True


def _is_animated(file: Usd.Attribute) -> bool:
    """True if a texture changes over time in the shot; copies that an earlier layer names do not count."""
    if not file.ValueMightBeTimeVarying():
        return False
    layers = [spec.layer for spec in file.GetPropertyStack(file.GetTimeSamples()[0])[:1]]
    return not any(map(is_marked, layers))


def _producer(plug: UsdShade.Input | None) -> Usd.Attribute | None:
    """The attribute that an input takes its value from, through interfaces of materials and node graphs."""
    found = UsdShade.Utils.GetValueProducingAttributes(plug) if plug else ()
    return found[0] if found else None


def _resolved(attribute: Usd.Attribute, asset: Sdf.AssetPath) -> str:
    """Path of a texture, with <UDIM> if it has tiles; as it is named if there is no such file."""
    if asset.resolvedPath:
        return asset.resolvedPath
    layers = [spec.layer for spec in attribute.GetPropertyStack(Usd.TimeCode.Default())]
    if UsdShade.UdimUtils.IsUdimIdentifier(asset.path) and layers:
        return UsdShade.UdimUtils.ResolveUdimPath(asset.path, layers[0]) or asset.path
    return asset.path
