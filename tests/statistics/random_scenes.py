# SPDX-License-Identifier: Apache-2.0
"""Small random scenes that combine features: a floor, some objects, lights and settings.

The seed determines everything in a scene. Lights are large and close and lobes are wide, so that
uniform directions find them; images are tiny and paths short.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from random_enclosures import KINDS, Enclosures
from random_lights import SQUARE, Lights
from random_materials import Materials
from stages import camera, matrix, mesh, moved, quad, sphere, turned, write_stage

PLACES = [(-1.05, 0.75, 0.2), (1.05, 0.75, -0.1), (0.0, 0.7, 1.1), (0.1, 1.5, -1.0)]


@dataclass
class RandomScene:
    """A stage on disk, with the settings to render it.

    Attributes:
        stage: The file.
        load: Options of ``wavecomb.load``.
        settings: Render settings that may change noise but not the mean.
        depth: max_depth.
        schlick: Whether Schlick's approximation replaces exact Fresnel.
        delta: Whether a material has a perfectly smooth lobe.
        features: Names of the features that the scene combines.
        single_light: Whether hiding the only light leaves the image unchanged: an area light
            without other emitters, no perfectly smooth lobes, and one scattering event at most.
    """

    stage: Path
    load: dict[str, Any]
    settings: dict[str, Any]
    depth: int
    schlick: bool
    delta: bool
    features: list[str] = field(default_factory=list)
    single_light: bool = False


class Objects:
    """Generates random objects as USD text."""

    def __init__(self, random: Generator, materials: Materials) -> None:
        self.random = random
        self.materials = materials
        self.prims: list[str] = []
        self.names: list[str] = []
        self.features: list[str] = []
        self.load: dict[str, Any] = {}
        self.moves = False

    def chance(self, p: float) -> bool:
        return bool(self.random.random() < p)

    def add(self, centre: Any) -> None:
        """Add an object at a point."""
        name = f"O{len(self.names)}"
        self.names.append(name)
        kinds = ["ball", "smooth ball", "box", "panel", "cage", "instances", "points", "gprim"]
        kind = str(self.random.choice(kinds, p=[0.13, 0.13, 0.15, 0.2, 0.12, 0.15, 0.05, 0.07]))
        self.features.append(kind)
        material = self.materials.surface()
        spin = turned(*self.random.uniform(-40, 40, 3))
        place = spin @ moved(*centre)
        if self.chance(0.1):
            self.features.append("mirrored")
            place = np.diag((-1.0, 1.0, 1.0, 1.0)) @ place
        where = matrix(place)
        if self.chance(0.15) and kind != "instances":
            self.features.append("moving")
            self.moves = True
            where = self.moving(place)
        text = self.body(kind, name, material)
        if kind == "instances":
            self.prims.append(self.instances(text, name, centre))
        else:
            head, rest = text.split("{", 1)
            self.prims.append(f"{head}{{\n{where}\n{rest}")

    def moving(self, place: Any) -> str:
        to = place @ moved(*self.random.uniform(-0.5, 0.5, 3))
        rows = [
            "( " + ", ".join("(" + ", ".join(f"{v:.9g}" for v in r) + ")" for r in m) + " )"
            for m in (place, to)
        ]
        return (
            f"matrix4d xformOp:transform.timeSamples = {{ 0: {rows[0]}, 1: {rows[1]} }}\n"
            'uniform token[] xformOpOrder = ["xformOp:transform"]'
        )

    def body(self, kind: str, name: str, material: str) -> str:
        """The prim at the origin, before its transform."""
        size = float(self.random.uniform(0.5, 0.7))
        if kind in ("ball", "smooth ball"):
            return sphere(name, material, radius=size, rings=8, smooth=kind == "smooth ball")
        if kind in ("panel", "instances"):
            corners = [(-size, -size, 0), (size, -size, 0), (size, size, 0), (-size, size, 0)]
            grown = np.asarray(corners) * 1.3
            return quad(name, grown, material, uv=SQUARE)
        if kind == "gprim":
            bound = f"rel material:binding = </World/{material}>"
            word = str(self.random.choice(["Sphere", "Cube", "Cylinder", "Cone"]))
            value = {"Cube": f"double size = {2 * size}", "Sphere": f"double radius = {size}"}.get(
                word, f"double radius = {size}\ndouble height = {size}"
            )
            return (
                f'def {word} "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] ) '
                f"{{\n{value}\n{bound}\n}}"
            )
        if kind == "points":
            return f"""def Points "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{
                point3f[] points = [(-0.3, 0, 0), (0.35, 0.1, 0.1), (0, 0.4, -0.2)]
                float[] widths = [0.6, 0.7, 0.5] ( interpolation = "vertex" )
                rel material:binding = </World/{material}>
            }}"""
        low, high = -0.8 * size, 0.8 * size
        points = [(x, y, z) for x in (low, high) for y in (low, high) for z in (low, high)]
        faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        text = mesh(name, points, faces, material, uv=[SQUARE[i % 4] for i in range(8)])
        if kind == "cage":
            self.load["subdivision"] = int(self.random.integers(1, 4))
            text = text.replace('subdivisionScheme = "none"', 'subdivisionScheme = "catmullClark"')
        return text

    def instances(self, text: str, name: str, centre: Any) -> str:
        """The prim as prototype of two instances."""
        rows = [
            turned(*self.random.uniform(-40, 40, 3)) @ moved(*(np.asarray(centre) + shift))
            for shift in ((-0.3, 0.0, 0.0), (0.3, 0.2, -0.4))
        ]
        inner = "\n".join(
            f'def Xform "I{i}" ( instanceable = true\nreferences = </World/{name}Shape> )'
            f" {{\n{matrix(m)}\n}}"
            for i, m in enumerate(rows)
        )
        shape = f'class Xform "{name}Shape" {{\n{text}\n}}'
        return f'{shape}\ndef Xform "{name}" {{\n{inner}\n}}'


def view(random: Generator, features: list[str], *, moves: bool) -> tuple[str, dict[str, Any]]:
    """A camera that sees all objects, and its render options."""
    load: dict[str, Any] = {}
    angle = random.uniform(-0.6, 0.6)
    eye = (6 * np.sin(angle), random.uniform(2, 4), 6 * np.cos(angle))
    lens = ""
    if random.random() < 0.15:
        features.append("lens")
        lens = "float fStop = 2\nfloat focusDistance = 6"
    if moves:
        lens += "\ndouble shutter:open = 0\ndouble shutter:close = 1"
        load["frame"] = 0.0
    text = camera(eye, (0, 0.7, 0), half=0.42, lens=lens)
    if random.random() < 0.1:
        features.append("orthographic")
        text = text.replace(
            "float focalLength", 'token projection = "orthographic"\nfloat focalLength'
        )
        text = text.replace("Aperture = 42.0", "Aperture = 50.0")
    return text, load


def settings(random: Generator, features: list[str]) -> dict[str, Any]:
    """Random settings that change noise but not the mean."""

    def one(*values: Any) -> Any:
        return values[int(random.integers(len(values)))]

    chosen = {
        "sampler": one("independent", "independent", "sobol"),
        "roulette": one("off", "off", "throughput", "cost-aware"),
        "roulette_depth": 1,
        # Matches the naive integrator: stochastic texel lookups change the mean where shading is
        # not linear.
        "texture_filter": "whole",
        "light_selection": one("auto", "tree", "power"),
        "cosine_sampling": bool(random.random() < 0.15),
        "policy": one("program", "none", "material", "texture-locality"),
        "integrator": one("wavefront", "wavefront", "wavefront", "reference"),
    }
    features += [str(chosen["sampler"]), f"roulette {chosen['roulette']}"]
    features.append(f"lights by {chosen['light_selection']}")
    if chosen["cosine_sampling"]:
        features.append("cosine sampling")
    return chosen


def enclosed(
    seed: int, materials: Materials, objects: Objects, places: list[Any], depth: int
) -> tuple[Enclosures, int, bool]:
    """Add the enclosure of a seed, for comparisons of settings.

    Returns:
        The enclosure, the max_depth of the stage, and whether it contains the only light.
    """
    random = np.random.default_rng((53, seed))
    enclosures = Enclosures(random, materials)
    kind = seed % (len(KINDS) + 1)
    if kind < len(KINDS):
        enclosures.add(KINDS[kind], places[int(random.integers(len(places)))])
    objects.prims += enclosures.prims
    # Textures need paths of one scattering event at most, as in stages without enclosures.
    depths, shares = ([0, 1], [0.25, 0.75]) if depth == 1 else ([2, 3, 6], [0.4, 0.3, 0.3])
    alone = enclosures.lights > 0 and bool(random.random() < 0.5)
    return enclosures, int(random.choice(depths, p=shares)), alone


def make_scene(seed: int, folder: Path, *, enclosure: bool = False) -> RandomScene:
    """Write the stage of a seed and its files to an empty folder.

    Args:
        seed: Determines everything in the scene.
        folder: The empty folder.
        enclosure: Add an enclosure of ``random_enclosures``. Such stages only serve to compare
            settings: the naive integrator has no subsurface and would miss small lights.
    """
    random = np.random.default_rng(seed)
    depth = int(random.choice([1, 2, 3], p=[0.6, 0.32, 0.08]))
    features: list[str] = []
    materials = Materials(random, folder, depth)
    floor = materials.of(str(random.choice(["diffuse", "plastic", "principled", "openpbr"])))
    half = 3.0
    corners = [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)]
    prims = [quad("Floor", corners, floor, uv=SQUARE)]
    objects = Objects(random, materials)
    order = [PLACES[k] for k in random.permutation(len(PLACES))]
    taken = int(random.integers(1, 4))
    for place in order[:taken]:
        objects.add(place)
    lights = Lights(random, folder, materials, ["Floor", *objects.names])
    for _ in range(int(random.integers(1, 4))):
        lights.add()
    load: dict[str, Any] = {**objects.load, "size": (32, 32)}
    if random.random() < 0.15:
        features.append("hidden lights")
        load["lights"] = "hidden"
    text, more = view(random, features, moves=objects.moves)
    chosen = settings(random, features)
    schlick = bool(random.random() < 0.1)
    single = False
    if enclosure:
        added, depth, alone = enclosed(seed, materials, objects, order[taken:], depth)
        if alone:
            features.append("no other light")
            lights.prims.clear()
            lights.features.clear()
        features += added.features
        materials.delta = materials.delta or added.delta
        single = depth == 1 and is_single(lights, materials, added)
    stage = write_stage(
        folder / "stage.usda", text, *materials.prims, *prims, *objects.prims, *lights.prims
    )
    if objects.moves:
        head = stage.read_text().replace("(\n", "(\nstartTimeCode = 0\nendTimeCode = 1\n", 1)
        stage.write_text(head)
    return RandomScene(
        stage=stage,
        load=load | more,
        settings=chosen,
        depth=depth,
        schlick=schlick,
        delta=materials.delta,
        features=[*materials.features, *objects.features, *lights.features, *features],
        single_light=single,
    )


def is_single(lights: Lights, materials: Materials, added: Enclosures) -> bool:
    """Whether hiding the lights of a stage changes only camera rays that hit them."""
    area = {"rect light", "disk light", "sphere light", "cylinder light"}
    outside = [word for word in lights.features if word.endswith(" light")]
    emissive = "glow" in materials.features or "emissive ball inside" in added.features
    known = all(word in area for word in outside)
    return len(lights.prims) + added.lights == 1 and known and not emissive and not materials.delta
