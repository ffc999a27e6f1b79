# SPDX-License-Identifier: Apache-2.0
"""Tests the panel of learned data: a map of directions, and selection probabilities of lights."""

import numpy as np
import pytest
from conftest import wait_final

from wavecomb.gui.viewport.panels.learned_panel import field_text, light_rows
from wavecomb.image.directions import density_map, map_directions, map_point, square_points

UP = np.array([0.0, 0.0, 1.0])


def test_a_map_keeps_what_there_is():
    """The map's mean over the sphere equals the mean of the bins, which have equal solid angles."""
    density = np.random.default_rng(3).gamma(0.4, 1.0, (16, 16))
    height = 256
    values, _ = density_map(density, UP, np.array([1.0, 2.0, -3.0]), height)
    assert values.shape == (height, 2 * height)
    weights = np.cos(np.pi * (0.5 - (np.arange(height) + 0.5) / height))
    assert (values.mean(axis=1) * weights).sum() / weights.sum() == pytest.approx(
        density.mean(), rel=0.01
    )


@pytest.mark.parametrize("ahead", [(0.0, 1.0, 0.0), (3.0, -1.0, 5.0), (0.0, 0.0, 1.0)])
def test_marks_are_where_the_map_has_the_direction(ahead):
    vectors, axes = map_directions(UP, np.array(ahead), 32)
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    for row, column in ((0, 5), (16, 31), (20, 60), (31, 0)):
        x, y = map_point(vectors[row, column], axes)
        assert (x * 64, y * 32) == pytest.approx((column + 0.5, row + 0.5), abs=1e-6)
    # The panel shows the up direction at the top, the forward direction in the middle, and the
    # right direction on the right.
    assert vectors[0, 0] @ UP > 0.99
    assert axes[1] == pytest.approx(np.cross(axes[0], UP))


def test_bins_are_those_of_the_core():
    """Directions map to the same points of the square as in tests/cpp/test_guide.cpp."""
    w = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], [0.6, 0.0, -0.8]], float)
    assert square_points(w) == pytest.approx(
        np.array([[0.5, 0.5], [1, 1], [1, 0.5], [0.5, 0], [1, 0.5 + 0.5 * (1 - np.sqrt(0.2))]]),
        abs=1e-12,
    )


def test_what_is_said_without_a_field():
    from wavecomb.gui.setup import Setup

    nothing = {"density": None, "axis": "+x", "light_shares": []}
    assert "Point at" in field_text(Setup(), None)
    assert "choose Guiding" in field_text(Setup(), nothing)
    assert "too few samples" in field_text(Setup(guiding="on"), nothing)


def test_many_lights_are_a_few_and_others():
    shares = [(f"L{k}", 1 / 40) for k in range(40)]
    rows = light_rows(shares)
    assert len(rows) == 12 and rows[-1][0] == "29 others"
    assert sum(share for _, share in rows) == pytest.approx(1)


@pytest.mark.slow
def test_the_panel_follows_the_cursor(cornell_window, qtbot):
    window = cornell_window
    dock = window.docks["learned"]
    panel = dock.widget()
    dock.show()
    dock.raise_()
    qtbot.waitUntil(panel.isVisible, timeout=5000)
    panel.hover((30, 80))
    qtbot.waitUntil(lambda: panel.learned is not None, timeout=5000)
    assert "choose Guiding" in panel.note.text() and panel.map.image is None
    assert [bar.end for bar in panel.lights.bars] == [100.0], "Cornell has one light"
    window.session.change(guiding="on", roulette="efficient", spp=16)
    wait_final(qtbot, window.session)
    qtbot.waitUntil(lambda: panel.map.image is not None, timeout=5000)
    assert panel.map.image.width() == 2 * panel.map.image.height()
    assert "of bounces are guided" in panel.note.text()
    assert not panel.grab().isNull()
    density = panel.learned["density"]
    panel.follow.setChecked(False)
    panel.hover((60, 20))
    qtbot.wait(120)
    assert np.array_equal(panel.learned["density"], density)
    panel.pick((60, 20))
    qtbot.waitUntil(lambda: not np.array_equal(panel.learned["density"], density), timeout=5000)


@pytest.mark.slow
def test_heat_maps_of_what_is_learned(cornell_window, qtbot):
    window = cornell_window
    window.session.change(guiding="on", roulette="efficient", allocate="error", spp=16)
    for layer, words in (
        ("guided_share", "guided"),
        ("survival", "roulette"),
        ("samples", "samples per pixel"),
    ):
        window.display.choose_layer(layer)
        qtbot.waitUntil(
            lambda layer=layer: (
                window.viewport.look.layer == layer
                and window.session.last_frame.final
                and window.session.last_frame.layer(layer) is not None
            ),
            timeout=20000,
        )
        qtbot.waitUntil(
            lambda words=words: (
                window.viewport.legend() is not None
                and words in window.viewport.legend().title.lower()
            ),
            timeout=5000,
        )
        array = window.session.last_frame.layer(layer)
        assert array.max() > array.min(), layer
