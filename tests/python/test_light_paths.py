# SPDX-License-Identifier: Apache-2.0
"""Tests light paths: equal images for all schedules, crops, and unsupported features."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import read_image
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

SIZE, SPP = 32, 2


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Generated stages as files."""
    folder = tmp_path_factory.mktemp("light_paths")

    def get(name: str) -> Path:
        path = folder / f"{name}.usdc"
        if not path.exists():
            write_scene(name, path, triangles=12_000, teapot_level=6, texture_size=64)
        return path

    return get


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain: dict[str, Any] = {"size": (SIZE, SIZE), "spp": SPP, "transport": "light"}
    return wavecomb.render(stage, **(plain | settings))


@pytest.mark.parametrize(("name", "projection"), [("caustics", None), ("pool", "latlong")])
def test_splats_of_one_pixel_do_not_depend_on_the_schedule(
    stages: Any, name: str, projection: Any
) -> None:
    stage = wavecomb.load(stages(name), projection=projection)
    layers = ("direct", "indirect", "emission", "techniques")
    plain = render(stage, light_splats="pixel", aovs=layers)
    assert not np.array_equal(plain.beauty, render(stage, light_splats="filtered").beauty)
    ways: list[dict[str, Any]] = [
        {"threads": 1, "wave_size": 64, "policy": "random-runs"},
        {"integrator": "reference"},
    ]
    for way in ways:
        other = render(stage, light_splats="pixel", aovs=layers, **way)
        assert np.array_equal(plain.beauty, other.beauty), way
        assert all(np.array_equal(plain.aovs[k], other.aovs[k]) for k in plain.aovs), way
    x0, y0, x1, y1 = region = (7, 9, 23, 29)
    part = render(stage, light_splats="pixel", region=region, crop=True)
    assert np.array_equal(part.beauty, plain.beauty[y0:y1, x0:x1])
    parts = sum(plain.aovs[k].astype(np.float64) for k in ("direct", "indirect", "emission"))
    assert np.allclose(parts, plain.beauty, rtol=1e-4, atol=1e-5)


def test_splats_go_to_one_pixel_where_a_denoiser_follows(stages: Any) -> None:
    stage = wavecomb.load(stages("caustics"))
    guides = ("guide_albedo", "guide_normal")
    filtered, pixel = (render(stage, light_splats=way).beauty for way in ("filtered", "pixel"))
    assert np.array_equal(render(stage).beauty, filtered)
    assert np.array_equal(render(stage, aovs=guides).beauty, pixel)
    assert np.array_equal(render(stage, aovs=guides, light_splats="filtered").beauty, filtered)


@pytest.mark.slow
def test_a_denoiser_removes_the_noise_of_light_paths(stages: Any) -> None:
    """After denoising, noise that is equal in neighbouring pixels would remain as grain."""
    pytest.importorskip("pyoidn")
    stage = wavecomb.load(stages("lens"))
    grain = {}
    for way in ("filtered", "pixel"):
        picture = render(
            stage, size=(128, 128), spp=4, light_splats=way, aovs=("guide_albedo", "guide_normal")
        )
        image = np.log(picture.with_denoised().denoised.mean(axis=2) + 1e-3)
        # The median ignores edges.
        grain[way] = np.median(np.abs(image[1:-1, 1:-1] - 0.25 * (
            image[:-2, 1:-1] + image[2:, 1:-1] + image[1:-1, :-2] + image[1:-1, 2:]
        )))  # fmt: skip
    assert grain["pixel"] < 0.5 * grain["filtered"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "projection"), [("caustics", None), ("mixed", None), ("pool", "latlong")]
)
def test_one_picture_whatever_the_schedule(stages: Any, name: str, projection: Any) -> None:
    stage = wavecomb.load(stages(name), projection=projection)
    plain = render(stage)
    assert not np.array_equal(plain.beauty, render(stage, transport="path").beauty)
    ways: list[dict[str, Any]] = [{"lanes": lanes} for lanes in _core.lane_widths()]
    ways += [
        {"threads": 1, "wave_size": 64, "policy": "random-runs"},
        {"policy": "material", "ray_order": "morton", "materialize": "on", "wave_size": 1000},
        {"integrator": "reference"},
        {"traversal": "single", "progressive": True, "aovs": ("crypto_object", "position")},
    ]
    for way in ways:
        other = render(stage, **way)
        assert np.array_equal(plain.beauty, other.beauty), way


