# SPDX-License-Identifier: Apache-2.0
"""Tests the fast path for meshes of triangles or quads against the general path."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd

from wavecomb import _core
from wavecomb.usd.geometry.mesh_arrays import (
    IDENTITY,
    MeshError,
    bake,
    bake_and_triangulate,
    bake_normals,
    extent,
    transform_shape,
)
from wavecomb.usd.geometry.shapes import SHAPES, read_shape
from wavecomb.usd.geometry.triangulate import triangulate

SEED = 20


def matrices(rng: np.random.Generator) -> list[Gf.Matrix4d]:
    """Returns the identity, a translation, a mirror with small integers, and a random matrix."""
    shift, mirror, turn = np.eye(4), np.diag([-2.0, 0.0, 3.0, 1.0]), rng.standard_normal((4, 4))
    shift[3, :3] = 1e6, -3.5, 0.0
    mirror[1, 0] = mirror[0, 1] = 1.0
    turn[:, 3] = 0, 0, 0, 1
    return [IDENTITY, *(Gf.Matrix4d(*m.ravel()) for m in (shift, mirror, turn))]


@pytest.mark.parametrize("size", [3, 4])
@pytest.mark.parametrize("count", [2, 3, 8, 65, 1000])
def test_the_short_way_gives_the_same_bits(size: int, count: int) -> None:
    rng = np.random.default_rng(SEED + count)
    points = (rng.standard_normal((count, 3)) * 10.0 ** rng.uniform(-3, 3)).astype(np.float32)
    points[rng.random((count, 3)) < 0.2] = 0
    counts = np.full(count, size, np.int32)
    indices = rng.integers(0, count, size * count).astype(np.int32)
    for matrix in matrices(rng):
        found = bake_and_triangulate(points, counts, indices, matrix)
        assert found is not None
        positions, bounds, topology = found
        wanted = points if matrix == IDENTITY else bake(points, matrix)
        assert positions.tobytes() == wanted.tobytes()
        np.testing.assert_array_equal(bounds, extent(wanted))
        long = triangulate(points, counts, indices)
        np.testing.assert_array_equal(topology.triangles, long.triangles)
        np.testing.assert_array_equal(topology.corner_ids(), long.corner_ids())
        np.testing.assert_array_equal(topology.face_ids(), long.face_ids())
        assert topology.triangles.dtype == np.uint32
        assert (topology.count, topology.point_count, topology.face_count) == (
            long.count, long.point_count, long.face_count
        )  # fmt: skip
        assert (positions is points) == (matrix == IDENTITY), "a copy only where points move"


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)


@pytest.mark.parametrize(
    ("counts", "indices"),
    [
        ([], []),
        ([3], [0, 1]),
        ([3], [0, 1, 2, 3]),
        ([3], [0, 1, 4]),
        ([3], [0, 1, -1]),
        ([3, 4], [0, 1, 2, 0, 1, 2, 3]),
        ([4, 3, 5], [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]),
        ([-3], []),
        ([2, 2], [0, 1, 2, 3]),
        ([5], [0, 1, 2, 3, 0]),
    ],
)
def test_anything_else_is_left_to_the_long_way(counts: list[int], indices: list[int]) -> None:
    faces = np.array(counts, np.int32), np.array(indices, np.int32)
    assert bake_and_triangulate(SQUARE, *faces, IDENTITY) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1.1e18, -3e38])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_that_are_nowhere_are_left_to_it(value: float, axis: int) -> None:
    points = SQUARE.copy()
    points[3, axis] = value
    faces = np.array([3], np.int32), np.array([0, 1, 2], np.int32)
    assert bake_and_triangulate(points, *faces, IDENTITY) is None
    assert bake_and_triangulate(SQUARE, *faces, IDENTITY) is not None
    assert bake_and_triangulate(SQUARE, *faces, Gf.Matrix4d(1e30)) is None


def test_points_that_no_triangle_has() -> None:
    triangles = np.array([[0, 1, 2], [2, 1, 4]], np.uint32)
    used = _core.used_points(triangles, 6)
    assert used is not None and used.tolist() == [True, True, True, False, True, False]
    assert _core.used_points(triangles[:1], 3) is None
    with pytest.raises(ValueError, match="a point that is not there"):
        _core.used_points(triangles, 4)


@pytest.mark.parametrize("kind", sorted(SHAPES))
def test_shapes_are_placed_with_the_bits_of_the_long_way(kind: str) -> None:
    stage = Usd.Stage.CreateInMemory()
    shape = read_shape(stage.DefinePrim("/Shape", kind), Usd.TimeCode.Default(), frozenset())
    assert shape is not None
    assert shape.positions.dtype == shape.normals.dtype == np.float32
    for matrix in matrices(np.random.default_rng(SEED)):
        positions, normals, bounds = transform_shape(shape.positions, shape.normals, matrix)
        wanted = bake(shape.positions, matrix)
        assert positions.tobytes() == wanted.tobytes()
        assert normals.tobytes() == bake_normals(shape.normals, matrix).tobytes()
        np.testing.assert_array_equal(bounds, extent(wanted))


def test_shapes_that_are_nowhere_say_so() -> None:
    far = Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 2e18, 0))
    with pytest.raises(MeshError, match="too far away"):
        transform_shape(SQUARE, SQUARE, far)
