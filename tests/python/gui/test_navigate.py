# SPDX-License-Identifier: Apache-2.0
"""Tests camera navigation, which consists of pure functions of camera poses."""

import numpy as np
import pytest

from wavecomb.gui.viewport import navigate
from wavecomb.gui.viewport.navigate import Pose
from wavecomb.usd.cameras.framing import corners

BOX = np.array([[-1.0, -2.0, -3.0], [2.0, 1.0, 0.5]])


def looking(position=(0.0, 0.0, 10.0), window=(-0.4, 0.4, -0.3, 0.3), path="/Cam"):
    to_world = np.eye(4)
    to_world[3, :3] = position
    return Pose(to_world, window, path=path)


def project(pose, point, aspect=4 / 3):
    """Returns image coordinates (x from -1 left to 1 right, y up) and the depth."""
    x0, x1, y0, y1 = pose.fitted(round(1200 * aspect), 1200)
    offset = np.asarray(point, float) - pose.position
    depth = -offset @ pose.back
    x, y = offset @ pose.right / depth, offset @ pose.up / depth
    return np.array([(2 * x - x0 - x1) / (x1 - x0), (2 * y - y0 - y1) / (y1 - y0)]), depth


def is_rigid(pose):
    axes = pose.to_world[:3, :3]
    return np.allclose(axes @ axes.T, np.eye(3), atol=1e-12) and np.linalg.det(axes) > 0


@pytest.mark.parametrize("up", ["X", "Y", "Z"])
def test_orbit_keeps_the_pivot_in_its_place(up):
    pose, pivot = looking(), np.array([1.0, 0.5, 2.0])
    if up != "Y":
        pose = navigate.view(pose, "front", corners(BOX), up, 4 / 3)
        pose = navigate.orbit(pose, pivot, 0.3, 0.2, up)
    before, depth = project(pose, pivot)
    moved = navigate.orbit(pose, pivot, 0.7, -0.3, up)
    after, new_depth = project(moved, pivot)
    assert np.allclose(before, after, atol=1e-9) and depth == pytest.approx(new_depth)
    assert is_rigid(moved) and moved.path is None
    # The horizon stays level: the camera's right vector is orthogonal to the stage's up axis.
    assert abs(moved.right @ navigate.UPS[up]) < 1e-12


def test_orbit_moves_the_camera_to_its_right_and_up():
    moved = navigate.orbit(looking(), np.zeros(3), 0.1, 0.2, "Y")
    assert moved.position[0] > 0 and moved.position[1] > 0
    assert np.linalg.norm(moved.position) == pytest.approx(10.0)


def test_orbit_stops_short_of_the_pole():
    pose = looking()
    for _ in range(20):
        pose = navigate.orbit(pose, np.zeros(3), 0.1, 0.4, "Y")
    assert pose.back[1] == pytest.approx(np.sin(navigate.STEEPEST))
    assert is_rigid(pose)
    down = navigate.orbit(pose, np.zeros(3), 0.0, -0.4, "Y")
    assert down.back[1] < pose.back[1]


def test_pan_takes_the_point_along_with_the_cursor():
    pose, point, size = looking(), np.array([0.4, -0.2, 1.0]), (800, 600)
    before, depth = project(pose, point)
    moved = navigate.pan(pose, depth, 40.0, 30.0, size)
    after, _ = project(moved, point)
    assert np.allclose((after - before) * np.array(size) / 2, [40.0, 30.0], atol=1e-9)


def test_dolly_goes_to_the_pivot_and_never_through():
    pose, pivot = looking(), np.array([1.0, 0.5, 2.0])
    before, depth = project(pose, pivot)
    moved = navigate.dolly(pose, pivot, 0.25)
    after, new_depth = project(moved, pivot)
    assert np.allclose(before, after) and new_depth == pytest.approx(depth / 4)
    for _ in range(50):
        moved = navigate.dolly(moved, pivot, 0.8)
    assert project(moved, pivot)[1] > 0


@pytest.mark.parametrize("name", navigate.VIEWS)
@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("aspect", [2.5, 0.6])
def test_views_hold_the_whole_box(name, up, aspect):
    pose = navigate.view(looking(), name, corners(BOX), up, aspect)
    places = np.array([project(pose, corner, aspect)[0] for corner in corners(BOX)])
    assert np.abs(places).max() == pytest.approx(0.9)
    assert is_rigid(pose)
    along = {"front": (0, 0, 1), "right": (1, 0, 0), "top": (0, 1, 0)}
    if up == "Y" and name in along:
        assert np.allclose(pose.back, along[name])


def test_frame_keeps_the_direction_and_an_off_axis_window_is_centred():
    pose = looking(window=(-0.1, 0.5, -0.3, 0.1))
    framed = navigate.frame(pose, corners(BOX), 4 / 3)
    assert np.allclose(framed.to_world[:3, :3], pose.to_world[:3, :3])
    place, _ = project(framed, BOX.mean(axis=0))
    assert np.allclose(place, 0.0, atol=1e-9)


def test_frame_of_a_point_stays_outside_of_it():
    point = np.array([[1.0, 2.0, 3.0]] * 2)
    framed = navigate.frame(looking(), corners(point), 1.0)
    assert project(framed, point[0])[1] > 0


def test_opposite_twice_is_back_again():
    pose, pivot = looking((3.0, 2.0, 9.0)), np.array([0.5, 0.0, 1.0])
    once = navigate.opposite(pose, pivot, "Y")
    assert once.back[2] == pytest.approx(-1.0)
    assert np.allclose(navigate.opposite(once, pivot, "Y").to_world, pose.to_world)
