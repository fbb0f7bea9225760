"""The networks that a layer makes, in the eyes of MaterialX itself: the build of USD in the wheel does not know its
nodes."""

from pathlib import Path

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as glsl
import MaterialX.PyMaterialXGenShader as generators
import pytest
from pxr import UsdShade

import scenes
from shots import FRAMES, bound, over, shot

# Those that have another name than in USD.
TYPES = {"asset": "filename", "float2": "vector2", "color3f": "color3", "int": "integer"}


@pytest.fixture(scope="module")
def library() -> mx.Document:
    found = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), found)
    return found


def document(material: UsdShade.Material, library: mx.Document, time: float) -> mx.Document:
    """The nodes of a material without node graphs, at a time code, as a MaterialX document."""
    made = mx.createDocument()
    made.setDataLibrary(library)
    for prim in material.GetPrim().GetChildren():
        shader = UsdShade.Shader(prim)
        definition = library.getNodeDef(shader.GetIdAttr().Get())
        assert definition is not None, f"MaterialX has no node {shader.GetIdAttr().Get()}"
        node = made.addNode(definition.getNodeString(), prim.GetName(), definition.getType())
        node.setNodeDefString(definition.getName())
        for plug in shader.GetInputs():
            wanted = definition.getActiveInput(plug.GetBaseName())
            assert wanted is not None, f"{definition.getName()} has no input {plug.GetBaseName()}"
            kind = TYPES.get(str(plug.GetTypeName()), str(plug.GetTypeName()))
            assert wanted.getType() == kind, f"{plug.GetFullName()} is a {wanted.getType()}, not a {kind}"
            port = node.addInput(plug.GetBaseName(), kind)
            if plug.HasConnectedSource():
                port.setNodeName(plug.GetConnectedSources()[0][0].source.GetPrim().GetName())
            else:
                value = plug.Get(time)
                port.setValueString(getattr(value, "path", None) or str(value))
    surface = made.addMaterialNode("material", made.getNode("surface"))
    assert surface is not None
    return made


@pytest.mark.parametrize("plugged", [True, False])
@pytest.mark.parametrize("how", [{"corners": False}, {"corners": False, "form": "delta"}, {}])
def test_networks_are_valid_and_become_shaders(tmp_path: Path, library: mx.Document, plugged: bool, how: dict) -> None:
    stage = shot(tmp_path)
    scenes.bind(stage.GetPrimAtPath("/world/one"), scenes.materialx_material(stage, "/world/looks/mx", plugged, False))
    final, _ = over(stage, **how)
    made = document(bound(final, "/world/one"), library, FRAMES[1])
    valid, message = made.validate()
    assert valid, message
    generator = glsl.GlslShaderGenerator.create()
    context = generators.GenContext(generator)
    context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
    code = generator.generate("surface", made.getChild("material"), context).getSourceCode("pixel")
    # The texture is read at what the last node before it hands out, and that is what was found in the map.
    read = [line for line in code.splitlines() if "mx_image_color3(colour_file" in line]
    last = "scale_out" if plugged else {"delta": "vrtm_redirected_sum_out"}.get(how.get("form"), "vrtm_redirected_out")
    assert len(read) == 1 and last in read[0], read
    if "corners" in how:
        assert sum("mx_image_vector2(vrtm_redirected_file" in line for line in code.splitlines()) == 1
