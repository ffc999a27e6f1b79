# SPDX-License-Identifier: Apache-2.0
"""Tests implicit shapes against closed forms, such as area, volume, normals and extent."""

import math

import numpy as np
import pytest
from usd_recorder import load

PI = math.pi


def frustum(r, s, h):
    """Returns side area and volume of a truncated cone."""
    return PI * (r + s) * math.hypot(h, r - s), PI * h * (r * r + r * s + s * s) / 3


def cylinder(r, s, h):
    area, volume = frustum(r, s, h)
    return area + PI * (r * r + s * s), volume


def capsule(r, s, h):
    area, volume = frustum(r, s, h)
    return area + 2 * PI * (r * r + s * s), volume + 2 * PI * (r**3 + s**3) / 3


SHAPES = [
    ("Sphere", "", 4 * PI, 4 * PI / 3, (1, 1, 1)),
    ("Sphere", "double radius = 3", 36 * PI, 36 * PI, (3, 3, 3)),
    ("Sphere", "double radius = -3", 36 * PI, 36 * PI, (3, 3, 3)),
    ("Cube", "", 24, 8, (1, 1, 1)),
    ("Cube", "double size = 5", 150, 125, (2.5, 2.5, 2.5)),
    ("Cylinder", "", *cylinder(1, 1, 2), (1, 1, 1)),
    ("Cylinder", 'double height = 6\nuniform token axis = "X"', *cylinder(1, 1, 6), (3, 1, 1)),
    (
        "Cylinder_1",
        'double radiusBottom = 2\ndouble radiusTop = 0.5\nuniform token axis = "Y"',
        *cylinder(2, 0.5, 2),
        (2, 1, 2),
    ),
    ("Cylinder_1", "double radiusBottom = 0\ndouble radiusTop = 2", *cylinder(0, 2, 2), (2, 2, 1)),
    ("Cone", "", *cylinder(1, 0, 2), (1, 1, 1)),
    ("Cone", 'double radius = 2\nuniform token axis = "X"', *cylinder(2, 0, 2), (1, 2, 2)),
    ("Capsule", "", *capsule(0.5, 0.5, 1), (0.5, 0.5, 1)),
    ("Capsule", 'double radius = 2\nuniform token axis = "Y"', *capsule(2, 2, 1), (2, 2.5, 2)),
    (
        "Capsule_1",
        "double radiusBottom = 2\ndouble radiusTop = 1\ndouble height = 4",
        *capsule(2, 1, 4),
        None,
    ),
    ("Plane", "", 4, 0, (1, 1, 0)),
    ("Plane", 'double width = 6\nuniform token axis = "X"', 12, 0, (0, 1, 3)),
    ("Plane", 'double width = 6\nuniform token axis = "Y"', 12, 0, (3, 0, 1)),
]


def corners(mesh, name):
    return mesh[name][mesh["indices"]].astype(np.float64)


def measure(mesh):
    """Returns area, enclosed volume, and unit normals (m, 3) of the triangles."""
    a, b, c = corners(mesh, "positions").transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
    return 0.5 * float(length.sum()), volume, cross / length[:, None]


@pytest.mark.parametrize("hand", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize(("prim", "body", "area", "volume", "extent"), SHAPES)
def test_closed_forms(tmp_path, prim, body, area, volume, extent, hand):
    body += f'\nuniform token orientation = "{hand}"'
    scene, _ = load(tmp_path, f'def {prim} "S" {{ {body} }}')
    mesh = scene.mesh("S")
    outside = 1 if hand == "rightHanded" else -1
    got_area, got_volume, faces = measure(mesh)
    # 64 segments about the axis lose 0.16 % of the area, and 0.3 % of a sphere's volume.
    assert area * 0.995 < got_area <= area * 1.000001
    assert volume * 0.995 - 1e-6 <= outside * got_volume <= volume * 1.000001
    if extent is not None:
        assert np.allclose(mesh["positions"].max(axis=0), extent, rtol=2e-3, atol=1e-6)
        assert np.allclose(mesh["positions"].min(axis=0), -np.array(extent), rtol=2e-3, atol=1e-6)
    normals = corners(mesh, "normals")
    assert np.allclose(np.linalg.norm(mesh["normals"], axis=1), 1, atol=1e-5)
    # A shading normal differs from its triangle's normal by at most half a segment.
    assert (np.einsum("ijk,ik->ij", normals, faces) > 0.99).all()
    assert mesh["uvs"].min() >= 0 and mesh["uvs"].max() <= 1
    assert np.allclose(np.ptp(mesh["uvs"], axis=0), 1)


def test_normals_are_exact(tmp_path):
    """The normals are exact normals of the ideal surface, not of the triangles."""
    scene, _ = load(
        tmp_path,
        'def Sphere "S" { double radius = 3 }'
        'def Cylinder_1 "C" { double radiusBottom = 2\n double radiusTop = 1\n double height = 1 }',
    )
    sphere = scene.mesh("S")
    assert np.allclose(sphere["normals"], sphere["positions"] / 3, atol=1e-6)
    cone = scene.mesh("C")
    side = np.abs(cone["normals"][:, 2]) < 0.9
    along = np.hypot(*cone["normals"][side, :2].T)
    assert np.allclose(along, math.sqrt(0.5), atol=1e-6)
    assert np.allclose(cone["normals"][side, 2], math.sqrt(0.5), atol=1e-6)


def test_planes_face_their_axis(tmp_path):
    for axis, normal in (("X", (1, 0, 0)), ("Y", (0, 1, 0)), ("Z", (0, 0, 1))):
        scene, _ = load(tmp_path, f'def Plane "P" {{ uniform token axis = "{axis}" }}')
        _, _, faces = measure(scene.mesh("P"))
        assert np.allclose(faces, normal)


def test_coordinates_go_round_and_up(tmp_path):
    """u is counter-clockwise about the axis as seen from its tip, v is along the axis."""
    scene, _ = load(tmp_path, 'def Sphere "S" {}')
    mesh = scene.mesh("S")
    x, y, z = mesh["positions"].T
    u, v = mesh["uvs"].T
    ring = np.hypot(x, y) > 1e-3
    angle = np.arctan2(y, x)[ring] / (2 * PI)
    assert np.allclose(np.exp(2j * PI * angle), np.exp(2j * PI * u[ring]), atol=1e-5)
    assert np.allclose(np.arcsin(np.clip(z, -1, 1)) / PI + 0.5, v, atol=1e-3)


def test_sizes_change_with_time(tmp_path):
    text = 'def Cylinder "C" { double radius.timeSamples = { 1: 1, 3: 3, } }'
    for frame in (1, 2, 3):
        scene, _ = load(tmp_path, text, frame=frame)
        assert np.isclose(scene.mesh("C")["positions"].max(), frame)
