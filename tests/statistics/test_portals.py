# SPDX-License-Identifier: Apache-2.0
"""Tests that portals improve the sampling of a dome without changing the mean."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stages import camera, material, matrix, mesh, moved, turned, write_sky, write_stage

import wavecomb
from wavecomb import _core

HALF, WINDOW = 2.0, 0.5


def room() -> str:
    """A cube around the origin with inward winding and a square hole in the centre of its wall at z
    = 2.
    """
    h, w = HALF, WINDOW
    points = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    points += [(-w, -w, h), (w, -w, h), (w, w, h), (-w, w, h)]
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4]]
    outer, hole = [1, 5, 7, 3], [8, 9, 10, 11]
    faces += [[outer[i], outer[(i + 1) % 4], hole[(i + 1) % 4], hole[i]] for i in range(4)]
    return mesh("Room", points, faces, "Walls")


WALLS = material("Walls", "diffuse", diffuseColor=(0.7, 0.6, 0.5))
INSIDE = camera((-1.5, 0.5, 1.5), (1, -0.8, -2), half=0.7)


def dome(*targets: str, image: Path | None = None) -> str:
    file = f"asset inputs:texture:file = @{image}@" if image else ""
    names = ", ".join(f"</World/{name}>" for name in targets)
    return f'def DomeLight "Dome" {{ {file}\nrel portals = [{names}]\n}}'


def portal(size: float = 2 * WINDOW, name: str = "Portal", place: Any = None) -> str:
    """A portal that faces -z."""
    place = moved(0, 0, HALF) if place is None else place
    return f"""def PortalLight "{name}" {{
        float inputs:width = {size}
        float inputs:height = {size}
        {matrix(place)}
    }}"""


@pytest.fixture
def shot(tmp_path: Path, beauty: Any) -> Any:
    def render(*prims: str, size: int = 24, spp: int = 256, **settings: Any) -> Any:
        stage = wavecomb.load(write_stage(tmp_path / "stage.usda", WALLS, room(), *prims))
        return beauty(stage, size, spp, **({"max_depth": 1} | settings))

    return render


def error(picture: Any, truth: Any) -> float:
    return float(np.mean((picture - truth) ** 2))


@pytest.mark.slow
def test_portals_change_no_mean_and_lower_the_noise(shot: Any, tmp_path: Path) -> None:
    sky = write_sky(tmp_path)
    with_it = INSIDE, portal(), dome("Portal", image=sky)
    truth = shot(*with_it, spp=4096, seed=7)
    plain = shot(INSIDE, dome(image=sky), spp=4096, seed=8)
    assert plain.mean() == pytest.approx(truth.mean(), rel=0.025)  # three standard errors
    noise = error(shot(INSIDE, dome(image=sky)), truth)
    assert error(shot(*with_it), truth) < noise / 3


@pytest.mark.slow
def test_light_from_beside_portals_counts(shot: Any, fewer: int) -> None:
    """The mean is the same with a portal over half of the window, beside it, or facing away."""
    expected = shot(INSIDE, portal(), dome("Portal"), spp=2048).mean()
    away = moved(0.7, 0, 0) @ turned(y=180) @ moved(0, 0, HALF)
    for place in (moved(WINDOW, 0, HALF), moved(1.5, 0, HALF), away):
        found = shot(INSIDE, portal(place=place), dome("Portal"), spp=8192 // fewer).mean()
        assert found == pytest.approx(expected, rel=0.02)


@pytest.mark.slow
def test_two_portals_that_overlap(shot: Any) -> None:
    expected = shot(INSIDE, portal(), dome("Portal"), spp=2048).mean()
    two = portal(1.5 * WINDOW, "A", moved(-0.1, 0.1, HALF)), portal(1.2, "B")
    assert shot(INSIDE, *two, dome("A", "B"), spp=2048).mean() == pytest.approx(expected, rel=5e-3)


def test_irradiance_through_a_window(shot: Any) -> None:
    """On the wall opposite the window: form factors of a parallel square of radiance 1."""
    view = camera((0, 0, 0), (0, 0, -HALF), half=1e-3)
    x = WINDOW / (2 * HALF)
    corner = x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / np.pi
    found = shot(view, portal(), dome("Portal"), size=16, spp=4096).mean(axis=(0, 1))
    assert found == pytest.approx(np.array((0.7, 0.6, 0.5)) * 4 * corner, rel=2e-3)


def test_every_way_gives_the_same_picture(tmp_path: Path) -> None:
    prims = (
        INSIDE, material("Walls", "metal", diffuseColor=(0.7, 0.6, 0.5), roughness=0.4), room(),
        portal(0.8), dome("Portal", image=write_sky(tmp_path)),
    )  # fmt: skip
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    plain: dict[str, Any] = {"size": (40, 30), "spp": 4, "max_depth": 5}
    reference = wavecomb.render(stage, integrator="reference", **plain).beauty
    assert reference.mean() > 0
    for policy in _core.policies():
        picture = wavecomb.render(stage, policy=policy, **plain).beauty
        assert np.array_equal(picture, reference), policy
