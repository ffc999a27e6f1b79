# SPDX-License-Identifier: Apache-2.0
"""Stages with volumes: smoke over an ember, clouds over the sea, and a street lamp in fog.

Grids are made procedurally and written as .vdb files in ``<stem>_volumes/`` beside the stage.
Materials are MaterialX ``volume`` nodes with coefficients per metre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdLux, UsdVol

from wavecomb import vdb
from wavecomb.errors import SceneError, WavecombError
from wavecomb.scenes.authoring import materials
from wavecomb.scenes.authoring.materials import Colour, Network
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.options import SceneOptions

Points = NDArray[np.float32]

_EDGE = 64
"""Edge of the table of noise values; the noise repeats after this number of units."""


class Noise:
    """Value noise, which interpolates random values at the points of a lattice smoothly."""

    def __init__(self, seed: int, number: int = 0) -> None:
        """Creates a noise. ``number`` distinguishes noise functions with the same seed."""
        rng = np.random.default_rng([seed, 977, number])
        self._table = rng.random((_EDGE, _EDGE, _EDGE), np.float32).ravel()

    def at(self, points: Points) -> NDArray[np.float32]:
        """Returns values in [0, 1] at points (n, 3)."""
        cell = np.floor(points)
        part = points - cell
        fade = part * part * part * (part * (part * 6.0 - 15.0) + 10.0)
        low = cell.astype(np.int64) % _EDGE
        high = (low + 1) % _EDGE
        found = np.zeros(len(points), np.float32)
        for corner in range(8):
            index = np.zeros(len(points), np.int64)
            weight = np.ones(len(points), np.float32)
            for axis in range(3):
                is_high = corner >> axis & 1
                index = index * _EDGE + (high if is_high else low)[:, axis]
                weight *= fade[:, axis] if is_high else 1.0 - fade[:, axis]
            found += weight * self._table[index]
        return found

    def fractal(self, points: Points, octaves: int, gain: float = 0.5) -> NDArray[np.float32]:
        """Sums octaves of noise to [0, 1]; ``gain`` is the ratio of successive weights."""
        found = np.zeros(len(points), np.float32)
        weight, weights = 1.0, 0.0
        for octave in range(octaves):
            found += np.float32(weight) * self.at(points * np.float32(2.0**octave) + 17.3 * octave)
            weights += weight
            weight *= gain
        return found / np.float32(weights)


Density = Callable[[Points], NDArray[np.float32]]


def sampled(
    density: Density, low: Sequence[float], high: Sequence[float], voxels: int, half: bool = True
) -> dict[str, Any]:
    """Samples a function of space as bricks of voxels for ``vdb.write``; leaves out zero bricks.

    Args:
        density: Function that returns values at points (n, 3), with 0 in empty space.
        low: Lower corner of the sampled box.
        high: Upper corner of the sampled box.
        voxels: Number of voxels along the longest edge.
        half: Whether to store values with 16 bits.
    """
    start, end = np.array(low), np.array(high)
    step = float((end - start).max()) / voxels
    counts = np.ceil((end - start) / (step * vdb.BRICK) - 1e-9).astype(int)
    inside = np.stack(np.meshgrid(*[np.arange(vdb.BRICK)] * 3, indexing="ij"), -1).reshape(-1, 3)
    origins, values = [], []
    for x in range(counts[0]):
        cells = np.stack(np.meshgrid([x], *map(np.arange, counts[1:]), indexing="ij"), -1)
        bricks = (cells.reshape(-1, 3) * vdb.BRICK).astype(np.int32)
        index = (bricks[:, None, :] + inside[None]).reshape(-1, 3)
        points = (start + (index + 0.5) * step).astype(np.float32)
        found = density(points).reshape(-1, vdb.BRICK, vdb.BRICK, vdb.BRICK)
        found = found.astype(np.float16 if half else np.float32)
        filled = found.any(axis=(1, 2, 3))
        origins.append(bricks[filled])
        values.append(found[filled])
    matrix = np.diag([step, step, step, 1.0])
    matrix[3, :3] = start + 0.5 * step
    return {
        "origins": np.concatenate(origins),
        "values": np.concatenate(values),
        "index_to_object": matrix,
    }


def _where(mask: NDArray[np.bool_], points: Points, of: Density) -> NDArray[np.float32]:
    """Evaluates a function at the points (n, 3) in a mask; the result is 0 at all other points."""
    found = np.zeros(len(points), np.float32)
    if mask.any():
        found[mask] = of(points[mask])
    return found


class _Volumes:
    """Writer of a stage's volumes and their materials."""

    def __init__(self, writer: StageWriter) -> None:
        self._writer = writer
        self._stage = writer.stage

    def material(
        self,
        name: str,
        absorption: Colour,
        scattering: Colour,
        anisotropy: float = 0.0,
        density: str = "",
        emission: Colour | None = None,
        glow: str = "",
    ) -> str:
        """Adds a MaterialX volume; its coefficients are per metre and are scaled by grids."""
        net = Network(self._stage, f"/World/Looks/{name}")

        def coefficient(kind: str, value: Colour, field: str) -> Any:
            """Returns a constant material input, multiplied by the grid ``field`` unless ""."""
            if not field:
                return kind, value
            reader = net.node("geompropvalue", "float", geomprop=("string", field))
            return net.node("multiply", f"{kind}FA", in1=(kind, value), in2=reader)

        inputs = {
            "vdf": net.closure(
                "Medium",
                "ND_anisotropic_vdf",
                absorption=coefficient("vector3", absorption, density),
                scattering=coefficient("vector3", scattering, density),
                anisotropy=("float", anisotropy),
            )
        }
        if emission is not None:
            radiance = coefficient("color3", emission, glow)
            inputs["edf"] = net.closure("Emission", "ND_uniform_edf", color=radiance)
        terminal = net.material.CreateVolumeOutput("mtlx")
        terminal.ConnectToSource(net.closure("Volume", "ND_volume", **inputs))
        return self._writer.own_material(name, net.material)

    def volume(
        self,
        name: str,
        material: str,
        extent: tuple[Sequence[float], Sequence[float]],
        grids: dict[str, dict[str, Any]] | None = None,
    ) -> None:
        """Adds a volume with the given grids, by field name.

        Without grids, the volume is homogeneous and fills its extent.
        """
        path = f"/World/Objects/{name}"
        prim = UsdVol.Volume.Define(self._stage, path)
        prim.CreateExtentAttr([Gf.Vec3f(*map(float, end)) for end in extent])
        self._writer.bind(prim.GetPrim(), material)
        if not grids:
            return
        file, asset = self._writer.volume_file(f"{name.lower()}.vdb")
        part = file.with_name(f".{file.name}.part")
        try:
            vdb.write(part, [{"name": field, **grid} for field, grid in grids.items()])
            part.replace(file)
        except WavecombError as error:
            raise SceneError(str(error).replace(str(part), str(file))) from error
        finally:
            Path(part).unlink(missing_ok=True)
        for field in grids:
            grid = UsdVol.OpenVDBAsset.Define(self._stage, f"{path}/{field}")
            grid.CreateFilePathAttr(asset)
            grid.CreateFieldNameAttr(field)
            prim.CreateFieldRelationship(field, grid.GetPath())


