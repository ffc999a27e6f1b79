# SPDX-License-Identifier: Apache-2.0
"""Tests quality "auto", the default: its decisions, which are equal for all parts of an image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stopping import StopAt

import wavecomb
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

ENOUGH = {"width": 160, "height": 160, "spp": 128}
"""Just enough samples for all pilot renders."""
PART = {**ENOUGH, "region": (60, 100, 76, 116), "crop": True}
WIDER = {"region": (50, 100, 76, 120)}
"""A region that contains that of ``PART``; ``inner`` returns the pixels of ``PART``."""
OTHER_SCHEDULE = {"threads": 1, "wave_size": 100, "policy": "material", "lanes": 1}
FEW = 4
"""Samples of images that need no pilot renders, since the decision is given. All renders with light
paths trace light paths for the whole image, so that renders with all samples take seconds."""


def scene_of(name: str, folder: Path) -> Any:
    write_scene(name, folder / f"{name}.usdc")
    return wavecomb.load(folder / f"{name}.usdc").scene


@pytest.fixture(scope="module")
def caustics(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return scene_of("caustics", tmp_path_factory.mktemp("quality"))


@pytest.fixture(scope="module")
def prism(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A scene with caustics behind glass, which merging finds."""
    return scene_of("prism", tmp_path_factory.mktemp("quality"))


def render(scene: Any, **settings: Any) -> Any:
    return _core.render(scene, _core.Settings(**{**PART, **settings}))


def decide(scene: Any, **settings: Any) -> Any:
    """Stops a render soon after its pilot renders; its result holds the decision only."""
    settings = {**PART, **settings}
    return _core.render(scene, _core.Settings(**settings), watcher=StopAt(1), interval=0.001)


def render_few(scene: Any, learned: bytes, **settings: Any) -> Any:
    """Renders few samples according to the decision of an earlier render."""
    settings = {**PART, "spp": FEW, **settings}
    return _core.render(scene, _core.Settings(**settings), learned=learned)


def inner(wider: Any) -> Any:
    """Returns the pixels of ``PART`` of a render of the region ``WIDER``."""
    return wider.beauty[:16, 10:26]


@pytest.fixture(scope="module")
def decided(caustics: Any) -> Any:
    """Result with the decision for the default settings."""
    return decide(caustics)


@pytest.fixture(scope="module")
def default(prism: Any) -> Any:
    """Renders a part of an image with default settings."""
    return render(prism)


def test_the_defaults_leave_the_decision_to_pilots() -> None:
    settings = _core.Settings().to_dict()
    assert {name: settings[name] for name in ("quality", "guiding", "transport")} == {
        "quality": "auto", "guiding": "auto", "transport": "auto",
    }  # fmt: skip


@pytest.mark.slow
def test_the_defaults_use_light_paths_for_caustics(caustics: Any, decided: Any) -> None:
    choice = decided.stats["transport"]
    assert choice["chosen"] == "light" and choice["gain"] > 1.3
    guiding = decided.stats["guiding"]
    assert not guiding["used"] and 0 < guiding["gain"] < 1.1
    image = render_few(caustics, decided.learned).beauty
    assert not np.array_equal(image, render(caustics, quality="plain", spp=FEW).beauty)


@pytest.mark.slow
def test_times_include_pilots(default: Any) -> None:
    choice, seconds = default.stats["transport"], default.stats["seconds"]
    assert choice["chosen"] == "light" and not default.stats["guiding"]["used"]
    assert 0 < choice["seconds"] < seconds["first_samples"] < seconds["render"]


def test_plain_is_what_is_left_without_both(caustics: Any) -> None:
    plain = render(caustics, quality="plain")
    assert plain.stats["transport"] is None and plain.stats["guiding"] is None
    forced = render(caustics, guiding="off", transport="path")
    assert np.array_equal(plain.beauty, forced.beauty)


@pytest.mark.parametrize("quality", ["auto", "plain"])
@pytest.mark.slow
def test_each_part_can_be_forced(caustics: Any, quality: str) -> None:
    way: dict[str, Any] = {"quality": quality, "spp": 2, "region": None, "crop": False}
    light = render(caustics, **way, transport="light")
    assert light.stats["transport"] is None and light.stats["guiding"] is None
    guided = render(caustics, **{**way, "spp": 8}, guiding="on")
    assert guided.stats["guiding"]["paths"] > 0
    both = render(caustics, **{**way, "spp": 8}, guiding="on", transport="light")
    assert both.stats["guiding"]["paths"] > 0 and both.stats["transport"] is None


def check_parts_and_schedules(scene: Any, decided: Any) -> None:
    """Asserts that a region and another schedule change neither the decision nor the image."""
    image = render_few(scene, decided.learned)
    assert image.stats["transport"]["why"] == "by an earlier render"
    for way in (OTHER_SCHEDULE, {"threads": 2}, WIDER):
        other = decide(scene, **way)
        assert other.stats["transport"]["gain"] == decided.stats["transport"]["gain"], way
        assert other.learned == decided.learned, way
        few = render_few(scene, other.learned, **way)
        assert few.stats["transport"]["chosen"] == "light", way
        assert np.array_equal(inner(few) if way is WIDER else few.beauty, image.beauty), way


