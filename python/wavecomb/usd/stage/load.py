# SPDX-License-Identifier: Apache-2.0
"""The way in: a USD file to a scene."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.load_options import LoadOptions
from wavecomb.machine import give_back_memory
from wavecomb.picture.working_space import from_rec709
from wavecomb.run.isolate import trail
from wavecomb.run.isolate.memory import describe_limit
from wavecomb.usd import mtlx
from wavecomb.usd.cameras.camera import (
    View,
    camera_motion,
    frame_planes,
    frame_points,
    read_camera,
)
from wavecomb.usd.cameras.framing import corners, joined
from wavecomb.usd.geometry.shutter import find_motion
from wavecomb.usd.geometry.strand_detail import StrandDetail
from wavecomb.usd.geometry.surfaces import Surfaces, parse_level
from wavecomb.usd.geometry.view_size import ViewSize
from wavecomb.usd.lights.dome import soft_dome, up_rotation
from wavecomb.usd.lights.filters import add_filters
from wavecomb.usd.lights.ies import IesTable
from wavecomb.usd.lights.light import LightReader
from wavecomb.usd.lights.links import LinkTable
from wavecomb.usd.looks.material import MaterialTable
from wavecomb.usd.looks.texture import MEGABYTE, TextureCache, TextureTable, texture_store
from wavecomb.usd.stage.catchers import IGNORED, check_there, set_catchers
from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.diagnostics import NOT_TEXT, captured, commentary
from wavecomb.usd.stage.emitters import light_what_is_drawn
from wavecomb.usd.stage.frame_cache import FrameCache
from wavecomb.usd.stage.group import Group, changes_size, placed_lights
from wavecomb.usd.stage.groups import DRAWN_COUNTS, GroupBuilder, LoadProgress
from wavecomb.usd.stage.identity import LightGroups
from wavecomb.usd.stage.loaded import LoadedStage
from wavecomb.usd.stage.opening import Survey, open_stage, select_variants, survey
from wavecomb.usd.stage.origin import Origin, find_origin, moved_to
from wavecomb.usd.stage.payloads import tell_unloaded
from wavecomb.usd.stage.ray_visibility import RayVisibility
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.times import frame_number, time_code
from wavecomb.usd.stage.traverse import Traversal
from wavecomb.usd.stage.view_options import Seen, check_view, seen_on
from wavecomb.usd.stage.volumes import add_volumes, say_cloudy, say_room
from wavecomb.usd.volumes.info import VolumeFacts

if TYPE_CHECKING:
    from wavecomb import _core

SurfacesOf = Callable[[MaterialTable], Surfaces]

MAX_LIGHTS = 4096
"""Lights that are placed; instances may multiply them."""


@dataclass(frozen=True)
class _Filled:
    """What was found while the builder was filled."""

    camera: str | None
    survey: Survey
    materials: tuple[str, ...]
    lights: tuple[str, ...]
    frame: float | None
    shutter: tuple[float, float] | None
    render: RenderChoice
    outline: NDArray[np.float64] | None
    volumes: tuple[VolumeFacts, ...]
    catchers: tuple[str, ...]
    origin: Origin


@dataclass(frozen=True)
class _Choice:
    """What is read, and how."""

    opened: Callable[[], Usd.Stage]
    options: LoadOptions
    editable: bool

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture."""
        return self.options.size


