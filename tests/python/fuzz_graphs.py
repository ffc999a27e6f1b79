# SPDX-License-Identifier: Apache-2.0
"""Stages that are broken by their structure: cycles, depth, and exponential expansion."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

SCHEMES = ("none", "loop", "bilinear", "catmullClark", "x")
HEAD = "#usda 1.0\n"
TRIANGLE = (
    'def Mesh "T" { point3f[] points = [(0,0,0), (1,0,0), (0,1,0)] int[] faceVertexCounts = [3] '
    "int[] faceVertexIndices = [0,1,2]; }\n"
).replace("] int", "]; int")

BOUND = TRIANGLE.replace(
    'def Mesh "T" {',
    'def Mesh "T" (prepend apiSchemas = ["MaterialBindingAPI"]) {\nrel material:binding = </M>\n',
)
"""USD text of a mesh with the material /M."""


def _write(folder: Path, text: str, name: str = "stage.usda") -> Path:
    path = folder / name
    path.write_text(HEAD + text)
    return path


def circles(rng: random.Random, folder: Path) -> Path:
    """Writes prims that reference, inherit, specialise or contain each other at random."""
    count = rng.randint(1, 8)
    names = [f"P{i}" for i in range(count)]
    files = [f"f{i}.usda" for i in range(rng.randint(0, 2))]

    def arc() -> str:
        target = f"</{rng.choice(names)}{rng.choice(('', '/C', '/C/C'))}>"
        kind = rng.choice(("references", "payload", "inherits", "specializes"))
        if kind in ("references", "payload"):
            target = (
                f"@{rng.choice([*files, 'stage.usda'])}@{target}" if rng.random() < 0.4 else target
            )
        return f"prepend {kind} = {target}"

    def prim(name: str, depth: int) -> str:
        kinds = {arc().split(" = ")[0]: arc() for _ in range(rng.randint(0, 3))}
        parts = list(kinds.values())
        parts = list({part.split(" = ")[0]: part for part in parts}.values())
        if rng.random() < 0.4:
            parts.append("instanceable = true")
        inside = TRIANGLE if rng.random() < 0.5 else ""
        if depth < 2:
            inside += prim("C", depth + 1)
        if rng.random() < 0.3:
            inside += (
                f'def PointInstancer "I" {{ rel prototypes = </{rng.choice(names)}>\n'
                "int[] protoIndices = [0]\npoint3f[] positions = [(0,0,0)]; }\n"
            )
        kind = rng.choice(("def Xform", "def", "class Xform", "over"))
        return f'{kind} "{name}" (\n' + "\n".join(parts) + f"\n) {{\n{inside}}}\n"

    def layer() -> str:
        sub = [f"@{rng.choice([*files, 'stage.usda'])}@" for _ in range(rng.randint(0, 2))]
        head = f"(\nsubLayers = [{', '.join(sub)}]\n)\n" if sub and rng.random() < 0.5 else ""
        return head + "".join(prim(name, 0) for name in names)

    for file in files:
        _write(folder, layer(), file)
    return _write(folder, layer())


def networks(rng: random.Random, folder: Path) -> Path:
    """Writes shaders, node graphs and primvars that connect to each other at random."""
    nodes = [f"N{i}" for i in range(rng.randint(1, 12))]
    ids = (
        "UsdPreviewSurface", "UsdUVTexture", "UsdTransform2d", "UsdPrimvarReader_float2",
        "ND_standard_surface_surfaceshader", "ND_image_color3", "ND_multiply_color3", "Nonsense",
    )  # fmt: skip
    inputs = (
        "diffuseColor",
        "st",
        "in",
        "normal",
        "opacity",
        "base_color",
        "in1",
        "texcoord",
        "file",
    )
    outputs = ("surface", "rgb", "result", "out", "r")

    def source() -> str:
        return f"</M/{rng.choice(nodes)}.outputs:{rng.choice(outputs)}>"

    text = f'def Material "M" {{ token outputs:surface.connect = {source()}\n'
    for node in nodes:
        kind = rng.choice(("Shader", "Shader", "NodeGraph", "Material"))
        text += f'def {kind} "{node}" {{ uniform token info:id = "{rng.choice(ids)}"\n'
        for name in rng.sample(inputs, rng.randint(0, 4)):
            text += f"float3 inputs:{name}.connect = {source()}\n"
        for name in outputs:
            text += f"token outputs:{name}\n"
            if kind != "Shader":
                text += f"token outputs:{name}.connect = {source()}\n"
        text += "}\n"
    text += "}\n"
    return _write(folder, text + BOUND)


def deep(rng: random.Random, folder: Path) -> Path:
    """Writes deeply nested prims, references, instancers, shaders or sublayers."""
    depth = rng.choice((10, 100, 300, 1000, 3000, 10000, 30000, 100000))
    how = rng.randrange(7)
    if how == 0:
        return _write(folder, 'def Xform "A" {\n' * depth + TRIANGLE + "}\n" * depth)
    if how == 1:
        inside = "dictionary a = {\n" * depth + "}\n" * depth
        return _write(folder, f"(customLayerData = {{\n{inside}}}\n)\n")
    if how == 2:
        return _write(folder, 'def "A" { int[] a = ' + "[" * depth + "1" + "]" * depth + ";}")
    if how == 3:  # chain of references
        depth = min(depth, 3000)
        text = "".join(
            f'def Xform "P{i}" (prepend references = </P{i + 1}>) {{}}\n' for i in range(depth)
        )
        return _write(folder, text + f'def Xform "P{depth}" {{ {TRIANGLE} }}')
    if how == 4:  # nested instancers
        depth = min(depth, 3000)
        text = "".join(
            f'def PointInstancer "P{i}" {{ rel prototypes = </P{i + 1}>\nint[] protoIndices = [0]\n'
            "point3f[] positions = [(0,0,0)]; }\n"
            for i in range(depth)
        )
        return _write(folder, text + f'def Xform "P{depth}" {{ {TRIANGLE} }}')
    if how == 5:  # chain of shaders
        depth = min(depth, 3000)
        text = 'def Material "M" { token outputs:surface.connect = </M/N0.outputs:out>\n'
        for i in range(depth):
            kind = "NodeGraph" if i % 2 == 0 else "Shader"
            text += (
                f'def {kind} "N{i}" {{ token outputs:out\n'
                f"token outputs:out.connect = </M/N{i + 1}.outputs:out>; }}\n"
            )
        last = 'uniform token info:id = "UsdPreviewSurface"\ntoken outputs:out;'
        text += f'def Shader "N{depth}" {{ {last} }} }}\n'
        return _write(folder, text + BOUND)
    depth = min(depth, 1000)  # nested sublayers
    for i in range(depth):
        _write(folder, f"(subLayers = [@layer{i + 1}.usda@])\n", f"layer{i}.usda")
    _write(folder, TRIANGLE, f"layer{depth}.usda")
    return _write(folder, "(subLayers = [@layer0.usda@])\n")


def doubling(rng: random.Random, folder: Path) -> Path:
    """Writes a few prims that expand to billions, since each contains the next at least twice."""
    levels, width = rng.choice(((6, 2), (10, 2), (14, 2), (30, 2), (8, 8), (3, 16), (64, 2)))
    how = rng.randrange(4)
    text = ""
    for i in range(levels):
        inside = ""
        for j in range(width):
            more = "instanceable = true\n" if how == 1 else ""
            arc = "inherits" if how == 3 else "references"
            inside += f'def Xform "C{j}" (\n{more}prepend {arc} = </P{i + 1}>\n) {{}}\n'
        if how == 2:
            text += (
                f'def PointInstancer "P{i}" {{ rel prototypes = </P{i + 1}>\n'
                f"int[] protoIndices = [{', '.join(['0'] * width)}]\n"
                f"point3f[] positions = [{', '.join(f'({j},0,{i})' for j in range(width))}]; }}\n"
            )
        else:
            text += f'{"def" if i == 0 else "class"} Xform "P{i}" {{\n{inside}}}\n'
    last = "def" if levels == 0 else "class"
    return _write(folder, text + f'{last} Xform "P{levels}" {{ {TRIANGLE} }}')


def arrays(rng: random.Random, folder: Path) -> Path:
    """Writes meshes and instancers whose arrays do not match each other."""

    def numbers(count: int, low: int, high: int) -> str:
        return ", ".join(str(rng.randint(low, high)) for _ in range(count))

    def triples(count: int) -> str:
        odd = ("nan", "inf", "-1e38", "1e38", "1e-45", "0")
        value = lambda: rng.choice(odd) if rng.random() < 0.1 else f"{rng.uniform(-9, 9):.3f}"  # noqa: E731
        return ", ".join(f"({value()}, {value()}, {value()})" for _ in range(count))

    text = ""
    for i in range(rng.randint(1, 6)):
        faces, corners, points = (rng.choice((0, 1, 2, 4, 9, 40)) for _ in range(3))
        colours = rng.choice((0, 1, faces, points))
        kinds = ("constant", "uniform", "vertex", "varying", "faceVarying", "none", "banana")
        text += (
            f'def Mesh "M{i}" {{\n'
            + "".join(
                f"{line}\n"
                for line in (
                    f"point3f[] points = [{triples(points)}]",
                    f"int[] faceVertexCounts = [{numbers(faces, -1, 5)}]",
                    f"int[] faceVertexIndices = [{numbers(corners, -1, max(1, points))}]",
                    f"int[] holeIndices = [{numbers(rng.randint(0, 2), -2, 5)}]",
                    f"int[] creaseIndices = [{numbers(rng.randint(0, 5), -1, 9)}]",
                    f"int[] creaseLengths = [{numbers(rng.randint(0, 3), -1, 4)}]",
                    f"float[] creaseSharpnesses = [{numbers(rng.randint(0, 3), -1, 10)}]",
                    f"int[] cornerIndices = [{numbers(rng.randint(0, 3), -1, 9)}]",
                    f"float[] cornerSharpnesses = [{numbers(rng.randint(0, 3), -1, 10)}]",
                    f'uniform token subdivisionScheme = "{rng.choice(SCHEMES)}"',
                    f"normal3f[] normals = [{triples(rng.choice((0, 1, points)))}] "
                    f'(interpolation = "{rng.choice(kinds)}")',
                    f"color3f[] primvars:displayColor = [{triples(colours)}] "
                    f'(interpolation = "{rng.choice(kinds)}")',
                    f"int[] primvars:displayColor:indices = [{numbers(rng.randint(0, 9), -1, 9)}]",
                )
                if rng.random() < 0.8
            )
            + "}\n"
        )
    count = rng.choice((0, 1, 5, 1000))
    text += (
        'def PointInstancer "I" { rel prototypes = [</M0>, </Gone>, </I>]\n'
        f"int[] protoIndices = [{numbers(count, -1, 3)}]\n"
        f"point3f[] positions = [{triples(rng.choice((0, 1, count)))}]\n"
        f"float3[] scales = [{triples(rng.choice((0, 1, count)))}]\n"
        f"int64[] ids = [{numbers(rng.choice((0, 1, count)), -5, 5)}]\n"
        f"int64[] invisibleIds = [{numbers(rng.choice((0, 3)), -5, 5)}]; }}\n"
    )
    kind = rng.choice(("cubic", "linear"))
    text += (
        f'def BasisCurves "B" {{ uniform token type = "{kind}"\n'
        f'uniform token basis = "{rng.choice(("bezier", "bspline", "catmullRom", "x"))}"\n'
        f'uniform token wrap = "{rng.choice(("periodic", "pinned", "nonperiodic"))}"\n'
        f"int[] curveVertexCounts = [{numbers(rng.randint(0, 4), -1, 7)}]\n"
        f"point3f[] points = [{triples(rng.choice((0, 4, 8, 20)))}]\n"
        f"float[] widths = [{numbers(rng.choice((0, 1, 4, 20)), -1, 2)}]; }}\n"
        f'def Points "D" {{ point3f[] points = [{triples(rng.choice((0, 3, 9)))}]\n'
        f"float[] widths = [{numbers(rng.choice((0, 1, 3, 9)), -1, 2)}]; }}\n"
    )
    return _write(folder, text)


GRAPHS: dict[str, Callable[[random.Random, Path], Path]] = {
    "circles": circles,
    "networks": networks,
    "deep": deep,
    "doubling": doubling,
    "arrays": arrays,
}
