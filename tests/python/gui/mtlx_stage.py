# SPDX-License-Identifier: Apache-2.0
"""A small stage with MaterialX materials: constants, textures, weights, instances."""

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World"
{
    def Scope "Looks"
    {
        def Material "Car"
        {
            token outputs:mtlx:surface.connect = </World/Looks/Car/S.outputs:out>
            def Shader "S"
            {
                uniform token info:id = "ND_open_pbr_surface_surfaceshader"
                float inputs:base_weight = 0.5
                color3f inputs:base_color = (0.8, 0.1, 0.1)
                float inputs:coat_weight = 0.6
                color3f inputs:emission_color = (1, 0.5, 0.2)
                token outputs:out
            }
        }
        def Material "Wood"
        {
            token outputs:mtlx:surface.connect = </World/Looks/Wood/S.outputs:out>
            def Shader "S"
            {
                uniform token info:id = "ND_open_pbr_surface_surfaceshader"
                color3f inputs:base_color.connect = </World/Looks/Wood/Image.outputs:out>
                float inputs:specular_roughness.connect = </World/Looks/Wood.inputs:polish>
                float inputs:emission_luminance = 0
                color3f inputs:emission_color.connect = </World/Looks/Wood/Image.outputs:out>
                float inputs:fuzz_weight.connect = </World/Looks/Wood/Grey.outputs:out>
                token outputs:out
            }
            float inputs:polish = 0.4
            def Shader "Image"
            {
                uniform token info:id = "ND_image_color3"
                asset inputs:file = @wood.png@
                color3f outputs:out
            }
            def Shader "Grey"
            {
                uniform token info:id = "ND_image_float"
                asset inputs:file = @wood.png@
                float outputs:out
            }
        }
        def Material "Standard"
        {
            token outputs:mtlx:surface.connect = </World/Looks/Standard/S.outputs:out>
            def Shader "S"
            {
                uniform token info:id = "ND_standard_surface_surfaceshader"
                float inputs:base = 0
                color3f inputs:base_color = (0.2, 0.5, 0.3)
                float inputs:emission = 0
                token outputs:out
            }
        }
        def Material "Gltf"
        {
            token outputs:mtlx:surface.connect = </World/Looks/Gltf/S.outputs:out>
            def Shader "S"
            {
                uniform token info:id = "ND_gltf_pbr_surfaceshader"
                color3f inputs:base_color = (0.3, 0.4, 0.8)
                float inputs:metallic = 0
                float inputs:roughness = 0.3
                token outputs:out
            }
        }
    }
    def Sphere "A" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </World/Looks/Car>
        double3 xformOp:translate = (-2.2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "B" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </World/Looks/Wood>
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0.2), (1, -1, 0.2), (1, 1, 0.2), (-1, 1, 0.2)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
        uniform token subdivisionScheme = "none"
    }
    def Sphere "C" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </World/Looks/Standard>
        double3 xformOp:translate = (2.2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Sphere "D" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </World/Looks/Gltf>
        double3 xformOp:translate = (0, 2.2, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "I1" (
        instanceable = true
        prepend references = </Part>
    )
    {
        double3 xformOp:translate = (-1.2, -1.6, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "I2" (
        instanceable = true
        prepend references = </Part>
    )
    {
        double3 xformOp:translate = (1.2, -1.6, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
class Xform "Part"
{
    def Sphere "Knob" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        double radius = 0.5
        rel material:binding = </Part/Gold>
    }
    def Material "Gold"
    {
        token outputs:mtlx:surface.connect = </Part/Gold/S.outputs:out>
        def Shader "S"
        {
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            color3f inputs:base_color = (0.9, 0.7, 0.2)
            float inputs:base_metalness = 1
            token outputs:out
        }
    }
}
"""

MTLX = """<?xml version="1.0"?>
<materialx version="1.38">
  <standard_surface name="SR" type="surfaceshader">
    <input name="base_color" type="color3" value="0.7, 0.2, 0.1" />
    <input name="specular_roughness" type="float" value="0.3" />
  </standard_surface>
  <surfacematerial name="Brick" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR" />
  </surfacematerial>
</materialx>
"""

REFERRING = """#usda 1.0
( defaultPrim = "World" )
def Xform "World"
{
    def Scope "Looks" ( references = @brick.mtlx@</MaterialX> )
    {
    }
    def Sphere "Ball" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </World/Looks/Materials/Brick>
    }
    def Sphere "Other"
    {
        rel material:binding = </World/Looks/Materials/Brick>
        double3 xformOp:translate = (2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "Gone" ( references = @gone.usda@ )
    {
    }
}
"""
"""A stage with a .mtlx file, a missing layer, and a binding without MaterialBindingAPI."""


def write_stage(folder):
    """Writes the stage and its texture, and returns the stage's path."""
    import numpy as np

    from wavecomb.image.files.image import write_png

    rows = np.linspace(0.1, 0.9, 16, dtype=np.float32)
    write_png(folder / "wood.png", np.broadcast_to(rows[:, None, None], (16, 16, 3)).copy())
    path = folder / "looks.usda"
    path.write_text(STAGE)
    return path


def write_referring(folder):
    """Writes the stage that refers to a .mtlx file, and returns its path."""
    (folder / "brick.mtlx").write_text(MTLX)
    path = folder / "referring.usda"
    path.write_text(REFERRING)
    return path
