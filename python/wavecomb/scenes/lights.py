# SPDX-License-Identifier: Apache-2.0
"""Stages for measuring light selection: a street at night and a photo studio.

``SceneOptions.lights`` sets the number of lights of the street. The length and total power of the
street do not depend on
the number of lights; a larger number makes each light smaller. The lights cycle through five kinds,
and their powers differ by a factor of up to 100:

- windows: rectangles on the facades, facing the street;
- lamps: disks that emit downwards;
- bulbs: spheres on strings across the street;
- signs: emissive boxes of 12 triangles at the facades;
- strips: emissive quads at the kerbs, of 2 triangles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom, UsdLux

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.stage import BOX, BOX_CORNERS, StageWriter
from wavecomb.scenes.models.teapot import teapot
from wavecomb.scenes.options import SceneOptions

MAX_LIGHTS = 200_000
_LENGTH, _HALF_WIDTH, _HEIGHT = 60.0, 5.0, 12.0
_POWER = 3000.0  # power of all lights together, in W
_SIGN_COLOURS = 16
_KINDS = ("Window", "Lamp", "Bulb", "Sign", "Strip")


def build_lights(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a street with ``options.lights`` lights."""
    if not 1 <= options.lights <= MAX_LIGHTS:
        raise SceneError(f"lights: lights must be from 1 to {MAX_LIGHTS}, not {options.lights}")
    rng = np.random.default_rng([options.seed, 1001])
    _street(writer, rng)
    count = options.lights
    power = np.exp(rng.uniform(np.log(0.1), np.log(10.0), count))
    power *= _POWER / power.sum()
    for index in range(count):
        colour = np.array([1.0, rng.uniform(0.4, 1.0), rng.uniform(0.15, 1.0)])
        size = rng.uniform(0.5, 1.5) * min(1.0, (200.0 / count) ** 0.5)
        kind = _KINDS[index % len(_KINDS)]
        z = -rng.uniform(0.0, _LENGTH)
        place = _PLACES[kind](rng, z)
        if kind in ("Sign", "Strip"):
            _mesh(writer, f"{kind}_{index:06d}", kind, place, size, power[index], rng)
        else:
            _light(writer, f"{kind}_{index:06d}", kind, place, size, power[index] * colour)
    writer.camera((1.5, 2.2, 6.0), (-0.5, 3.0, -20.0), 65.0, options.aspect or 1.5)


_PLACES = {
    "Window": lambda rng, z: (rng.choice([-1, 1]) * (_HALF_WIDTH - 0.02), rng.uniform(1, 11), z),
    "Lamp": lambda rng, z: (rng.choice([-1, 1]) * rng.uniform(2.5, 4.5), rng.uniform(3, 5), z),
    "Bulb": lambda rng, z: (rng.uniform(-4, 4), rng.uniform(4, 8), z),
    "Sign": lambda rng, z: (rng.choice([-1, 1]) * rng.uniform(4.0, 4.5), rng.uniform(2.5, 8), z),
    "Strip": lambda rng, z: (rng.choice([-1, 1]) * rng.uniform(3.0, 4.9), 0.02, z),
}
"""Functions that choose a random position (x, y, z) for each kind of light."""


def _light(
    writer: StageWriter,
    name: str,
    kind: str,
    place: tuple[float, float, float],
    size: float,
    power: NDArray[np.float64],
) -> None:
    """Adds a UsdLux light with a power of ``power`` (3,) W."""
    path = f"/World/Lights/{name}"
    if kind == "Window":
        light = UsdLux.RectLight.Define(writer.stage, path)
        light.CreateWidthAttr(0.8 * size)
        light.CreateHeightAttr(size)
        radiance = power / (np.pi * 0.8 * size * size)
    elif kind == "Lamp":
        light = UsdLux.DiskLight.Define(writer.stage, path)
        light.CreateRadiusAttr(0.2 * size)
        radiance = power / (np.pi * np.pi * (0.2 * size) ** 2)
    else:
        light = UsdLux.SphereLight.Define(writer.stage, path)
        light.CreateRadiusAttr(0.06 * size)
        radiance = power / (4.0 * np.pi * np.pi * (0.06 * size) ** 2)
    peak = float(radiance.max())
    light.CreateIntensityAttr(peak)
    light.CreateColorAttr(Gf.Vec3f(*(float(v) / peak for v in radiance)))
    xform = UsdGeom.XformCommonAPI(light)
    xform.SetTranslate(tuple(float(v) for v in place))
    # UsdLux lights emit along their -Z axis. Window lights are rotated to face the street, lamps to
    # face down.
    if kind == "Window":
        xform.SetRotate((0.0, 90.0 if place[0] > 0 else -90.0, 0.0))
    elif kind == "Lamp":
        xform.SetRotate((-90.0, 0.0, 0.0))


