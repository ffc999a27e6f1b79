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


@pytest.fixture(scope="module")
def caustics(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("quality") / "caustics.usdc"
    write_scene("caustics", path)
    return wavecomb.load(path).scene


def render(scene: Any, **settings: Any) -> Any:
    return _core.render(scene, _core.Settings(**{**PART, **settings}))


@pytest.fixture(scope="module")
def default(caustics: Any) -> Any:
    """Renders a part of an image with default settings."""
    return render(caustics)


def test_the_defaults_leave_the_decision_to_pilots() -> None:
    settings = _core.Settings().to_dict()
    assert {name: settings[name] for name in ("quality", "guiding", "transport")} == {
        "quality": "auto", "guiding": "auto", "transport": "auto",
    }  # fmt: skip


@pytest.mark.slow
def test_the_defaults_use_light_paths_for_caustics(caustics: Any, default: Any) -> None:
    choice = default.stats["transport"]
    assert choice["chosen"] == "light" and choice["gain"] > 1.3
    seconds = default.stats["seconds"]
    assert 0 < choice["seconds"] < seconds["first_samples"] < seconds["render"]
    assert default.stats["guiding"] is None
    assert not np.array_equal(default.beauty, render(caustics, quality="plain").beauty)


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
    assert quality == "plain" or "guiding" in guided.stats["transport"]["why"]


@pytest.mark.slow
def test_all_parts_and_schedules_decide_alike(caustics: Any, default: Any) -> None:
    for way in ({"threads": 1, "wave_size": 100, "policy": "material"}, {"lanes": 1, "threads": 2}):
        other = render(caustics, **way)
        assert other.stats["transport"]["gain"] == default.stats["transport"]["gain"], way
        assert np.array_equal(other.beauty, default.beauty), way
    wider = render(caustics, region=(50, 100, 76, 120))
    assert np.array_equal(wider.beauty[:16, 10:26], default.beauty)


@pytest.mark.slow
def test_a_decision_is_handed_on(caustics: Any, default: Any) -> None:
    """A decision that is given, or that the renderer has stored, replaces pilot renders."""
    settings = _core.Settings(**PART)
    again = _core.render(caustics, settings, learned=default.learned)
    assert again.stats["transport"]["why"] == "by an earlier render"
    assert again.stats["transport"]["gain"] == default.stats["transport"]["gain"]
    assert np.array_equal(again.beauty, default.beauty)
    renderer = _core.Renderer(caustics)
    first = renderer.render(settings)
    second = renderer.render(_core.Settings(**{**PART, "region": (50, 100, 76, 120)}))
    assert first.stats["transport"]["seconds"] > 0 == second.stats["transport"]["seconds"]
    assert np.array_equal(second.beauty[:16, 10:26], default.beauty)


@pytest.mark.slow
def test_a_resumed_render_keeps_its_decision(caustics: Any, default: Any) -> None:
    stop = StopAt(1)
    _core.render(caustics, _core.Settings(**PART), watcher=stop, interval=0.001)
    again = _core.render(caustics, _core.Settings(**PART, threads=1), state=stop.state)
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
    stats = render(scene, spp=256, region=(0, 0, 4, 4), transport="path").stats
    assert stats["guiding"]["used"] and stats["guiding"]["gain"] >= 1.25


@pytest.mark.slow
def test_merging_is_decided_alike_for_all_parts_and_schedules(tmp_path: Path) -> None:
    """The prism has caustics behind glass, which merging finds."""
    path = tmp_path / "prism.usdc"
    write_scene("prism", path)
    prism = wavecomb.load(path).scene
    first = render(prism)
    choice = first.stats["transport"]
    assert (choice["chosen"], choice["merges"], choice["light_paths"]) == ("light", True, 1)
    for way in ({"threads": 1, "wave_size": 100, "policy": "material"}, {"lanes": 1}):
        assert np.array_equal(render(prism, **way).beauty, first.beauty), way
    wider = render(prism, region=(50, 100, 76, 120))
    assert np.array_equal(wider.beauty[:16, 10:26], first.beauty)
    again = _core.render(prism, _core.Settings(**PART), learned=first.learned)
    assert np.array_equal(again.beauty, first.beauty)
    stop = StopAt(1)
    _core.render(prism, _core.Settings(**PART), watcher=stop, interval=0.001)
    resumed = _core.render(prism, _core.Settings(**PART), state=stop.state)
    assert np.array_equal(resumed.beauty, first.beauty)
    unmerged = render(prism, auto_merge="off")
    assert not unmerged.stats["transport"]["merges"]
    assert not np.array_equal(unmerged.beauty, first.beauty)
    # Merging does not go with errors of pixels, and light paths are used without merging.
    for way in ({"noise": 0.05}, {"aovs": ("direct",)}):
        other = render(prism, **way).stats["transport"]
        assert (other["chosen"], other["merges"]) == ("light", False), way
