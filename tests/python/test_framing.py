# SPDX-License-Identifier: Apache-2.0
"""Tests that visible objects fill the image of a stage without a camera."""

import tracemalloc

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

import wavecomb
from wavecomb.image.files.render_output import camera_window
from wavecomb.usd.cameras import framing
from wavecomb.usd.cameras.camera import Lens, frame_points
from wavecomb.usd.instances.group import Group

SIZES = [(120, 120), (208, 117), (117, 208), (300, 75)]


def sphere(stage):
    UsdGeom.Sphere.Define(stage, "/A")


def cube(stage):
    UsdGeom.Cube.Define(stage, "/A")


def pole(stage):
    pole = UsdGeom.Cylinder.Define(stage, "/A")
    pole.GetHeightAttr().Set(12.0)
    pole.GetRadiusAttr().Set(0.3)


def floor(stage):
    floor = UsdGeom.Cube.Define(stage, "/A")
    UsdGeom.XformCommonAPI(floor).SetScale(Gf.Vec3f(5, 0.01, 3))
    UsdGeom.XformCommonAPI(floor).SetTranslate(Gf.Vec3d(400, -30, 1000))


def corner(stage):
    """Adds a tetrahedron that fills little of its bounding box, with an unused point."""
    mesh = UsdGeom.Mesh.Define(stage, "/A")
    mesh.GetPointsAttr().Set([(0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2), (90, 90, 90)])
    mesh.GetFaceVertexCountsAttr().Set([3, 3, 3, 3])
    mesh.GetFaceVertexIndicesAttr().Set([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    mesh.GetSubdivisionSchemeAttr().Set("none")


def rounded(stage):
    """Adds a subdivided cube, which is nearly a ball and much smaller than its control mesh."""
    mesh = UsdGeom.Mesh.Define(stage, "/A")
    at = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    mesh.GetPointsAttr().Set(at)
    mesh.GetFaceVertexCountsAttr().Set([4] * 6)
    faces = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    mesh.GetFaceVertexIndicesAttr().Set(faces)


def crowd(stage):
    """Adds many instances of a ball in two rotated point instancers."""
    at = [Gf.Vec3f(4.0 * np.cos(k), 0.0, 4.0 * np.sin(k)) for k in range(900)]
    for name, turn in (("/P", 0.0), ("/Q", 70.0)):
        cloud = UsdGeom.PointInstancer.Define(stage, name)
        ball = UsdGeom.Sphere.Define(stage, f"{name}/Ball")
        ball.GetRadiusAttr().Set(0.4)
        cloud.GetPrototypesRel().AddTarget(ball.GetPath())
        cloud.GetPositionsAttr().Set(at)
        cloud.GetProtoIndicesAttr().Set([0] * len(at))
        UsdGeom.XformCommonAPI(cloud).SetRotate(Gf.Vec3f(turn, 0, 0))


def drops(stage):
    drops = UsdGeom.Points.Define(stage, "/A")
    drops.GetPointsAttr().Set([(0, 0, 0), (3, 1, 0), (-2, 0.5, 1)])
    drops.GetWidthsAttr().Set([1.0, 2.0, 0.5])


def z_up(stage):
    UsdGeom.SetStageUpAxis(stage, "Z")
    cube(stage)


SHAPES = [sphere, cube, pole, floor, corner, rounded, crowd, drops, z_up]


def spans(path, size, **options):
    """Returns the covered fractions of width and height, and the offset of the covered centre."""
    picture = wavecomb.render(path, size=size, spp=1, aovs=["depth"], filter="box", **options)
    depth = np.asarray(picture.depth).reshape(size[1], size[0])
    seen = np.isfinite(depth) & (depth > 0) & (depth < 1e9)
    assert not seen.all()
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    # The first and the last covered pixel are half covered on average, so the extent is one pixel
    # less.
    wide, high = columns[-1] - columns[0], rows[-1] - rows[0]
    middle = abs(columns[-1] + columns[0] + 1 - size[0]), abs(rows[-1] + rows[0] + 1 - size[1])
    return (wide / size[0], high / size[1]), middle


@pytest.mark.parametrize("number", range(len(SHAPES)))
def test_what_is_seen_fills_the_picture(number, tmp_path):
    """The shapes cover 80 to 92 % of the limiting dimension and are centred in it."""
    shape, size = SHAPES[number], SIZES[number % len(SIZES)]
    stage = Usd.Stage.CreateInMemory()
    shape(stage)
    path = tmp_path / "stage.usda"
    stage.Export(str(path))
    share, middle = spans(path, size)
    assert 0.80 <= max(share) <= 0.92, share
    filled = int(np.argmax(share))
    assert middle[filled] <= 0.05 * size[filled], middle


def within(view, points, size):
    """Returns the smallest and largest image coordinates of points, in [-1, 1]."""
    local = np.c_[points, np.ones(len(points))] @ np.linalg.inv(view.transform)
    x0, x1, y0, y1 = camera_window(view.options, *size)
    flat = view.options.get("projection") == "orthographic"
    depth = np.ones(len(points)) if flat else -local[:, 2]
    assert (depth > 0).all()
    x = (local[:, 0] / depth - 0.5 * (x0 + x1)) / (0.5 * (x1 - x0))
    y = (local[:, 1] / depth - 0.5 * (y0 + y1)) / (0.5 * (y1 - y0))
    return np.array([[x.min(), y.min()], [x.max(), y.max()]])


@pytest.mark.parametrize("projection", [None, "orthographic"])
@pytest.mark.parametrize("conform", ["expandAperture", "cropAperture", "adjustApertureWidth"])
@pytest.mark.parametrize("size", SIZES)
def test_points_touch_a_margin_on_both_sides(projection, conform, size):
    rng = np.random.default_rng(3)
    for scale in ((1, 1, 1), (20, 0.1, 3), (0.01, 0.01, 5)):
        points = rng.normal(size=(400, 3)) * scale + 50.0
        view = frame_points(points, "Y", Lens(projection, conform=conform), size)
        low, high = within(view, points, size)
        assert high.max() <= framing.FILLED + 1e-6 and low.min() >= -framing.FILLED - 1e-6
        axis = int(np.argmax(high - low))
        # In perspective, different depths may limit the two sides.
        assert high[axis] == pytest.approx(framing.FILLED) or low[axis] == pytest.approx(
            -framing.FILLED
        )


@pytest.mark.slow
def test_an_outline_is_what_matters():
    rng = np.random.default_rng(5)
    ball = rng.normal(size=(50000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    kept = framing.outline(ball)
    assert len(kept) <= len(framing.DIRECTIONS) == 162
    for direction in rng.normal(size=(200, 3)):
        direction /= np.linalg.norm(direction)
        assert (kept @ direction).max() >= 0.98 * (ball @ direction).max()
    # If the same points are sorted by position, whole blocks of points are skipped.
    ball = ball[np.lexsort((ball[:, 0], np.round(8 * ball[:, 1]), np.round(8 * ball[:, 2])))]
    directions = framing.DIRECTIONS.astype(np.float32)
    near = framing._near_the_outside(ball.astype(np.float32), None, directions[:6])
    assert len(near) < 0.5 * len(ball)
    sizes = rng.uniform(size=len(ball)).astype(np.float32)
    balls = framing.outline_of_balls(ball, sizes)
    exact = (ball @ framing.DIRECTIONS.T + sizes[:, None]).max(axis=0)
    assert np.allclose((balls @ framing.DIRECTIONS.T).max(axis=0), exact, rtol=1e-5)
    sorted_kept = framing.outline(ball)
    assert np.allclose(
        (sorted_kept @ framing.DIRECTIONS.T).max(axis=0), (kept @ framing.DIRECTIONS.T).max(axis=0)
    )
    box = np.array([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]])
    assert len(framing.outline(framing.corners(box))) == 8
    assert len(framing.outline(np.repeat(framing.corners(box), 99, axis=0))) == 8
    # Of many instances, only the outermost in some direction are kept.
    places = np.tile(np.eye(4), (5000, 1, 1))
    places[:, 3, :3] = 10.0 * rng.normal(size=(5000, 3))
    every = (kept[None] + places[:, 3:, :3]).reshape(-1, 3)
    found = framing.placed(kept, places)
    for direction in framing.DIRECTIONS[:6]:
        assert (found @ direction).max() == pytest.approx((every @ direction).max(), rel=0.02)


def test_a_group_of_many_things_keeps_few_points():
    rng = np.random.default_rng(6)
    group, every = Group("world"), []
    for _ in range(500):
        points = rng.normal(size=(190, 3))
        every.append(points)
        group.reach(framing.outline(points), None)
    assert sum(map(len, group.outlines)) <= framing.MANY_POINTS
    found, whole = framing.joined(group.outlines), np.concatenate(every)
    for direction in framing.DIRECTIONS:
        assert (found @ direction).max() == pytest.approx((whole @ direction).max(), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "block", "most"),
    [(10_000, 1 << 12, 20e6), pytest.param(100_000, 1 << 15, 150e6, marks=pytest.mark.long)],
)
def test_millions_of_places_are_looked_at_in_parts(monkeypatch, count, block, most):
    """Distances are computed in blocks, since all at once would need 4 kB per instance."""
    monkeypatch.setattr(framing, "_BLOCK", block)
    chance = np.random.default_rng(5)
    transforms = np.tile(np.eye(4), (count, 1, 1))
    transforms[:, :3, :3] *= chance.random((count, 1, 1)) + 0.1
    transforms[:, 3, :3] = chance.normal(size=(count, 3)) * 100
    points = chance.random((30, 3))
    tracemalloc.start()
    found = framing.placed(points, transforms)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < most
    monkeypatch.setattr(framing, "_BLOCK", 1 << 20)
    assert np.array_equal(found, framing.placed(points, transforms))
    whole = (points @ transforms[:, :3, :3] + transforms[:, 3:, :3]).reshape(-1, 3)
    reach = framing.DIRECTIONS @ whole.T
    assert ((framing.DIRECTIONS @ found.T).max(axis=1) > 0.99 * reach.max(axis=1)).all()


def test_nothing_and_a_point_are_framed():
    for points in (None, np.empty((0, 3)), np.array([[3.0, 4.0, 5.0]])):
        view = frame_points(points, "Y")
        assert np.isfinite(view.transform).all() and view.options["near_clip"] > 0
