# SPDX-License-Identifier: Apache-2.0
"""Tests lenses: distortion, overscan, apertures, rolling shutters and motion vectors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from click.testing import CliRunner
from usd_recorder import load, said, write

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.exr import write_exr

SIZE = (64, 48)
CAMERA = """#usda 1.0
( upAxis = "Y"; startTimeCode = 1; endTimeCode = 2 )
def Camera "Cam" {
    float focalLength = 20
    MORE
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "Sky" {}
"""
BALLS = """
def PointInstancer "Balls" {
    rel prototypes = [</Balls/Ball>]
    int[] protoIndices = [0, 0, 0, 0, 0]
    point3f[] positions = [(0, 0, 0), (-3, 1.8, 0), (3, 1.8, 0), (-3, -1.8, 0), (3, -1.8, 0)]
    def Sphere "Ball" { double radius = 0.4 }
}
"""
MOVING = """
def Mesh "Card" {
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    double3 xformOp:translate.timeSamples = { 1: (-0.5, 0, 0), 2: (0.5, 0.25, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def _stage(folder: Path, prims: str = BALLS, more: str = "") -> Path:
    return write(folder, CAMERA.replace("MORE", more) + prims)


def _render(stage: Path, **options: Any) -> wavecomb.Picture:
    return wavecomb.render(stage, **{"size": SIZE, "spp": 4, "aovs": ["alpha"], **options})


def _centre(alpha: np.ndarray[Any, Any]) -> tuple[float, float]:
    """Returns the centroid of alpha in the upper left part, in pixels."""
    part = alpha[: alpha.shape[0] * 2 // 5, : alpha.shape[1] * 2 // 5]
    y, x = np.mgrid[: part.shape[0], : part.shape[1]] + 0.5
    return float((x * part).sum() / part.sum()), float((y * part).sum() / part.sum())


def test_a_barrel_draws_corners_inwards(tmp_path: Path) -> None:
    plain = _render(_stage(tmp_path), spp=64).aovs["alpha"]
    bent = _render(_stage(tmp_path, more="float wavecomb:lens:k1 = -0.3"), spp=64).aovs["alpha"]
    (x, y), (bx, by) = _centre(plain), _centre(bent)
    # Half of the window's width is 20.955 / 2 / 20 in the plane at distance 1.
    step = 2 * 20.955 / 2 / 20 / SIZE[0]
    px, py = (x - SIZE[0] / 2) * step, (y - SIZE[1] / 2) * step
    scale = 1 - 0.3 * (px * px + py * py)
    assert bx == pytest.approx(SIZE[0] / 2 + scale * px / step, abs=0.25)
    assert by == pytest.approx(SIZE[1] / 2 + scale * py / step, abs=0.25)
    by_option = _render(_stage(tmp_path), spp=64, lens_settings={"lens_k1": -0.3}).aovs["alpha"]
    assert by_option.tobytes() == bent.tobytes()


def test_every_schedule_gives_the_same_bits(tmp_path: Path) -> None:
    says = """float wavecomb:lens:k1 = -0.2
        float wavecomb:lens:p1 = 0.01
        float fStop = 1
        float focusDistance = 6
        int wavecomb:lens:apertureBlades = 5
        float wavecomb:lens:squeeze = 2
        double shutter:open = 0
        double shutter:close = 1
        token wavecomb:lens:rollingShutter = "top"
        float wavecomb:lens:rollingDuration = 0.2"""
    stage = _stage(tmp_path, MOVING, says)
    aovs = ["alpha", "motion", "depth_nearest", "distance"]
    first = _render(stage, aovs=aovs)
    assert first.aovs["motion"].any()
    for schedule in (
        {"integrator": "reference"},
        {"threads": 1, "wave_size": 64, "lanes": 1},
        {"policy": "material", "traversal": "single"},
    ):
        other = _render(stage, aovs=aovs, **schedule)
        assert other.beauty.tobytes() == first.beauty.tobytes(), schedule
        for name in aovs:
            assert other.aovs[name].tobytes() == first.aovs[name].tobytes(), (schedule, name)


def _st_map(path: Path, scale: float) -> Path:
    """Writes an ST map that magnifies the centre of the image."""
    y, x = (np.mgrid[:60, :80] + 0.5) / np.array([60, 80])[:, None, None]
    s, t = 0.5 + (x - 0.5) * scale, 0.5 + (0.5 - y) * scale
    write_exr(path, {"beauty": np.stack([s, t, 0 * s], axis=2).astype(np.float32)})
    return path


@pytest.mark.slow
def test_an_st_map_moves_pixels(tmp_path: Path) -> None:
    stage = _stage(tmp_path)
    plain = _render(stage, spp=64).aovs["alpha"]
    map_file = _st_map(tmp_path / "st.exr", 0.8)
    large = _render(stage, spp=64, st_map=map_file).aovs["alpha"]
    middle = np.s_[12:36, 16:48]
    assert large[middle].sum() == pytest.approx(plain[middle].sum() / 0.8**2, rel=0.03)
    same = _render(stage, spp=64, st_map=_st_map(tmp_path / "one.exr", 1.0)).aovs["alpha"]
    np.testing.assert_allclose(same, plain, atol=0.07)


def test_a_picture_that_is_no_map(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"depth": np.zeros((4, 4), np.float32)})
    with pytest.raises(wavecomb.WavecombError, match="an ST map has the channels R and G"):
        _render(_stage(tmp_path), st_map=tmp_path / "a.exr")


def test_overscan_is_a_larger_data_window(tmp_path: Path) -> None:
    stage, file = _stage(tmp_path), tmp_path / "a.exr"
    run = CliRunner().invoke(
        main,
        ["render", str(stage), "-o", str(file), "--size", "64", "48", "--overscan", "10", "--spp",
         "64", "--aov", "alpha", "--quiet"],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    source = oiio.ImageInput.open(str(file))
    spec = source.spec()
    assert (spec.x, spec.y, spec.width, spec.height) == (-10, -10, 84, 68)
    assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, 64, 48)
    alpha = source.read_image()[:, :, list(spec.channelnames).index("alpha")]
    plain = _render(stage, spp=64)
    np.testing.assert_allclose(alpha[10:-10, 10:-10], plain.aovs["alpha"], atol=0.2)
    assert abs(alpha[10:-10, 10:-10] - plain.aovs["alpha"]).mean() < 0.005
    matrices = {one.name: one.value for one in spec.extra_attribs}
    np.testing.assert_allclose(matrices["worldToNDC"], np.ravel(plain.metadata["worldToNDC"]),
                               rtol=1e-6)  # fmt: skip
    with pytest.raises(Exception, match="no overscan"):
        _render(stage, overscan=4, projection="latlong")


def test_merging_keeps_the_overscan(tmp_path: Path) -> None:
    stage, files = _stage(tmp_path), [str(tmp_path / f"{name}.exr") for name in "abc"]
    for seed, overscan in ((0, 3), (1, 3), (2, 4)):
        size = 19 - overscan
        picture = _render(stage, seed=seed, overscan=overscan, size=(2 * size, 2 * size),
                          aovs=["samples"])  # fmt: skip
        picture.save(files[seed])
    merged = str(tmp_path / "d.exr")
    run = CliRunner().invoke(main, ["merge", *files[:2], "-o", merged])
    assert run.exit_code == 0, run.output
    spec = oiio.ImageInput.open(merged).spec()
    assert (spec.x, spec.y, spec.width, spec.full_width) == (-3, -3, 38, 32)
    run = CliRunner().invoke(main, ["merge", files[0], files[2], "-o", merged])
    assert run.exit_code == 2 and "overscan is 4, that of" in run.stderr


def test_motion_is_in_pixels_to_the_right_and_up(tmp_path: Path) -> None:
    says = "double shutter:open = 0\n double shutter:close = 1"
    picture = _render(_stage(tmp_path, MOVING, says), spp=16, aovs=["motion", "alpha"], frame=1)
    motion = picture.aovs["motion"]
    covered = picture.aovs["alpha"] == 1
    # Image size in pixels of one unit of length at distance 8, for this aperture and focal length.
    pixels = SIZE[0] / (20.955 / 20) / 8
    assert covered.sum() > 20
    np.testing.assert_allclose(motion[covered], np.broadcast_to((pixels, pixels / 4),
                               motion[covered].shape), rtol=1e-3)  # fmt: skip
    assert not motion[picture.aovs["alpha"] == 0].any()
    with pytest.raises(Exception, match="does not support latlong"):
        _render(_stage(tmp_path), aovs=["motion"], projection="latlong")


def test_depths_of_one_sample(tmp_path: Path) -> None:
    picture = _render(_stage(tmp_path, MOVING), aovs=["depth", "depth_nearest", "distance",
                                                      "position"])  # fmt: skip
    hit = np.isfinite(picture.aovs["depth_nearest"])
    assert hit.any() and not hit.all()
    np.testing.assert_allclose(picture.aovs["depth_nearest"][hit], 8, rtol=1e-5)
    far = np.linalg.norm(picture.aovs["position"] - np.array([0, 0, 8]), axis=2)
    np.testing.assert_allclose(picture.aovs["distance"][hit], far[hit], rtol=1e-5)
    assert np.isinf(picture.aovs["distance"][~hit]).all()


def test_a_rolling_shutter_shears(tmp_path: Path) -> None:
    says = "double shutter:open = 0\n double shutter:close = 1"
    stage = _stage(tmp_path, MOVING, says)
    rolled = _render(stage, spp=16, frame=1, lens_settings={"rolling_shutter": "top"}).aovs["alpha"]
    x = np.arange(SIZE[0]) + 0.5
    rows = np.flatnonzero(rolled.sum(axis=1) > 5)
    centres = (rolled[rows] * x).sum(axis=1) / rolled[rows].sum(axis=1)
    assert len(rows) > 8 and centres[-2] - centres[1] > 0.8
    # Each pixel row is exposed at a single instant, so edges are sharp.
    assert (rolled[rows[2:-2]] % 1 > 0).sum(axis=1).max() <= 6


def test_an_aperture_has_its_shape(tmp_path: Path) -> None:
    """Bokeh of a point: a triangle covers less than a disk, and a squeeze halves the width."""
    point = 'def Sphere "Dot" { double radius = 0.1 }'
    says = "float fStop = 1\n float focusDistance = 3"
    stage = _stage(tmp_path, point, says)

    def spread(**settings: Any) -> tuple[float, float, float]:
        alpha = _render(stage, spp=1024, size=(48, 48), lens_settings=settings).aovs["alpha"]
        y, x = np.mgrid[:48, :48] - 23.5
        total = alpha.sum()
        return (
            float((x * x * alpha).sum() / total), float((y * y * alpha).sum() / total),
            float((alpha > 0).mean()),
        )  # fmt: skip

    round_x, round_y, disk = spread()
    assert round_x == pytest.approx(round_y, rel=0.1)
    narrow_x, narrow_y, _ = spread(lens_squeeze=2)
    assert narrow_x == pytest.approx(round_x / 4, rel=0.15)
    assert narrow_y == pytest.approx(round_y, rel=0.1)
    assert spread(aperture_blades=3)[2] < 0.75 * disk


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("no=1", "--lens-setting no: is not known; there are aperture_blades"),
        ("lens_k1=x", "must be a number"),
        ("rolling_shutter=up", "must be one of off, top"),
        ("aperture_blades=2", "aperture_blades is 2; it must be 0, or a whole number from 3"),
        ("lens_k1=-9", "folds over within the picture"),
        ("lens_k1", "must be NAME=VALUE"),
    ],
)
def test_settings_that_cannot_be(word: str, says: str, tmp_path: Path) -> None:
    run = CliRunner().invoke(
        main,
        ["render", str(_stage(tmp_path)), "-o", str(tmp_path / "a.exr"), "--spp", "1", "--size",
         "16", "12", "--lens-setting", word],
    )  # fmt: skip
    assert run.exit_code == 2 and says in run.stderr


def test_attributes_that_are_no_good_are_left_out(tmp_path: Path) -> None:
    text = CAMERA.replace("MORE", 'token wavecomb:lens:rollingShutter = "sideways"') + BALLS
    _, loaded = load(tmp_path, text)
    assert "wavecomb:lens:rollingShutter of a camera left out" in said(loaded)
