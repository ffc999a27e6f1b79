# SPDX-License-Identifier: Apache-2.0
"""The way in: a USD file to a scene."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.usd.camera import all_cameras, find_camera, frame_bounds, read_camera
from wavecomb.usd.diagnostics import captured, commentary
from wavecomb.usd.groups import DRAWN_COUNTS, Group, GroupBuilder, placed_lights
from wavecomb.usd.light import KINDS as LIGHT_KINDS
from wavecomb.usd.light import LightReader, soft_dome, up_rotation
from wavecomb.usd.material import MaterialTable
from wavecomb.usd.report import LoadReport
from wavecomb.usd.texture import TextureTable
from wavecomb.usd.traverse import Traversal

if TYPE_CHECKING:
    from wavecomb import _core

PURPOSES = ("default", "render", "proxy", "guide")
MAX_LIGHTS = 4096
"""Lights that are placed; instances may multiply them."""


@dataclass
class LoadedStage:
    """A stage that was read.

    Attributes:
        scene: Ready to render.
        report: What there is to say about it.
        camera_path: Prim of the camera; None where the bounds were framed.
        seconds: Time taken.
        stage_path: The file.
        cameras: Prims of all cameras that could be chosen.
    """

    scene: _core.Scene
    report: LoadReport
    camera_path: str | None
    seconds: float
    stage_path: Path
    cameras: tuple[str, ...] = ()


def load_stage(
    path: str | Path,
    *,
    frame: float | None = None,
    camera: str | None = None,
    purposes: Sequence[str] = ("default", "render"),
    variants: Mapping[str, str] | None = None,
    threads: int = 0,
    builder_factory: Callable[[], _core.SceneBuilder] | None = None,
) -> LoadedStage:
    """Reads a USD stage into a scene.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        frame: Time code; None: the stage's start, else default values.
        camera: Prim path or unique name of a camera; None: the render settings', the stage's first,
            or a view that frames all.
        purposes: Of the geometry to draw: default, render, proxy, guide.
        variants: Selections to make: ``{"/World/Car{paint}": "red"}``; without a path the default
            prim's.
        threads: For images and textures; 0: all.
        builder_factory: Makes the scene builder; None: the native one.

    Raises:
        WavecombError: The file or an option is no good.
    """
    started = clock.perf_counter()
    unknown = [name for name in purposes if name not in PURPOSES]
    if unknown:
        raise WavecombError(f"no purpose {unknown[0]!r}; there are {', '.join(PURPOSES)}")
    if frame is not None and not np.isfinite(frame):
        raise WavecombError(f"frame must be a number, not {frame}")
    report = LoadReport()
    file = Path(path)
    with captured(report):
        builder = _native_builder(threads) if builder_factory is None else builder_factory()
        textures = TextureTable(builder, report, threads)
        try:
            camera_path, cameras = _fill(
                builder, file, frame, camera, purposes, variants or {}, textures, report
            )
        finally:
            textures.release()
        scene = _build(builder, file)
    if builder_factory is None:
        _give_back_memory()
    return LoadedStage(scene, report, camera_path, clock.perf_counter() - started, file, cameras)


def _fill(
    builder: _core.SceneBuilder,
    file: Path,
    frame: float | None,
    camera: str | None,
    purposes: Sequence[str],
    variants: Mapping[str, str],
    textures: TextureTable,
    report: LoadReport,
) -> tuple[str | None, tuple[str, ...]]:
    """Fills the builder; gives the camera's path and those of all. The stage is closed then."""
    stage = _open(file)
    if variants:
        _select(stage, variants)
    chosen = _read(stage, _time(stage, frame), camera, purposes, builder, textures, report)
    return chosen, tuple(str(prim.GetPath()) for prim in all_cameras(stage))


def _native_builder(threads: int) -> _core.SceneBuilder:
    from wavecomb import _core

    return _core.SceneBuilder(threads)


def _give_back_memory() -> None:
    from wavecomb import _core

    _core.give_back_memory()