def load_stage(
    source: str | Path | Usd.Stage,
    options: LoadOptions | None = None,
    *,
    editable: bool = False,
    reuse: TextureCache | None = None,
    cache: FrameCache | None = None,
    progress: LoadProgress | None = None,
    builder_factory: Callable[[], _core.SceneBuilder] | None = None,
    store_factory: Callable[[LoadReport], _core.TextureStore | None] | None = None,
    **changes: Any,
) -> LoadedStage:
    """Reads a USD stage into a scene.

    Args:
        source: A .usd, .usda, .usdc or .usdz file, or a stage that is open. That stays open, and is
            only written to where ``variants`` are chosen. It must not change meanwhile.
        options: How it is read. Mask, payloads and session layer are of files only.
        editable: For programs that change what was read: materials that look alike stay apart, and
            the result has ``textures``. Changes no picture.
        reuse: ``textures`` of an earlier read: those whose files did not change are shared.
        cache: Of a stage that is open and was read at another frame: what did not change is
            shared. Changes nothing else.
        progress: Is told how many of the prims found so far are read.
        builder_factory: Makes the scene builder; None: the native one.
        store_factory: With ``builder_factory``: gives what keeps its textures within the limit,
            and tells the report; None: nothing does, so that levels are left out.
        **changes: Fields of ``LoadOptions``, in place of those of ``options``.

    Raises:
        WavecombError: The file or an option is no good.
    """
    started = clock.perf_counter()
    chosen = LoadOptions.of(options, changes)
    check_view(chosen)
    if isinstance(source, Usd.Stage) and chosen.chooses_what_opens:
        raise WavecombError("mask, payloads, session_layer are chosen when the stage is opened")
    level = parse_level(chosen.subdivision)
    threads = chosen.threads
    report = LoadReport()
    file = _file_of(source)
    if cache is not None:
        reuse = cache.textures
    opened = _opener(source, chosen)
    # What is not finite in a file is found where it is read; NumPy need not say it.
    with captured(report), np.errstate(all="ignore"):
        if builder_factory is None:
            store = texture_store(chosen.texture_limit, reuse, report)
            builder = _native_builder(threads, store)
        else:
            store = None if store_factory is None else store_factory(report)
            builder = builder_factory()
        textures = TextureTable(builder, report, threads, reuse, chosen.working_space, store)

        def surfaces_of(materials: MaterialTable) -> Surfaces:
            return Surfaces(
                builder, materials, report, subdivision=level, size=chosen.size, threads=threads
            )

        try:
            choice = _Choice(opened, chosen, editable)
            filled = _fill(builder, choice, textures, report, surfaces_of, cache, progress)
        except UnicodeDecodeError:
            raise WavecombError(f"{file}: {NOT_TEXT}") from None
        except Tf.ErrorException as error:
            raise WavecombError(f"{file}: USD cannot read it: {commentary(error)}") from None
        except MemoryError:
            raise WavecombError(
                f"{file}: out of memory while it was read{describe_limit()}"
            ) from None
        finally:
            textures.release()
        trail.note("building the scene of", file)
        scene = _build(builder, file)
        trail.note("rendering", file)
    if cache is not None:
        cache.textures = textures.cache(scene)
        cache.end_frame()
        report.absorb(cache.opening)
    if builder_factory is None:
        give_back_memory()
    return LoadedStage(
        scene,
        report,
        filled.camera,
        clock.perf_counter() - started,
        file,
        filled.survey.cameras,
        filled.survey.lights,
        filled.materials,
        filled.lights,
        filled.frame,
        textures.cache(scene) if editable else None,
        filled.shutter,
        filled.render,
        chosen.working_space,
        chosen.texture_limit is not None and store is None,
        filled.outline,
        filled.volumes,
        filled.catchers,
        filled.origin,
    )


def _file_of(source: str | Path | Usd.Stage) -> Path:
    """The file of a stage; of one in memory its layer's name."""
    if not isinstance(source, Usd.Stage):
        return Path(source)
    layer = source.GetRootLayer()
    return Path(layer.realPath or layer.identifier)


def _opener(source: str | Path | Usd.Stage, options: LoadOptions) -> Callable[[], Usd.Stage]:
    """Gives the stage; one that is opened by it is closed when nobody holds it any more."""
    if isinstance(source, Usd.Stage):
        stage = source

        def choose() -> Usd.Stage:
            select_variants(stage, options.variants or {})
            return stage

        return choose
    file = Path(source)
    layer = None if options.session_layer is None else Path(options.session_layer)
    return lambda: open_stage(
        file, options.variants or {}, mask=options.mask, session_layer=layer,
        payloads=options.payloads,
    )  # fmt: skip