def test_settings_of_paths_change_the_picture_alike(stages: Any) -> None:
    stage = wavecomb.load(stages("caustics"))
    for way in (
        {"roulette": "cost-aware", "costs": "model"},
        {"fresnel": "schlick"},
        {"sampler": "independent"},
        {"light_selection": "tree"},
        {"seed": 9},
    ):
        assert np.array_equal(
            render(stage, **way).beauty, render(stage, integrator="reference", **way).beauty
        ), way


@pytest.mark.parametrize("projection", [None, "latlong"])
def test_parts_are_those_of_the_whole(stages: Any, projection: Any) -> None:
    stage = wavecomb.load(stages("caustics"), projection=projection)
    whole = render(stage).beauty
    # This crop includes the seam and the lower pole of a latlong image.
    x0, y0, x1, y1 = region = (9, 5, 27, 22) if projection is None else (9, 5, 32, 32)
    part = render(stage, region=region).beauty
    assert np.array_equal(part[y0:y1, x0:x1], whole[y0:y1, x0:x1])
    assert not part[:y0].any()
    crop = render(stage, region=region, crop=True).beauty
    assert np.array_equal(crop, whole[y0:y1, x0:x1])


def test_a_resumed_picture_is_that_which_nothing_stopped(stages: Any, tmp_path: Path) -> None:
    def run(name: str, *arguments: str) -> Any:
        out = tmp_path / name
        size = ["--size", str(SIZE), str(SIZE), "--transport", "light"]
        result = CliRunner().invoke(
            main, ["render", str(stages("caustics")), "-o", str(out), *size, *arguments]
        )
        assert result.exit_code == 0, result.output
        return read_image(out)

    whole = run("whole.exr", "--spp", "12")
    state = str(tmp_path / "state.wcc")
    run("half.exr", "--spp", "12", "--checkpoint", state)
    assert np.array_equal(whole, run("again.exr", "--spp", "12", "--resume", state))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"clamp_indirect": 1.0}, "clamp_indirect"),
        ({"cosine_sampling": True}, "cosine_sampling"),
        ({"aovs": ("lpe:a=C.{10}D.*[LO]",)}, "too many states"),
        ({"transport": "both"}, "must be one of path, light, auto, bdpt"),
    ],
    ids=lambda x: str(x)[:30],
)
def test_what_it_does_not_go_with_is_one_line(
    stages: Any, settings: dict[str, Any], message: str
) -> None:
    stage = wavecomb.load(stages("caustics"))
    with pytest.raises(ValueError, match=message) as error:
        render(stage, **settings)
    assert "\n" not in str(error.value)


def test_brightness_of_lights_does_not_matter(stages: Any) -> None:
    """Multiplying a light's power by 2^20 multiplies light splats and image by exactly 2^20."""
    from pxr import Usd, UsdLux

    path = stages("caustics")
    plain = render(wavecomb.load(path)).beauty
    stage = Usd.Stage.Open(str(path))
    lamp = UsdLux.SphereLight.Get(stage, "/World/Lights/Lamp").GetIntensityAttr()
    lamp.Set(lamp.Get() * 2.0**20)
    brighter = path.with_name("brighter.usdc")
    stage.Export(str(brighter))
    np.testing.assert_array_equal(render(wavecomb.load(brighter)).beauty, plain * np.float32(2**20))


def test_lights_that_send_no_paths_are_named(stages: Any, tmp_path: Path) -> None:
    """Lights without light paths are listed, and camera paths find all of their light."""
    from pxr import Usd, UsdLux

    stage = Usd.Stage.Open(str(stages("caustics")))
    lamp = UsdLux.LightAPI(stage.GetPrimAtPath("/World/Lights/Lamp"))
    lamp.CreateSpecularAttr(0.5)
    path = tmp_path / "half.usdc"
    stage.Export(str(path))
    loaded = wavecomb.load(path)
    picture = render(loaded)
    assert picture.stats["lights_without_paths"] == ["/World/Lights/Lamp"]
    alone = render(loaded, transport="path")
    np.testing.assert_allclose(picture.beauty, alone.beauty, rtol=1e-5)
