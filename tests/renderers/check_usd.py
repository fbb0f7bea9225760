"""USD: what UsdPreviewSurface can do, and that the map cannot be wired into it."""

from pxr import Sdf, Sdr, Usd, UsdShade, UsdValidation

from checks import check, document, run


def complaints(stage):
    """Complaints of all validators but those of files: the texture does not lie beside a document's text."""
    registry = UsdValidation.ValidationRegistry()
    names = [m.name for m in registry.GetAllValidatorMetadata() if m.name.startswith(("usdShade", "usdGeom", "usdValidation:"))]
    validators = [v for v in map(registry.GetOrLoadValidatorByName, names) if v]
    if "usdShadeValidators:ShaderSdrCompliance" not in names:
        raise LookupError("the validator of shaders is missing")
    return [e.GetMessage() for e in UsdValidation.ValidationContext(validators).Validate(stage)]


def mismatched(stage):
    """Inputs that are plugged to an output of another type, by the nodes' definitions: the validators look at each end
    alone."""
    registry, found = Sdr.Registry(), []
    for prim in stage.Traverse():
        for plug in UsdShade.Shader(prim).GetInputs() if prim.IsA(UsdShade.Shader) else ():
            for source in plug.GetConnectedSources()[0]:
                name = UsdShade.Shader(source.source).GetIdAttr().Get()
                node = registry.GetShaderNodeByIdentifier(name)
                kind = node.GetShaderOutput(source.sourceName).GetTypeAsSdfType().GetSdfType()
                if kind.type != plug.GetTypeName().type:
                    found.append(f"{plug.GetFullName()} of {prim.GetName()} is a {plug.GetTypeName()}, {name} hands out {kind}")
    return found


def load(text):
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(text)
    return Usd.Stage.Open(layer)


def corner_uvs():
    text = document("USD", "usda")
    stage = load(text)
    found = complaints(stage) + mismatched(stage)
    check("usd: redirected corner UVs as a primvar", not found, "; ".join(found) or "no complaint")
    wrong = load(text.replace("float2 inputs:st.connect", "float3 inputs:st.connect"))
    check("usd: a wrong type is noticed", bool(complaints(wrong)), "; ".join(complaints(wrong))[:150])
    wired = load(text.replace("</model/material/uv.outputs:result>", "</model/material/albedo.outputs:rgb>"))
    check("usd: a texture's rgb does not fit st", len(mismatched(wired)) == 1, "; ".join(mismatched(wired)))
    surface = UsdShade.Material(stage.GetPrimAtPath("/model/material")).ComputeSurfaceSource()[0]
    texture = surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source
    reader = texture.GetInput("st").GetConnectedSources()[0][0].source
    name = UsdShade.Shader(reader).GetInput("varname").Get()
    mesh = stage.GetPrimAtPath("/model/skin").GetAttribute(f"primvars:{name}")
    check("usd: UVs per frame reach the texture", mesh.GetNumTimeSamples() == 2, f"{name}: {mesh.GetTimeSamples()}")


def no_dependent_lookup():
    """A texture hands out floats, a float3 and a float4; coordinates are float2, and no node makes one of floats."""
    registry = Sdr.Registry()
    nodes = [n for n in registry.GetShaderNodeNames() if n.startswith("Usd") and n != "UsdPreviewSurface"]
    makers = []
    for name in nodes:
        node = registry.GetShaderNodeByIdentifier(name)
        out = {str(node.GetShaderOutput(o).GetTypeAsSdfType().GetSdfType()) for o in node.GetShaderOutputNames()}
        ins = {str(node.GetShaderInput(i).GetTypeAsSdfType().GetSdfType()) for i in node.GetShaderInputNames()}
        if "float2" in out and ins & {"float", "float3", "float4"} and name != "UsdTransform2d":
            makers.append(name)
    texture = registry.GetShaderNodeByIdentifier("UsdUVTexture")
    outputs = {o: str(texture.GetShaderOutput(o).GetTypeAsSdfType().GetSdfType()) for o in texture.GetShaderOutputNames()}
    held = "UsdUVTexture" in nodes and not makers and "float2" not in outputs.values()
    check("usd: a UsdUVTexture cannot feed another one's st", held, f"outputs {outputs}; nodes that make a float2: {makers}")


run(corner_uvs, no_dependent_lookup)
