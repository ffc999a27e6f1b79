# SPDX-License-Identifier: Apache-2.0
"""Tests edits of absorbing glass with contents, and absorption that a value graph drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_interiors import filled, glass_ball, quad

import wavecomb
from wavecomb import _core
from wavecomb.usd.graphs.values import PARAMETERS, Expressions, assemble, numbers

SIGMA = np.array([0.3, 0.7, 1.1])
GLASS, STONE = 0, 1
"""Material ids of the glass and of the card inside the glass."""
LAMP = {"radius": 0.1, "color": (30, 28, 25)}


def moved(x: float) -> Any:
    matrix = np.eye(4)
    matrix[3, 0] = x
    return matrix


def scene(
    *, tinted: bool = True, stone: bool = True, lamp: float = 3.0, graph: Any = None, **layers: Any
) -> Any:
    """A ball of glass around the origin, with a grey card inside and a light at x = ``lamp``.

    Args:
        tinted: Whether the glass absorbs.
        stone: Whether the card is inside the glass; otherwise the card is beside the glass.
        lamp: Position of the light.
        graph: Adds a graph to a builder and returns its number.
        layers: Layer parameters of OpenPBR for the glass.
    """
    builder = wavecomb.SceneBuilder()
    more = {} if tinted else {"transmission_depth": 0.0, "transmission_color": (1, 1, 1)}
    if graph is None:
        ball = glass_ball(builder, **more, **layers)
    else:
        filled(builder, 1.5)
        number = builder.add_material(
            "openpbr", name="/Glass", ior=1.5, roughness=0.0, metallic=0.0, graph=graph(builder),
            openpbr={"transmission_weight": 1.0, "transmission_depth": 1.0, **layers},
        )  # fmt: skip
        ball = mesh_ball(builder, number)
    builder.add_to_group(0, ball)
    quad(builder, 0.0 if stone else 5.0, 0.5)
    builder.add_light("sphere", moved(lamp), **LAMP)
    builder.add_light("dome", np.eye(4), color=(0.3, 0.3, 0.3))
    camera = np.eye(4)
    camera[3, 2] = 4.0
    builder.set_camera(camera, window=(-0.4, 0.4, -0.4, 0.4))
    return builder.build()


def mesh_ball(builder: Any, material: int) -> int:
    from wavecomb.scenes.caustics import ball

    mesh = ball(1.0, 24)
    return int(builder.add_mesh(mesh.points, mesh.faces.astype(np.uint32), material=material))


def image(renderer: Any, **more: Any) -> bytes:
    settings = _core.Settings(width=16, height=16, spp=4, max_depth=6, **more)
    return bytes(renderer.render(settings).beauty.tobytes())


def refuses_light_paths(renderer: Any) -> bool:
    """Returns whether light paths are refused because absorbing glass contains objects."""
    try:
        image(renderer, transport="light")
    except _core.Error as error:
        assert "objects inside of absorbing glass" in str(error) and "\n" not in str(error)
        return True
    return False


TINT = {"transmission_depth": 1.0, "transmission_color": tuple(np.exp(-SIGMA))}
CLEAR = {"transmission_depth": 0.0, "transmission_color": (1, 1, 1)}
FAR, INSIDE = 3.0, 0.5
"""Positions of the light: beside the glass and inside the glass."""


@pytest.mark.parametrize(
    ("before", "edit", "after"),
    [
        ({"tinted": False}, {"materials": {GLASS: TINT}}, {}),
        ({}, {"materials": {GLASS: CLEAR}}, {"tinted": False}),
        ({"stone": False}, {"lights": {0: {"transform": moved(INSIDE)}}},
         {"stone": False, "lamp": INSIDE}),
        ({"stone": False, "lamp": INSIDE}, {"lights": {0: {"transform": moved(FAR)}}},
         {"stone": False}),
        ({"lamp": INSIDE}, {"lights": {0: {"transform": moved(FAR)}}}, {}),
        ({"tinted": False, "stone": False}, {"materials": {GLASS: TINT}}, {"stone": False}),
        ({"tinted": False, "stone": False},
         {"materials": {GLASS: TINT}, "lights": {0: {"transform": moved(INSIDE)}}},
         {"stone": False, "lamp": INSIDE}),
        ({"stone": False}, {"materials": {STONE: {"base_color": (0.1, 0.2, 0.3)}}}, None),
    ],
)  # fmt: skip
def test_edits_search_glass_again(
    before: dict[str, Any], edit: dict[str, Any], after: dict[str, Any] | None
) -> None:
    """An edited scene gives the same image and refusals as a scene built with the edited values."""
    renderer = _core.Renderer(scene(**before))
    first = image(renderer)
    count = len(renderer.scene.materials)
    renderer.edit(**edit)
    if after is None:
        assert not refuses_light_paths(renderer)
        assert len(renderer.scene.materials) == count
        return
    anew = _core.Renderer(scene(**after))
    assert image(renderer) == image(anew) != first
    assert refuses_light_paths(renderer) == refuses_light_paths(anew)
    assert renderer.scene.materials == anew.scene.materials
    holds = after.get("tinted", True) and (after.get("stone", True) or "lamp" in after)
    assert refuses_light_paths(renderer) == holds


@pytest.mark.parametrize("layer", ["transmission_scatter", "nested_priority"])
def test_edits_that_need_media_inside_of_meshes(layer: str) -> None:
    """Edits can add scattering or a nesting priority to glass."""
    value: Any = (0.5, 0.5, 0.5) if layer == "transmission_scatter" else 1.0
    renderer = _core.Renderer(scene(stone=False))
    first = image(renderer)
    renderer.edit(materials={GLASS: {layer: value}})
    anew = _core.Renderer(scene(stone=False, **{layer: value}))
    assert image(renderer) == image(anew)
    assert (image(renderer) != first) == (layer == "transmission_scatter")
    with pytest.raises(_core.Error, match="media inside of meshes"):
        image(renderer, transport="light")


def graph_of(**driven: Any) -> Any:
    """Returns a function that adds a graph which drives parameters by texture coordinates."""

    def add(builder: Any) -> int:
        make = Expressions()
        u = make.op("abs", make.input("position")[:1])
        parts: dict[int, Any] = {}
        for name, factor in driven.items():
            start, width = PARAMETERS[name]
            value = make.op("multiply", u, numbers(factor))
            parts |= dict.fromkeys(range(start, start + width), value[0])
        made = assemble(parts)
        return int(builder.add_graph(made.ops, made.constants, made.images, made.outputs))

    return add


def test_glass_with_a_graph_elsewhere_is_searched() -> None:
    """Light paths are refused for constant absorption, also if a graph drives other parameters."""
    tint = {"transmission_color": tuple(np.exp(-SIGMA))}
    for driven, weight in (("roughness", 1.0), ("transmission_weight", 0.0)):
        for stone in (True, False):
            made = scene(
                graph=graph_of(**{driven: 0.5}), stone=stone, transmission_weight=weight, **tint
            )
            assert refuses_light_paths(_core.Renderer(made)) == stone, driven
            assert not made.warnings


def test_absorption_by_a_graph() -> None:
    """Light paths are refused; a warning says that the glass does not dim objects inside."""
    for stone, lamp in ((True, FAR), (False, INSIDE), (False, FAR)):
        made = scene(graph=graph_of(extinction=1.0), stone=stone, lamp=lamp)
        with pytest.raises(_core.Error, match="absorption comes from a value graph") as error:
            image(_core.Renderer(made), transport="light")
        assert "\n" not in str(error.value)
        automatic = image(_core.Renderer(made), transport="auto")
        assert automatic == image(_core.Renderer(made), transport="path")
        said = [line for line in made.warnings if "/Glass" in line]
        assert len(said) == (stone or lamp == INSIDE), made.warnings
        assert all("does not dim light on its way to objects" in line for line in said)


def test_absorption_by_a_graph_in_a_stage_of_media() -> None:
    """With nested dielectrics, a warning says that a graph's absorption has no effect."""
    made = scene(graph=graph_of(extinction=1.0), stone=False, nested_priority=1.0)
    assert [line for line in made.warnings if "does not absorb" in line], made.warnings