@pytest.mark.slow
def test_all_parts_and_schedules_decide_alike(caustics: Any, decided: Any) -> None:
    check_parts_and_schedules(caustics, decided)


@pytest.mark.slow
def test_a_decision_is_handed_on(prism: Any, default: Any) -> None:
    """A decision that is given replaces pilot renders and gives the same image."""
    again = _core.render(prism, _core.Settings(**PART), learned=default.learned)
    assert again.stats["transport"]["why"] == "by an earlier render"
    assert again.stats["transport"]["gain"] == default.stats["transport"]["gain"]
    assert np.array_equal(again.beauty, default.beauty)


@pytest.mark.slow
def test_a_renderer_stores_its_decision(prism: Any, default: Any) -> None:
    """Another part of the image is rendered without pilot renders."""
    renderer = _core.Renderer(prism)
    first = renderer.render(_core.Settings(**PART), watcher=StopAt(1), interval=0.001)
    second = renderer.render(_core.Settings(**{**PART, **WIDER}))
    assert first.stats["transport"]["seconds"] > 0 == second.stats["transport"]["seconds"]
    assert np.array_equal(inner(second), default.beauty)


@pytest.mark.slow
def test_a_resumed_render_keeps_its_decision(prism: Any, default: Any) -> None:
    stop = StopAt(1)
    _core.render(prism, _core.Settings(**PART), watcher=stop, interval=0.001)
    again = _core.render(prism, _core.Settings(**PART, **OTHER_SCHEDULE), state=stop.state)
    assert again.stats["transport"]["why"] == "by an earlier render"
    assert np.array_equal(again.beauty, default.beauty)


def test_more_samples_do_not_change_the_transport_of_a_render(caustics: Any) -> None:
    """A render that started without light paths, for lack of samples, resumes without them."""
    short = {**PART, "spp": 4}
    stop = StopAt(1)
    _core.render(caustics, _core.Settings(**short), watcher=stop, interval=0.001)
    for state in (stop.state, {k: v for k, v in stop.state.items() if k != "learned.field"}):
        more = _core.render(caustics, _core.Settings(**PART), state=state)
        assert more.stats["transport"]["chosen"] == "path"
        assert (more.samples == PART["spp"]).all()


@pytest.mark.slow
def test_short_time_limits_leave_no_time_for_pilots(caustics: Any) -> None:
    stats = render(caustics, time_limit=0.1, threads=2).stats
    assert stats["transport"]["chosen"] == "path"
    assert "too few samples" in stats["transport"]["why"]
    assert stats["guiding"] is None


@pytest.mark.slow
def test_late_pilots_give_up(caustics: Any) -> None:
    """Pilot renders for 64 threads take too much of a 0.5 s limit, so light paths are not used."""
    stats = render(caustics, time_limit=0.5, threads=64).stats
    assert stats["transport"]["chosen"] == "path"
    assert "too much of the time limit" in stats["transport"]["why"]


@pytest.mark.slow
def test_a_room_is_guided_if_paths_start_at_the_camera(plain_room: Path) -> None:
    scene = wavecomb.load(plain_room).scene
    stats = decide(scene, region=(0, 0, 4, 4), transport="path").stats
    assert stats["guiding"]["used"] and stats["guiding"]["gain"] >= 1.25


@pytest.mark.slow
def test_few_pixels_do_not_end_the_pilots_by_chance(tmp_path: Path) -> None:
    """In the first part of this pilot render, guiding seems to lose 37 %, by chance."""
    path = tmp_path / "room.usdc"
    write_scene("room", path, seed=7, plain=True, aspect=1.0)
    size = {"width": 128, "height": 128, "spp": 169, "max_depth": 7, "filter": "box"}
    scene = wavecomb.load(path).scene
    stats = decide(scene, **size, region=(0, 0, 2, 2), transport="path").stats
    assert stats["guiding"]["used"] and stats["guiding"]["gain"] > 2


@pytest.mark.slow
def test_merging_is_decided_alike_for_all_parts_and_schedules(prism: Any, default: Any) -> None:
    choice = default.stats["transport"]
    assert (choice["chosen"], choice["merges"], choice["light_paths"]) == ("light", True, 1)
    check_parts_and_schedules(prism, default)
    unmerged = decide(prism, auto_merge="off")
    assert not unmerged.stats["transport"]["merges"]
    image = render_few(prism, default.learned).beauty
    without = render_few(prism, unmerged.learned, auto_merge="off").beauty
    assert not np.array_equal(without, image)
    # Merging does not go with errors of pixels, and light paths are used without merging.
    for way in ({"noise": 0.05}, {"aovs": ("direct",)}):
        other = decide(prism, **way).stats["transport"]
        assert (other["chosen"], other["merges"]) == ("light", False), way
