# SPDX-License-Identifier: Apache-2.0
"""Small USD stages as text, for tests with known results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = Sequence[float]
Array = NDArray[np.float64]


def write_stage(path: Path, *prims: str) -> Path:
    """Write prims, given as text, to a Y-up stage."""
    header = '#usda 1.0\n(\ndefaultPrim = "World"\nmetersPerUnit = 1\nupAxis = "Y"\n)\n'
    path.write_text(header + 'def Xform "World" {\n' + "\n".join(prims) + "\n}\n")
    return path


def numbers(values: Any) -> str:
    """Format a tuple, or a list of tuples, as USD text."""
    array = np.asarray(values, np.float64)
    if array.ndim == 1:
        return "(" + ", ".join(f"{v:.9g}" for v in array) + ")"
    return "[" + ", ".join(numbers(row) for row in array) + "]"


def matrix(rows: Array) -> str:
    """Transform op of a prim, as a matrix for row vectors."""
    inner = ", ".join("(" + ", ".join(f"{v:.17g}" for v in row) + ")" for row in rows)
    return (
        f"matrix4d xformOp:transform = ( {inner} )\n"
        'uniform token[] xformOpOrder = ["xformOp:transform"]'
    )


def look_at(eye: Vector, target: Vector) -> Array:
    """Transform of a camera or light at ``eye`` that points at ``target`` along its -z."""
    back = np.subtract(eye, target).astype(np.float64)
    back /= np.linalg.norm(back)
    up = np.array((0.0, 1.0, 0.0)) if abs(back[1]) < 0.99 else np.array((0.0, 0.0, -1.0))
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    out = np.eye(4)
    out[0, :3], out[1, :3], out[2, :3], out[3, :3] = right, np.cross(back, right), back, eye
    return out


def camera(
    eye: Vector, target: Vector, half: float = 0.3, lens: str = "", clip: Vector = (1e-3, 1e6)
) -> str:
    """Camera whose image is 2 x ``half`` wide at distance 1."""
    aperture = 2.0 * half * 50.0
    return f"""def Camera "Camera" {{
        float focalLength = 50
        float horizontalAperture = {aperture}
        float verticalAperture = {aperture}
        float2 clippingRange = {numbers(clip)}
        {lens}
        {matrix(look_at(eye, target))}
    }}"""


def mesh(
    name: str,
    points: Any,
    faces: Sequence[Sequence[int]],
    material: str | None,
    *,
    uv: Any = None,
    normals: Any = None,
    transform: Array | None = None,
) -> str:
    """Polygon mesh; normals and uv are per point."""
    lines = [
        f"point3f[] points = {numbers(points)}",
        f"int[] faceVertexCounts = {[len(face) for face in faces]}",
        f"int[] faceVertexIndices = {[int(i) for face in faces for i in face]}",
        'uniform token subdivisionScheme = "none"',
    ]
    if uv is not None:
        lines.append(f'texCoord2f[] primvars:st = {numbers(uv)} ( interpolation = "vertex" )')
    if normals is not None:
        lines.append(f'normal3f[] normals = {numbers(normals)} ( interpolation = "vertex" )')
    if material is not None:
        lines.append(f"rel material:binding = </World/{material}>")
    if transform is not None:
        lines.append(matrix(transform))
    body = "\n".join(lines)
    return f'def Mesh "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{\n{body}\n}}'


def quad(name: str, corners: Any, material: str | None, **options: Any) -> str:
    """A face of four corners, counter-clockwise seen from the front."""
    return mesh(name, corners, [[0, 1, 2, 3]], material, **options)


def ground(material: str, half: float = 4.0, height: float = 0.0) -> str:
    """A square that faces up."""
    h = half
    corners = [(-h, height, h), (h, height, h), (h, height, -h), (-h, height, -h)]
    return quad("Ground", corners, material)


def box(name: str, low: Vector, high: Vector, material: str) -> str:
    """A closed box with outward winding."""
    points = [
        (x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])
    ]
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return mesh(name, points, faces, material)


def sphere(
    name: str,
    material: str,
    centre: Vector = (0.0, 0.0, 0.0),
    radius: float = 1.0,
    *,
    rings: int = 12,
    smooth: bool = False,
    transform: Array | None = None,
) -> str:
    """A faceted sphere, or a fine one with smooth normals."""
    theta = np.linspace(0.0, np.pi, rings + 1)[1:-1]
    count = 2 * rings
    phi = 2.0 * np.pi * np.arange(count) / count
    t, f = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(f), np.cos(t), -np.sin(t) * np.sin(f)], axis=2)
    unit = np.concatenate([unit.reshape(-1, 3), [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]])
    top, bottom = len(unit) - 2, len(unit) - 1
    faces = []
    for k in range(count):
        n = (k + 1) % count
        faces.append([top, k, n])
        for r in range(rings - 2):
            a, b = r * count, (r + 1) * count
            faces.append([a + k, b + k, b + n])
            faces.append([a + k, b + n, a + n])
        last = (rings - 2) * count
        faces.append([bottom, last + n, last + k])
    return mesh(
        name,
        unit * radius + np.asarray(centre),
        faces,
        material,
        normals=unit if smooth else None,
        transform=transform,
    )


_KINDS = {
    "normal": "normal3f",
    "diffuseColor": "color3f",
    "specularColor": "color3f",
    "emissiveColor": "color3f",
    "useSpecularWorkflow": "int",
    "base_color": "color3f",
    "transmission_color": "color3f",
}


def material(
    name: str,
    program: str,
    *,
    texture: Path | str | None = None,
    eta: Vector | None = None,
    k: Vector | None = None,
    **inputs: Any,
) -> str:
    """UsdPreviewSurface with a program. ``texture`` is a raw image for diffuseColor."""
    lines = [f'custom string wavecomb:program = "{program}"']
    for key, value in (("eta", eta), ("k", k)):
        if value is not None:
            lines.append(f"custom float3 wavecomb:{key} = {numbers(value)}")
    shader = ['uniform token info:id = "UsdPreviewSurface"', "token outputs:surface"]
    for key, value in inputs.items():
        text = numbers(value) if np.ndim(value) else f"{value}"
        shader.append(f"{_KINDS.get(key, 'float')} inputs:{key} = {text}")
    nodes = ""
    if texture is not None:
        shader.append(f"color3f inputs:diffuseColor.connect = </World/{name}/Map.outputs:rgb>")
        nodes = f"""def Shader "Map" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{texture}@
            token inputs:sourceColorSpace = "raw"
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float2 inputs:st.connect = </World/{name}/St.outputs:result>
            float3 outputs:rgb
        }}
        def Shader "St" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}"""
    body = "\n".join(lines)
    inner = "\n".join(shader)
    return f"""def Material "{name}" {{
        {body}
        token outputs:surface.connect = </World/{name}/Surface.outputs:surface>
        def Shader "Surface" {{
            {inner}
        }}
        {nodes}
    }}"""


def light(
    kind: str,
    name: str = "Light",
    colour: Vector = (1.0, 1.0, 1.0),
    transform: Array | None = None,
    **inputs: Any,
) -> str:
    """UsdLux light of kind "Rect", "Sphere", "Distant", "Dome" or "Disk"."""
    lines = [f"color3f inputs:color = {numbers(colour)}", "float inputs:intensity = 1"]
    for key, value in inputs.items():
        if key == "texture":
            lines.append(f"asset inputs:texture:file = @{value}@")
        elif isinstance(value, bool):
            lines.append(f"bool inputs:{key} = {int(value)}")
        else:
            lines.append(f"float inputs:{key} = {value}")
    if transform is not None:
        lines.append(matrix(transform))
    return f'def {kind}Light "{name}" {{\n' + "\n".join(lines) + "\n}"


def moved(x: float, y: float, z: float) -> Array:
    """Translation, for row vectors."""
    out = np.eye(4)
    out[3, :3] = (x, y, z)
    return out


def turned(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    """Rotation in degrees about x, then y, then z, for row vectors."""
    out = np.eye(4)
    for axis, degrees in enumerate((x, y, z)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.eye(4)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, s, -s, c
        out = out @ turn
    return out


def latlong_directions(height: int) -> Array:
    """Directions of the pixels of a latlong image in OpenEXR's convention, (h, 2 h, 3).

    The image centre points along +z, the column at s = 1/4 along +x, and the top row up.
    """
    t = (np.arange(height) + 0.5) / height
    s = (np.arange(2 * height) + 0.5) / (2 * height)
    latitude = np.pi * (0.5 - t)[:, None]
    longitude = 2.0 * np.pi * (0.5 - s)[None, :]
    x = np.cos(latitude) * np.sin(longitude)
    z = np.cos(latitude) * np.cos(longitude)
    y = np.broadcast_to(np.sin(latitude), x.shape)
    return np.stack([x, y, z], axis=2)


def sky(directions: Array) -> Array:
    """Smooth environment without symmetry, (..., 3), from 0.1 to 2.5."""
    x, y, z = np.moveaxis(directions, -1, 0)
    red = np.exp(1.5 * (0.8 * x + 0.5 * y + 0.33 * z - 0.4))
    green = 0.5 + 0.4 * z + 0.05 * x
    blue = 0.4 + 0.25 * y - 0.2 * x * z + 0.3 * np.maximum(-z, 0.0) ** 2
    return np.stack([red, green, blue], axis=-1) + 0.1


def write_sky(folder: Path, height: int = 128) -> Path:
    """Write ``sky`` as an EXR file."""
    from wavecomb.scenes.authoring.textures import write_image

    path = folder / "sky.exr"
    write_image(path, sky(latlong_directions(height)).astype(np.float32), "float")
    return path
