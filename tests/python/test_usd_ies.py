# SPDX-License-Identifier: Apache-2.0
"""Tests IES profiles: symmetry, photometric types and invalid files."""

import numpy as np
import pytest
from usd_recorder import load, said

from wavecomb.usd.lights.ies import IesError, parse_ies


def ies(vertical, horizontal, candela, kind=1, factors=(1, 1, 1), tilt="NONE"):
    multiplier, ballast, lamp = factors
    rows = [
        "IESNA:LM-63-2002",
        "[TEST] none",
        f"TILT={tilt}",
        f"1 -1 {multiplier} {len(vertical)} {len(horizontal)} {kind} 2 0 0 0",
        f"{ballast} {lamp} 10",
    ]
    for values in (vertical, horizontal, np.ravel(candela)):
        rows.append(" ".join(f"{v:g}" for v in values))
    return "\n".join(rows) + "\n"


def candela(profile, theta, phi):
    """Interpolates a profile with NumPy."""
    planes = [np.interp(theta, profile.vertical, row) for row in profile.candela]
    return np.interp(phi % 360, profile.horizontal, planes)


def test_values_are_multiplied_by_the_files_factors():
    profile = parse_ies(ies([0, 90], [0], [10, 4], factors=(2, 0.5, 0.25)))
    assert profile.candela.tolist() == [[2.5, 1.0]]
    assert profile.horizontal.tolist() == [0]


@pytest.mark.parametrize(
    ("horizontal", "values", "alike"),
    [
        ([0, 45, 90], [1, 2, 5], [(0, 1), (45, 2), (90, 5), (135, 2), (180, 1), (270, 5)]),
        ([0, 90, 180], [1, 2, 5], [(0, 1), (90, 2), (180, 5), (270, 2), (225, 3.5)]),
        ([90, 180, 270], [1, 2, 5], [(90, 1), (180, 2), (0, 2), (270, 5), (45, 1.5), (315, 3.5)]),
        ([90, 135, 270], [1, 2, 5], [(90, 1), (45, 2), (270, 5), (0, 3), (180, 3)]),
        ([0, 120, 240], [1, 2, 5], [(0, 1), (240, 5), (300, 3)]),  # without 360
        ([0, 180, 360], [1, 2, 1], [(90, 1.5), (270, 1.5)]),
    ],
)
def test_symmetry(horizontal, values, alike):
    profile = parse_ies(ies([0, 90], horizontal, np.repeat(values, 2)))
    assert profile.horizontal[0] == 0 and profile.horizontal[-1] == 360
    for phi, expected in alike:
        assert candela(profile, 45, phi) == pytest.approx(expected), phi


def test_type_b_and_a_know_their_poles():
    # The intensity depends on the horizontal angle only, 90 to 0, equal on both sides.
    text = ies([-90, 90], [0, 90], [90, 90, 0, 0], kind=2)
    b = parse_ies(text)
    assert candela(b, 0, 0) == pytest.approx(90)
    assert candela(b, 60, 0) == pytest.approx(30)  # sin H = x
    assert candela(b, 60, 180) == pytest.approx(30)
    assert candela(b, 60, 90) == pytest.approx(90)  # x = 0
    assert candela(b, 120, 0) == 0  # the back
    h = np.degrees(np.arcsin(np.sin(np.radians(40)) * np.cos(np.radians(30))))
    assert candela(b, 40, 30) == pytest.approx(90 - h, rel=1e-6)
    a = parse_ies(ies([-90, 90], [0, 90], [90, 90, 0, 0], kind=3))
    h = np.degrees(np.arctan(np.tan(np.radians(40)) * np.cos(np.radians(30))))
    assert candela(a, 40, 30) == pytest.approx(90 - h, rel=1e-6)


GOOD = ies([0, 90], [0], [10, 4])
BAD = [
    ("", "no TILT line"),
    (GOOD.replace("TILT=NONE", "TILT=lamp.tlt"), "another file (LAMP.TLT)"),
    (GOOD.replace("10 4", "10"), "ends within its candela"),
    (GOOD.replace("10 4", "10 four"), "'four' is not a number"),
    (GOOD.replace("10 4", "10 nan"), "not finite"),
    (ies([0, 90, 60], [0], [1, 2, 3]), "vertical angles do not ascend"),
    (ies([0, 90], [0, 45], [1, 2, 3, 4]), "end at 45"),
    (ies([0, 90], [10, 45], [1, 2, 3, 4]), "begin at 10"),
    (ies([0, 200], [0], [1, 2]), "0 to 180"),
    (ies([0], [0], [1]), "0 to 180"),
    (GOOD.replace("2 1 1 2", "2 1 7 2"), "photometric type"),
    (GOOD.replace("2 1 1 2", "-2 1 1 2"), "-2 vertical angles"),
    (GOOD.replace("2 1 1 2", "99999999 9 1 2"), "1e+08 vertical angles"),
]


@pytest.mark.parametrize(("text", "reason"), BAD)
def test_bad_files_say_what_is_wrong(text, reason):
    with pytest.raises(IesError) as caught:
        parse_ies(text)
    assert reason in str(caught.value) and "\n" not in str(caught.value)


SPOT = """def SphereLight "L" (prepend apiSchemas = ["ShapingAPI"]) {
    asset inputs:shaping:ies:file = @lamp.ies@
    float inputs:shaping:ies:angleScale = -0.5
    bool inputs:shaping:ies:normalize = true }
def RectLight "M" (prepend apiSchemas = ["ShapingAPI"]) {
    asset inputs:shaping:ies:file = @lamp.ies@ }"""


def test_lights_share_a_profile(tmp_path):
    (tmp_path / "lamp.ies").write_text(GOOD)
    scene, loaded = load(tmp_path, SPOT)
    first, second = scene.lights
    assert (first["ies"], first["ies_angle_scale"], first["ies_normalize"]) == (0, -0.5, True)
    assert (second["ies"], second["ies_angle_scale"], second["ies_normalize"]) == (0, 0, False)
    assert first["cone_angle"] == 90
    assert len(scene.profiles) == 1 and scene.profiles[0]["candela"].tolist() == [[10, 4]]
    assert not loaded.report.warnings


@pytest.mark.parametrize("text", [None, *(text for text, _ in BAD[:3])])
def test_lights_are_drawn_without_bad_profiles(tmp_path, text):
    if text is not None:
        (tmp_path / "lamp.ies").write_text(text)
    scene, loaded = load(tmp_path, SPOT)
    assert len(scene.lights) == 2 and not any("ies" in light for light in scene.lights)
    (warning,) = loaded.report.warnings
    assert "lamp.ies cannot be read" in warning.what and "drawn without it" in said(loaded)
