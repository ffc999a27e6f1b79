# SPDX-License-Identifier: Apache-2.0
"""Tests the conversion of floats to displayed colours."""

import numpy as np
import pytest

from wavecomb import ocio
from wavecomb.errors import WavecombError
from wavecomb.gui.swatch import to_qimage
from wavecomb.gui.viewport import display
from wavecomb.gui.viewport.display import Look
from wavecomb.image import layer_view
from wavecomb.image.files import image


@pytest.fixture
def light():
    pixels = np.random.default_rng(7).gamma(1.0, 0.6, (24, 32, 3)).astype(np.float32)
    pixels[0, 0], pixels[0, 1], pixels[0, 2] = np.nan, np.inf, -1.0
    return pixels


@pytest.mark.parametrize(("view", "transfer"), [("Linear", "clamp"), ("Neutral", "neutral")])
@pytest.mark.parametrize("exposure", [0.0, 1.5, -3.0])
def test_own_views_are_those_of_png_files(light, view, transfer, exposure):
    shown = display.show(light, Look("beauty", exposure, view))
    assert np.array_equal(shown.pixels, image.display(light, exposure=exposure, tone_map=transfer))
    assert shown.legend is None


def test_ocio_has_aces_and_shows_grey_as_grey():
    names = display.views()
    assert names[:2] == ["Linear", "Neutral"]
    aces = [name for name in names if "ACES" in name]
    assert aces, "OpenImageIO has no views of OpenColorIO built in"
    grey = np.full((4, 4, 3), 0.18, np.float32)
    codes = display.develop(grey, 0.0, aces[0])
    assert np.ptp(codes) <= 1 and 60 < codes[0, 0, 0] < 140
    brighter = display.develop(grey, 1.0, aces[0])
    assert brighter[0, 0, 0] > codes[0, 0, 0]
    # Highlights are compressed, not clipped.
    hot = display.develop(np.full((2, 2, 3), 2.0, np.float32), 0.0, aces[0])
    assert hot.max() < 255


def test_plain_ocio_view_is_srgb(light):
    finite = np.abs(np.nan_to_num(light, nan=0.5, posinf=2.0))
    mine = display.develop(finite, 0.0, "Linear").astype(int)
    theirs = display.develop(finite, 0.0, "Un-tone-mapped").astype(int)
    assert np.abs(mine - theirs).max() <= 1


def test_ocio_shows_broken_pixels(light):
    codes = display.develop(light, 0.0, "Un-tone-mapped")
    assert tuple(codes[0, 0]) == (255, 0, 255)


def test_ocio_of_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("OCIO", str(tmp_path / "none.ocio"))
    assert display.views() == ["Linear", "Neutral"]
    assert "none.ocio" in (ocio.problem() or "")
    with pytest.raises(WavecombError, match="no view 'Film'; there are Linear"):
        display.develop(np.zeros((1, 1, 3), np.float32), 0.0, "Film")


def test_heat_runs_from_dark_to_light_and_marks_what_is_not_finite():
    values = np.arange(12.0).reshape(3, 4)
    values[2, 3] = np.inf
    shown = layer_view.heat(values, "samples")
    lightness = shown.pixels.reshape(-1, 3).astype(int).sum(axis=1)[:11]
    assert (np.diff(lightness) > 0).all()
    assert tuple(shown.pixels[2, 3]) == layer_view.NOT_FINITE
    assert (shown.legend.low, shown.legend.high) == (0.0, 10.0)
    assert [label for _, label in shown.legend.ticks(3)] == ["0", "5", "10"]


def test_logarithmic_heat_has_equal_steps_for_equal_ratios():
    values = np.array([[1.0, 10.0, 100.0, 1000.0, 0.0]])
    shown = layer_view.heat(values, "cost", 1.0, 1000.0)
    ramp = layer_view.ramp(256)
    assert tuple(shown.pixels[0, 0]) == tuple(ramp[0]) == tuple(shown.pixels[0, 4])
    assert tuple(shown.pixels[0, 3]) == tuple(ramp[255])
    assert tuple(shown.pixels[0, 1]) == tuple(ramp[85])
    labels = [label for _, label in shown.legend.ticks(4)]
    assert labels == ["1", "10", "100", "1e+03"]


def test_heat_of_one_value_and_of_nothing():
    assert layer_view.heat(np.full((2, 2), 3.0), "samples").pixels.shape == (2, 2, 3)
    assert layer_view.heat(np.full((2, 2), np.nan), "error").pixels[0, 0, 1] == 255


def test_layers_that_are_no_light_ignore_exposure():
    normal = np.zeros((1, 2, 3), np.float32)
    normal[0, 0, 2], normal[0, 1, 2] = 1.0, -1.0
    for exposure in (0.0, 4.0):
        shown = display.show(normal, Look("normal", exposure, "Neutral")).pixels
        assert tuple(shown[0, 0]) == (128, 128, 255) and tuple(shown[0, 1]) == (128, 128, 0)


def test_ids_have_colours_of_their_own():
    ids = np.arange(64).reshape(8, 8).astype(np.float32)
    colours = display.show(ids, Look("material_id")).pixels.reshape(-1, 3)
    assert len({tuple(c) for c in colours}) == 64 and tuple(colours[0]) == (0, 0, 0)
    crypto = np.zeros((2, 2, 4), np.float32)
    crypto[0, 0, 0] = 1.5
    shown = display.show(crypto, Look("crypto_object")).pixels
    assert shown[0, 0].any() and not shown[1, 1].any()


def test_image_has_the_codes(light):
    codes = image.display(light[1:])
    shown = to_qimage(codes)
    assert (shown.width(), shown.height()) == (32, 23)
    for x, y in ((0, 0), (31, 22), (5, 9)):
        assert shown.pixelColor(x, y).getRgb()[:3] == tuple(int(c) for c in codes[y, x])


def test_layers_with_false_colours_follow_from_the_table():
    names = ("depth", "alpha", "cost", "samples", "variance", "distance", "beauty", "uv", "albedo")
    shown = [name for name in names if layer_view.has_false_colours(name)]
    assert shown == ["depth", "alpha", "cost", "samples", "variance", "distance"]
    legend = layer_view.heat(np.ones((2, 2)), "survival").legend
    assert legend is not None and legend.title == "Survival of roulette"
