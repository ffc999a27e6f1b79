# SPDX-License-Identifier: Apache-2.0
"""Tests SSIM, FLIP, trimmed relMSE and the z-test on images with known results."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from wavecomb.cli import compare as command
from wavecomb.cli import main
from wavecomb.image.compare.comparison import compare, trimmed_mean
from wavecomb.image.compare.heatmap import KINDS
from wavecomb.image.compare.perceptual import METRICS, flip, measure, psnr, ssim
from wavecomb.image.compare.z_test import sidak, z_test
from wavecomb.image.files.image import linear_from_srgb, write_exr

RNG = np.random.default_rng


def picture(seed: int = 1, shape: tuple[int, int, int] = (24, 32, 3)) -> np.ndarray:
    return RNG(seed).random(shape, np.float32)


# ---- trimmed relMSE ------------------------------------------------------------------------------


def test_trimming_takes_the_largest_terms_only() -> None:
    values = RNG(2).permutation(np.arange(2000.0))
    assert trimmed_mean(values, 0.001) == pytest.approx(np.arange(1998.0).mean())
    assert trimmed_mean(values, 0.0) == pytest.approx(values.mean())
    assert trimmed_mean(np.empty(0)) == 0.0


def test_one_firefly_decides_the_mean_and_not_the_trimmed_one() -> None:
    reference = np.full((40, 50, 3), 0.5, np.float32)
    noisy = reference + np.float32(0.01)
    clean = compare(noisy, reference)
    noisy[3, 4] = 1e4
    result = compare(noisy, reference)
    assert result.rel_mse > 1e4
    assert result.rel_mse_trimmed == pytest.approx(clean.rel_mse, rel=1e-5)
    assert result.rel_mse_trimmed == pytest.approx(0.01**2 / (0.25 + 0.01), rel=1e-3)


# ---- SSIM and FLIP -------------------------------------------------------------------------------


@pytest.mark.parametrize("metric", METRICS)
def test_equal_pictures(metric: str) -> None:
    a = picture()
    best = {"psnr": np.inf, "ssim": 1.0}.get(metric, 0.0)
    assert measure(metric, a, a.copy()) == pytest.approx(best)


def test_psnr_of_a_known_error_as_shown() -> None:
    grey = linear_from_srgb(np.full((8, 8, 3), 0.5, np.float32))
    other = linear_from_srgb(np.full((8, 8, 3), 0.51, np.float32))
    assert psnr(other, grey) == pytest.approx(40.0, abs=1e-3)  # a difference of 0.01
    # Values above the display's white are not visible, unless the exposure lowers them.
    assert psnr(grey + 2, grey + 3) == np.inf
    assert psnr(grey + 2, grey + 3, exposure=-3) < 30.0


def test_ssim_of_flat_pictures_is_the_luminance_term() -> None:
    x, y = 0.25, 0.5  # encoded values
    a, b = (
        np.full((20, 20, 3), linear_from_srgb(np.array([v], np.float32))[0], np.float32)
        for v in (x, y)
    )
    assert ssim(a, b) == pytest.approx((2 * x * y + 1e-4) / (x * x + y * y + 1e-4), abs=1e-5)


def test_ssim_of_opposite_checks_is_negative_and_of_noise_falls() -> None:
    checks = (np.indices((24, 24)).sum(axis=0) % 2)[:, :, None].repeat(3, axis=2).astype(np.float32)
    assert ssim(1 - checks, checks) < -0.9
    smooth = np.linspace(0.1, 0.8, 64, dtype=np.float32)[None, :, None] * np.ones((64, 1, 3), "f4")
    some, more = (
        ssim(smooth + RNG(5).normal(0, s, smooth.shape).astype("f4"), smooth) for s in (0.01, 0.1)
    )
    assert 1 > some > more > 0


def test_ssim_against_sums_over_one_window() -> None:
    """An 11 x 11 image has one complete window, so SSIM is a formula of weighted sums."""
    a, b = picture(1, (11, 11, 1)), picture(2, (11, 11, 1))
    d = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
    w = np.outer(d, d) / d.sum() ** 2

    def encoded(p: np.ndarray) -> np.ndarray:
        v = p[:, :, 0].astype(float)
        return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)

    x, y = encoded(a), encoded(b)
    mx, my = (w * x).sum(), (w * y).sum()
    vx, vy = (w * (x - mx) ** 2).sum(), (w * (y - my) ** 2).sum()
    cov = (w * (x - mx) * (y - my)).sum()
    expected = (2 * mx * my + 1e-4) * (2 * cov + 9e-4)
    expected /= (mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4)
    assert ssim(a, b) == pytest.approx(expected, abs=1e-5)


def test_flip_of_known_pairs() -> None:
    black, white = np.zeros((16, 16, 3), np.float32), np.ones((16, 16, 3), np.float32)
    green = np.zeros_like(black)
    green[:, :, 1] = 1
    blue = np.zeros_like(black)
    blue[:, :, 2] = 1
    # FLIP scales its range by the largest colour difference, which is that of green and blue.
    assert flip(green, blue).mean() == pytest.approx(1.0, abs=0.01)
    assert 0.5 < flip(black, white).mean() <= 1.0
    near = flip(white * np.float32(0.98), white).mean()
    assert 0.0 < near < 0.1
    # LDR-FLIP does not see values above the display's white, HDR-FLIP does.
    lamp = white.copy()
    lamp[4:8, 4:8] = 50.0
    other = lamp * np.float32(1.0)
    other[4:8, 4:8] = 10.0
    assert flip(other, lamp).max() == 0.0
    assert flip(other, lamp, high_range=True).max() > 0.1


def test_exposure_is_used() -> None:
    a, b = picture() * np.float32(4), picture(2) * np.float32(4)
    scaled = np.float32(0.25)
    for metric in ("ssim", "flip-ldr"):
        assert measure(metric, a, b, -2.0) == pytest.approx(
            measure(metric, a * scaled, b * scaled), abs=1e-5
        )


def test_what_metrics_refuse() -> None:
    small = np.zeros((10, 30, 3), np.float32)
    with pytest.raises(ValueError, match="at least 11 x 11"):
        ssim(small, small)
    with pytest.raises(ValueError, match="black"):
        flip(small + 1, small, high_range=True)
    with pytest.raises(ValueError, match="same size"):
        flip(small, picture())


# ---- z-test --------------------------------------------------------------------------------------


def noisy_pair(seed: int, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns a noisy image, its mean without ``shift``, and the variance of its noise."""
    rng = RNG(seed)
    mean = rng.random((40, 48, 3)) + 0.5
    variance = (0.05 * mean) ** 2
    return mean + shift + rng.normal(0, np.sqrt(variance)), mean, variance


