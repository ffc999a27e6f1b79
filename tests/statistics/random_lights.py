# SPDX-License-Identifier: Apache-2.0
"""Lights of random scenes: all kinds of UsdLux, large enough to be found by chance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from random_materials import Materials, colour, number
from stages import look_at, matrix, numbers, quad, write_sky

SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


class Lights:
    """Generates random lights as USD text.

    Attributes:
        prims: USD text of the lights.
        features: Names of the special features that were chosen.
        linked: Objects that light linking may refer to.
    """

    def __init__(
        self, random: Generator, folder: Path, materials: Materials, linked: list[str]
    ) -> None:
        self.random = random
        # A separate generator, so that all other choices of a seed stay the same.
        self.shapes = random.spawn(1)[0]
        self.folder = folder
        self.materials = materials
        self.linked = linked
        self.prims: list[str] = []
        self.features: list[str] = []

    def chance(self, p: float) -> bool:
        return bool(self.random.random() < p)

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def add(self) -> None:
        """Add a light of a random kind."""
        kinds = {
            "Dome": 0.18, "Rect": 0.14, "Disk": 0.09, "Sphere": 0.1, "Cylinder": 0.08,
            "Distant": 0.08, "Sun": 0.05, "Point": 0.05, "Panel": 0.15, "MeshLight": 0.08,
        }  # fmt: skip
        kind = str(self.random.choice(list(kinds), p=list(kinds.values())))
        self.features.append(f"{kind.lower()} light")
        name = f"L{len(self.prims)}"
        if kind == "Dome":
            self.prims.append(self.dome(name))
        elif kind == "Panel":
            self.prims.append(self.panel(name, light=False))
        elif kind == "MeshLight":
            self.prims.append(self.panel(name, light=True))
        else:
            self.prims.append(self.lamp(name, kind))

    def strength(self, scale: float) -> str:
        return colour(self.random.uniform(0.3, 1.0, 3) * scale)

    def above(self) -> Any:
        """A random transform above the objects that faces down."""
        angle, reach = self.between(0, 2 * np.pi), self.between(0.3, 1.6)
        eye = (reach * np.cos(angle), self.between(2.2, 2.8), reach * np.sin(angle))
        return look_at(eye, (self.between(-0.5, 0.5), 0.2, self.between(-0.5, 0.5)))

    def dome(self, name: str) -> str:
        lines = [f"color3f inputs:color = {self.strength(0.6)}"]
        if self.chance(0.5):
            self.features.append("sky")
            write_sky(self.folder, 32)
            lines.append("asset inputs:texture:file = @sky.exr@")
        if self.chance(0.4):
            self.features.append("portal")
            portal = name + "Portal"
            lines.append(f"rel portals = </World/{portal}>")
            self.prims.append(f"""def PortalLight "{portal}" {{
                float inputs:width = 3
                float inputs:height = 2
                {matrix(self.above())}
            }}""")
        return self.write("Dome", name, lines, [], shaped=False)

    def lamp(self, name: str, kind: str) -> str:
        lines, apis = [], []
        size = self.between(1.2, 2.2)
        strengths = {"Distant": 1.5, "Sun": 1.5, "Point": 6.0}
        lines.append(f"color3f inputs:color = {self.strength(strengths.get(kind, 3.0))}")
        lines.append(matrix(self.above()))
        if kind == "Rect":
            lines += [f"float inputs:width = {size:.3f}", f"float inputs:height = {size / 2:.3f}"]
            if self.chance(0.4):
                self.features.append("light texture")
                lines.append(f"asset inputs:texture:file = @{self.materials.image(4, 0.0, 1.0)}@")
        elif kind == "Disk":
            lines.append(f"float inputs:radius = {size / 2:.3f}")
        elif kind == "Sphere":
            lines.append(f"float inputs:radius = {size / 3:.3f}")
        elif kind == "Cylinder":
            lines += [f"float inputs:length = {size:.3f}", f"float inputs:radius = {size / 5:.3f}"]
        elif kind == "Distant":
            lines.append(f"float inputs:angle = {self.between(40, 80):.3f}")
        elif kind == "Sun":
            lines.append("float inputs:angle = 0")
        elif kind == "Point":
            lines += ["float inputs:radius = 0.1", "bool treatAsPoint = 1"]
        if kind != "Point" and self.chance(0.1):
            self.features.append("normalized")
            lines.append("bool inputs:normalize = 1")
        shaped = kind not in ("Distant", "Sun") and self.chance(0.3)
        kind = {"Sun": "Distant", "Point": "Sphere"}.get(kind, kind)
        return self.write(kind, name, lines, apis, shaped=shaped)

    def panel(self, name: str, *, light: bool) -> str:
        """Add an emissive square: by its material only, or as a mesh light."""
        cut = not light and self.chance(0.55)
        half = self.between(0.7, 1.2)
        corners = [(-half, half, 0), (half, half, 0), (half, -half, 0), (-half, -half, 0)]
        material = self.materials.glowing(cut=cut)
        if not light:
            return quad(name, corners, material, uv=SQUARE, transform=self.above())
        modes = ["materialGlowTintsLight", "independent", "noMaterialResponse"]
        mode = str(self.random.choice(modes))
        self.features.append(mode)
        lines = [
            f"color3f inputs:color = {self.strength(2.0)}",
            f'uniform token light:materialSyncMode = "{mode}"',
            f"point3f[] points = {numbers(corners)}",
            "int[] faceVertexCounts = [4]",
            "int[] faceVertexIndices = [0, 1, 2, 3]",
            'uniform token subdivisionScheme = "none"',
            f'texCoord2f[] primvars:st = {numbers(SQUARE)} ( interpolation = "vertex" )',
            f"rel material:binding = </World/{material}>",
            matrix(self.above()),
        ]
        apis = ["MeshLightAPI", "MaterialBindingAPI"]
        return self.write("Mesh", name, lines, apis, shaped=self.chance(0.2))

    def write(
        self, kind: str, name: str, lines: list[str], apis: list[str], *, shaped: bool
    ) -> str:
        """The prim with random attributes that all kinds of lights have."""
        if shaped:
            apis = [*apis, "ShapingAPI"]
            lines = lines + self.shaping()
        if self.chance(0.2):
            self.features.append("multipliers")
            lines = [
                *lines,
                f"float inputs:diffuse = {self.between(0, 2):.3f}",
                f"float inputs:specular = {self.between(0, 2):.3f}",
            ]
        if kind in ("Rect", "Disk", "Sphere", "Cylinder") and self.shapes.random() < 0.12:
            self.features.append("hidden from the camera")
            lines = [*lines, "bool primvars:wavecomb:visibility:camera = 0"]
        for link in ("lightLink", "shadowLink"):
            if self.linked and self.chance(0.15):
                self.features.append(link)
                out = str(self.random.choice(self.linked))
                lines = [*lines, f"rel collection:{link}:excludes = </World/{out}>"]
        if self.chance(0.05):
            self.features.append("no shadows")
            apis = [*apis, "ShadowAPI"]
            lines = [*lines, "bool inputs:shadow:enable = 0"]
        schema = ", ".join(f'"{api}"' for api in apis)
        head = f"( prepend apiSchemas = [{schema}] )" if apis else ""
        word = kind if kind == "Mesh" else f"{kind}Light"
        return f'def {word} "{name}" {head} {{\n        ' + "\n        ".join(lines) + "\n    }"

    def shaping(self) -> list[str]:
        way = str(self.random.choice(["cone", "focus", "ies"]))
        self.features.append(way)
        if way == "cone":
            return [
                f"float inputs:shaping:cone:angle = {self.between(40, 80):.2f}",
                f"float inputs:shaping:cone:softness = {number(self.between(0, 1))}",
            ]
        if way == "focus":
            return [
                f"float inputs:shaping:focus = {self.between(0.5, 3):.2f}",
                f"color3f inputs:shaping:focusTint = {self.strength(0.5)}",
            ]
        candela = " ".join(number(v) for v in self.random.uniform(0.2, 2.0, 10))
        (self.folder / "lamp.ies").write_text(
            "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 5 2 1 2 0 0 0\n1 1 10\n"
            f"0 30 60 90 180\n0 90\n{candela}\n"
        )
        return ["asset inputs:shaping:ies:file = @lamp.ies@"]
