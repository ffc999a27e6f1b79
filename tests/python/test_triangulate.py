# SPDX-License-Identifier: Apache-2.0
"""Tests the triangulation of arbitrary polygons: results and run time."""

import numpy as np
import pytest
from usd_recorder import load

from wavecomb import _core
from wavecomb.usd.geometry import triangulate as module

UP = np.array([0.0, 0.0, 1.0])


def turn(a, b, c):
    return (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])


def every_ear(flat):
    """Clips ears by checking every corner in each step, as a reference."""

    def is_ear(a, b, c):
        if turn(flat[a], flat[b], flat[c]) <= 0:
            return False
        others = flat[[i for i in ring if i not in (a, b, c)]]
        inside = np.ones(len(others), bool)
        for one, other in ((a, b), (b, c), (c, a)):
            inside &= turn(flat[one], flat[other], others) >= 0
        for corner in (a, b, c):
            inside &= (others != flat[corner]).any(axis=1)
        return not inside.any()

    ring, out, at, misses = list(range(len(flat))), [], 0, 0
    while len(ring) > 3:
        size = len(ring)
        triple = ring[at - 1], ring[at], ring[(at + 1) % size]
        if misses >= size or is_ear(*triple):
            out.append(triple)
            ring.pop(at)
            at, misses = at % len(ring), 0
        else:
            at, misses = (at + 1) % size, misses + 1
    return np.array([*out, ring])


def star(n, rng):
    angle, radius = np.sort(rng.random(n)) * 2 * np.pi, 0.2 + rng.random(n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def spiral(n, turns):
    t = np.linspace(0, 1, n // 2)
    there, back = (
        (t + width)[:, None] * np.stack([np.cos(t * turns), np.sin(t * turns)], axis=1)
        for width in (0.02, 0.02 + 1.8 / turns)
    )
    return np.concatenate([there, back[::-1]])


def comb(n, rng):
    x, tip = np.linspace(0, 1, n - 2), 0.5 + rng.random(n - 2)
    teeth = np.stack([x, np.where(np.arange(n - 2) % 2 == 1, tip, 0.1 * tip)], axis=1)
    return np.concatenate([[[0, 0], [1, 0]], teeth[::-1]])


def pentagram(n, _rng):
    step = next(k for k in range(n // 2 - 1, 0, -1) if np.gcd(k, n) == 1)
    angle = np.arange(n) * 2 * np.pi * step / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


HARD = {
    "star": star,
    "spiral": lambda n, _: spiral(n, 100.0),
    "wide spiral": lambda n, _: spiral(n, max(12.0, n / 30.0)),
    "comb": comb,
    "pentagram": pentagram,
    "random": lambda n, rng: rng.random((n, 2)),
    "far apart": lambda n, rng: rng.standard_cauchy((n, 2)),
    "walk": lambda n, rng: np.cumsum(rng.normal(size=(n, 2)), axis=0),
    "few places": lambda n, rng: rng.integers(0, 4, (n, 2)).astype(float),
    "two heaps": lambda n, rng: 0.01 * rng.normal(size=(n, 2)) + (np.arange(n) % 2)[:, None],
    "noise in x": lambda n, rng: np.stack([np.sort(rng.random(n)), rng.random(n)], axis=1),
    "a line": lambda n, _: np.arange(n)[:, None] * [1.0, 0.0],
    "one place": lambda n, _: np.zeros((n, 2)),
}


@pytest.mark.parametrize("name", HARD)
def test_ears_are_those_of_looking_everywhere(name):
    for seed, count in enumerate((4, 5, 6, 11, 24, 61)):
        rng = np.random.default_rng(seed)
        flat = HARD[name](count, rng)
        for corners in (flat, flat[::-1], np.roll(flat, count // 2, axis=0)):
            corners = np.ascontiguousarray(corners)
            found, hurried = _core.clip_ears(corners)
            assert hurried == 0
            assert (found == every_ear(corners)).all()


def check_time(name, count):
    """Asserts that the search for ears needs few steps per corner."""
    flat = np.ascontiguousarray(HARD[name](count, np.random.default_rng(count)))
    triangles, hurried = _core.clip_ears(flat, module._EAR_STEPS * count // 100_000)
    assert hurried == 0
    assert triangles.shape == (len(flat) - 2, 3)
    assert sorted(set(triangles.ravel().tolist())) == list(range(len(flat)))


@pytest.mark.parametrize("name", HARD)
def test_faces_of_5000_corners_take_no_time(name):
    check_time(name, 5000)


@pytest.mark.long
@pytest.mark.parametrize("name", HARD)
def test_faces_of_100000_corners_take_a_second(name):
    check_time(name, 100_000)


def test_large_concave_faces_are_covered_once():
    """A comb of 8,000 corners, which was once too large for ear clipping."""
    corners = comb(8000, np.random.default_rng(3))
    points = np.concatenate([corners, np.zeros((8000, 1))], axis=1).astype(np.float32)
    topology = module.triangulate(
        points, np.array([8000], np.int32), np.arange(8000, dtype=np.int32)
    )
    p = points[topology.triangles].astype(float)
    areas = 0.5 * turn(p[:, 0].T, p[:, 1].T, p[:, 2])
    x, y = points[:, 0].astype(float), points[:, 1].astype(float)
    assert (areas >= 0).all()
    assert areas.sum() == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def test_corners_that_are_no_numbers_make_a_fan():
    flat = np.random.default_rng(0).random((6, 2))
    flat[3, 1] = np.nan
    triangles, hurried = _core.clip_ears(flat)
    assert triangles.tolist() == [[0, i, i + 1] for i in range(1, 5)]
    assert hurried == 0


def tangle(count):
    p = np.random.default_rng(7).random((count, 2))
    points = ", ".join(f"({x:.6f}, {y:.6f}, 0)" for x, y in p)
    return f"""def Mesh "Tangle" {{
        point3f[] points = [{points}]
        int[] faceVertexCounts = [{count}]
        int[] faceVertexIndices = [{", ".join(map(str, range(count)))}]
        uniform token subdivisionScheme = "none" }}"""


def test_a_stage_with_a_tangled_face_loads(tmp_path):
    scene, stage = load(tmp_path, tangle(5000))
    assert scene.meshes[0]["indices"].shape == (4998, 3)
    assert not any("crosses itself" in line for line in stage.report.lines())


def test_faces_that_take_too_long_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_EAR_STEPS", 1000)
    scene, stage = load(tmp_path, tangle(500))
    assert scene.meshes[0]["indices"].shape == (498, 3)
    (line,) = (line for line in stage.report.lines() if "crosses itself too often" in line)
    assert "/Tangle" in line
