# SPDX-License-Identifier: Apache-2.0
"""Tests connections of camera and light paths: schedules, crops, layers by technique."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

SIZE, SPP = 32, 3


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A loaded stage with materials of all kinds."""
    path = tmp_path_factory.mktemp("connections") / "mixed.usdc"
    write_scene("mixed", path, triangles=12_000, teapot_level=6, texture_size=64)
    return wavecomb.load(path)


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain: dict[str, Any] = {"size": (SIZE, SIZE), "spp": SPP, "transport": "bdpt"}
    return wavecomb.render(stage, **(plain | settings))


WAYS: list[dict[str, Any]] = [
    *({"lanes": lanes} for lanes in (1, 8)),
    {"threads": 1, "wave_size": 64, "policy": "random-runs"},
    {"policy": "material", "ray_order": "morton", "materialize": "on", "wave_size": 1000},
    {"integrator": "reference"},
    {"traversal": "single", "progressive": True, "aovs": ("crypto_object", "position")},
]


@pytest.mark.slow
def test_one_picture_whatever_the_schedule(caustics: Path, mixed: Any) -> None:
    for stage in (wavecomb.load(caustics), mixed):
        plain = render(stage).beauty
        assert not np.array_equal(plain, render(stage, transport="light").beauty)
        for way in WAYS:
            if way.get("lanes", 1) in _core.lane_widths():
                assert np.array_equal(plain, render(stage, **way).beauty), way


@pytest.mark.slow
def test_settings_of_paths_change_the_picture_alike(mixed: Any) -> None:
    for way in (
        {"roulette": "cost-aware", "costs": "model"},
        {"sampler": "independent", "seed": 9},
        {"light_selection": "tree", "max_depth": 3},
        {"light_aim": "off"},
    ):
        waves, reference = (
            render(mixed, integrator=name, **way).beauty for name in ("wavefront", "reference")
        )
        assert np.array_equal(waves, reference), way


@pytest.mark.slow
def test_parts_are_those_of_the_whole(mixed: Any) -> None:
    whole = render(mixed).beauty
    x0, y0, x1, y1 = region = (9, 5, 27, 22)
    part = render(mixed, region=region).beauty
    assert np.array_equal(part[y0:y1, x0:x1], whole[y0:y1, x0:x1])
    assert not part[:y0].any()
    crop = render(mixed, region=region, crop=True).beauty
    assert np.array_equal(crop, whole[y0:y1, x0:x1])


def test_techniques_add_up_to_the_beauty(mixed: Any) -> None:
    plain = render(mixed)
    asked = render(mixed, aovs=("techniques",))
    assert asked.beauty.tobytes() == plain.beauty.tobytes()
    names = ("bounces", "light_samples", "light_paths")
    parts = [asked.aovs[f"by_{name}"] for name in names]
    np.testing.assert_allclose(sum(parts), asked.beauty, rtol=1e-5, atol=1e-6)
    assert all(part.max() > 0 for part in parts)
    other = render(mixed, aovs=("techniques",), integrator="reference")
    for name, layer in asked.aovs.items():
        assert layer.tobytes() == other.aovs[name].tobytes(), name


def test_nothing_is_connected_where_one_scattering_is_all(mixed: Any) -> None:
    found, light = (render(mixed, max_depth=1, transport=name).beauty for name in ("bdpt", "light"))
    np.testing.assert_array_equal(found, light)


def test_what_it_does_not_go_with_is_one_line(mixed: Any) -> None:
    with pytest.raises(ValueError, match="transport bdpt does not go with clamp_indirect") as error:
        render(mixed, clamp_indirect=1.0)
    assert "\n" not in str(error.value)
