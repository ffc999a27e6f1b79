# SPDX-License-Identifier: Apache-2.0
"""A small stage with an example of everything that the scene panel shows."""

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World"
{
    def Camera "Cam" {
        float focalLength = 20
        double3 xformOp:translate = (0, 1, 8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "Side" {
        float focalLength = 20
        double3 xformOp:translate = (1, 1, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Scope "Looks" {
        def Material "Red" {
            token outputs:surface.connect = </World/Looks/Red/S.outputs:surface>
            def Shader "S" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (0.8, 0.1, 0.1)
                float inputs:roughness = 0.4
                token outputs:surface
            }
        }
        def Material "Wood" {
            token outputs:surface.connect = </World/Looks/Wood/S.outputs:surface>
            def Shader "S" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/Looks/Wood/T.outputs:rgb>
                float inputs:roughness.connect = </World/Looks/Wood.inputs:polish>
                float inputs:clearcoat.connect = </World/Looks/Wood.inputs:polish>
                token outputs:surface
            }
            float inputs:polish = 0.25
            def Shader "T" {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @wood.png@
                float3 outputs:rgb
            }
        }
        def Material "Twin" {
            token outputs:surface.connect = </World/Looks/Twin/S.outputs:surface>
            def Shader "S" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (0.8, 0.1, 0.1)
                float inputs:roughness = 0.4
                token outputs:surface
            }
        }
    }
    def Xform "Things" {
        def Sphere "Ball" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
            rel material:binding = </World/Looks/Red>
            double3 xformOp:translate = (-2, 1, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def Cube "Box" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
            rel material:binding = </World/Looks/Wood>
            double3 xformOp:translate = (2, 1, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def Cone "Top" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
            rel material:binding = </World/Looks/Twin>
            double3 xformOp:translate = (0, 3, -1)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def GeometryLight "Dust" { }
    }
    def Xform "Sign" (
        variants = { string look = "ball" }
        prepend variantSets = "look"
    ) {
        double3 xformOp:translate = (0, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        variantSet "look" = {
            "ball" { def Sphere "Shape" { double radius = 0.7 } }
            "box" { def Cube "Shape" { double size = 1.2 } }
        }
    }
    def Xform "I1" ( instanceable = true
        prepend references = </Part> ) {
        double3 xformOp:translate = (-1, -1, 2)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "I2" ( instanceable = true
        prepend references = </Part> ) {
        double3 xformOp:translate = (1, -1, 2)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Scope "Lights" {
        def RectLight "Key" {
            float inputs:intensity = 6
            float inputs:width = 4
            float inputs:height = 4
            double3 xformOp:translate = (0, 4, 6)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def SphereLight "Bulb" {
            float inputs:intensity = 30
            bool treatAsPoint = 1
            double3 xformOp:translate = (-3, 4, 2)
            float3 xformOp:scale = (2, 2, 2)
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        }
        def DomeLight "Sky" { float inputs:intensity = 0.3 }
    }
}
class Xform "Part"
{
    def Sphere "Knob" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        double radius = 0.5
        rel material:binding = </Part/Gold>
    }
    def Material "Gold" {
        token outputs:surface.connect = </Part/Gold/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.9, 0.7, 0.2)
            float inputs:metallic = 1
            token outputs:surface
        }
    }
}
"""


def write_stage(folder):
    """Writes the stage and its texture, and returns the stage's path."""
    import numpy as np

    from wavecomb.image.files.image import write_png

    rows = np.linspace(0.1, 0.9, 16, dtype=np.float32)
    write_png(folder / "wood.png", np.broadcast_to(rows[:, None, None], (16, 16, 3)).copy())
    path = folder / "scene.usda"
    text = STAGE.replace("{ ", "{\n").replace(" }", "\n}")
    path.write_text(text.replace('{\nstring look = "ball"\n}', '{ string look = "ball" }'))
    return path