def _mesh(
    writer: StageWriter,
    name: str,
    kind: str,
    place: tuple[float, float, float],
    size: float,
    power: float,
    rng: np.random.Generator,
) -> None:
    """Adds an emissive mesh of about ``power`` W, with the radiance rounded to a few values."""
    half = np.array([0.25, 0.4, 0.03]) if kind == "Sign" else np.array([0.04, 0.0, 0.6])
    half = half * size
    area = 8.0 * (half[0] * half[1] + half[1] * half[2] + half[0] * half[2])
    # Emissive triangles emit from both sides, but only the outer sides of a closed box illuminate
    # the scene.
    wanted = power / (np.pi * area * (1.0 if kind == "Sign" else 0.5))
    step = round(2.0 * np.log2(wanted))
    hue = int(rng.integers(_SIGN_COLOURS))
    tint = 0.55 + 0.45 * np.cos(2.0 * np.pi * (hue / _SIGN_COLOURS + np.array([0, 1, 2]) / 3.0))
    material = f"Glow_{hue:02d}_{step + 100:03d}"
    emission = tuple(float(v) for v in tint * 2.0 ** (step / 2.0))
    writer.material(material, materials.emissive((emission[0], emission[1], emission[2])))
    path = f"/World/Objects/{name}"
    if kind == "Sign":
        writer.box(path, place, half, material)
    else:
        writer.quad(path, (np.array(place) + BOX_CORNERS * half)[[0, 1, 5, 4]], material)


def _street(writer: StageWriter, rng: np.random.Generator) -> None:
    """Adds the ground, facades with bays, and a wall that closes the street."""
    writer.material("Asphalt", materials.diffuse((0.22, 0.22, 0.24)))
    far = _LENGTH + 2.0
    ground: list[list[float]] = [[-30, 0, 8], [30, 0, 8], [30, 0, -far], [-30, 0, -far]]
    writer.quad("/World/Set/Ground", ground, "Asphalt")
    end: list[list[float]] = [[-30, 0, -far], [30, 0, -far], [30, 16, -far], [-30, 16, -far]]
    writer.quad("/World/Set/End", end, "Asphalt")
    for side in (-1, 1):
        z, house = 8.0, 0
        while z > -far:
            width = float(rng.uniform(5.0, 9.0))
            name = f"Wall_{house % 4}"
            shade = 0.35 + 0.12 * (house % 4)
            writer.material(name, materials.diffuse((shade, 0.92 * shade, 0.8 * shade)))
            x0, x1 = side * _HALF_WIDTH, side * (_HALF_WIDTH + 6.0)
            top = _HEIGHT + float(rng.uniform(0.0, 4.0))
            corners = [[x, y, w] for x in (x0, x1) for y in (0.0, top) for w in (z - width, z)]
            path = f"/World/Set/House_{'L' if side < 0 else 'R'}{house:02d}"
            writer.polygons(path, np.array(corners), BOX, name)
            z -= width
            house += 1


_COLUMNS, _ROWS, _PITCH = 10, 9, 2.6
_GROUND_HALF = 13.5
_TEAPOT_SCALE = 0.36
_LOOKS = {
    "Clay": materials.TERRACOTTA,
    "Chalk": materials.CHALK,
    "BluePlastic": materials.BLUE_PLASTIC,
    "YellowPlastic": materials.YELLOW_PLASTIC,
    "Bronze": materials.BRONZE,
    "Copper": materials.COPPER,
}


def build_studio(writer: StageWriter, options: SceneOptions) -> None:
    """Builds 90 objects in rows on a matt floor, with key light, fill light and a dim uniform dome.

    The dome has most of the power of all lights, but contributes little to the image. BSDF sampling
    also finds the dome's light.
    """
    rng = np.random.default_rng([options.seed, 3])
    writer.material("Floor", materials.diffuse((0.35, 0.34, 0.33)))
    writer.floor("Floor", _GROUND_HALF, "Floor")
    for name, info in _LOOKS.items():
        writer.material(name, info)
    dragon = writer.prototype("Dragon", options.dragon_mesh())
    pot = writer.prototype("Teapot", teapot(options.teapot_level))
    for index in range(_COLUMNS * _ROWS):
        column, row = index % _COLUMNS, index // _COLUMNS
        x = (column - 0.5 * (_COLUMNS - 1)) * _PITCH + rng.uniform(-0.3, 0.3)
        z = (row - 0.5 * (_ROWS - 1)) * _PITCH + rng.uniform(-0.3, 0.3)
        is_pot = (column + row) % 2 == 0
        writer.instance(
            f"/World/Objects/{'Teapot' if is_pot else 'Dragon'}_{index:02d}",
            pot if is_pot else dragon,
            list(_LOOKS)[int(rng.integers(len(_LOOKS)))],
            (x, 0.0, z),
            rng.uniform(-180.0, 180.0),
            (_TEAPOT_SCALE if is_pot else 1.0) * math.exp(rng.uniform(-0.1, 0.1)),
        )
    writer.rect_light("Key", (-3.0, 11.0, 6.0), 3.0, 3.0, (13.0, 12.6, 12.0), -62.0)
    writer.rect_light("Fill", (9.0, 10.0, 14.0), 4.0, 4.0, (2.6, 2.8, 3.2), -40.0)
    writer.even_dome("Dome", 0.12)
    writer.camera((0.0, 9.0, 19.0), (0.0, 0.5, -1.0), 50.0, options.aspect or 1.0)
