"""MaterialX: the document's graph is valid and becomes shaders, of which check_osl.py renders one."""

import pathlib
import re
import sys

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as glsl
import MaterialX.PyMaterialXGenMsl as msl
import MaterialX.PyMaterialXGenOsl as osl
import MaterialX.PyMaterialXGenShader as shader

from checks import check, document, run

folder = pathlib.Path(sys.argv[1])
path = mx.getDefaultDataSearchPath()
library = mx.createDocument()
mx.loadLibraries(mx.getDefaultDataLibraryFolders(), path, library)


def load(text):
    graph = mx.createDocument()
    mx.readFromXmlString(graph, text)
    graph.setDataLibrary(library)
    return graph


def source(generator, element):
    maker = generator.create()
    context = shader.GenContext(maker)
    context.registerSourceCodeSearchPath(path)
    context.getOptions().fileTextureVerticalFlip = True
    return maker.generate("redirected", element, context).getSourceCode("pixel")


def validity():
    text = document("MaterialX", "xml")
    valid, message = load(text).validate()
    check("materialx: the graph is valid", valid, message.strip() or "no complaint")
    wrong = text.replace('<image name="redirected" type="vector2">', '<image name="redirected" type="color3">')
    valid, message = load(wrong).validate()
    check("materialx: a colour is no texture coordinate", not valid, message.strip().splitlines()[0])


def shaders():
    graph = load(document("MaterialX", "xml"))
    material = graph.getChild("material")
    for name, generator in ("GLSL", glsl.GlslShaderGenerator), ("MSL", msl.MslShaderGenerator):
        code = source(generator, material)
        call = re.search(r"mx_image_color3\(albedo_file,.*\bredirected_out\b", code)
        check(f"materialx: {name}", call is not None, f"{len(code)} characters; the albedo is read at redirected_out")
    code = source(osl.OslShaderGenerator, graph.getChild("skin").getOutput("colour"))
    # For check_osl.py: the UV from a parameter, since u and v are others in Cycles; and of the headers only what is used,
    # since the compiler in Blender's Python module crashes on their operators.
    changed = code.replace('#include "mx_funcs.h"', "struct vector2 { float x; float y; };")
    changed = changed.replace("vector2(u,v)", "vector2(at[0], at[1])")
    changed = changed.replace("int uv_index = 0", "vector at = 0, int uv_index = 0")
    check("materialx: OSL", changed.count("at[0]") == 1, f"{len(code)} characters")
    (folder / "materialx.osl").write_text(changed)


run(validity, shaders)