def _ground(writer: StageWriter, half: float, colour: Colour) -> None:
    writer.material("Ground", materials.diffuse(colour))
    writer.floor("Ground", half, "Ground")


def smoke_density(seed: int) -> Density:
    """Returns the density (at most 1) of a plume, 4 m high, that swirls and widens."""
    swirl = [Noise(seed, number) for number in range(3)]
    detail = Noise(seed, 3)

    def density(points: Points) -> NDArray[np.float32]:
        height = points[:, 1]
        radius = 0.16 + 0.2 * height
        drift = np.stack([0.18 * np.sin(1.7 * height), 0 * height, 0.14 * np.cos(2.1 * height)], 1)
        away = np.hypot(points[:, 0] - drift[:, 0], points[:, 2] - drift[:, 2])
        near = (away < 1.8 * radius) & (height > 0)

        def inside(some: Points) -> NDArray[np.float32]:
            high = some[:, 1]
            bend = np.stack([noise.at(some * np.float32(1.6)) for noise in swirl], axis=1) - 0.5
            moved = some + bend * (0.15 + 0.25 * high)[:, None]
            shift = np.stack([0.18 * np.sin(1.7 * high), 0 * high, 0.14 * np.cos(2.1 * high)], 1)
            r = np.hypot(moved[:, 0] - shift[:, 0], moved[:, 2] - shift[:, 2])
            body = 1.0 - (r / (0.16 + 0.2 * high)) ** 2
            cut = detail.fractal(moved * np.float32(4.0), 5) - 0.5
            fading = np.clip(4.0 - high, 0.0, 1.0) * np.clip(8.0 * high, 0.0, 1.0)
            thick = np.clip(body + 2.2 * cut, 0.0, 1.0) * fading / (1.0 + 0.5 * high)
            return np.asarray(thick, np.float32)

        return _where(near, points, inside)

    return density


