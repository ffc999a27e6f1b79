# SPDX-License-Identifier: Apache-2.0
"""Tests path guiding: equal images for all schedules, no bias, crops and statistics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from parts import is_long
from stopping import StopAt

import wavecomb
from wavecomb.cli import main
from wavecomb.image.directions import density_map, map_directions
from wavecomb.image.files.image import read_image
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

SIZE = 64
SPP = 32
"""Smallest sample count for which an eighth of the samples suffices to train a guiding field."""
WAYS: list[dict[str, Any]] = [
    {"guiding": "on"},
    {"guiding": "on", "roulette": "efficient"},
    {"guiding": "off", "roulette": "efficient"},
]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Cornell box as a file."""
    path = tmp_path_factory.mktemp("guiding") / "cornell.usda"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def cornell(stage: Path) -> Any:
    return wavecomb.load(stage).scene


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A stage with many shading programs, textures, glass, a dome and a sun."""
    path = tmp_path_factory.mktemp("guiding") / "mixed.usdc"
    write_scene("mixed", path, triangles=20000, texture_size=256)
    return wavecomb.load(path).scene


def render(scene: Any, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(scene, **{"size": (SIZE, SIZE), "spp": SPP, **settings})


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("name", ["cornell", "mixed"])
def test_one_picture_whatever_the_schedule(
    request: pytest.FixtureRequest, name: str, way: dict[str, Any]
) -> None:
    scene = request.getfixturevalue(name)
    plain = render(scene, **way)
    learned = plain.stats["guiding"]
    assert learned["paths"] >= 12000
    assert learned["regions"] > 0
    # On the scene Mixed, so few training paths show no gain.
    if name == "cornell":
        assert (learned["guided_share"] > 0) == (way["guiding"] == "on")
        assert not np.array_equal(plain.beauty, render(scene).beauty)
    others: list[dict[str, Any]] = [
        {"lanes": 1, "threads": 1, "traversal": "single", "progressive": True},
        {"wave_size": 64, "threads": 2, "aovs": ("all",)},
        {"policy": "random-runs", "wave_size": 1000},
        {"policy": "material", "costs": "model", "ray_order": "morton", "materialize": "on"},
        {"integrator": "reference"},
    ]
    for other in others:
        same = render(scene, **way, **other)
        assert np.array_equal(plain.beauty, same.beauty), other
        for fact in ("bounces", "cells", "survival", "regions", "guided_regions", "guided_share"):
            assert same.stats["guiding"][fact] == learned[fact], (other, fact)


@pytest.mark.slow
@pytest.mark.parametrize("guiding", ["off", "on"])
@pytest.mark.parametrize(
    "transport",
    [{"transport": "light"}, {"transport": "bdpt"}, {"transport": "light", "merge_radius": 1.0}],
    ids=["light", "bdpt", "merged"],
)
def test_learns_beside_light_paths(cornell: Any, transport: dict[str, Any], guiding: str) -> None:
    """The film of training has no sums for light paths, which must not write there."""
    way = {"roulette": "efficient", "guiding": guiding, **transport}
    plain = render(cornell, **way)
    assert plain.stats["guiding"]["paths"] >= 12000
    assert (plain.stats["guiding"]["guided_share"] > 0) == (guiding == "on")
    for other in ({"lanes": 1, "threads": 1, "wave_size": 64}, {"integrator": "reference"}):
        assert np.array_equal(plain.beauty, render(cornell, **way, **other).beauty), other
    without = render(cornell, **transport, roulette="off")
    assert plain.beauty.mean() == pytest.approx(without.beauty.mean(), rel=0.01)


@pytest.mark.parametrize("way", [*WAYS, {"guiding": "on", "transport": "light"}], ids=str)
@pytest.mark.slow
def test_parts_are_those_of_the_whole(cornell: Any, way: dict[str, Any]) -> None:
    whole = render(cornell, **way)
    x0, y0, x1, y1 = box = (10, 20, 43, 50)
    part = render(cornell, region=box, **way)
    assert np.array_equal(part.beauty[y0:y1, x0:x1], whole.beauty[y0:y1, x0:x1])
    crop = render(cornell, region=box, crop=True, **way)
    assert np.array_equal(crop.beauty, whole.beauty[y0:y1, x0:x1])
    # A render with other seeds uses the same field.
    other = render(cornell, seed=5, **way).stats["guiding"]
    assert other["guided_share"] == whole.stats["guiding"]["guided_share"]


@pytest.mark.slow
def test_a_resumed_picture_is_that_which_nothing_stopped(stage: Path, tmp_path: Path) -> None:
    def run(name: str, *arguments: str) -> Any:
        out = tmp_path / name
        options = ["--size", str(SIZE), str(SIZE), "--guiding", "on", "--roulette", "efficient"]
        result = CliRunner().invoke(
            main, ["render", str(stage), "-o", str(out), *options, *arguments]
        )
        assert result.exit_code == 0, result.output
        return read_image(out)

    whole = run("whole.exr", "--spp", "64")
    state = str(tmp_path / "state.wcc")
    run("half.exr", "--spp", "64", "--checkpoint", state)
    assert np.array_equal(whole, run("again.exr", "--spp", "64", "--resume", state))


def as_settings(**values: Any) -> Any:
    return _core.Settings(**{"width": SIZE, "height": SIZE, "spp": SPP, **values})


@pytest.fixture(scope="module")
def stopped(cornell: Any) -> dict[str, Any]:
    """The state of a guided render that was stopped."""
    stop = StopAt(1)
    settings = as_settings(guiding="on", spp=128)
    _core.render(cornell, settings, watcher=stop, interval=0.01)
    assert 0 < stop.state["film.pixels"].view(np.uint32)[6::8].max() < 128
    return stop.state


@pytest.mark.slow
def test_what_was_learned_goes_on_with_a_render(cornell: Any, stopped: dict[str, Any]) -> None:
    """A resumed render with other threads and lanes uses the stored guiding field."""
    way = {"guiding": "on", "spp": 128}
    whole = _core.render(cornell, as_settings(**way))
    again = _core.render(
        cornell, as_settings(**way, threads=1, lanes=1, wave_size=512), state=stopped
    )
    assert np.array_equal(again.beauty, whole.beauty)
    told, before = again.stats["guiding"], whole.stats["guiding"]
    assert told["kept"] and not before["kept"] and told["seconds"] == 0
    for fact in before:
        if fact not in ("seconds", "kept"):
            assert told[fact] == before[fact], fact
    field = before["field_bytes"]
    assert field <= stopped["learned.field"].size <= field + 4096
    # A checkpoint of an older version has no field, so training runs again.
    older = {name: value for name, value in stopped.items() if name != "learned.field"}
    again = _core.render(cornell, as_settings(**way), state=older)
    assert np.array_equal(again.beauty, whole.beauty) and not again.stats["guiding"]["kept"]


@pytest.mark.slow
def test_more_samples_are_guided_as_those_before(cornell: Any, stopped: dict[str, Any]) -> None:
    """A render that is resumed with more samples keeps its guiding field."""
    more = _core.render(cornell, as_settings(guiding="on", spp=160), state=stopped)
    learned = more.stats["guiding"]
    assert learned["kept"] and learned["paths"] == pytest.approx(SIZE * SIZE * 128 / 8, rel=0.08)
    assert (more.samples == 160).all()


@pytest.mark.slow
def test_a_render_that_finds_it_does_not_pay_keeps_that(cornell: Any) -> None:
    part = as_settings(guiding="auto", spp=1000, region=(0, 0, 2, 1))
    stop = StopAt(1)
    _core.render(cornell, part, watcher=stop, interval=0.01)
    again = _core.render(cornell, part, state=stop.state).stats["guiding"]
    assert again["kept"] and not again["used"] and again["gain"] > 0


@pytest.mark.slow
def test_what_is_learned_is_kept_for_the_next_render_of_a_scene(cornell: Any) -> None:
    renderer = _core.Renderer(cornell)
    way: dict[str, Any] = {"guiding": "on", "roulette": "efficient"}
    first = renderer.render(as_settings(**way))
    assert not first.stats["guiding"]["kept"]
    for other in ({"seed": 3}, {"region": (3, 4, 40, 50)}, {"aovs": ["depth"], "wave_size": 64}):
        settings = as_settings(**way, **other)
        next_one = renderer.render(settings)
        assert next_one.stats["guiding"]["kept"], other
        assert np.array_equal(next_one.beauty, _core.render(cornell, settings).beauty), other
    assert not renderer.render(as_settings(**way, max_depth=3)).stats["guiding"]["kept"]
    renderer.edit(camera=cornell.camera)
    assert not renderer.render(as_settings(**way, max_depth=3)).stats["guiding"]["kept"]


def test_a_damaged_field_is_refused(cornell: Any, stopped: dict[str, Any]) -> None:
    settings = as_settings(guiding="on", spp=129, region=(0, 0, 2, 2))
    good = stopped["learned.field"]
    rng = np.random.default_rng(6)
    for cut in (0, 1, 3, 90, good.size - 1):
        if cut > 0:
            with pytest.raises(_core.Error, match=r"start anew|train a new one"):
                _core.render(cornell, settings, state={**stopped, "learned.field": good[:cut]})
    refused = 0
    for _ in range(30):
        bad = good.copy()
        at = rng.integers(0, good.size, 8)
        bad[at] = rng.integers(0, 256, 8)
        try:
            _core.render(cornell, settings, state={**stopped, "learned.field": bad})
        except _core.Error as error:
            assert "start anew" in str(error) or "train a new one" in str(error)
            refused += 1
    assert refused > 20


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell", "mixed"])
def test_is_unbiased(request: pytest.FixtureRequest, name: str) -> None:
    """Means over many seeds agree with unguided renders' means, for each tile of the image."""
    scene = request.getfixturevalue(name)
    seeds = 12

    def tiles(way: dict[str, Any], first: int) -> Any:
        pictures = [
            render(scene, seed=seed, filter="box", clamp_indirect=0.0, **way).beauty
            for seed in range(first, first + seeds)
        ]
        return np.array(pictures).reshape(seeds, 4, SIZE // 4, 4, SIZE // 4, 3).mean((2, 4, 5))

    plain = tiles({}, 100)
    for number, way in enumerate(WAYS):
        guided = tiles(way, 1000 * (number + 1))
        variance = (plain.var(0, ddof=1) + guided.var(0, ddof=1)) / seeds
        z = (guided.mean(0) - plain.mean(0)) / np.sqrt(np.maximum(variance, 1e-12))
        # Student's t with about 20 degrees of freedom, 16 tiles, three settings, two stages: 1 %.
        assert np.abs(z).max() < 5.2, (way, z)


def test_short_renders_learn_nothing(cornell: Any) -> None:
    short = render(cornell, spp=16, guiding="on", roulette="efficient")
    assert short.stats["guiding"] is None
    assert np.array_equal(short.beauty, render(cornell, spp=16).beauty)


def test_memory_is_bounded(cornell: Any) -> None:
    small = render(cornell, spp=256, guiding="on", learn_memory=1).stats["guiding"]
    assert 0 < small["field_bytes"] <= 1 << 20


def test_a_stage_without_light_is_rendered() -> None:
    builder = wavecomb.SceneBuilder()
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    points = np.array([[-1, -1, -3], [1, -1, -3], [1, 1, -3], [-1, 1, -3]], np.float32)
    material = builder.add_material("diffuse", name="Wall")
    builder.add_to_group(0, builder.add_mesh(points, quad, material=material))
    builder.set_camera(np.eye(4), window=(-1.0, 1.0, -1.0, 1.0))
    dark = render(builder.build(), guiding="on", roulette="efficient")
    assert not dark.beauty.any()
    assert dark.stats["guiding"]["regions"] == 0


def test_the_summary_says_what_was_learned(stage: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(
        main,
        ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--size", str(SIZE), str(SIZE),
         "--spp", str(SPP), "--guiding", "on", "--verbose"],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "learned from" in result.output
    words = " ".join(result.output.split())
    assert "of bounced light is guided" in words
    assert "of paths continue after a bounce" in words


@pytest.mark.slow
def test_auto_decides_alike_whatever_the_schedule(plain_room: Path) -> None:
    """All schedules, and the reference integrator, choose guiding in a room lit through a door."""
    scene = wavecomb.load(plain_room).scene
    part: dict[str, Any] = {
        **{"size": (480, 320), "spp": 132, "region": (100, 100, 104, 102), "guiding": "auto"}
    }
    first = wavecomb.render(scene, **part)
    assert first.stats["guiding"]["used"]
    # Training with a hundredth of the samples shows the gain, so training continues to its full
    # length.
    assert first.stats["guiding"]["paths"] > 1.5 * 480 * 320 * 132 / 100
    ways: list[dict[str, Any]] = [{"threads": 1, "lanes": 1, "wave_size": 64, "policy": "none"}]
    if is_long():
        ways.append({"integrator": "reference"})
    for way in ways:
        other = wavecomb.render(scene, **part, **way)
        assert other.stats["guiding"]["gain"] == first.stats["guiding"]["gain"], way
        assert other.beauty.tobytes() == first.beauty.tobytes(), way


def test_auto_leaves_a_stage_alone_where_it_does_not_pay() -> None:
    """Guiding is not used under a uniform dome, where BSDF sampling is already good."""
    builder = wavecomb.SceneBuilder()
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    points = np.array([[-9, -1, 9], [9, -1, 9], [9, -1, -9], [-9, -1, -9]], np.float32)
    material = builder.add_material("diffuse", name="Floor", base_color=(0.5, 0.5, 0.5))
    builder.add_to_group(0, builder.add_mesh(points, quad, material=material))
    builder.add_light("dome", np.eye(4), color=(1, 1, 1), name="Sky")
    builder.set_camera(np.eye(4), window=(-1.0, 1.0, -1.0, 1.0))
    scene = builder.build()
    # Training covers the whole image, the render a part of it.
    part: dict[str, Any] = {"spp": 5000, "region": (20, 40, 28, 44)}
    automatic = render(scene, guiding="auto", **part)
    assert not automatic.stats["guiding"]["used"]
    assert np.array_equal(automatic.beauty, render(scene, **part).beauty)


@pytest.mark.slow
def test_auto_learns_only_where_that_is_a_small_share(cornell: Any) -> None:
    """Guiding is trained only if a small fraction of the samples or of the time limit suffices."""
    part: dict[str, Any] = {"guiding": "auto", "region": (0, 0, 1, 1)}
    assert render(cornell, spp=488, **part).stats["guiding"] is None
    learned = render(cornell, spp=1000, **part).stats["guiding"]
    assert learned["paths"] <= 64 * 64 * 1000 / 150
    assert 0.5 < learned["gain"] < 1.25 and not learned["used"]
    limited = {**part, "spp": 2**20, "threads": 2}
    assert render(cornell, time_limit=3.5, **limited).stats["guiding"] is None
    learned = render(cornell, time_limit=60.0, **limited).stats["guiding"]
    # Training gives up on a busy machine.
    assert 20_000 < learned["paths"] <= 240_000 and learned["seconds"] < 4


@pytest.mark.slow
def test_a_limit_of_time_is_taught_for_as_long_as_it_may_be(cornell: Any) -> None:
    """The first training round assumes a rendering speed; later rounds use measured speeds."""
    way: dict[str, Any] = {"spp": 2**20, "threads": 2, "guiding": "on", "region": (0, 0, 1, 1)}
    learned = render(cornell, time_limit=3.0, **way).stats["guiding"]
    assert learned["rounds"] == 3
    # The assumed training speed is several times too low for this scene, so training traces more
    # paths, unless the machine is busy.
    assert learned["paths"] > 3 * 2 * 50_000 / 8 or learned["seconds"] > 0.2
    assert learned["seconds"] < 1.5


LEARNED_AOVS = ("guided_share", "survival")


@pytest.mark.slow
def test_layers_say_what_became_of_bounces(cornell: Any) -> None:
    plain = render(cornell, aovs=LEARNED_AOVS, roulette="off")
    assert not plain.aovs["guided_share"].any()
    assert (plain.aovs["survival"] == 1).all()
    way: dict[str, Any] = {"guiding": "on", "roulette": "efficient", "aovs": LEARNED_AOVS}
    both = render(cornell, **way)
    share, survival = (both.aovs[name] for name in LEARNED_AOVS)
    # In each region, at least a quarter of the bounces are sampled by the BSDF.
    assert 0.1 < share.mean() < share.max() <= 0.75
    assert 0.1 <= survival.min() < survival.mean() < survival.max() <= 1
    assert np.array_equal(both.beauty, render(cornell, **{**way, "aovs": ()}).beauty)
    others: list[dict[str, Any]] = [
        {"lanes": 1, "threads": 1},
        {"wave_size": 64, "policy": "material", "materialize": "on"},
        {"integrator": "reference"},
    ]
    for other in others:
        same = render(cornell, **way, **other)
        for name in LEARNED_AOVS:
            assert np.array_equal(both.aovs[name], same.aovs[name]), (name, other)


def floor(albedo: float) -> Any:
    """Returns a floor below the horizon of a uniform sky; paths have at most one bounce."""
    builder = wavecomb.SceneBuilder()
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    points = np.array([[-9, -1, 9], [9, -1, 9], [9, -1, -9], [-9, -1, -9]], np.float32)
    material = builder.add_material("diffuse", name="Floor", base_color=(albedo,) * 3)
    builder.add_to_group(0, builder.add_mesh(points, quad, material=material))
    builder.add_light("dome", np.eye(4), color=(1, 1, 1), name="Sky")
    builder.set_camera(np.eye(4), window=(-1.0, 1.0, -1.0, 1.0))
    return builder.build()


def test_survival_is_the_probability_of_roulette() -> None:
    """The AOV "survival" is min(3 x 0.2, 1) after a bounce off albedo 0.2, and 1 for misses."""
    picture = render(
        floor(0.2), spp=4, filter="box", aovs=("survival",), roulette="throughput", roulette_depth=1
    )
    survival = picture.aovs["survival"]
    assert survival[-1] == pytest.approx(0.6, rel=1e-5)
    assert (survival[0] == 1).all()


def test_what_was_learned_can_be_looked_up(cornell: Any) -> None:
    renderer = _core.Renderer(cornell)
    place = (0.3 * SIZE, 0.5 * SIZE, SIZE, SIZE)
    assert renderer.learned(*place) is None, "before there was a render"
    renderer.render(_core.Settings(width=SIZE, height=SIZE, spp=SPP, guiding="on"))
    learned = renderer.learned(*place)
    density = learned["density"]
    assert density.shape == (32, 32) and density.min() > 0
    # A bin of the region may contain the centres of two output bins, or none.
    assert density.mean() * 4 * np.pi == pytest.approx(1, rel=2e-2)
    assert 0 <= learned["guided_share"] <= 0.75
    # Light comes from the hemisphere of the normal.
    up, ahead = np.eye(3)[1], np.eye(3)[2]
    vectors, _ = map_directions(up, ahead, 64)
    values, _ = density_map(density, up, ahead, 64)
    weights = values * np.sqrt(1 - np.clip(vectors @ up, -1, 1) ** 2)
    n = np.array(renderer.pick(*place)["normal"])
    assert (
        learned["axis"] == ("+" if n[np.abs(n).argmax()] > 0 else "-") + "xyz"[np.abs(n).argmax()]
    )
    assert weights[vectors @ n > 0].sum() > 0.9 * weights.sum()
    assert sum(share for _, share in learned["light_shares"]) == pytest.approx(1, abs=1e-6)
    renderer.render(_core.Settings(width=SIZE, height=SIZE, spp=4))
    assert renderer.learned(*place)["density"] is None


@pytest.mark.slow
@pytest.mark.parametrize("weights", ["power", "calibrated"])
def test_shares_of_lights_are_those_of_the_render(mixed: Any, weights: str) -> None:
    """With light selection by power, light probabilities are equal at all points."""
    renderer = _core.Renderer(mixed)
    settings = _core.Settings(
        width=SIZE, height=SIZE, spp=1, light_selection="power", light_weights=weights
    )
    calibration = renderer.render(settings).stats["light_calibration"]
    places = [(0.5 * SIZE, y * SIZE, SIZE, SIZE) for y in (0.6, 0.9)]
    shares = [renderer.learned(*place)["light_shares"] for place in places]
    assert shares[0] == shares[1]
    assert sum(share for _, share in shares[0]) == pytest.approx(1, abs=1e-6)
    if weights == "calibrated":
        told = sorted((part["share"] for part in calibration["shares"]), reverse=True)
        found = [share for _, share in shares[0]]
        assert found == pytest.approx(told[: len(found)], abs=1e-3)