def _fill(
    builder: _core.SceneBuilder,
    choice: _Choice,
    textures: TextureTable,
    report: LoadReport,
    surfaces_of: SurfacesOf,
    cache: FrameCache | None,
    progress: LoadProgress | None,
) -> _Filled:
    """Fills the builder. A stage that was opened here is closed then."""
    stage = choice.opened()
    if cache is None:
        mtlx.tell(stage, report)
    tell_unloaded(stage, report)
    time = time_code(stage, choice.options.frame)
    found = survey(stage)
    materials = MaterialTable(builder, textures, time, report, apart=choice.editable)
    seen = seen_on(stage, choice.options, report)
    origin = textures.origin = find_origin(stage, time, seen.camera, seen.purposes)
    chosen, lights, shutter, outline, volumes, catchers = _read(
        stage,
        time,
        choice,
        seen,
        builder,
        textures,
        materials,
        bool(found.lights),
        report,
        surfaces_of(materials),
        cache,
        progress,
    )
    used = frame_number(time)
    return _Filled(
        chosen, found, materials.paths(), lights, used, shutter, seen.choice, outline, volumes,
        catchers, origin,
    )  # fmt: skip


def _native_builder(threads: int, store: _core.TextureStore | None) -> _core.SceneBuilder:
    from wavecomb import _core

    return _core.SceneBuilder(threads, store)


def _read(
    stage: Usd.Stage,
    time: Usd.TimeCode,
    choice: _Choice,
    seen: Seen,
    builder: _core.SceneBuilder,
    textures: TextureTable,
    materials: MaterialTable,
    has_lights: bool,
    report: LoadReport,
    surfaces: Surfaces,
    cache: FrameCache | None,
    progress: LoadProgress | None,
) -> tuple[
    str | None, tuple[str, ...], tuple[float, float] | None, NDArray[np.float64] | None,
    tuple[VolumeFacts, ...], tuple[str, ...],
]:  # fmt: skip
    """Fills the builder; gives camera, lights, shutter, outline, volumes and catchers."""
    up_axis = str(UsdGeom.GetStageUpAxis(stage))
    view_prim = seen.camera
    groups = LightGroups(report)
    profiles, hidden = IesTable(builder, report), choice.options.lights == "hidden"
    links = LinkTable(builder, report)
    lights = LightReader(time, up_axis, textures, groups, report, profiles, hidden, links)
    motion = find_motion(view_prim, time, seen.blur, report)
    rays = RayVisibility(builder, report, IGNORED[choice.options.catch])
    traversal = Traversal(
        time, seen.purposes, lights, report, motion, seen.binding_purposes,
        rays, textures.origin,
    )  # fmt: skip
    if choice.options.texture_limit is not None and textures.store is None:
        _limit_textures(stage, traversal, seen, choice, textures, report)
    view = None
    if view_prim is not None:
        to_world = np.array(traversal.xforms.GetLocalToWorldTransform(view_prim))
        to_world = moved_to(to_world, textures.origin)
        view = read_camera(view_prim, to_world, time, report, seen.lens)
    outline = None
    planes = frame_planes(up_axis, seen.lens, choice.size)
    meshes = None if cache is None else cache.meshes
    surfaces.cache = None if cache is None else cache.refined
    groups_of = GroupBuilder(
        stage, traversal, builder, materials, groups, report, surfaces, meshes, progress,
        framed=planes if view is None else None,
        detail=_strand_detail(view, choice.options, report), notes_emitters=not has_lights,
    )  # fmt: skip
    world = groups_of.world()
    lit = has_lights or groups_of.mesh_lights.any or groups_of.volumes.glow
    if materials.glows and not lit:
        lit = groups_of.emits_otherwise or light_what_is_drawn(world, materials)
    _hold_out(stage, choice.options.holdouts, builder)
    catchers = set_catchers(stage, choice.options, rays.catchers, builder)
    light_paths = _add_lights(world, lit, up_axis, textures, builder, report, materials.glows)
    volumes = add_volumes(world, builder, report, textures.origin)
    say_room(volumes, choice.options.texture_limit, report)
    say_cloudy(volumes, materials.cloudy, report)
    if not any(report.counts.get(kind) for kind in DRAWN_COUNTS):
        report.note("nothing to draw: the picture shows the environment only")
    chosen = None if view is None or view_prim is None else str(view_prim.GetPath())
    if view is None:
        report.note("no camera: framed what is drawn")
        outline = joined(world.outlines, planes)
        view = frame_points(outline, up_axis, seen.lens, choice.size)
    elif view_prim is not None:
        moves = camera_motion(view_prim, motion, textures.origin)
        if moves is not None:
            view.options["motion"] = moves
    surfaces.finish(world, view)
    if cache is not None:
        cache.has_same_levels = partial(surfaces.has_same_levels, world)
    builder.set_camera(view.transform, **view.options)
    shutter = None if motion is None else motion.shutter
    return chosen, light_paths, shutter, outline, volumes, catchers


