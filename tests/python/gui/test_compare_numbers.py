# SPDX-License-Identifier: Apache-2.0
"""Tests image comparison without a window: loading, error metrics, and the FLIP process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wavecomb.errors import WavecombError
from wavecomb.gui.compare.differences import numbers, pixel_rows, rows, verdict
from wavecomb.gui.compare.flip_process import FlipProcess
from wavecomb.gui.compare.picture_sides import Side, common_layers, pair, problem, read_side
from wavecomb.image.compare.comparison import compare
from wavecomb.image.compare.perceptual import flip
from wavecomb.image.files.image import write_exr, write_png

RNG = np.random.default_rng


def picture(seed: int = 1, height: int = 12, width: int = 16, channels: int = 3) -> np.ndarray:
    return RNG(seed).random((height, width, channels), np.float32)


def side(seed: int = 1, **layers: np.ndarray) -> Side:
    return Side("made up", {"beauty": picture(seed), **layers})


def test_files_are_read_with_all_layers(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"beauty": picture(), "depth": picture(channels=1)[:, :, 0]})
    write_exr(tmp_path / "a_var.exr", {"beauty": picture(3)})
    found = read_side(tmp_path / "a.exr")
    assert list(found.layers) == ["beauty", "depth"] and found.size == (16, 12)
    np.testing.assert_array_equal(
        found.variance, read_side(tmp_path / "a_var.exr").layers["beauty"]
    )
    assert "variance of a_var.exr" in found.note
    np.save(tmp_path / "b.npy", picture(2))
    np.testing.assert_array_equal(read_side(tmp_path / "b.npy").layer("beauty"), picture(2))
    write_png(tmp_path / "c.png", picture())
    assert read_side(tmp_path / "c.png").variance is None


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("missing.exr", None, "no such file"),
        ("bad.exr", b"nonsense", "cannot be read as an image"),
        ("bad.npy", b"nonsense", "bad.npy"),
        ("flat.npy", "array", "has the shape"),
    ],
)
def test_files_that_are_no_good(tmp_path: Path, name: str, content: object, says: str) -> None:
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content:
        np.save(path, np.zeros(3, np.float32))
    with pytest.raises(WavecombError, match=says):
        read_side(path)


def test_what_cannot_be_compared_is_said() -> None:
    a, b = side(), side(2)
    assert problem(a, b, "beauty") == ""
    assert "Choose A and B" in problem(None, None, "beauty")
    assert "Choose B" in problem(a, None, "beauty")
    small = Side("small", {"beauty": picture(height=6)})
    assert "A is 16 x 12, B is 16 x 6" in problem(a, small, "beauty")
    assert "A has no layer depth" in problem(a, side(1, depth=picture(1, channels=1)), "depth")
    grey = Side("grey", {"beauty": picture(channels=1)})
    assert "3 channels in A and 1 in B" in problem(a, grey, "beauty")
    alpha = Side("alpha", {"beauty": picture(2, channels=4)})
    assert problem(a, alpha, "beauty") == ""
    assert [p.shape[2] for p in pair(a, alpha, "beauty")] == [3, 3]


def test_layers_that_both_have() -> None:
    a = side(1, depth=picture(1, channels=1), normal=picture(4))
    assert common_layers(a, side(2, normal=picture(5))) == ["beauty", "normal"]
    assert common_layers(a, None) == ["beauty", "depth", "normal"]
    assert common_layers(None, None) == []
    one = Side("a PNG", {"grey": picture()})
    assert common_layers(one, a) == ["beauty"]


def test_numbers_are_those_of_compare() -> None:
    a, b = side(1, depth=picture(3, channels=1)), side(2, depth=picture(3, channels=1))
    found = numbers(a, b, "beauty", 0.0)
    assert found.comparison == compare(picture(1), picture(2))
    assert found.test is None and "variance" in found.test_note
    assert found.others_differ == ()
    text = {name: value for name, value, _ in rows(found)}
    assert text["relMSE"] == f"{found.comparison.rel_mse:.4g}"
    assert text["Pixels that differ"].startswith("192 of 192")
    assert text["FLIP, mean"] == "being computed" and text["PSNR"].endswith(" dB")
    assert text["Other layers"] == "all the same, bit for bit"
    assert found.with_flip(0.25).flip == 0.25
    other = numbers(a, side(2, depth=picture(4, channels=1)), "beauty", 0.0)
    assert other.others_differ == ("depth",)


def test_same_means_every_bit() -> None:
    a = side()
    equal = numbers(a, side(), "beauty", 0.0)
    assert verdict(equal) == "bit for bit the same"
    changed = picture()
    changed[0, 0, 0] = 0.0
    minus = changed.copy()
    minus[0, 0, 0] = -0.0
    found = numbers(Side("", {"beauty": changed}), Side("", {"beauty": minus}), "beauty", 0.0)
    assert verdict(found) == "different" and found.comparison.pixels_different == 1


def test_noise_is_told_from_a_difference() -> None:
    truth = np.full((64, 64, 3), 0.5, np.float32)
    spread = 0.05

    def noisy(seed: int, offset: float = 0.0) -> Side:
        made = truth + offset + RNG(seed).normal(0, spread, truth.shape).astype(np.float32)
        return Side(
            "", {"beauty": made.astype(np.float32)}, variance=np.full_like(truth, spread**2)
        )

    assert verdict(numbers(noisy(1), noisy(2), "beauty", 0.0)) == "different; within noise"
    assert verdict(numbers(noisy(1), noisy(2, 0.05), "beauty", 0.0)).endswith("more than noise")


def test_values_of_a_pixel() -> None:
    a, b = side(1), side(2)
    found = pixel_rows(a, b, "beauty", 3, 5)
    gap = picture(1)[5, 3].astype(float) - picture(2)[5, 3].astype(float)
    assert [float(v) for v in found["A - B"].split()] == pytest.approx(gap, rel=1e-3)
    assert list(pixel_rows(a, None, "beauty", 3, 5)) == ["A"]
    assert pixel_rows(a, b, "beauty", 16, 5) == {} and pixel_rows(a, b, "none", 3, 5) == {}


@pytest.mark.slow
def test_flip_in_its_process_is_flip() -> None:
    pytest.importorskip("flip_evaluator")
    process = FlipProcess()
    a, b = picture(1), picture(2)
    np.testing.assert_array_equal(process.flip(a, b, False, 0.5), flip(a, b, exposure=0.5))
    with pytest.raises(WavecombError, match="which is black"):
        process.flip(a, np.zeros_like(b), True, 0.0)
    process.stop()
    with pytest.raises(WavecombError, match="was stopped"):
        process.flip(a, b, False, 0.0)
