# SPDX-License-Identifier: Apache-2.0
"""Tests light calibration: less noise, the same mean, and equal images for all schedules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb import _core
from wavecomb.cli.summary import light_line
from wavecomb.scenes import write_scene

SIZE = (32, 24)


@pytest.fixture(scope="module")
def studio_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("studio") / "studio.usdc"
    write_scene("studio", path, triangles=10_000, teapot_level=6)
    return path


@pytest.fixture(scope="module")
def studio(studio_path: Path) -> Any:
    return wavecomb.load(studio_path).scene


def room() -> Any:
    """Returns a room with a mostly hidden light, small lights, a dome and an emissive mesh."""
    builder = wavecomb.SceneBuilder()
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)

    def plane(points: Any, material: int) -> None:
        builder.add_to_group(
            0, builder.add_mesh(np.array(points, np.float32), quad, material=material)
        )

    def place(x: float, y: float, z: float) -> Any:
        at = np.eye(4)
        at[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # emits downwards
        at[3, :3] = x, y, z
        return at

    white = builder.add_material("diffuse", name="White", base_color=(0.7, 0.7, 0.7))
    shiny = builder.add_material("metal", name="Shiny", roughness=0.3, base_color=(0.9, 0.8, 0.6))
    glow = builder.add_material("emissive", name="Glow", emission=(4, 2, 1))
    plane([[-4, -1, -8], [4, -1, -8], [4, -1, 0], [-4, -1, 0]], white)
    plane([[-4, -1, -8], [-4, 3, -8], [4, 3, -8], [4, -1, -8]], shiny)
    plane([[-4, 0, -8], [-1, 0, -8], [-1, 0, -4], [-4, 0, -4]], white)
    plane([[2, 0, -6], [2.2, 0, -6], [2.2, 0.3, -5.8], [2, 0.3, -5.8]], glow)
    key = {"width": 1.0, "height": 1.0}
    builder.add_light("rect", place(0, 3, -4), color=(9, 9, 8), name="Key", **key)
    builder.add_light("rect", place(-3, 2, -6), color=(40, 40, 40), name="Hidden", **key)
    builder.add_light("sphere", place(1, 0, -3), color=(5, 7, 9), radius=0.1, name="Ball")
    builder.add_light("dome", np.eye(4), color=(0.1, 0.1, 0.12), name="Sky")
    builder.set_camera(np.eye(4), window=(-0.8, 0.8, -0.6, 0.6))
    return builder.build()


def render(
    scene: Any, weights: str = "calibrated", seed: int = 0, spp: int = 16, **more: Any
) -> Any:
    more.setdefault("size", SIZE)
    return wavecomb.render(scene, spp=spp, seed=seed, light_weights=weights, **more)


def shares(picture: Any) -> dict[str, float]:
    return {part["name"]: part["share"] for part in picture.stats["light_calibration"]["shares"]}


@pytest.mark.slow
def test_a_dim_dome_costs_no_noise(studio: Any) -> None:
    def picture(weights: str, seed: int, spp: int) -> Any:
        return render(
            studio, weights, seed, spp, size=(40, 40), max_depth=1, sampler="independent",
            filter="box", filter_width=1.0,
        )  # fmt: skip

    reference = picture("calibrated", 99, 1024)
    truth = reference.beauty.astype(np.float64)
    errors = {
        weights: np.mean(
            [
                ((picture(weights, seed, 16).beauty - truth) ** 2 / (truth**2 + 0.01)).mean()
                for seed in range(4)
            ]
        )
        for weights in ("power", "calibrated")
    }
    assert errors["calibrated"] < 0.35 * errors["power"], errors
    found = {part["name"]: part for part in reference.stats["light_calibration"]["shares"]}
    dome = found["/World/Lights/Dome"]
    assert dome["by_power"] > 0.6 and dome["share"] < 0.1
    assert found["/World/Lights/Key"]["share"] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("selection", ["power", "tree"])
def test_the_mean_is_that_of_power(selection: str) -> None:
    scene = room()
    runs = 24
    stacks = {
        weights: np.array(
            [
                render(scene, weights, seed, 32, max_depth=3, light_selection=selection).beauty
                for seed in range(runs)
            ],
            np.float64,
        )
        for weights in ("power", "calibrated")
    }
    assert not np.array_equal(stacks["power"][0], stacks["calibrated"][0])
    # Means over blocks of 8 x 8 pixels are close to normally distributed.
    blocks = {k: v.reshape(runs, 3, 8, 4, 8, 3).mean(axis=(2, 4, 5)) for k, v in stacks.items()}
    a, b = blocks["power"], blocks["calibrated"]
    z = (a.mean(0) - b.mean(0)) / np.sqrt((a.var(0, ddof=1) + b.var(0, ddof=1)) / runs)
    assert np.abs(z).max() < 4.5, z
    assert np.sqrt((z**2).mean()) < 1.8, z
    totals = {k: v.mean(axis=(1, 2, 3)) for k, v in stacks.items()}
    difference = totals["calibrated"].mean() - totals["power"].mean()
    error = np.sqrt(sum(t.var(ddof=1) for t in totals.values()) / runs)
    assert abs(difference) < 4 * error
    assert error < 0.01 * totals["power"].mean()


@pytest.mark.parametrize("selection", ["power", "tree"])
def test_one_picture_for_all_schedules(selection: str) -> None:
    scene = room()
    expected = render(scene, integrator="reference", light_selection=selection)
    assert shares(expected)
    for i, lanes in enumerate(_core.lane_widths()):
        picture = render(
            scene, lanes=lanes, wave_size=(64, 4096)[i % 2], threads=1 + i % 2,
            policy=("none", "material", "texture-locality")[i % 3], light_selection=selection,
        )  # fmt: skip
        assert picture.beauty.tobytes() == expected.beauty.tobytes(), lanes
        assert shares(picture) == shares(expected)


def test_light_groups_add_up(studio: Any) -> None:
    picture = render(studio, aovs=["light_groups"])
    total = sum(
        layer.astype(np.float64) for name, layer in picture.aovs.items() if name[:6] == "light_"
    )
    assert total == pytest.approx(picture.beauty, rel=1e-4, abs=1e-5)


class _StopAtOnce:
    """Stops a render when it first reports new samples, and keeps its state."""

    def __init__(self) -> None:
        self.state: dict[str, Any] = {}

    def progress(self, status: dict[str, Any]) -> str | None:
        return "stop" if status["samples_done"] > status["resumed_samples"] else None

    def snapshot(self, snapshot: Any) -> None:
        self.state = {
            name: value.copy() if hasattr(value, "copy") else value
            for name, value in snapshot.state().items()
        }


@pytest.mark.slow
def test_a_resumed_picture_has_the_same_shares(studio: Any) -> None:
    settings = _core.Settings(width=48, height=32, spp=600)
    whole = _core.render(studio, settings)
    state: dict[str, Any] | None = None
    runs = 0
    part = whole
    for _ in range(300):
        watcher = _StopAtOnce()
        part = _core.render(studio, settings, watcher=watcher, state=state)
        state = watcher.state
        runs += 1
        assert shares(part) == shares(whole)
        if not part.cancelled:
            break
    assert runs > 1, "or nothing was resumed"
    assert not part.cancelled
    assert part.beauty.tobytes() == whole.beauty.tobytes()


def test_statistics_and_summary_tell(studio: Any) -> None:
    stats = render(studio).stats
    told = stats["light_calibration"]
    assert stats["settings"]["light_weights"] == "calibrated"
    assert told["paths"] == 1024 and told["seconds"] > 0 and not told["kept"]
    assert sum(part["share"] for part in told["shares"]) == pytest.approx(1, abs=1e-6)
    line = light_line(told)
    assert line is not None and line.startswith("lights: ") and "Key" in line and "%" in line
    plain = render(studio, "power").stats["light_calibration"]
    assert plain["paths"] == 0 and plain["shares"] == [] and light_line(plain) is None
    with pytest.raises(_core.Error, match="light_weights"):
        render(studio, "best")
