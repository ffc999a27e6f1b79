# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the statistical tests."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks" / "peers"))

if TYPE_CHECKING:
    from recording import RecordingBuilder


@pytest.fixture(scope="session")
def mitsuba() -> ModuleType:
    """Mitsuba 3; skips the test if it is not available."""
    try:
        from mitsuba_bridge import load_mitsuba

        return load_mitsuba()
    except ImportError as error:
        pytest.skip(f"Mitsuba 3 is needed (make setup-test): {error}")


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Function that writes a small generated stage once and returns its path."""
    folder = tmp_path_factory.mktemp("generated")

    def stage(name: str) -> Path:
        from wavecomb.scenes import write_scene

        path = folder / f"{name}.usdc"
        if not path.exists():
            write_scene(name, path, triangles=20_000, teapot_level=8, texture_size=256)
        return path

    return stage


Render = Callable[..., NDArray[np.float32]]


@pytest.fixture(scope="session")
def beauty() -> Render:
    """Function that renders with plain settings: box filter, independent sampler, no roulette."""

    def render(scene: Any, size: int = 64, spp: int = 64, **settings: Any) -> NDArray[np.float32]:
        import wavecomb

        plain = {
            "filter": "box",
            "filter_width": 1.0,
            "sampler": "independent",
            "roulette": "off",
            "threads": 2,
        }
        return wavecomb.render(scene, size=(size, size), spp=spp, **(plain | settings)).beauty

    return render


@pytest.fixture(
    params=[
        pytest.param(4, id="quarter"),
        pytest.param(1, id="whole", marks=pytest.mark.long),
    ]
)
def fewer(request: pytest.FixtureRequest) -> int:
    """Divisor of sample counts: 4 in `make test`, 1 in `make test-long`.

    `make test-long` therefore detects differences half as large as `make test`. The noise
    determines the level of Welch's t, so fewer samples do not cause more failures.
    """
    return int(request.param)


@pytest.fixture
def recorded(tmp_path: Path) -> Callable[..., RecordingBuilder]:
    """Function that writes prims to a stage, loads it and returns the recorded scene."""

    def make(*prims: str) -> RecordingBuilder:
        from recording import record
        from stages import write_stage

        return record(write_stage(tmp_path / "stage.usda", *prims))

    return make
