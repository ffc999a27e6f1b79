# SPDX-License-Identifier: Apache-2.0
"""Enclosures of random scenes: shells around lights, thin walls, nested glass, touching lights.

Sampling techniques disagree most easily where light passes through a closed surface: shadow rays
start at offset origins, end on close lights, and cross boundaries of media.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from random_lights import SQUARE
from random_materials import Materials, colour, number
from stages import box, matrix, moved, quad, sphere, turned

KINDS = ("lit shell", "thin wall", "lit subsurface", "nested glass", "touching light")
"""Kinds of enclosures. Consecutive seeds cycle through the kinds of enclosures; every sixth seed
has none.
"""


class Enclosures:
    """Generates random enclosures as USD text.

    Attributes:
        prims: USD text of the objects and lights.
        features: Names of the special features that were chosen.
        lights: Number of lights that were added.
        delta: Whether a material has a perfectly smooth lobe.
    """

    def __init__(self, random: Generator, materials: Materials) -> None:
        self.random = random
        self.materials = materials
        self.prims: list[str] = []
        self.features: list[str] = []
        self.lights = 0
        self.delta = False

    def chance(self, p: float) -> bool:
        return bool(self.random.random() < p)

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def add(self, kind: str, centre: Any) -> None:
        """Add an enclosure of a kind in ``KINDS`` around a point."""
        self.features.append(kind)
        {
            "lit shell": self.lit_shell,
            "thin wall": self.thin_wall,
            "lit subsurface": self.lit_subsurface,
            "nested glass": self.nested_glass,
            "touching light": self.touching_light,
        }[kind](np.asarray(centre, np.float64))

    def light(self, kind: str, at: Any, size: float, power: float, spin: Any = None) -> None:
        """Add a light of about the given size; its radiance compensates for a small area."""
        place = (np.eye(4) if spin is None else spin) @ moved(*at)
        radiance = colour(self.random.uniform(0.5, 1.0, 3) * power / size**2)
        extent = {
            "Sphere": f"float inputs:radius = {number(size)}",
            "Disk": f"float inputs:radius = {number(size)}",
            "Rect": f"float inputs:width = {number(2 * size)}\n"
            f"float inputs:height = {number(2 * size)}",
            "Cylinder": f"float inputs:radius = {number(0.5 * size)}\n"
            f"float inputs:length = {number(2 * size)}",
        }[kind]
        self.features.append(f"{kind.lower()} light inside")
        self.prims.append(
            f'def {kind}Light "E{len(self.prims)}" {{\n{extent}\n'
            f"color3f inputs:color = {radiance}\n{matrix(place)}\n}}"
        )
        self.lights += 1

    def inner_light(self, at: Any, size: float, power: float = 0.7) -> None:
        """Add a light of any kind, or an emissive ball, inside an object."""
        if self.chance(0.15):
            self.features.append("emissive ball inside")
            value = colour(self.random.uniform(0.5, 1.0, 3) * power / size**2)
            shade = self.materials.write("emissive", {"color3f emissiveColor": value}, {})
            self.prims.append(sphere(f"E{len(self.prims)}", shade, at, size, rings=4))
            return
        kind = str(self.random.choice(["Sphere", "Sphere", "Rect", "Disk", "Cylinder"]))
        self.light(kind, at, size, power, turned(*self.random.uniform(-180, 180, 3)))

    def closed(
        self, material: str, centre: Any, size: float, *, smooth: bool | None = None
    ) -> None:
        """Add a closed shape: a smooth or faceted ball, or a box."""
        name = f"E{len(self.prims)}"
        smooth = self.chance(0.6) if smooth is None else smooth
        if smooth or self.chance(0.5):
            self.features.append("smooth shell" if smooth else "faceted shell")
            ball = sphere(name, material, centre, size, rings=16, smooth=smooth)
            self.prims.append(ball)
            return
        self.features.append("box shell")
        low, high = np.asarray(centre) - 0.8 * size, np.asarray(centre) + 0.8 * size
        self.prims.append(box(name, low, high, material))

    def thin(self) -> str:
        """A thin-walled material that transmits light."""
        inputs = {
            "bool geometry_thin_walled": "true",
            "float specular_weight": number(self.between(0.0, 1.0)),
            "float specular_roughness": self.materials.rough(),
            "float subsurface_weight": number(self.between(0.5, 1.0)),
            "color3f subsurface_color": self.materials.tint(0.5, 0.9),
        }
        if self.chance(0.3):
            self.features.append("thin transmission")
            inputs["float transmission_weight"] = number(self.between(0.3, 0.8))
            self.materials.clear_wall(inputs)
            self.delta = self.delta or self.materials.delta
        return self.materials.open_pbr_of(inputs)

    def glass(self, *, absorbs: bool) -> str:
        """Rough or smooth glass; OpenPBR if it absorbs."""
        smooth = self.chance(0.25)
        self.delta = self.delta or smooth
        rough = "0" if smooth else number(self.between(0.3, 0.8))
        self.features.append("smooth glass" if smooth else "rough glass")
        if not absorbs and self.chance(0.5):
            inputs = {
                "float roughness": rough,
                "float ior": number(self.between(1.3, 1.7)),
                "color3f diffuseColor": self.materials.tint(0.7, 1.0),
            }
            return self.materials.write("dielectric", inputs, {})
        inputs = {
            "float transmission_weight": "1",
            "float specular_roughness": rough,
            "float specular_ior": number(self.between(1.3, 1.7)),
        }
        if absorbs:
            inputs["color3f transmission_color"] = self.materials.tint(0.3, 0.8)
            inputs["float transmission_depth"] = number(self.between(0.2, 1.0))
        return self.materials.open_pbr_of(inputs)

    def lit_shell(self, centre: Any) -> None:
        """Add a closed thin-walled or rough glass shell around a light, like a lampshade."""
        size = self.between(0.5, 0.7)
        material = self.thin() if self.chance(0.6) else self.glass(absorbs=False)
        self.closed(material, centre, size, smooth=self.chance(0.75))
        self.inner_light(centre + self.random.uniform(-0.1, 0.1, 3), self.between(0.1, 0.25))

    def thin_wall(self, centre: Any) -> None:
        """Add one or several thin panels close to a light."""
        material = self.thin()
        for k in range(int(self.random.integers(1, 3))):
            place = turned(*self.random.uniform(-30, 30, 3)) @ moved(
                *(centre + np.array((0.0, 0.0, 0.3 * k)))
            )
            corners = np.asarray([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * 0.6
            name = f"E{len(self.prims)}"
            self.prims.append(quad(name, corners, material, uv=SQUARE, transform=place))
        behind = centre - np.array((0.0, 0.0, self.between(0.1, 0.5)))
        self.inner_light(behind, self.between(0.1, 0.3), 1.0)

    def lit_subsurface(self, centre: Any) -> None:
        """Add a closed body with subsurface scattering that contains a light, a body or both."""
        size = self.between(0.5, 0.7)
        inputs = {
            "float specular_weight": number(self.between(0.0, 0.6)),
            "float specular_roughness": self.materials.rough(),
            "float subsurface_weight": number(self.between(0.6, 1.0)),
            "color3f subsurface_color": self.materials.tint(0.4, 0.9),
            "float subsurface_radius": number(self.between(0.01, 0.3)),
        }
        self.closed(self.materials.open_pbr_of(inputs), centre, size)
        self.inner_light(centre, self.between(0.15, 0.3), 1.5)
        if self.chance(0.3):
            self.features.append("body inside")
            at = centre + np.array((0.25, 0.0, 0.0))
            self.prims.append(box(f"E{len(self.prims)}", at - 0.1, at + 0.1, self.opaque()))

    def opaque(self) -> str:
        """A diffuse material."""
        return self.materials.write("diffuse", {"color3f diffuseColor": self.materials.tint()}, {})

    def nested_glass(self, centre: Any) -> None:
        """Add an opaque or glass object inside absorbing glass, sometimes with a light."""
        size = self.between(0.55, 0.75)
        self.closed(self.glass(absorbs=True), centre, size)
        inner = self.opaque() if self.chance(0.6) else self.glass(absorbs=self.chance(0.6))
        at = centre + self.random.uniform(-0.1, 0.1, 3)
        self.closed(inner, at, 0.45 * size)
        if self.chance(0.4):
            self.inner_light(centre + np.array((0.0, 0.33, 0.0)), 0.12, 0.5)

    def touching_light(self, centre: Any) -> None:
        """Add a light that touches or cuts a surface, or lies just above it."""
        way = str(self.random.choice(["tangent", "sunk", "edge", "close", "cut"]))
        self.features.append(f"light {way}")
        x, _, z = centre
        size = self.between(0.2, 0.4)
        if way == "tangent":
            self.light("Sphere", (x, size, z), size, 0.7)
        elif way == "sunk":
            self.light("Sphere", (x, self.between(-0.3, 0.6) * size, z), size, 0.7)
        elif way == "edge":
            spin = turned(y=self.between(-180, 180))
            self.light("Rect", (x, size, z), size, 1.0, spin)
        elif way == "close":
            # A disk light slightly above the floor, facing up or down.
            spin = turned(x=90.0 if self.chance(0.5) else -90.0)
            self.light("Disk", (x, 1e-3, z), size, 0.7, spin)
        else:
            corners = np.asarray([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * 0.6
            place = turned(y=self.between(-40, 40)) @ moved(*centre)
            material = self.thin() if self.chance(0.5) else self.opaque()
            self.prims.append(
                quad(f"E{len(self.prims)}", corners, material, uv=SQUARE, transform=place)
            )
            self.light("Sphere", centre, size, 0.7)
