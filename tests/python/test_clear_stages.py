# SPDX-License-Identifier: Apache-2.0
"""Tests stages with caustics of water and glass: shapes, and positions of focused light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wavecomb
from wavecomb.scenes import write_scene
from wavecomb.scenes.caustics import LENS_FOCUS, lens, water
from wavecomb.scenes.models.mesh import face_areas, signed_volume


def test_the_lens_is_two_caps_that_face_outwards() -> None:
    mesh = lens(12)
    assert face_areas(mesh.points, mesh.faces).min() >= 0.0
    # Two spherical caps of height h and radius r have the volume pi h^2 (3 r - h) / 3 each.
    r = LENS_FOCUS
    h = r - np.sqrt(r * r - 0.9**2)
    assert signed_volume(mesh.points, mesh.faces) == pytest.approx(
        2 * np.pi * h * h * (3 * r - h) / 3, rel=0.02
    )
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=1e-5)
    side = np.sign(mesh.points[:, 0])
    assert (side * mesh.normals[:, 0] > 0.0).sum() > 0.95 * len(side)


def test_normals_of_the_water_are_those_of_its_facets() -> None:
    mesh = water(40)
    a, b, c = (mesh.points[mesh.faces[:, k]].astype(float) for k in range(3))
    facet = np.cross(b - a, c - a)
    facet /= np.linalg.norm(facet, axis=1, keepdims=True)
    assert (facet[:, 1] > 0.9).all()
    smooth = mesh.normals[mesh.faces].mean(axis=1)
    assert np.abs((facet * smooth).sum(axis=1)).min() > 0.9995


def test_the_lens_shows_the_lamp_where_optics_says(tmp_path: Path) -> None:
    """The lens images the light at twice its focal length, at the same size."""
    path = tmp_path / "lens.usdc"
    write_scene("lens", path, teapot_level=12)
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    camera = UsdGeom.Camera.Get(stage, "/World/Camera")
    view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(1.5, 1.4, 0), Gf.Vec3d(4, 1.4, 0), Gf.Vec3d(0, 1, 0))
    camera.GetPrim().GetAttribute("xformOp:transform").Set(view.GetInverse())
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 100.0))
    camera.CreateHorizontalApertureAttr(35.0 * 2.4 / 2.5)
    camera.CreateVerticalApertureAttr(35.0 * 2.4 / 2.5)
    straight = tmp_path / "straight.usdc"
    stage.Export(str(straight))
    # 48 pixels cover 2.4 units of the wall.
    picture = wavecomb.render(straight, size=(48, 48), spp=64, transport="light", max_depth=4)
    light = picture.beauty.sum(axis=2)
    y, x = (np.indices(light.shape) - 23.5) * (2.4 / 48)
    near = np.hypot(x, y) < 0.45
    assert light[near].sum() > 0.7 * light[np.hypot(x, y) < 0.85].sum()
    bright = np.where(near, light, 0.0)
    assert abs((bright * x).sum() / bright.sum()) < 0.03
    assert abs((bright * y).sum() / bright.sum()) < 0.03
