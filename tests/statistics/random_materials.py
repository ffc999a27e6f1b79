# SPDX-License-Identifier: Apache-2.0
"""Materials of random scenes: any program, textures, presence, emission; with wide lobes.

Lobes narrower than roughness 0.4 are left to the chi-square tests, since uniform directions hardly
find such lobes. Perfectly smooth lobes are included: the naive integrator follows each one
explicitly.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from wavecomb.image.files.image import write_png_codes


def number(value: float) -> str:
    return f"{value:.4g}"


def colour(values: Any) -> str:
    return "(" + ", ".join(number(v) for v in values) + ")"


class Materials:
    """Generates random materials as USD text.

    Attributes:
        prims: USD text of the materials.
        features: Names of the special features that were chosen.
        delta: Whether a material has a perfectly smooth lobe.
    """

    def __init__(self, random: Generator, folder: Path, depth: int) -> None:
        self.random = random
        self.folder = folder
        self.prims: list[str] = []
        self.features: list[str] = []
        self.delta = False
        # Later vertices filter textures by the ray cone of the sampled lobe, which the naive
        # integrator's uniform directions do not have; and textured parameters are not linear.
        self.plain = depth > 1

    def chance(self, p: float) -> bool:
        return bool(self.random.random() < p)

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def tint(self, low: float = 0.15, high: float = 0.85) -> str:
        return colour(self.random.uniform(low, high, 3))

    def rough(self) -> str:
        return number(self.between(0.4, 1.0))

    def image(self, texels: int, low: float, high: float) -> str:
        """Write a file of random texels."""
        path = self.folder / f"{len(list(self.folder.glob('*.png')))}.png"
        pixels = self.random.uniform(255 * low, 255 * high, (texels, texels, 3))
        write_png_codes(path, pixels.astype(np.uint8))
        return path.name

    def surface(self) -> str:
        """Add a material of a random kind and return its path."""
        kinds = ["diffuse", "metal", "dielectric", "plastic", "principled", "openpbr"]
        weights = [0.22, 0.13, 0.12, 0.16, 0.22, 0.15]
        return self.of(str(self.random.choice(kinds, p=weights)))

    def of(self, program: str) -> str:
        """Add a material of a program and return its path."""
        self.features.append(program)
        if program == "openpbr":
            return self.open_pbr()
        inputs: dict[str, str] = {"color3f diffuseColor": self.tint()}
        nodes: dict[str, tuple[str, str]] = {}
        may_be_smooth = program in ("metal", "dielectric", "plastic")
        smooth = may_be_smooth and self.chance(0.3)
        if program not in ("diffuse", "emissive"):
            inputs["float roughness"] = "0" if smooth else self.rough()
            if smooth:
                self.features.append(f"smooth {program}")
                self.delta = True
        if program in ("dielectric", "plastic"):
            # Rough glass with an index near 1 has a lobe as narrow as a mirror's.
            low = 1.45 if program == "dielectric" and not smooth else 1.2
            inputs["float ior"] = number(self.between(low, 2.0))
        if program == "dielectric":
            inputs["color3f diffuseColor"] = self.tint(0.6, 1.0)
        if program == "principled":
            self.principled(inputs, nodes)
        if program != "dielectric" and not self.plain and self.chance(0.3):
            self.features.append("textured")
            nodes["color3f diffuseColor"] = (self.image(2, 0.1, 0.9), "rgb")
        return self.write(program, inputs, nodes)

    def principled(self, inputs: dict[str, str], nodes: dict[str, tuple[str, str]]) -> None:
        """Choose the layers of UsdPreviewSurface."""
        if self.chance(0.3):
            inputs["float metallic"] = number(self.between(0.2, 1.0))
        if self.chance(0.3):
            inputs["float clearcoat"] = number(self.between(0.3, 1.0))
            smooth = self.chance(0.3)
            inputs["float clearcoatRoughness"] = "0" if smooth else self.rough()
            self.delta = self.delta or smooth
            self.features.append("smooth clearcoat" if smooth else "clearcoat")
        if self.chance(0.2):
            inputs["int useSpecularWorkflow"] = "1"
            inputs["color3f specularColor"] = self.tint(0.02, 0.5)
        if self.chance(0.4):
            self.opacity(inputs, nodes, may_transmit=True)
        if self.chance(0.15):
            self.glow(inputs, nodes, 0.5)

    def opacity(
        self, inputs: dict[str, str], nodes: dict[str, tuple[str, str]], *, may_transmit: bool
    ) -> None:
        """Choose a cut-out by presence or threshold, or transparency."""
        ways = ["presence", "threshold", "transparent", "transparent"]
        way = str(self.random.choice(ways if may_transmit else ways[:2]))
        self.features.append(way)
        inputs["float opacity"] = number(self.between(0.2, 0.8))
        if way == "transparent":
            self.delta = True
        if way == "presence":
            inputs["token opacityMode"] = '"presence"'
        if way == "threshold":
            inputs["float opacityThreshold"] = "0.5"
        if way == "threshold" or self.chance(0.4):
            what = "transparency texture" if way == "transparent" else "opacity texture"
            self.features.append(what)
            nodes["float opacity"] = (self.image(8, 0.0, 1.0), "r")

    def glow(
        self, inputs: dict[str, str], nodes: dict[str, tuple[str, str]], strength: float
    ) -> None:
        """Make a material emissive."""
        self.features.append("glow")
        inputs["color3f emissiveColor"] = colour(self.random.uniform(0.3, 1.0, 3) * strength)
        if self.chance(0.3):
            self.features.append("glow texture")
            nodes["color3f emissiveColor"] = (self.image(2, 0.1, 1.0), "rgb")

    def glowing(self, *, cut: bool) -> str:
        """Add an emissive material, with cut-outs if ``cut``; return its path."""
        inputs: dict[str, str] = {"color3f diffuseColor": self.tint(), "float roughness": "0.6"}
        nodes: dict[str, tuple[str, str]] = {}
        self.glow(inputs, nodes, 3.0)
        if not cut and self.chance(0.4):
            inputs = {name: text for name, text in inputs.items() if "emissive" in name}
            return self.write("emissive", inputs, nodes)
        if cut:
            self.features.append("glow that is cut out")
            self.opacity(inputs, nodes, may_transmit=False)
        return self.write("principled", inputs, nodes)

    def open_pbr(self) -> str:
        """Add a MaterialX open_pbr_surface with random inputs; return its path."""
        inputs = {
            "color3f base_color": self.tint(),
            "float base_diffuse_roughness": number(self.between(0.0, 1.0)),
            "float specular_roughness": self.rough(),
            "float specular_weight": number(self.between(0.0, 1.0)),
        }
        if self.chance(0.3):
            inputs["float base_metalness"] = number(self.between(0.3, 1.0))
        if self.chance(0.3):
            self.features.append("coat")
            inputs["float coat_weight"] = number(self.between(0.3, 1.0))
            inputs["float coat_roughness"] = self.rough()
            inputs["color3f coat_color"] = self.tint(0.4, 1.0)
        if self.chance(0.25):
            self.features.append("fuzz")
            inputs["float fuzz_weight"] = number(self.between(0.3, 1.0))
        if self.chance(0.3):
            self.features.append("transmission")
            inputs["float transmission_weight"] = number(self.between(0.3, 1.0))
            inputs["color3f transmission_color"] = self.tint(0.4, 1.0)
            inputs["float transmission_depth"] = number(self.between(0.5, 2.0))
        if self.chance(0.15):
            inputs["bool geometry_thin_walled"] = "true"
            inputs["float subsurface_weight"] = "0.5"
            self.clear_wall(inputs)
        if self.chance(0.1):
            self.features.append("film")
            inputs["float thin_film_weight"] = "1"
        return self.open_pbr_of(inputs)

    def clear_wall(self, inputs: dict[str, str]) -> None:
        """Make a thin wall smooth, so that rays pass straight, if it transmits much light."""
        if float(inputs.get("float transmission_weight", "0")) < 0.55:
            return
        self.delta = True
        self.features.append("clear wall")
        for name in ("float specular_roughness", "float coat_roughness"):
            if name in inputs:
                inputs[name] = "0"

    def open_pbr_of(self, inputs: dict[str, str]) -> str:
        """Add an open_pbr_surface with given inputs ("type name" to value); return its path."""
        name = f"M{len(self.prims)}"
        lines = "\n".join(
            f"{key.split()[0]} inputs:{key.split()[1]} = {value}" for key, value in inputs.items()
        )
        self.prims.append(f"""def Material "{name}" {{
        token outputs:mtlx:surface.connect = </World/{name}/S.outputs:out>
        def Shader "S" {{
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            {lines}
            token outputs:out
        }}
    }}""")
        return name

    def write(self, program: str, inputs: dict[str, str], nodes: dict[str, tuple[str, str]]) -> str:
        """Add a UsdPreviewSurface; ``nodes`` maps inputs to image and channel."""
        name = f"M{len(self.prims)}"
        lines, readers = [], []
        for key, value in inputs.items():
            kind, word = key.split()
            if key not in nodes:
                lines.append(f"{kind} inputs:{word} = {value}")
        for key, (image, channel) in nodes.items():
            kind, word = key.split()
            lines.append(f"{kind} inputs:{word}.connect = </World/{name}/{word}.outputs:{channel}>")
            scale = "(4, 4, 4, 1)" if word == "emissiveColor" else "(1, 1, 1, 1)"
            readers.append(f"""def Shader "{word}" {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @{image}@
                token inputs:sourceColorSpace = "raw"
                token inputs:wrapS = "clamp"
                token inputs:wrapT = "clamp"
                float4 inputs:scale = {scale}
                float2 inputs:st.connect = </World/{name}/St.outputs:result>
                float3 outputs:rgb
                float outputs:r
            }}""")
        if readers:
            readers.append("""def Shader "St" {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }""")
        body, rest = "\n            ".join(lines), "\n        ".join(readers)
        self.prims.append(f"""def Material "{name}" {{
        custom string wavecomb:program = "{program}"
        token outputs:surface.connect = </World/{name}/Surface.outputs:surface>
        def Shader "Surface" {{
            uniform token info:id = "UsdPreviewSurface"
            token outputs:surface
            {body}
        }}
        {rest}
    }}""")
        return name
