# SPDX-License-Identifier: Apache-2.0
"""Render a page of shader balls: each lobe of OpenPBR with sweeps of its parameters.

    .venv/bin/python benchmarks/shaderballs.py
    .venv/bin/python benchmarks/shaderballs.py metal coat -o out/balls --ball 160 --spp 256

A sweep is a row of balls in one image. The stage of a sweep is written next to its image. The page
is index.html in the output folder. The exit code is 1 if a stage has warnings, which are printed.
"""

from __future__ import annotations

import argparse
import html
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import wavecomb
from wavecomb.image.files.output_file import replacing

GLASS = {"transmission_weight": 1.0, "specular_roughness": 0.0}
GOLD = {"base_metalness": 1.0, "base_color": (0.94, 0.78, 0.34), "specular_roughness": 0.3}
RED = {"base_color": (0.6, 0.08, 0.05), "specular_roughness": 0.4}
BLACK = {"base_color": (0.02, 0.02, 0.02)}


@dataclass(frozen=True)
class Sweep:
    """Balls that differ in inputs of open_pbr_surface."""

    name: str
    about: str
    common: dict[str, Any]
    steps: tuple[dict[str, Any], ...]

    @classmethod
    def of(cls, name: str, about: str, common: dict[str, Any], key: str, *values: Any) -> Sweep:
        """Make a sweep of one input."""
        return cls(name, about, common, tuple({key: value} for value in values))


UNIT = (0.0, 0.25, 0.5, 0.75, 1.0)
SWEEPS = (
    Sweep.of("diffuse", "Diffuse roughness (EON)",
             {"specular_weight": 0.0, "base_color": (0.8, 0.6, 0.4)},
             "base_diffuse_roughness", *UNIT),
    Sweep.of("specular", "Dielectric over diffuse: roughness", RED, "specular_roughness", *UNIT),
    Sweep.of("specular-ior", "Dielectric over diffuse: index",
             {**BLACK, "specular_roughness": 0.2}, "specular_ior", 1.1, 1.33, 1.5, 2.0, 3.0),
    Sweep.of("metal", "Metal: roughness", GOLD, "specular_roughness", *UNIT),
    Sweep.of("metal-edge", "Metal: tint at 82 degrees", {**GOLD, "base_color": (0.8, 0.8, 0.8)},
             "specular_color", (1.0, 1.0, 1.0), (0.5, 0.7, 1.0), (0.0, 0.4, 1.0),
             (1.0, 0.5, 0.2), (0.0, 0.0, 0.0)),
    Sweep.of("brushed", "Metal: anisotropy", {**GOLD, "specular_roughness": 0.35},
             "specular_roughness_anisotropy", 0.0, 0.3, 0.6, 0.8, 0.95),
    Sweep.of("coat", "Coat: roughness", {**RED, "coat_weight": 1.0, "specular_roughness": 0.6},
             "coat_roughness", 0.0, 0.1, 0.3, 0.6, 1.0),
    Sweep.of("coat-colour", "Coat: colour, with its darkening",
             {**GOLD, "coat_weight": 1.0}, "coat_color", (1.0, 1.0, 1.0), (1.0, 0.5, 0.3),
             (0.9, 0.15, 0.1), (0.3, 0.8, 0.4), (0.2, 0.4, 0.9)),
    Sweep.of("fuzz", "Fuzz: weight", {"base_color": (0.15, 0.03, 0.2), "specular_weight": 0.3,
             "fuzz_color": (0.9, 0.7, 1.0), "fuzz_roughness": 0.4}, "fuzz_weight", *UNIT),
    Sweep.of("fuzz-roughness", "Fuzz: roughness", {**BLACK, "specular_weight": 0.0,
             "fuzz_weight": 1.0}, "fuzz_roughness", 0.1, 0.3, 0.5, 0.7, 1.0),
    Sweep.of("film", "Thin film on metal: thickness in micrometres",
             {"base_metalness": 1.0, "base_color": (0.6, 0.6, 0.6), "specular_roughness": 0.15,
              "thin_film_weight": 1.0}, "thin_film_thickness", 0.1, 0.25, 0.4, 0.6, 0.9),
    Sweep.of("glass", "Transmission: roughness", GLASS, "specular_roughness",
             0.0, 0.15, 0.3, 0.5, 0.8),
    Sweep.of("absorption", "Transmission: depth of absorption",
             {**GLASS, "transmission_color": (0.2, 0.7, 0.5)}, "transmission_depth",
             0.0, 0.25, 0.5, 1.0, 4.0),
    Sweep("wall", "Thin walls: weight of transmission, and leaves",
          {"geometry_thin_walled": True, "specular_roughness": 0.2,
           "base_color": (0.3, 0.6, 0.2), "subsurface_color": (0.5, 0.8, 0.2)},
          ({"transmission_weight": 0.0}, {"transmission_weight": 0.5},
           {"transmission_weight": 1.0}, {"subsurface_weight": 0.5}, {"subsurface_weight": 1.0})),
    Sweep.of("metalness", "From plastic to metal", RED, "base_metalness", *UNIT),
    Sweep.of("opacity", "Opacity", RED, "geometry_opacity", 1.0, 0.75, 0.5, 0.25, 0.1),
)  # fmt: skip