def _open(file: Path) -> Usd.Stage:
    """The stage of a file, with all payloads."""
    if not file.exists():
        raise WavecombError(f"{file}: no such file")
    if file.is_dir():
        raise WavecombError(f"{file}: is a folder; name the stage in it")
    if not Usd.Stage.IsSupportedFile(str(file)):
        raise WavecombError(f"{file}: not a USD file; use .usd, .usda, .usdc or .usdz")
    try:
        stage = Usd.Stage.Open(str(file), Usd.Stage.LoadAll)
    except Tf.ErrorException as error:
        raise WavecombError(f"{file}: cannot be read as USD: {commentary(error)}") from None
    if not stage:
        raise WavecombError(f"{file}: cannot be read as USD")
    return stage


def _select(stage: Usd.Stage, variants: Mapping[str, str]) -> None:
    """Makes variant selections in the session layer."""
    stage.SetEditTarget(stage.GetSessionLayer())
    for key, choice in variants.items():
        where, _, name = key.rpartition("{") if "{" in key else ("", "", key)
        name = name.rstrip("}")
        if where and not Sdf.Path.IsValidPathString(where):
            raise WavecombError(f"variant {key}: {where} is not a prim path")
        prim = stage.GetPrimAtPath(where) if where else stage.GetDefaultPrim()
        if not prim:
            raise WavecombError(f"variant {key}: no prim {where or '(the stage has no default)'}")
        sets = prim.GetVariantSets()
        if name not in sets.GetNames():
            known = ", ".join(sets.GetNames()) or "none"
            raise WavecombError(f"variant {key}: {prim.GetPath()} has the sets: {known}")
        variant_set = sets.GetVariantSet(name)
        if choice not in variant_set.GetVariantNames():
            known = ", ".join(variant_set.GetVariantNames()) or "none"
            raise WavecombError(f"variant {key}={choice}: there are {known}")
        variant_set.SetVariantSelection(choice)


def _time(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    if frame is not None:
        return Usd.TimeCode(frame)
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.Default()


def _read(
    stage: Usd.Stage,
    time: Usd.TimeCode,
    camera: str | None,
    purposes: Sequence[str],
    builder: _core.SceneBuilder,
    textures: TextureTable,
    report: LoadReport,
) -> str | None:
    """Fills the builder; gives the camera's path."""
    up_axis = str(UsdGeom.GetStageUpAxis(stage))
    view_prim = find_camera(stage, camera)
    materials = MaterialTable(builder, textures, time, report)
    lights = LightReader(time, up_axis, textures, report)
    traversal = Traversal(time, purposes, lights, report)
    world = GroupBuilder(stage, traversal, builder, materials, report).world()
    lit = materials.glows or _has_lights(stage)
    _add_lights(world, lit, up_axis, textures, builder, report)
    if not any(report.counts.get(kind) for kind in DRAWN_COUNTS):
        report.note("nothing to draw: the picture shows the environment only")
    view = None
    if view_prim is not None:
        to_world = np.array(traversal.xforms.GetLocalToWorldTransform(view_prim))
        view = read_camera(view_prim, to_world, time, report)
    chosen = None if view is None or view_prim is None else str(view_prim.GetPath())
    if view is None:
        report.note("no camera: framed the bounds")
        view = frame_bounds(world.bounds, up_axis)
    builder.set_camera(view.transform, **view.options)
    return chosen


def _has_lights(stage: Usd.Stage) -> bool:
    """Whether the stage holds lights that Wavecomb knows, seen or not."""
    every = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    return any(prim.GetTypeName() in LIGHT_KINDS for prim in every)


def _add_lights(
    world: Group,
    lit: bool,
    up_axis: str,
    textures: TextureTable,
    builder: _core.SceneBuilder,
    report: LoadReport,
) -> None:
    """Adds all lights, or a soft dome where nothing else gives light (``lit``)."""
    lights = placed_lights(world, MAX_LIGHTS + 1)
    if len(lights) > MAX_LIGHTS:
        report.warn(f"more than {MAX_LIGHTS} lights: the rest is left out")
        lights = lights[:MAX_LIGHTS]
    for light, transform in lights:
        builder.add_light(light.kind, transform, **light.options)
    if not lights and lit:
        report.note("no visible light; the scene is lit by emissive materials or not at all")
    elif not lights:
        report.note("no light: added a soft dome")
        texture = textures.add_pixels("soft dome", soft_dome())
        builder.add_light("dome", up_rotation(up_axis), name="soft dome", texture=texture)


def _build(builder: _core.SceneBuilder, file: Path) -> _core.Scene:
    try:
        return builder.build()
    except ValueError as error:
        raise WavecombError(f"{file}: {error}") from error
