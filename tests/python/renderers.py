"""Loads exported materials with Mitsuba 3 and MaterialX and prints what they make of them as one JSON object.

Arguments: a JSON file {"directions": [[lx, ly, lz, vx, vy, vz], …], "mitsuba": [paths], "materialx": [paths]}.
Exit code 77 where the packages are missing.
"""

import json
import sys

try:
    import MaterialX as mx
    import MaterialX.PyMaterialXGenGlsl as gen_glsl
    import MaterialX.PyMaterialXGenShader as gen_shader
    import mitsuba as mi
except ImportError:
    sys.exit(77)


def mitsuba_values(path, directions):
    """f of a material at each pair of directions: Mitsuba's value over the cosine of its outgoing direction."""
    bsdf = mi.load_file(path)
    context = mi.BSDFContext()
    interaction = mi.SurfaceInteraction3f()
    values = []
    for lx, ly, lz, vx, vy, vz in directions:
        interaction.wi = mi.Vector3f(vx, vy, vz)
        value = bsdf.eval(context, interaction, mi.Vector3f(lx, ly, lz))
        values.append([float(value[c]) / lz for c in range(3)])
    return values


def materialx_findings(path):
    """Whether the document is valid against the library, and the length of the shader that is generated from it."""
    library = mx.createDocument()
    search = mx.getDefaultDataSearchPath()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    document = mx.createDocument()
    mx.readFromXmlFile(document, path)
    document.setDataLibrary(library)
    valid, message = document.validate()
    generator = gen_glsl.GlslShaderGenerator.create()
    context = gen_shader.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    element = gen_shader.findRenderableElements(document)[0]
    shader = generator.generate(element.getName(), element, context)
    source = shader.getSourceCode(gen_shader.PIXEL_STAGE)
    inputs = {}
    for node in document.getNodes("standard_surface"):
        definition = node.getNodeDef()
        unknown = [i.getName() for i in node.getInputs() if definition.getActiveInput(i.getName()) is None]
        inputs = {"set": [i.getName() for i in node.getInputs()], "unknown": unknown}
    return {"valid": valid, "message": message, "shader_characters": len(source), "inputs": inputs}


def main(path):
    with open(path, encoding="utf-8") as f:
        job = json.load(f)
    mi.set_variant("scalar_rgb")
    print(
        json.dumps(
            {
                "mitsuba": [mitsuba_values(p, job["directions"]) for p in job["mitsuba"]],
                "materialx": [materialx_findings(p) for p in job["materialx"]],
            }
        )
    )


main(sys.argv[1])