def _strand_detail(
    view: View | None, options: LoadOptions, report: LoadReport
) -> StrandDetail | None:
    """What thins out strands for a view, if that is asked for."""
    if options.strand_pixels <= 0:
        return None
    if view is None:
        report.note("strands are not thinned out: there is no camera to say how thin they are")
        return None
    return StrandDetail(ViewSize(view, options.size), options.strand_pixels, report)


def _hold_out(stage: Usd.Stage, paths: tuple[str, ...], builder: _core.SceneBuilder) -> None:
    """Makes holdouts of prims. Raises WavecombError for a path that leads to none."""
    check_there(stage, "--holdout", paths)
    for path in paths:
        builder.add_visibility(path, {"holdout": True})


def _limit_textures(
    stage: Usd.Stage,
    traversal: Traversal,
    seen: Seen,
    choice: _Choice,
    textures: TextureTable,
    report: LoadReport,
) -> None:
    """Says which mip levels the textures leave out."""
    from wavecomb.usd.looks.texture_limit import plan_levels

    view = None
    if seen.camera is not None:
        to_world = np.array(traversal.xforms.GetLocalToWorldTransform(seen.camera))
        view = read_camera(seen.camera, to_world, traversal.time, LoadReport(), seen.lens)
    if view is None:
        cache = UsdGeom.BBoxCache(traversal.time, list(UsdGeom.Imageable.GetOrderedPurposeTokens()))
        box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
        points = None
        if not box.IsEmpty():
            bounds = np.array([box.GetMin(), box.GetMax()])
            # The ball inside of the box: the view that is found later is no nearer than this one's.
            points = bounds.mean(axis=0) + (corners(bounds) - bounds.mean(axis=0)) / np.sqrt(3.0)
        view = frame_points(points, str(UsdGeom.GetStageUpAxis(stage)), seen.lens, choice.size)
    limit = float(choice.options.texture_limit or 0) * MEGABYTE
    textures.drops = plan_levels(
        stage, traversal.time, ViewSize(view, choice.size), limit, report, textures.working
    )


def _add_lights(
    world: Group,
    lit: bool,
    up_axis: str,
    textures: TextureTable,
    builder: _core.SceneBuilder,
    report: LoadReport,
    glows: bool,
) -> tuple[str, ...]:
    """Adds all lights, or a soft dome where nothing else gives light (``lit``); their paths.

    ``glows``: whether there are emissive materials all the same.
    """
    lights = placed_lights(world, MAX_LIGHTS + 1)
    if len(lights) > MAX_LIGHTS:
        report.warn(f"more than {MAX_LIGHTS} lights: the rest is left out")
        lights = lights[:MAX_LIGHTS]
    for light, place in lights:
        options, transform = light.options, place.middle
        if place.steps is not None:
            options = {**options, "motion": np.ascontiguousarray(place.steps)}
            if changes_size(place.steps):
                what = "lights that change their size: as large as in mid-shutter"
                report.missing(what, options["name"])
        if "portals" in options:
            options = {**options, "portals": options["portals"] @ transform}
        if light.filters:
            options = {**options, "filter": add_filters(builder, light.filters, transform)}
        builder.add_light(light.kind, transform, **options)
    if lights:
        return tuple(light.options["name"] for light, _ in lights)
    if lit:
        report.note("no visible light; the scene is lit by emissive materials or not at all")
        return ()
    if glows:
        what = "no light but emissive materials that light too little: added a soft dome"
        report.note(f"{what} (a light of intensity 0 keeps it off)")
    else:
        report.note("no light: added a soft dome")
    texture = textures.add_pixels("soft dome", from_rec709(soft_dome(), textures.working))
    builder.add_light("dome", up_rotation(up_axis), name="soft dome", texture=texture)
    return ("",)


def _build(builder: _core.SceneBuilder, file: Path) -> _core.Scene:
    try:
        return builder.build()
    except ValueError as error:
        raise WavecombError(f"{file}: {error}") from error
