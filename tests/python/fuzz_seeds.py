# SPDX-License-Identifier: Apache-2.0
"""Valid stages and images from which ``fuzz_cases`` makes broken ones.

The seed stages are small and contain an example of everything that the loader reads, so that most
mutations have an effect.
"""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from pxr import Sdf, UsdUtils

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    endTimeCode = 3
    metersPerUnit = 0.01
    startTimeCode = 1
    upAxis = "Z"
    customLayerData = { dictionary deep = { int[] list = [1, 2, 3] } }
)

class Xform "_kind" { double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]; }

def Xform "World" (
    kind = "assembly"
    prepend variantSets = "look"
    variants = { string look = "red"; }
) {
    variantSet "look" = {
        "blue" { color3f[] primvars:displayColor = [(0, 0, 1)]; }
        "red" { color3f[] primvars:displayColor = [(1, 0, 0)]; }
   }

    def Camera "Cam" {
        float focalLength = 35
        float horizontalAperture = 36
        float verticalAperture = 24
        float2 clippingRange = (0.1, 10000)
        float fStop = 2.8
        float focusDistance = 12
        float3 xformOp:rotateXYZ = (70, 0, 20)
        double3 xformOp:translate.timeSamples = { 1: (4, -12, 5), 2: (5, -12, 5), 3: (6, -12, 5) }
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
   }

    def Mesh "Quads" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token subdivisionScheme = "catmullClark"
        float3[] extent = [(-2, -2, 0), (2, 2, 1)]
        int[] faceVertexCounts = [4, 4, 3, 3]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 6, 4, 5, 6]
        int[] holeIndices = [3]
        int[] creaseIndices = [0, 1, 2]
        int[] creaseLengths = [3]
        float[] creaseSharpnesses = [2.5]
        int[] cornerIndices = [4]
        float[] cornerSharpnesses = [10]
        point3f[] points = [(-2, -2, 0), (0, -2, 0), (2, -2, 0), (-2, 0, 1), (0, 0, 1), (2, 0, 1),
            (0, 2, 0)]
        point3f[] points.timeSamples = {
            1: [(-2, -2, 0), (0, -2, 0), (2, -2, 0), (-2, 0, 1), (0, 0, 1), (2, 0, 1), (0, 2, 0)],
            3: [(-2, -2, 0), (0, -2, 0), (2, -2, 0), (-2, 0, 2), (0, 0, 2), (2, 0, 2), (0, 2, 0)],
       }
        vector3f[] velocities = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1),
            (0, 0, 1)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
        int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 0, 1, 2]
        normal3f[] primvars:normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1),
            (0, 0, 1), (0, 0, 1)] (interpolation = "vertex")
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)] (
            interpolation = "uniform")
        float[] primvars:displayOpacity = [0.5] (interpolation = "constant")
        rel material:binding = </World/Looks/Paint>

        def GeomSubset "Some" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1, 2]
            rel material:binding = </World/Looks/Lamp>
       }
   }

    def Scope "Looks" {
        def Material "Paint" {
            float inputs:rough = 0.3
            token outputs:surface.connect = </World/Looks/Paint/Surface.outputs:surface>
            def Shader "Surface" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/Looks/Paint/Map.outputs:rgb>
                normal3f inputs:normal.connect = </World/Looks/Paint/Bumps.outputs:rgb>
                float inputs:roughness.connect = </World/Looks/Paint.inputs:rough>
                float inputs:opacity = 1
                float inputs:ior = 1.5
                token outputs:surface
           }
            def Shader "Map" {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./TEXTURE@
                float2 inputs:st.connect = </World/Looks/Paint/Place.outputs:result>
                token inputs:wrapS = "mirror"
                float4 inputs:scale = (1, 1, 1, 1)
                float4 inputs:fallback = (1, 0, 0, 1)
                float3 outputs:rgb
           }
            def Shader "Bumps" {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./TEXTURE@
                token inputs:sourceColorSpace = "raw"
                float4 inputs:scale = (2, 2, 2, 1)
                float4 inputs:bias = (-1, -1, -1, 0)
                float3 outputs:rgb
           }
            def Shader "Place" {
                uniform token info:id = "UsdTransform2d"
                float2 inputs:in.connect = </World/Looks/Paint/Reader.outputs:result>
                float inputs:rotation = 30
                float2 inputs:scale = (2, 2)
                float2 outputs:result
           }
            def Shader "Reader" {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
           }
       }
        def Material "Lamp" {
            token outputs:surface.connect = </World/Looks/Lamp/S.outputs:surface>
            def Shader "S" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:emissiveColor = (3, 2, 1)
                token outputs:surface
           }
       }
        def Material "Standard" {
            token outputs:mtlx:surface.connect = </World/Looks/Standard/S.outputs:out>
            def Shader "S" {
                uniform token info:id = "ND_standard_surface_surfaceshader"
                color3f inputs:base_color = (0.2, 0.6, 0.3)
                float inputs:metalness = 0.5
                float inputs:transmission = 0.1
                token outputs:out
           }
       }
   }

    def Xform "Parts" {
        def Xform "Part" (instanceable = true
            prepend references = </Prototypes/Part>) {
            double3 xformOp:translate = (3, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
       }
        def Xform "Again" (instanceable = true
            prepend references = </Prototypes/Part>
            prepend inherits = </_kind>) {
            matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 2, 0, 0), (0, 0, 1, 0), (-3, 0, 0, 1))
            uniform token[] xformOpOrder = ["xformOp:transform"]
       }
        def "Other" (payload = @./OTHER@</Root>) {}
   }

    def PointInstancer "Many" {
        rel prototypes = [</World/Many/A>, </Prototypes/Part>]
        int[] protoIndices = [0, 1, 0, 1]
        int64[] ids = [1, 2, 3, 4]
        int64[] invisibleIds = [3]
        point3f[] positions = [(0, 3, 0), (1, 3, 0), (2, 3, 0), (3, 3, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.7, 0.7, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (0.5, 0.5, 0.5), (1, 1, 1), (1, 2, 1)]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (
            interpolation = "vertex")
        def Sphere "A" { double radius = 0.4; }
   }

    def Cube "Box" { double size = 1.5
        token visibility.timeSamples = { 1: "inherited", 3: "invisible" }; }
    def Cylinder "Can" { double height = 2
        double radius = 0.5
        uniform token axis = "X"; }
    def Cone "Hat" { double height = 2; }
    def Capsule "Pill" { double radius = 0.3; }
    def Plane "Floor" { double width = 20
        double length = 20; }

    def BasisCurves "Hair" {
        uniform token type = "cubic"
        uniform token basis = "bspline"
        int[] curveVertexCounts = [4, 5]
        point3f[] points = [(0, 0, 1), (0, 0, 2), (0, 1, 3), (0, 1, 4), (1, 0, 1), (1, 0, 2),
            (1, 1, 3), (1, 1, 4), (1, 1, 5)]
        float[] widths = [0.1, 0.05] (interpolation = "uniform")
   }
    def Points "Dust" {
        point3f[] points = [(0, 0, 5), (1, 0, 5), (2, 0, 5)]
        float[] widths = [0.1, 0.2, 0.3]
        int64[] ids = [5, 6, 7]
   }

    def SkelRoot "Body" (prepend apiSchemas = ["SkelBindingAPI"]) {
        rel skel:skeleton = </World/Body/Bones>
        def Skeleton "Bones" {
            uniform token[] joints = ["a", "a/b"]
            uniform matrix4d[] bindTransforms = [((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1)),
                ((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,1,1))]
            uniform matrix4d[] restTransforms = [((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1)),
                ((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,1,1))]
       }
        def Mesh "Skin" (prepend apiSchemas = ["SkelBindingAPI"]) {
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 0, 2)]
            int[] primvars:skel:jointIndices = [0, 0, 1] (elementSize = 1
                interpolation = "vertex")
            float[] primvars:skel:jointWeights = [1, 1, 1] (elementSize = 1
                interpolation = "vertex")
       }
   }

    def DomeLight "Sky" { float inputs:intensity = 0.5
        asset inputs:texture:file = @./DOME@
        token inputs:texture:format = "latlong"; }
    def SphereLight "Bulb" { float inputs:radius = 0.2
        color3f inputs:color = (1, 0.9, 0.8)
        bool inputs:enableColorTemperature = 1
        float inputs:exposure = 4
        double3 xformOp:translate = (0, 0, 8)
        uniform token[] xformOpOrder = ["xformOp:translate"]; }
    def RectLight "Panel" { float inputs:width = 2
        float inputs:shaping:cone:angle = 50; }
    def DistantLight "Sun" { float inputs:angle = 1; }
}

