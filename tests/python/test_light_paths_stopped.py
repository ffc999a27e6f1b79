# SPDX-License-Identifier: Apache-2.0
"""Tests light paths in stopped and resumed renders, with lenses and motion blur."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stopping import StopAt

import wavecomb

_core = pytest.importorskip("wavecomb._core")

ENDINGS: list[dict[str, Any]] = [
    {"spp": 24},
    {"spp": 48, "noise": 0.05},
    {"spp": 32, "adaptive": 0.06},
    {"spp": 32, "allocate": "error", "error": True},
]
AOVS = ["direct", "indirect", "light_groups", "by_light_paths", "lpe:a=C.*D[LO]"]


@pytest.fixture(scope="module")
def stages(caustics: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A plain stage, one with a lens, and one with a moving ball of glass."""
    from pxr import Gf, Usd, UsdGeom

    folder = tmp_path_factory.mktemp("stopped")

    def changed(name: str, change: Any) -> Any:
        stage = Usd.Stage.Open(str(caustics))
        change(stage)
        stage.Export(str(folder / f"{name}.usdc"))
        return wavecomb.load(folder / f"{name}.usdc")

    def camera_of(stage: Any) -> Any:
        return UsdGeom.Camera(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Camera)))

    def blur(stage: Any) -> None:
        camera_of(stage).GetFStopAttr().Set(1.2)
        camera_of(stage).GetFocusDistanceAttr().Set(6.0)

    def move(stage: Any) -> None:
        stage.SetStartTimeCode(1)
        stage.SetEndTimeCode(2)
        camera_of(stage).GetShutterCloseAttr().Set(0.5)
        way = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Objects/Ball")).AddTranslateOp()
        way.Set(Gf.Vec3d(0, 0, 0), 1)
        way.Set(Gf.Vec3d(2.0, 0.4, 0), 2)

    return {
        "plain": wavecomb.load(caustics),
        "lens": changed("lens", blur),
        "motion": changed("motion", move),
    }


@pytest.mark.parametrize("transport", ["light", "bdpt"])
@pytest.mark.parametrize("name", ["lens", "motion"])
def test_lenses_and_motion_are_one_picture(stages: Any, name: str, transport: str) -> None:
    def render(**way: Any) -> wavecomb.Picture:
        plain = {"size": (32, 24), "spp": 3, "transport": transport, "aovs": AOVS}
        return wavecomb.render(stages[name], **(plain | way))

    first = render()
    still = wavecomb.render(stages["plain"], size=(32, 24), spp=3, transport=transport)
    assert not np.array_equal(still.beauty, first.beauty)
    for way in (
        {"integrator": "reference"},
        {"threads": 1, "wave_size": 64, "policy": "random-runs", "lanes": 1},
    ):
        other = render(**way)
        assert other.beauty.tobytes() == first.beauty.tobytes(), way
        for layer, values in first.aovs.items():
            assert other.aovs[layer].tobytes() == values.tobytes(), (layer, way)


def went_on(scene: Any, settings: dict[str, Any], runs: int = 200) -> tuple[Any, int]:
    """Renders with repeated stops; each run has another schedule."""
    state: dict[str, Any] | None = None
    for run in range(runs):
        watcher = StopAt(random.Random(run).randrange(2))
        way = {"threads": 1 + run % 2, "wave_size": (64, 4096, 1000)[run % 3]}
        part = _core.Settings(**settings, **way)
        result = _core.render(scene, part, watcher=watcher, state=state, interval=0.01)
        state = watcher.state
        if not result.cancelled:
            return result, run + 1
    raise AssertionError("it never ended")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("transport", "ending"),
    [("light", ENDINGS[0]), ("bdpt", ENDINGS[0]), ("light", ENDINGS[1]), ("bdpt", ENDINGS[2]),
     ("light", ENDINGS[3])],
)  # fmt: skip
def test_stopped_renders_go_on(stages: Any, transport: str, ending: dict[str, Any]) -> None:
    scene = stages["plain"].scene
    settings: dict[str, Any] = {"width": 32, "height": 24, "transport": transport, **ending}
    names = AOVS[:-1]
    whole = _core.render(scene, _core.Settings(**settings, aovs=names))
    result, runs = went_on(scene, {**settings, "aovs": names})
    assert runs > 1, "or nothing was resumed"
    assert result.beauty.tobytes() == whole.beauty.tobytes()
    assert result.samples.tobytes() == whole.samples.tobytes()
    for name, layer in whole.aovs.items():
        assert result.aovs[name].tobytes() == layer.tobytes(), name
