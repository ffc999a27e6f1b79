# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wavecomb.image.compare.comparison import compare, luminance
from wavecomb.image.compare.heatmap import MIN_WIDTH, heat_map, write_heat_map
from wavecomb.image.files.image import read_image, srgb_from_linear, write_exr
from wavecomb.image.layer_view import colour_map, signed_colour_map


@pytest.fixture
def pair() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    a = rng.random((6, 9, 3), np.float32)
    return a, (a + rng.normal(0, 0.1, a.shape)).astype(np.float32)


def test_figures_against_plain_formulas(pair: tuple[np.ndarray, np.ndarray]) -> None:
    a, b = (picture.astype(np.float64) for picture in pair)
    result = compare(*pair)
    assert not result.equal
    assert result.pixels_different == 54
    assert result.mean_signed == pytest.approx((a - b).mean(axis=(0, 1)))
    assert result.mean_abs == pytest.approx(np.abs(a - b).mean(axis=(0, 1)))
    assert result.rmse == pytest.approx(np.sqrt(((a - b) ** 2).mean()))
    assert result.rel_mse == pytest.approx(((a - b) ** 2 / (b**2 + 0.01)).mean())
    light = np.abs((a - b) @ [0.2126, 0.7152, 0.0722])
    assert result.luminance_mean_abs == pytest.approx(light.mean())
    assert result.luminance_max_abs == pytest.approx(light.max())
    assert result.max_abs == pytest.approx(np.abs(a - b).max())
    assert result.luminance_max_at is not None
    x, y = result.luminance_max_at
    assert light[y, x] == light.max()


def test_equal(pair: tuple[np.ndarray, np.ndarray]) -> None:
    result = compare(pair[0], pair[0].copy())
    assert result.equal
    assert result.rmse == result.rel_mse == result.max_abs == result.luminance_max_abs == 0
    assert result.luminance_max_at is None


def test_bits_count() -> None:
    zero = np.zeros((2, 2, 3), np.float32)
    assert not compare(-zero, zero).equal
    assert compare(-zero, zero).max_abs == 0
    assert compare(-zero, zero).within(0)
    one = np.ones((2, 2, 3), np.float32)
    assert not compare(np.nextafter(one, np.float32(2)), one).equal


def test_nan_and_infinities_are_left_out(pair: tuple[np.ndarray, np.ndarray]) -> None:
    a, b = pair
    a[0, 0, 0] = b[0, 0, 0] = np.nan
    a[1, 1, 1] = np.inf
    result = compare(a, b)
    assert result.pixels_not_finite == 2
    assert result.not_finite_differ == 2
    assert not result.within(1e9)
    rest = np.ones((6, 9), bool)
    rest[0, 0] = rest[1, 1] = False
    difference = a[rest].astype(np.float64) - b[rest]
    assert result.rmse == pytest.approx(np.sqrt((difference**2).mean()))
    assert compare(a, a).equal
    assert compare(a, a).not_finite_differ == 0


def test_nothing_finite() -> None:
    nan = np.full((2, 2, 3), np.nan, np.float32)
    result = compare(nan, np.zeros_like(nan))
    assert not result.equal
    assert result.rmse == 0
    assert result.pixels_not_finite == 4


def test_layers(tmp_path: Path, pair: tuple[np.ndarray, np.ndarray]) -> None:
    a = {"beauty": pair[0], "depth": np.full((6, 9), np.inf), "albedo": pair[0]}
    b = {"beauty": pair[0], "depth": np.full((6, 9), np.inf), "normal": pair[0]}
    write_exr(tmp_path / "a.exr", a)
    write_exr(tmp_path / "b.exr", b)
    result = compare(tmp_path / "a.exr", str(tmp_path / "b.exr"))
    assert result.equal
    assert result.only_a == ("albedo",)
    assert result.only_b == ("normal",)
    b["depth"] = np.full((6, 9), 2.0)
    write_exr(tmp_path / "b.exr", b)
    result = compare(tmp_path / "a.exr", tmp_path / "b.exr")
    assert not result.equal
    assert result.pixels_different == 0
    assert result.layers == {"depth": {"equal": False, "max_abs": 0.0}}


def test_one_channel() -> None:
    result = compare(np.ones((2, 3)), np.zeros((2, 3)))
    assert result.channels == 1
    assert result.luminance_max_abs == 1


def test_sizes_must_agree() -> None:
    with pytest.raises(ValueError, match="image A is 3 x 2 with 3 channels"):
        compare(np.ones((2, 3, 3)), np.ones((3, 2, 3)))
    with pytest.raises(ValueError, match="shape"):
        compare(np.ones(3), np.ones(3))


def test_is_exported() -> None:
    import wavecomb.image.compare.heatmap

    assert wavecomb.compare is compare
    assert callable(wavecomb.compare)


def test_colour_map_is_even() -> None:
    colours = colour_map(64)
    assert (colours >= 0).all()
    assert (colours <= 1).all()
    light = luminance(colours[None].astype(np.float64))[0]
    assert (np.diff(light) > 0).all()
    steps = np.linalg.norm(np.diff(srgb_from_linear(colours), axis=0), axis=1)
    assert steps.max() < 0.1


def test_signed_colour_map_is_even_to_both_sides() -> None:
    light = luminance(signed_colour_map(65)[None].astype(np.float64))[0]
    assert (np.diff(light[32:]) > 0).all()
    assert (np.diff(light[:33]) < 0).all()
    assert light[32] == 0
    assert light[0] == pytest.approx(light[-1], rel=0.15)


def test_heat_map(tmp_path: Path) -> None:
    a = np.zeros((40, 400, 3), np.float32)
    b = a.copy()
    b[10, 10] = 1.0
    b[20, 20] = 1e-9
    b[30, 30] = np.nan
    heat = heat_map(a, b)
    assert heat.shape[1:] == (400, 3)
    assert heat.shape[0] > 40
    colours = colour_map()
    assert heat[10, 10] == pytest.approx(colours[-1])
    assert heat[20, 20] == pytest.approx(colours[0])
    assert heat[30, 30].tolist() == [0, 1, 1]
    assert heat[0, 0].tolist() == [0, 0, 0]
    assert (heat[44:58] == 1).all(axis=2).any()  # title
    assert (heat[82:] == 1).all(axis=2).any()  # numbers
    write_heat_map(tmp_path / "h.png", a, b)
    assert read_image(tmp_path / "h.png").shape == heat.shape


def test_signed_heat_map() -> None:
    b = np.zeros((8, 400, 3), np.float32)
    a = b.copy()
    a[1, 1], a[2, 2], a[3, 3] = 2.0, -2.0, 2e-5
    heat, colours = heat_map(a, b, "signed"), signed_colour_map()
    assert heat[1, 1] == pytest.approx(colours[-1])
    assert heat[2, 2] == pytest.approx(colours[0])
    assert heat[3, 3].max() < 0.02
    assert heat[1, 1, 0] > heat[1, 1, 2]
    assert heat[2, 2, 0] < heat[2, 2, 2]


@pytest.mark.parametrize("kind", ["absolute", "signed"])
@pytest.mark.parametrize("shape", [(1, 1, 3), (3, 20, 1), (2, 60, 3)])
def test_small_heat_maps(shape: tuple[int, int, int], kind: str) -> None:
    a = np.zeros(shape, np.float32)
    for b in (a, a + 1):
        heat = heat_map(a, b, kind)
        assert heat.shape[1] == MIN_WIDTH
        assert (heat[shape[0] :] == 1).all(axis=2).any()