over "Prototypes" {
    over "Part" {
        def Mesh "Tile" {
            uniform token subdivisionScheme = "none"
            uniform token orientation = "leftHanded"
            int[] faceVertexCounts = [3, 3]
            int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
            point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
       }
   }
}

def Scope "Render" {
    def RenderSettings "Settings" { rel camera = </World/Cam>
        int2 resolution = (640, 360); }
}
"""

OTHER = """#usda 1.0
def Xform "Root" {
    def Cube "Inside" { double size = 0.7; }
}
"""

IMAGES = {"png": "uint8", "jpg": "uint8", "exr": "half", "hdr": "float"}
"""Maps file suffixes to pixel types."""


def stage_text(texture: str = "a.png", dome: str = "a.hdr") -> str:
    """Returns the stage as text, with the given texture and dome files."""
    text = STAGE.replace("TEXTURE", texture).replace("DOME", dome)
    return text.replace("OTHER", "other.usda")


@cache
def stage_bytes(suffix: str) -> bytes:
    """Returns the stage as .usda, .usdc or .usdz."""
    text = stage_text()
    if suffix == "usda":
        return text.encode()
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text)
    with tempfile.TemporaryDirectory() as folder:
        crate = Path(folder, "stage.usdc")
        assert layer.Export(str(crate))
        if suffix == "usdc":
            return crate.read_bytes()
        for name in ("a.png", "a.hdr"):
            Path(folder, name).write_bytes(image_bytes(name[2:]))
        Path(folder, "other.usda").write_text(OTHER)
        package = Path(folder, "stage.usdz")
        assert UsdUtils.CreateNewUsdzPackage(str(crate), str(package))
        return package.read_bytes()


@cache
def image_bytes(suffix: str) -> bytes:
    """Returns an image of 24 x 12 pixels."""
    import OpenImageIO as oiio

    rows, columns = np.indices((12, 24))
    values = np.stack([columns / 24, rows / 12, (rows + columns) % 3 / 2], axis=2)
    with tempfile.TemporaryDirectory() as folder:
        name = str(Path(folder, f"image.{suffix}"))
        output = oiio.ImageOutput.create(name)
        spec = oiio.ImageSpec(24, 12, 3, IMAGES[suffix])
        assert output.open(name, spec), oiio.geterror()
        assert output.write_image(values.astype(np.float32))
        output.close()
        return Path(name).read_bytes()
