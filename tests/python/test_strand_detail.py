# SPDX-License-Identifier: Apache-2.0
"""Tests that fewer, wider strands replace strands that are thin in the image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt

import wavecomb
from wavecomb.usd import load_stage
from wavecomb.usd.geometry.strands import hash_to_unit, lay_out

pytest.importorskip("wavecomb._core")

COUNT = 4000


def lawn(path: Path, away: float, projection: str = "perspective", widths: str = "vertex") -> Path:
    """Writes upright strands of many colours on a 2 by 2 square, seen from distance ``away``."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    rng = np.random.default_rng(4)
    curves = UsdGeom.BasisCurves.Define(stage, "/World/Lawn")
    roots = np.stack([rng.uniform(-1, 1, COUNT), np.zeros(COUNT), rng.uniform(-0.1, 0.1, COUNT)], 1)
    points = roots[:, None] + np.linspace(-1, 1, 4)[None, :, None] * np.array([0, 1, 0])
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.CreateCurveVertexCountsAttr([4] * COUNT)
    curves.CreateTypeAttr("cubic")
    curves.CreateBasisAttr("bezier")
    counts = {"constant": 1, "uniform": COUNT, "varying": 2 * COUNT, "vertex": 4 * COUNT}
    curves.CreateWidthsAttr([0.0005] * counts[widths])
    curves.SetWidthsInterpolation(widths)
    primvar = UsdGeom.PrimvarsAPI(curves).CreatePrimvar(
        "displayColor", Sdf.ValueTypeNames.Color3fArray, "uniform"
    )
    primvar.Set(Vt.Vec3fArray.FromNumpy(rng.uniform(0.2, 0.8, (COUNT, 3)).astype(np.float32)))
    dome = UsdLux.DomeLight.Define(stage, "/World/Sky")
    dome.GetPrim().CreateAttribute(
        "primvars:arnold:visibility:camera", Sdf.ValueTypeNames.Bool
    ).Set(False)
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateProjectionAttr(projection)
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, away))
    if projection == "orthographic":
        camera.CreateHorizontalApertureAttr(40.0)
        camera.CreateVerticalApertureAttr(40.0)
    stage.GetRootLayer().Save()
    return path


@pytest.mark.slow
@pytest.mark.parametrize("widths", ["constant", "uniform", "varying", "vertex"])
def test_opacity_and_colours_are_kept(tmp_path: Path, widths: str) -> None:
    """The remaining strands have the same coverage and mean colour."""
    stage = lawn(tmp_path / "lawn.usda", 8.0, widths=widths)
    options: dict[str, Any] = {"size": (64, 64), "max_depth": 2, "aovs": ["alpha"], "seed": 2}
    every = wavecomb.render(stage, spp=64, **options)
    some = wavecomb.render(stage, spp=64, strand_pixels=0.1, **options)
    notes = [str(note) for note in load_stage(stage, size=(64, 64), strand_pixels=0.1).report.notes]
    assert any("strands thinner than 0.1 pixels left out" in note for note in notes), notes
    centre = slice(24, 40)
    cover = [picture.aovs["alpha"][centre, centre].mean() for picture in (every, some)]
    assert 0.3 < cover[0] < 0.95
    assert cover[1] == pytest.approx(cover[0], rel=0.06)
    colour = [picture.beauty[centre, centre].mean(axis=(0, 1)) for picture in (every, some)]
    np.testing.assert_allclose(colour[1], colour[0], rtol=0.1)


def segments(stage: Path, pixels: float) -> int:
    """Counts the curve segments that remain."""
    return int(load_stage(stage, size=(400, 400), strand_pixels=pixels).scene.curve_segments)


def test_more_distance_keeps_fewer_of_the_same(tmp_path: Path) -> None:
    kept = [segments(lawn(tmp_path / f"{x}.usda", x), 0.2) for x in (1.0, 8.0, 32.0)]
    assert kept[0] == COUNT > kept[1] > kept[2] > 0
    # Strand width in pixels for a focal length of 50 mm, a 20.955 mm aperture and 400 pixels.
    wide = 0.0005 * 400 * 50 / 20.955 / np.array([8.0, 32.0])
    assert kept[1:] == pytest.approx(COUNT * wide / 0.2, rel=0.15)


def test_orthographic_widths_do_not_depend_on_distance(tmp_path: Path) -> None:
    kept = [segments(lawn(tmp_path / f"{x}.usda", x, "orthographic"), 0.2) for x in (3.0, 30.0)]
    # A width of 0.0005 of 4 units over 400 pixels is a twentieth of a pixel; a quarter remains.
    assert kept[0] == kept[1] == pytest.approx(COUNT / 4, rel=0.1)


def test_wide_strands_stay_as_they_are(tmp_path: Path) -> None:
    stage = lawn(tmp_path / "lawn.usda", 0.5)
    every = wavecomb.render(stage, size=(16, 16), spp=2, max_depth=2)
    some = wavecomb.render(stage, size=(16, 16), spp=2, max_depth=2, strand_pixels=0.001)
    np.testing.assert_array_equal(every.beauty, some.beauty)


def test_what_is_kept_of_a_layout() -> None:
    strands = lay_out(np.array([4, 2, 5, 4, 7]), "bspline", "nonperiodic")
    assert strands.kept.tolist() == [0, 2, 3, 4]
    values = np.arange(22.0)[:, None]
    assert strands.greatest(values, "vertex").tolist() == [3, 10, 14, 21]
    assert strands.greatest(np.arange(5.0)[:, None], "uniform").tolist() == [0, 2, 3, 4]
    some = strands.only(np.array([True, False, True, True]))
    assert some.kept.tolist() == [0, 3, 4]
    assert some.sizes == strands.sizes
    assert some.count == 1 + 1 + 4
    controls = some.at_controls(np.array([1.0, 2.0, 3.0])).tolist()
    assert controls == [1.0] * 4 + [2.0] * 4 + [3.0] * 13


def test_numbers_look_random() -> None:
    x = hash_to_unit(np.arange(100_000))
    counts = np.histogram(x, bins=50, range=(0, 1))[0]
    # The limit is the 0.1 % point of chi-square with 49 degrees of freedom.
    assert ((counts - 2000) ** 2 / 2000).sum() < 85
    assert abs(np.corrcoef(x[1:], x[:-1])[0, 1]) < 0.01