def _fire(points: Points, smoke: Density) -> NDArray[np.float32]:
    """Returns the temperature (at most 1) in the lower part of the plume."""
    low = np.clip(1.0 - points[:, 1] / 0.9, 0.0, 1.0)
    return _where(low > 0, points, lambda some: smoke(some) ** np.float32(0.3)) * low


def build_smoke(writer: StageWriter, options: SceneOptions) -> None:
    """Builds smoke that rises over an ember, in front of a wall."""
    volumes = _Volumes(writer)
    _ground(writer, 8.0, (0.3, 0.3, 0.3))
    writer.material("Brick", materials.diffuse((0.32, 0.16, 0.12)))
    writer.box("/World/Objects/Hearth", (0.0, 0.06, 0.0), (0.35, 0.06, 0.35), "Brick")
    density = smoke_density(options.seed)
    low, high = (-1.6, 0.0, -1.6), (1.6, 4.0, 1.6)
    grids = {
        "density": sampled(density, low, high, options.voxels),
        "heat": sampled(lambda at: _fire(at, density), (-0.8, 0.0, -0.8), (0.8, 0.9, 0.8),
                        max(options.voxels * 2 // 5, 8)),
    }  # fmt: skip
    smoke = volumes.material(
        "Smoke", (0.9, 0.95, 1.0), (8.0, 8.0, 8.0), 0.2, "density", (14.0, 4.2, 0.9), "heat"
    )
    volumes.volume("Plume", smoke, (low, high), grids)
    writer.rect_light("Key", (-3.5, 5.5, 3.0), 2.0, 2.0, (22.0, 21.0, 19.0), -60.0)
    writer.dome_light("Sky", 30.0, 0.35)
    writer.camera((0.0, 1.7, 6.5), (0.0, 1.8, 0.0), 42.0, options.aspect or 0.75)


def cloud_density(seed: int) -> Density:
    """Returns the density (at most 1) of flat-bottomed cumulus clouds; one scene unit is 100 m."""
    rng = np.random.default_rng([seed, 41])
    place, size = [], []
    for _ in range(9):
        middle, spread = rng.uniform(-7.5, 7.5, 2), rng.uniform(1.2, 2.2)
        for _ in range(9):
            high = float(rng.random() ** 1.5)
            x, z = middle + rng.normal(0, spread * (1.0 - 0.7 * high), 2)
            place.append((x, 0.4 + 2.6 * high * spread / 2.2, z))
            size.append(rng.uniform(0.7, 1.3) * (1.25 - 0.55 * high))
    detail = Noise(seed, 7)

    def density(points: Points) -> NDArray[np.float32]:
        best = np.full(len(points), -1.0, np.float32)
        for centre, radius in zip(place, size, strict=True):
            away = ((points - np.array(centre, np.float32)) ** 2).sum(axis=1)
            best = np.maximum(best, (1.0 - away / radius**2).astype(np.float32))
        near = (best > -0.8) & (points[:, 1] > 0)

        def inside(some: Points) -> NDArray[np.float32]:
            cut = detail.fractal(some * np.float32(1.3), 6, 0.6) - 0.5
            floor = np.clip(some[:, 1] * 3.0, 0.0, 1.0)
            return np.asarray(np.clip(best[near] + 3.0 * cut, 0, 1) * floor, np.float32)

        return _where(near, points, inside)

    return density


def build_clouds(writer: StageWriter, options: SceneOptions) -> None:
    """Builds clouds over the sea in the evening; one scene unit is 100 m."""
    volumes = _Volumes(writer)
    _ground(writer, 400.0, (0.015, 0.03, 0.045))
    low, high = (-11.0, 0.0, -11.0), (11.0, 5.0, 11.0)
    grid = sampled(cloud_density(options.seed), low, high, options.voxels)
    grid["index_to_object"][3, 1] += 6.0
    haze = volumes.material("Cloud", (0.0, 0.0, 0.0), (0.05, 0.05, 0.05), 0.6, "density")
    extent = ((low[0], low[1] + 6.0, low[2]), (high[0], high[1] + 6.0, high[2]))
    volumes.volume("Heaps", haze, extent, {"density": grid})
    sun = UsdLux.DistantLight.Define(writer.stage, "/World/Lights/Sun")
    sun.CreateAngleAttr(0.53)
    sun.CreateIntensityAttr(45000.0)
    sun.CreateColorAttr(Gf.Vec3f(1.0, 0.78, 0.52))
    sun.AddRotateXYZOp().Set(Gf.Vec3f(-14.0, 62.0, 0.0))
    writer.dome_light("Sky", 30.0, 0.6)
    # Add a weak fill light, so that the shadows are not black.
    writer.rect_light("Glow", (0.0, 40.0, 0.0), 30.0, 30.0, (0.25, 0.3, 0.4))
    writer.camera((0.0, 5.5, 26.0), (0.0, 7.5, 0.0), 50.0, options.aspect or 16.0 / 9.0)


def build_fog(writer: StageWriter, options: SceneOptions) -> None:
    """Builds a street lamp and a window in homogeneous fog, with posts in front of them."""
    volumes = _Volumes(writer)
    _ground(writer, 14.0, (0.2, 0.2, 0.21))
    writer.material("Post", materials.diffuse((0.12, 0.1, 0.09)))
    writer.material("House", materials.diffuse((0.4, 0.36, 0.3)))
    rng = np.random.default_rng([options.seed, 53])
    for index in range(9):
        x, z = -6.0 + 1.5 * index, -1.5 - 2.0 * float(rng.random())
        tall = float(rng.uniform(0.9, 1.3))
        writer.box(f"/World/Objects/Post_{index}", (x, tall, z), (0.09, tall, 0.09), "Post")
    writer.box("/World/Objects/House", (5.5, 2.5, -7.0), (2.0, 2.5, 0.3), "House")
    fog = volumes.material("Fog", (0.0, 0.0, 0.0), (0.09, 0.09, 0.09), 0.7)
    volumes.volume("Fog", fog, ((-13.0, 0.001, -13.0), (13.0, 8.0, 13.0)))
    lamp = UsdLux.SphereLight.Define(writer.stage, "/World/Lights/Lamp")
    lamp.CreateRadiusAttr(0.12)
    lamp.CreateIntensityAttr(900.0)
    lamp.CreateColorAttr(Gf.Vec3f(1.0, 0.72, 0.4))
    lamp.AddTranslateOp().Set(Gf.Vec3d(-1.2, 3.4, -4.5))
    lamp.AddRotateXOp().Set(-90.0)
    shaping = UsdLux.ShapingAPI.Apply(lamp.GetPrim())
    shaping.CreateShapingConeAngleAttr(52.0)
    shaping.CreateShapingConeSoftnessAttr(0.2)
    writer.rect_light("Window", (5.0, 3.2, -6.6), 1.0, 1.4, (9.0, 7.0, 4.0), 180.0)
    writer.camera((0.0, 1.6, 8.5), (0.0, 2.0, -4.0), 55.0, options.aspect or 16.0 / 9.0)
