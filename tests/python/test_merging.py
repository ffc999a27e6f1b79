# SPDX-License-Identifier: Apache-2.0
"""Tests the merging of light paths with points seen through mirrors and glass."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from stopping import StopAt

import wavecomb
from wavecomb.cli import main
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Generated stages as files."""
    folder = tmp_path_factory.mktemp("merging")

    def get(name: str) -> Path:
        path = folder / f"{name}.usdc"
        if not path.exists():
            write_scene(name, path, triangles=12_000, teapot_level=6, texture_size=64)
        return path

    return get


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain: dict[str, Any] = {"size": (32, 24), "spp": 3, "transport": "light", "merge_radius": 2.0}
    return wavecomb.render(stage, **(plain | settings))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pool", "mixed"])
def test_one_picture_whatever_the_schedule(stages: Any, name: str) -> None:
    stage = wavecomb.load(stages(name))
    aovs = ("techniques", "crypto_object")
    first = render(stage, aovs=aovs)
    assert not np.array_equal(first.beauty, render(stage, merge_radius=0.0).beauty)
    ways: list[dict[str, Any]] = [{"lanes": lanes} for lanes in _core.lane_widths()]
    ways += [
        {"threads": 1, "wave_size": 64, "policy": "random-runs"},
        {"policy": "material", "ray_order": "morton", "materialize": "on", "wave_size": 1000},
        {"integrator": "reference"},
        {"traversal": "single", "progressive": True},
    ]
    for way in ways:
        other = render(stage, aovs=aovs, **way)
        assert np.array_equal(first.beauty, other.beauty), way
        for layer, values in first.aovs.items():
            assert np.array_equal(values, other.aovs[layer]), (layer, way)
    parts = [first.aovs[f"by_{part}"] for part in ("bounces", "light_samples", "light_paths")]
    assert np.allclose(sum(parts), first.beauty, rtol=1e-4, atol=1e-6)


def test_parts_are_those_of_the_whole(stages: Any) -> None:
    stage = wavecomb.load(stages("pool"))
    whole = render(stage).beauty
    x0, y0, x1, y1 = region = (9, 5, 27, 20)
    part = render(stage, region=region).beauty
    assert np.array_equal(part[y0:y1, x0:x1], whole[y0:y1, x0:x1])
    assert not part[:y0].any()


@pytest.mark.slow
def test_stopped_renders_go_on(stages: Any) -> None:
    scene = wavecomb.load(stages("pool")).scene
    settings: dict[str, Any] = {
        "width": 32, "height": 24, "spp": 12, "transport": "light", "merge_radius": 2.0
    }  # fmt: skip
    whole = _core.render(scene, _core.Settings(**settings))
    state: dict[str, Any] | None = None
    for run in range(200):
        watcher = StopAt(random.Random(run).randrange(2))
        part = _core.Settings(**settings, threads=1 + run % 2, wave_size=(64, 256, 100)[run % 3])
        result = _core.render(scene, part, watcher=watcher, state=state, interval=0.002)
        state = watcher.state
        if not result.cancelled:
            break
    assert run > 0, "or nothing was resumed"
    assert result.beauty.tobytes() == whole.beauty.tobytes()


@pytest.mark.parametrize(
    ("way", "named"),
    [
        ({"transport": "bdpt"}, "merge_radius"),
        ({"noise": 0.05}, "errors of pixels"),
        ({"error": True}, "errors of pixels"),
        ({"aovs": ("direct",)}, "AOVs that split the beauty"),
        ({"aovs": ("lpe:a=CD.*",)}, "AOVs that split the beauty"),
    ],
)
def test_what_it_does_not_go_with(stages: Any, way: dict[str, Any], named: str) -> None:
    stage = wavecomb.load(stages("pool"))
    with pytest.raises(_core.Error, match=named) as error:
        render(stage, **way)
    assert "\n" not in str(error.value)


def test_other_renders_know_nothing_of_it(stages: Any) -> None:
    stage = wavecomb.load(stages("pool"))
    for transport in ("path", "light"):
        plain = render(stage, transport=transport, merge_radius=0.0)
        assert np.array_equal(
            plain.beauty, wavecomb.render(stage, size=(32, 24), spp=3, transport=transport).beauty
        )
    path = render(stage, transport="path")
    assert np.array_equal(path.beauty, render(stage, transport="path", merge_radius=0.0).beauty)


def test_the_command_takes_it(stages: Any, tmp_path: Path) -> None:
    out = tmp_path / "a.exr"
    command = ["render", str(stages("pool")), "-o", str(out), "--size", "16", "12", "--spp", "2"]
    done = CliRunner().invoke(main, [*command, "--transport", "light", "--merge-radius", "1.5"])
    assert done.exit_code == 0, done.output
    assert out.exists()
