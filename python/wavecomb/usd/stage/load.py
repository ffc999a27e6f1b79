# SPDX-License-Identifier: Apache-2.0
"""Reads a USD file or an open stage into a scene."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.image.working_space import from_rec709
from wavecomb.load_options import LoadOptions
from wavecomb.machine import give_back_memory, without_collection
from wavecomb.run.isolation import progress_notes
from wavecomb.run.isolation.memory import describe_limit
from wavecomb.usd import mtlx
from wavecomb.usd.cameras.camera import (
    View,
    camera_motion,
    frame_planes,
    frame_points,
    read_camera,
)
from wavecomb.usd.cameras.framing import corners, joined
from wavecomb.usd.geometry.cage import ViewSize
from wavecomb.usd.geometry.gprims import COUNTS
from wavecomb.usd.geometry.shutter import find_motion
from wavecomb.usd.geometry.strands import StrandDetail
from wavecomb.usd.geometry.subdivision import SubdivisionSurfaces, parse_level
from wavecomb.usd.instances.group import Group, changes_size, is_lit_by_emitters, placed_lights
from wavecomb.usd.instances.group_builder import GroupBuilder
from wavecomb.usd.instances.mesh_batch import LoadProgress
from wavecomb.usd.instances.placement import add_volumes, report_grid_memory, report_ignored_volumes
from wavecomb.usd.layers.opening import list_contents, open_stage, select_variants
from wavecomb.usd.layers.population import report_unloaded_payloads
from wavecomb.usd.lights.dome import Y_TO_Z, soft_dome
from wavecomb.usd.lights.filters import add_filters
from wavecomb.usd.lights.ies import IesTable
from wavecomb.usd.lights.light import LightReader, LinkTable
from wavecomb.usd.materials.material import MaterialTable
from wavecomb.usd.materials.texture import MEGABYTE, TextureCache, TextureTable, texture_store
from wavecomb.usd.render_settings.view import ViewSettings, check_view, view_settings
from wavecomb.usd.stage.collections import LightGroups
from wavecomb.usd.stage.context import WORLD, LoadContext, Origin, find_origin, to_scene_space
from wavecomb.usd.stage.frame_cache import FrameCache
from wavecomb.usd.stage.load_result import LoadedStage
from wavecomb.usd.stage.ray_visibility import IGNORED, RayVisibility, check_exists, set_catchers
from wavecomb.usd.stage.report import NOT_TEXT, LoadReport, capture_diagnostics, first_message
from wavecomb.usd.stage.time_codes import frame_number, time_code
from wavecomb.usd.stage.traversal import Traversal

if TYPE_CHECKING:
    from wavecomb import _core

MAX_LIGHTS = 4096
"""Maximum number of lights in a scene, since instancing can multiply them."""


def load_stage(
    source: str | Path | Usd.Stage,
    options: LoadOptions | None = None,
    *,
    editable: bool = False,
    reuse: TextureCache | None = None,
    cache: FrameCache | None = None,
    progress: LoadProgress | None = None,
    builder_factory: Callable[[], _core.SceneBuilder] | None = None,
    **changes: Any,
) -> LoadedStage:
    """Reads a USD stage into a scene.

    Args:
        source: A .usd, .usda, .usdc or .usdz file, or an open stage. An open stage stays open, is
            changed only if ``variants`` are given, and must not change during the call.
        options: Options of the load. A mask, a payload option and a session layer require a file.
        editable: Whether to keep equal materials separate and to keep ``textures``, for programs
            that edit the scene. ``editable`` does not change the image.
        reuse: ``textures`` of an earlier load; textures of unchanged files are shared.
        cache: Cache of the same open stage, filled when another frame was read; unchanged data is
            shared. The cache does not change the image.
        progress: Called with the number of prims read and the number found so far.
        builder_factory: Creates a scene builder without a texture store, for tests.
        **changes: Fields of ``LoadOptions`` that replace the fields of ``options``.

    Raises:
        WavecombError: The file or an option is invalid.
    """
    started = clock.perf_counter()
    chosen = LoadOptions.of(options, changes)
    check_view(chosen)
    parse_level(chosen.subdivision)
    if isinstance(source, Usd.Stage) and chosen.chooses_what_opens:
        raise WavecombError("mask, payloads, session_layer are chosen when the stage is opened")
    report, file = LoadReport(), _file_of(source)
    if cache is not None:
        reuse = cache.textures
    # Disable NumPy's warnings about values that are not finite, since the readers of prims handle
    # such values.
    with capture_diagnostics(report), np.errstate(all="ignore"), without_collection():
        store = None
        if builder_factory is None:
            from wavecomb import _core

            store = texture_store(chosen.texture_limit, reuse, report)
            builder = _core.SceneBuilder(chosen.threads, store)
        else:
            builder = builder_factory()
        try:
            load = _Load(source, builder, chosen, report, reuse, store, editable)
            facts = load.run(cache, progress)
            textures = load.textures
            # If this call opened the stage, deleting `load` closes it.
            del load
        except UnicodeDecodeError:
            raise WavecombError(f"{file}: {NOT_TEXT}") from None
        except Tf.ErrorException as error:
            raise WavecombError(f"{file}: USD cannot read it: {first_message(error)}") from None
        except MemoryError:
            raise WavecombError(
                f"{file}: out of memory while it was read{describe_limit()}"
            ) from None
        progress_notes.note("building the scene of", file)
        try:
            scene = builder.build()
        except ValueError as error:
            raise WavecombError(f"{file}: {error}") from error
        progress_notes.note("rendering", file)
    if cache is not None:
        cache.textures = textures.cache(scene)
        cache.end_frame()
        report.absorb(cache.opening)
    if builder_factory is None:
        give_back_memory()
    return LoadedStage(
        scene, report, stage_path=file, seconds=clock.perf_counter() - started,
        textures=textures.cache(scene) if editable else None, working_space=chosen.working_space,
        leaves_out_levels=chosen.texture_limit is not None and store is None, **facts,
    )  # fmt: skip


def _file_of(source: str | Path | Usd.Stage) -> Path:
    """Returns the file of a stage, or the identifier of an in-memory stage's layer."""
    if not isinstance(source, Usd.Stage):
        return Path(source)
    layer = source.GetRootLayer()
    return Path(layer.realPath or layer.identifier)


