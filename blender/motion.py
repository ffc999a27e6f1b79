# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples moving and deforming objects, and writes them over geometry that was exported before."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .context import Translation, data_path, local_matrix, object_path

RIGID = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME", "EMPTY",
         "CAMERA", "LIGHT", "ARMATURE", "LATTICE"}  # fmt: skip


@dataclass
class Shape:
    """The geometry of an object at one time.

    Attributes:
        topology: Checksum of all geometry data except positions.
        content: Checksum of positions.
        points: Positions, or None if they are not needed.
    """

    topology: int
    content: int
    points: np.ndarray | None


@dataclass
class Sampled:
    """Samples of moving and deforming objects for one frame.

    Attributes:
        frame: Time of the frame.
        matrices: World matrices by object and time.
        local: Matrices relative to the parent, by object and time.
        shapes: Shapes of meshes by object and time.
        signature: Value that changes whenever the geometry has to be exported again.
        base: Checksum of positions and local matrix of each exported object, by object.
        shutter: Opening and closing time relative to the frame; None without motion blur.
    """

    frame: float
    matrices: dict[str, dict[float, Any]] = field(default_factory=dict)
    local: dict[str, dict[float, Any]] = field(default_factory=dict)
    shapes: dict[str, dict[float, Shape]] = field(default_factory=dict)
    signature: object = None
    base: dict[str, Any] = field(default_factory=dict)
    shutter: tuple[float, float] | None = None


def shutter_of(scene: Any) -> tuple[float, float] | None:
    """Returns the shutter interval in frames relative to the frame."""
    render = scene.render
    if not render.use_motion_blur or render.motion_blur_shutter <= 0.0:
        return None
    length = float(render.motion_blur_shutter)
    position = getattr(render, "motion_blur_position", None) or scene.cycles.motion_blur_position
    first = {"START": 0.0, "CENTER": -0.5 * length, "END": -length}[str(position)]
    return (first, first + length)


def sample(
    depsgraph: Any, move_to: Callable[[float], None], needs_shapes: bool, steps: int = 3
) -> Sampled:
    """Samples all objects over the shutter interval, and returns to the frame.

    Args:
        depsgraph: Evaluated scene, which ``move_to`` updates.
        move_to: Sets the frame, fractions included.
        needs_shapes: Whether later frames will reuse the geometry.
        steps: Number of times over the interval.
    """
    scene = depsgraph.scene
    frame = float(scene.frame_current_final)
    found = Sampled(frame, shutter=shutter_of(scene))
    times = [frame]
    if found.shutter is not None:
        first, last = (frame + offset for offset in found.shutter)
        times = [first + (last - first) * i / (steps - 1) for i in range(steps)]
    for time in times:
        if time != frame or len(times) > 1:
            move_to(time)
        _sample_at(depsgraph, time, found, needs_shapes or len(times) > 1)
    if len(times) > 1:
        move_to(frame)
        if frame not in times:
            _sample_at(depsgraph, frame, found, True)
    if needs_shapes:
        found.signature = _signature(depsgraph, found)
    at = frame
    found.base = {
        name: (shape[at].content if at in shape else 0, _key(found.local[name][at]))
        for name, shape in ((n, found.shapes.get(n, {})) for n in found.local)
        if at in found.local[name]
    }
    _drop_still(found)
    return found


def _sample_at(depsgraph: Any, time: float, found: Sampled, with_shapes: bool) -> None:
    for thing in depsgraph.objects:
        if thing.type not in RIGID:
            continue
        found.matrices.setdefault(thing.name, {})[time] = thing.matrix_world.copy()
        found.local.setdefault(thing.name, {})[time] = local_matrix(thing)
        if with_shapes and thing.type == "MESH":
            found.shapes.setdefault(thing.name, {})[time] = _shape_of(thing)


def _shape_of(thing: Any) -> Shape:
    mesh = thing.data
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", points) if len(points) else None
    counts = (len(mesh.vertices), len(mesh.polygons), len(mesh.loops), len(mesh.materials))
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    topology = zlib.crc32(corners.tobytes(), zlib.crc32(repr(counts).encode()))
    return Shape(topology, zlib.crc32(points.tobytes()), points.reshape(-1, 3))


def _key(matrix: Any) -> tuple[float, ...]:
    return tuple(round(float(value), 7) for row in matrix for value in row)


def _signature(depsgraph: Any, found: Sampled) -> object:
    rows = []
    for thing in depsgraph.objects:
        data = thing.data
        shapes = found.shapes.get(thing.name, {})
        topology = shapes[found.frame].topology if found.frame in shapes else 0
        slots = tuple(s.material.name if s.material else "" for s in thing.material_slots)
        parent = thing.parent.name if thing.parent else ""
        rows.append((thing.name, thing.type, data.name if data else "", parent, topology, slots))
    instances = tuple(
        (i.object.name, _key(i.matrix_world)) for i in depsgraph.object_instances if i.is_instance
    )
    return (tuple(sorted(rows)), instances)


def _drop_still(found: Sampled) -> None:
    """Reduces objects that do not move within the shutter interval to a single sample."""
    for table in (found.matrices, found.local):
        for name, samples in table.items():
            if len({_key(matrix) for matrix in samples.values()}) == 1:
                table[name] = {found.frame: next(iter(samples.values()))}
    for name, shapes in found.shapes.items():
        if len({(s.content, s.topology) for s in shapes.values()}) == 1:
            found.shapes[name] = {found.frame: next(iter(shapes.values()))}


def write_motion(into: Translation, sampled: Sampled, base: dict[str, Any]) -> None:
    """Writes transforms and points that move, or differ from the exported geometry."""
    for name, samples in sampled.local.items():
        thing = into.depsgraph.objects.get(name)
        if thing is None or thing.type in ("CAMERA", "LIGHT"):
            continue
        exported = base.get(name)
        moved = exported is None or exported[1] != _key(next(iter(samples.values())))
        if len(samples) > 1 or moved:
            into.layer.over(object_path(thing)).transform(samples)
        shapes = sampled.shapes.get(name, {})
        if not shapes:
            continue
        changed = exported is None or exported[0] != next(iter(shapes.values())).content
        if len(shapes) > 1 or (changed and base):
            _write_points(into, thing, shapes)
    if sampled.shutter is not None:
        camera = into.layer.over("/Wavecomb/Camera")
        camera.set("double shutter:open", sampled.shutter[0])
        camera.set("double shutter:close", sampled.shutter[1])


def _write_points(into: Translation, thing: Any, shapes: dict[float, Shape]) -> None:
    if len({shape.topology for shape in shapes.values()}) > 1:
        into.report.miss("motion blur of a mesh whose topology changes", thing.name)
        return
    prim = into.layer.over(data_path(thing))
    prim.sample("point3f[] points", {time: shape.points for time, shape in shapes.items()})
    # The exported normals belong to the old points.
    if any(polygon.use_smooth for polygon in thing.data.polygons[:64]):
        normals = _vertex_normals(thing.data)
        prim.lines.append("normal3f[] normals = None")
        prim.lines.append(f"normal3f[] primvars:normals = {_text(normals)} (")
        prim.lines.append('    interpolation = "vertex"')
        prim.lines.append(")")
    else:
        prim.lines.append("normal3f[] normals = None")


def _vertex_normals(mesh: Any) -> np.ndarray:
    found = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertex_normals.foreach_get("vector", found)
    return found.reshape(-1, 3)


def _text(values: np.ndarray) -> str:
    from .usda import text_of

    return text_of(values)


def names(things: Iterable[Any]) -> list[str]:
    """Returns the names of objects."""
    return [thing.name for thing in things]