def sphere(rings: int = 48, segments: int = 96) -> str:
    """A ball of radius 1 with texture coordinates and smooth normals across the seam."""
    points, normals, uvs, faces = [], [], [], []
    for i in range(rings + 1):
        polar = math.pi * i / rings
        for j in range(segments + 1):
            around = 2.0 * math.pi * j / segments
            place = (
                math.sin(polar) * math.cos(around),
                math.cos(polar),
                -math.sin(polar) * math.sin(around),
            )
            points.append(place)
            normals.append(place)
            uvs.append((j / segments, 1.0 - i / rings))
    for i in range(rings):
        for j in range(segments):
            a, b = i * (segments + 1) + j, (i + 1) * (segments + 1) + j
            faces.append((a, b, b + 1, a + 1))
    counts = ", ".join("4" for _ in faces)
    indices = ", ".join(str(index) for face in faces for index in face)
    return f"""
        int[] faceVertexCounts = [{counts}]
        int[] faceVertexIndices = [{indices}]
        point3f[] points = [{_tuples(points)}]
        normal3f[] normals = [{_tuples(normals)}] (interpolation = "vertex")
        texCoord2f[] primvars:st = [{_tuples(uvs)}] (interpolation = "vertex")
        uniform token subdivisionScheme = "none\""""


def _tuples(values: list[tuple[float, ...]]) -> str:
    return ", ".join("(" + ", ".join(f"{x:.6g}" for x in value) + ")" for value in values)


def _input(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return f"bool inputs:{name} = {str(value).lower()}"
    if isinstance(value, tuple):
        return f"color3f inputs:{name} = {value}"
    return f"float inputs:{name} = {value}"


def stage(sweep: Sweep) -> str:
    """A stage with a ball for each step, on striped ground, under a window light and a sky."""
    count = len(sweep.steps)
    parts = []
    for i, step in enumerate(sweep.steps):
        inputs = "\n            ".join(_input(k, v) for k, v in {**sweep.common, **step}.items())
        x = 2.3 * (i - 0.5 * (count - 1))
        parts.append(f"""
    def Material "M{i}" {{
        token outputs:mtlx:surface.connect = </World/M{i}/S.outputs:out>
        def Shader "S" {{
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            {inputs}
            token outputs:out
        }}
    }}
    def Mesh "Ball{i}" (
        prepend apiSchemas = ["MaterialBindingAPI"]
        prepend references = </Ball>
    ) {{
        rel material:binding = </World/M{i}>
        double3 xformOp:translate = ({x}, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}""")
    width = 2.3 * count
    stripes = []
    for j in range(-3, 3):
        shade = 0.5 if j % 2 else 0.08
        z = 0.9 * j
        stripes.append(f"""
    def Mesh "Ground{j + 3}" {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-20, 0, {z}), (-20, 0, {z + 0.9}), (20, 0, {z + 0.9}), (20, 0, {z})]
        color3f[] primvars:displayColor = [({shade}, {shade}, {shade})]
    }}""")
    aperture = 20.0
    distance = 14.0
    focal = aperture * distance / width
    return f"""#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
class Mesh "Ball" {{{sphere()}
}}
def Xform "World" {{{"".join(parts)}{"".join(stripes)}
    def Camera "Camera" {{
        float horizontalAperture = {aperture}
        float verticalAperture = {aperture / count}
        float focalLength = {focal}
        double3 xformOp:translate = (0, {1 + distance * 0.25}, {distance})
        float xformOp:rotateX = {-math.degrees(math.atan(0.25))}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}
    def RectLight "Window" {{
        float inputs:width = 8
        float inputs:height = 3
        float inputs:intensity = 5
        double3 xformOp:translate = (-6, 7, 6)
        float3 xformOp:rotateXYZ = (-45, -40, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }}
    def DomeLight "Sky" {{
        float inputs:intensity = 0.35
    }}
}}
"""


def main() -> int:
    """Render the sweeps and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [sweep.name for sweep in SWEEPS]
    parser.add_argument(
        "sweeps", nargs="*", metavar="SWEEP", help=f"{', '.join(names)}; default: all"
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("out/shaderballs"))
    parser.add_argument("--ball", type=int, default=160, help="size of a ball in pixels")
    parser.add_argument("--spp", type=int, default=128)
    options = parser.parse_args()
    if unknown := [name for name in options.sweeps if name not in names]:
        print(f"no sweep is called {unknown[0]}; there are {', '.join(names)}", file=sys.stderr)
        return 2
    options.output.mkdir(parents=True, exist_ok=True)
    rows, said = [], []
    for sweep in SWEEPS:
        if options.sweeps and sweep.name not in options.sweeps:
            continue
        path = options.output / f"{sweep.name}.usda"
        path.write_text(stage(sweep), encoding="utf-8")
        loaded = wavecomb.load(path)
        said += [f"{sweep.name}: {line}" for line in loaded.report.lines()]
        size = (options.ball * len(sweep.steps), options.ball)
        picture = wavecomb.render(loaded, size=size, spp=options.spp, max_depth=12)
        picture.save(path.with_suffix(".png"))
        steps = ", ".join(
            html.escape("; ".join(f"{k} {v}" for k, v in step.items())) for step in sweep.steps
        )
        rows.append(
            f'<h2>{html.escape(sweep.about)}</h2><img src="{sweep.name}.png" alt=""><p>{steps}</p>'
        )
        print(f"{sweep.name}: {path.with_suffix('.png')}", flush=True)
    page = options.output / "index.html"
    with replacing(page) as part:
        part.write_text(
            '<!doctype html><html lang="en"><meta charset="utf-8"><title>Shader balls</title>'
            "<style>body { font: 14px sans-serif; margin: 2em } img { max-width: 100% }</style>"
            f"<h1>OpenPBR, lobe by lobe</h1><p>{options.spp} samples a pixel.</p>"
            + "\n".join(rows)
            + "</html>\n",
            encoding="utf-8",
        )
    for line in said:
        print(line, file=sys.stderr)
    print(f"Wrote {page}")
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