def _opened(source: str | Path | Usd.Stage, options: LoadOptions) -> Usd.Stage:
    """Returns the open stage with the variants of the options."""
    if isinstance(source, Usd.Stage):
        target = source.GetEditTarget()
        try:
            select_variants(source, options.variants or {})
        finally:
            source.SetEditTarget(target)
        return source
    layer = None if options.session_layer is None else Path(options.session_layer)
    return open_stage(
        Path(source), options.variants or {}, mask=options.mask, session_layer=layer,
        payloads=options.payloads,
    )  # fmt: skip


class _Load:
    """State of one load of a stage into a scene builder.

    Attributes:
        textures: Textures of the scene.
    """

    def __init__(
        self,
        source: str | Path | Usd.Stage,
        builder: _core.SceneBuilder,
        options: LoadOptions,
        report: LoadReport,
        reuse: TextureCache | None,
        store: _core.TextureStore | None,
        editable: bool,
    ) -> None:
        self._stage = _opened(source, options)
        time = time_code(self._stage, options.frame)
        self._context = LoadContext(self._stage, time, builder, report, options)
        self.textures = TextureTable(self._context, reuse, store)
        self._materials = MaterialTable(self._context, self.textures, apart=editable)
        self._surfaces = SubdivisionSurfaces(self._context, self._materials)

    def run(self, cache: FrameCache | None, progress: LoadProgress | None) -> dict[str, Any]:
        """Fills the scene builder; returns fields of ``LoadedStage``."""
        try:
            return self._run(cache, progress)
        finally:
            self.textures.release()

    def _run(self, cache: FrameCache | None, progress: LoadProgress | None) -> dict[str, Any]:
        c, textures = self._context, self.textures
        if cache is None:
            mtlx.report_problems(c.stage, c.report)
        report_unloaded_payloads(c.stage, c.report)
        found = list_contents(c.stage)
        settings = view_settings(c.stage, c.options, c.report, found.may_have_cameras)
        c.motion = find_motion(settings.camera, c.time, settings.blur, c.report)
        c.purposes, c.binding_purposes = settings.purposes, settings.binding_purposes
        c.origin = textures.origin = find_origin(
            c.stage, c.time, settings.camera, settings.purposes
        )
        groups = LightGroups(c.report)
        lights = LightReader(c, textures, groups, IesTable(c), LinkTable(c))
        rays = RayVisibility(c, IGNORED[c.options.catch])
        if c.options.texture_limit is not None and textures.store is None:
            self._limit_textures(settings)
        view = self._camera_view(settings, c.origin, c.report)
        planes = frame_planes(c.up_axis, settings.lens, c.options.size)
        c.framed = planes if view is None else None
        self._surfaces.cache = None if cache is None else cache.refined
        group_builder = GroupBuilder(
            c, Traversal(c, lights, rays), self._materials, groups, self._surfaces,
            cache=None if cache is None else cache.meshes, progress=progress,
            detail=self._strand_detail(view), notes_emitters=not found.lights,
        )  # fmt: skip
        world = group_builder.world()
        lit = bool(found.lights) or group_builder.mesh_lights.any or group_builder.volumes.may_light
        if self._materials.emits and not lit:
            lit = group_builder.has_other_emission or is_lit_by_emitters(world, self._materials)
        check_exists(c.stage, "--holdout", c.options.holdouts)
        for path in c.options.holdouts:
            c.builder.add_visibility(path, {"holdout": True})
        catchers = set_catchers(c.stage, c.options, rays.catchers, c.builder)
        light_paths = self._add_lights(world, lit)
        volumes = add_volumes(world, c)
        report_grid_memory(volumes, c.options.texture_limit, c.report)
        report_ignored_volumes(volumes, self._materials.scattering_interiors, c.report)
        if not any(c.report.counts.get(kind) for kind in (*COUNTS.values(), "volumes")):
            c.report.note("nothing to draw: the image shows the environment only")
        camera_path = (
            None if view is None or settings.camera is None else str(settings.camera.GetPath())
        )
        outline = self._set_camera(settings, view, world, planes)
        if cache is not None:
            cache.has_same_levels = partial(self._surfaces.has_same_levels, world)
        return {
            "camera_path": camera_path, "cameras": found.cameras, "lights": found.lights,
            "material_paths": self._materials.paths(), "light_paths": light_paths,
            "frame": frame_number(c.time), "shutter": c.motion and c.motion.shutter,
            "render": settings.choice, "outline": outline, "volumes": volumes, "catchers": catchers,
            "origin": c.origin,
        }  # fmt: skip

    def _camera_view(
        self, settings: ViewSettings, origin: Origin, report: LoadReport
    ) -> View | None:
        """Returns the view of the camera prim relative to an origin.

        Returns None if there is no valid camera prim.
        """
        if settings.camera is None:
            return None
        c = self._context
        to_world = np.array(UsdGeom.XformCache(c.time).GetLocalToWorldTransform(settings.camera))
        moved = to_scene_space(to_world, origin)
        return read_camera(settings.camera, moved, c.time, report, settings.lens)

    def _set_camera(
        self, settings: ViewSettings, view: View | None, world: Group, planes: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Sets the camera and refines meshes; returns the outline if the default camera is used."""
        c, outline = self._context, None
        if view is None:
            c.report.note("no camera: framed what is drawn")
            outline = joined(world.outlines, planes)
            view = frame_points(outline, c.up_axis, settings.lens, c.options.size)
        elif (moves := camera_motion(settings.camera, c.motion, c.origin)) is not None:
            view.options["motion"] = moves
        self._surfaces.finish(world, view)
        c.builder.set_camera(view.transform, **view.options)
        return outline

    def _strand_detail(self, view: View | None) -> StrandDetail | None:
        """Returns the simplification of thin strands if the options enable it."""
        c = self._context
        if c.options.strand_pixels <= 0:
            return None
        if view is None:
            what = "strands are not simplified: their width in pixels is unknown without a camera"
            c.report.note(what)
            return None
        return StrandDetail(ViewSize(view, c.options.size), c.options.strand_pixels, c.report)

    def _limit_textures(self, settings: ViewSettings) -> None:
        """Chooses the number of finest mip levels of each texture that are not loaded."""
        from wavecomb.usd.materials.texture_limit import plan_levels

        c = self._context
        view = self._camera_view(settings, WORLD, LoadReport())
        if view is None:
            purposes = list(UsdGeom.Imageable.GetOrderedPurposeTokens())
            box = UsdGeom.BBoxCache(c.time, purposes).ComputeWorldBound(c.stage.GetPseudoRoot())
            bounds, points = box.ComputeAlignedRange(), None
            if not bounds.IsEmpty():
                ends = np.array([bounds.GetMin(), bounds.GetMax()])
                # Compute a preliminary view of the inscribed ball of the bounding box. The final
                # view is computed from the geometry, and its camera is never closer than this
                # preliminary camera.
                points = ends.mean(axis=0) + (corners(ends) - ends.mean(axis=0)) / np.sqrt(3.0)
            view = frame_points(points, c.up_axis, settings.lens, c.options.size)
        limit = float(c.options.texture_limit or 0) * MEGABYTE
        self.textures.drops = plan_levels(c, ViewSize(view, c.options.size), limit)

    def _add_lights(self, world: Group, lit: bool) -> tuple[str, ...]:
        """Adds all lights, or a default dome if nothing emits light; returns the lights' paths.

        ``lit`` says whether the stage has lights or sufficient emission.
        """
        c = self._context
        lights = placed_lights(world, MAX_LIGHTS + 1)
        if len(lights) > MAX_LIGHTS:
            c.report.warn(f"more than {MAX_LIGHTS} lights: the rest is left out")
            lights = lights[:MAX_LIGHTS]
        for light, place in lights:
            options, transform = dict(light.options), place.middle
            if place.steps is not None:
                options["motion"] = np.ascontiguousarray(place.steps)
                if changes_size(place.steps):
                    what = "lights that change their size (constant, as at mid-shutter)"
                    c.report.missing(what, options["name"])
            if "portals" in options:
                options["portals"] = options["portals"] @ transform
            if light.filters:
                options["filter"] = add_filters(c.builder, light.filters, transform)
            c.builder.add_light(light.kind, transform, **options)
        if lights:
            return tuple(light.options["name"] for light, _ in lights)
        if lit:
            c.report.note("no visible light; the scene is lit by emissive materials or not at all")
            return ()
        if self._materials.emits:
            what = "no light except emissive materials that are too dim: added a soft dome"
            c.report.note(f"{what} (a light of intensity 0 keeps it off)")
        else:
            c.report.note("no light: added a soft dome")
        image = from_rec709(soft_dome(), self.textures.working)
        texture = self.textures.add_pixels("soft dome", image)
        turn = Y_TO_Z if c.up_axis == "Z" else np.eye(4)
        c.builder.add_light("dome", turn, name="soft dome", texture=texture)
        return ("",)