def test_equal_distributions_are_rejected_as_often_as_the_level_says() -> None:
    rejected = 0
    for seed in range(100):
        a, b, variance = noisy_pair(seed)
        rejected += not z_test(a, b, variance_a=variance, significance=0.1).agrees
    assert 2 <= rejected <= 20  # 10 expected; P(outside) < 0.1 %


def test_a_shift_is_found_and_placed() -> None:
    a, b, variance = noisy_pair(7)
    assert z_test(a, b, variance_a=variance).agrees
    whole = z_test(a + 0.01, b, variance_a=variance)
    assert not whole.agrees
    assert whole.worst_tile is None
    a[16:24, 8:16, 1] *= 1.05
    local = z_test(a, b, variance_b=variance)
    assert not local.agrees
    assert local.worst_tile == (8, 16)
    assert local.pixels_accepted > 0.999


def test_both_variances_add() -> None:
    a, b, variance = noisy_pair(3)
    both = z_test(a, b, variance_a=variance * 0.5, variance_b=variance * 0.5)
    assert both.z_pixels == pytest.approx(z_test(a, b, variance_a=variance).z_pixels, rel=1e-6)


def test_quiet_pixels() -> None:
    b = np.ones((8, 8, 3), np.float32)
    zero = np.zeros_like(b)
    assert z_test(b * np.float32(1 + 1e-6), b, variance_a=zero).agrees
    assert not z_test(b * np.float32(1 + 1e-3), b, variance_a=zero).agrees


