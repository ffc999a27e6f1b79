# SPDX-License-Identifier: Apache-2.0
"""Tests that scenes with media refuse light paths, and that "auto" uses camera paths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wavecomb

pytest.importorskip("wavecomb._core")

SIZE = 12


def stage(medium: str) -> Any:
    """Returns a stage with a glass ball, a light and a medium."""
    builder = wavecomb.SceneBuilder()
    looks = {
        "skin": {"subsurface_weight": 1.0, "subsurface_radius": (1, 1, 1)},
        "cloudy": {
            "transmission_weight": 1.0,
            "transmission_depth": 0.5,
            "transmission_color": (0.8, 0.7, 0.6),
            "transmission_scatter": (0.3, 0.3, 0.3),
        },
    }
    clear = builder.add_material("dielectric", roughness=0.0, ior=1.5)
    other = builder.add_material("openpbr", openpbr=looks[medium]) if medium in looks else clear
    for x, look in ((-1.2, clear), (0.4, other)):
        corners = [[x + i, j, -6 + k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        faces = [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ]
        points, triangles = np.array(corners, np.float32), np.array(faces, np.uint32)
        builder.add_to_group(0, builder.add_mesh(points, triangles, material=look))
    if medium == "volume":
        bounds = ((-3, -3, -8), (3, 3, -2))
        builder.add_volume(np.eye(4), bounds=bounds, extinction=(0.1,) * 3, albedo=(0.9,) * 3)
    lamp = np.eye(4)
    lamp[3, :3] = (1.5, 2.2, -4.0)
    builder.add_light("sphere", lamp, color=(30, 28, 25), radius=0.4)
    builder.set_camera(np.eye(4), window=(-0.4, 0.4, -0.4, 0.4))
    return builder.build()


REFUSALS = {
    "volume": "transport light does not go with volumes",
    "skin": "transport light does not go with subsurface scattering",
    "cloudy": "transport light does not go with media inside of meshes",
}


@pytest.mark.parametrize("medium", list(REFUSALS))
def test_media_are_refused_in_one_line_and_left_out_by_auto(medium: str) -> None:
    scene = stage(medium)
    size: dict[str, Any] = {"size": (SIZE, SIZE), "spp": 4}
    with pytest.raises(ValueError, match=REFUSALS[medium]) as error:
        wavecomb.render(scene, transport="light", **size)
    assert "\n" not in str(error.value) and "or transport path or auto" in str(error.value)
    auto = wavecomb.render(scene, transport="auto", **size)
    assert auto.stats["transport"]["chosen"] == "path"
    assert REFUSALS[medium].removeprefix("transport light does not go with ") in str(
        auto.stats["transport"]["why"]
    )
    plain = wavecomb.render(scene, **size).beauty
    assert plain.max() > 0
    assert auto.beauty.tobytes() == plain.tobytes()


def test_clear_glass_alone_is_no_medium() -> None:
    scene = stage("none")
    size: dict[str, Any] = {"size": (SIZE, SIZE), "spp": 4}
    assert wavecomb.render(scene, transport="light", **size).beauty.max() > 0