def test_what_the_z_test_refuses() -> None:
    a = np.ones((8, 8, 3), np.float32)
    with pytest.raises(ValueError, match="needs a variance"):
        z_test(a, a)
    with pytest.raises(ValueError, match="negative"):
        z_test(a, a, variance_a=-a)
    with pytest.raises(ValueError, match="shape"):
        z_test(a, a, variance_b=a[:4])


def test_sidak() -> None:
    assert sidak(0.05, 1) == pytest.approx(0.05)
    assert sidak(0.02, 3) == pytest.approx(1 - 0.98**3)
    assert sidak(1e-20, 10) == pytest.approx(1e-19)
    assert sidak(1.0, 4) == 1.0


# ---- the command ---------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    a, b, variance = noisy_pair(11)
    pictures = {"a": a, "b": b, "variance": variance, "far": b + 1, "small": b[:5, :5]}
    for name, pixels in pictures.items():
        write_exr(tmp_path / f"{name}.exr", {"beauty": pixels})
    return {name: str(tmp_path / f"{name}.exr") for name in pictures}


def run(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(main, ["compare", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_command_metrics_and_z_test(files: dict[str, str]) -> None:
    a, b, variance = files["a"], files["b"], files["variance"]
    options = ("--metric", "flip-hdr", "--metric", "ssim", "--variance-a", variance)
    code, text, _ = run(a, b, *options)
    assert code == 0
    assert "no difference shown" in text
    code, text, _ = run(a, b, *options, "--json")
    document = json.loads(text)
    assert code == 0
    assert set(document["metrics"]) == {"ssim", "flip-hdr"}
    assert 0 < document["metrics"]["ssim"] < 1
    assert document["z_test"]["agrees"] is True
    assert document["rel_mse_trimmed"] < document["rel_mse"]
    code, text, _ = run(files["far"], b, "--variance-a", variance)
    assert code == 1
    assert "different expectation" in text


def test_the_command_offers_what_there_is() -> None:
    assert command._METRICS == METRICS
    assert (*KINDS, "z") == command._MAPS


@pytest.mark.parametrize("kind", [*KINDS, "z"])
def test_command_maps(files: dict[str, str], tmp_path: Path, kind: str) -> None:
    from wavecomb.image.files.image import read_image

    out = tmp_path / "map.png"
    extra = ("--variance-b", files["variance"])
    code, _, error = run(files["a"], files["b"], "--heatmap", str(out), "--map", kind, *extra)
    assert code == 0, error
    pixels = read_image(out)
    assert pixels.shape[0] > 40
    assert np.ptp(pixels[:40, :48], axis=(0, 1)).max() > 0.03  # not blank
    assert (pixels[40:] == 1).all(axis=2).any()  # text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a", "b", "--map", "z", "--heatmap", "z.png"), "--map z needs --variance-a"),
        (("small", "small", "--metric", "ssim"), "at least 11 x 11"),
        (("a", "b", "--variance-a", "small"), "the variance of A has the shape"),
    ],
)
def test_command_errors(files: dict[str, str], arguments: tuple[str, ...], message: str) -> None:
    code, _, error = run(*(files.get(argument, argument) for argument in arguments))
    assert code == 2
    assert message in error
    assert error.count("\n") == 1


def test_without_the_extra(files: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    code, text, _ = run(files["a"], files["b"], "--metric", "ssim")
    assert code == 1
    assert "SSIM" in text
    code, _, error = run(files["a"], files["b"], "--metric", "flip-ldr")
    assert code == 2
    assert "pip install 'flip-evaluator" in error
