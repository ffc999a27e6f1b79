# SPDX-License-Identifier: Apache-2.0
"""Tests MaterialX's hextiledimage and hextilednormalmap against a second implementation."""

import numpy as np
import pytest
from materialx_nodes import Node, points, run

from wavecomb.usd.materialx.nodes import images


def reference(uv, tiling, rotation, scales, offsets):
    """Evaluates mx_hextile_coord: coordinates (3, n, 2), rotations (3, n), weights (3, n)."""
    coord = uv * tiling
    st = coord * 2 * np.sqrt(3)
    skewed = np.stack([st[:, 0] - 0.57735027 * st[:, 1], 1.15470054 * st[:, 1]], 1)
    base = np.floor(skewed)
    x, y = (skewed - base).T
    z = 1 - x - y
    s = (z <= 0) * 1.0
    sign = 2 * s - 1
    weights = np.stack([-z * sign, s - y * sign, s - x * sign])
    steps = [np.stack(one, 1) for one in ((s, s), (s, 1 - s), (1 - s, s))]
    where, turns = [], []
    for step in steps:
        cell = base + step
        centre = np.stack([cell[:, 0] + 0.5 * cell[:, 1], cell[:, 1] / 1.15470054], 1)
        centre = centre / (2 * np.sqrt(3))
        p = cell + 0.12345
        a = np.stack([p[:, 0], p[:, 1], p[:, 0]], 1) * (0.1031, 0.1030, 0.0973) % 1.0
        a = a + (a * (a[:, [1, 2, 0]] + 33.33)).sum(axis=1, keepdims=True)
        chance = (a[:, [0, 0]] + a[:, [1, 2]]) * a[:, [2, 1]] % 1.0
        turn = np.radians(rotation) * chance[:, 0]
        scale = scales[0] + (scales[1] - scales[0]) * chance[:, 1]
        shift = offsets[0] + (offsets[1] - offsets[0]) * chance
        d, c, k = coord - centre, np.cos(turn), np.sin(turn)
        away = np.stack([d[:, 0] * c - d[:, 1] * k, d[:, 0] * k + d[:, 1] * c], 1)
        where.append(away / scale[:, None] + centre + shift)
        turns.append(turn)
    return np.array(where), np.array(turns), weights


def test_copies_are_where_materialx_has_them():
    node = Node("ND_hextiledimage_color3").give(
        file="a.png", tiling="3,2", rotationrange="0,90", scalerange="0.5,1.5",
        offsetrange="0.1,0.7",
    )  # fmt: skip
    grid = images._Grid(node.call("out"))
    at = points(500)
    at[:, :2] = at[:, :2] * 3 - 1
    where, turns, weights = reference(
        at[:, :2].astype(np.float64), (3, 2), 90, (0.5, 1.5), (0.1, 0.7)
    )
    copies = grid.copies()
    # The hash is the fractional part of a large number. Floats lose its last digits, so some hash
    # values wrap around.
    for k, copy in enumerate(copies):
        assert np.quantile(np.abs(run(copy.turn, at)[:, 0] - turns[k]), 0.95) < 1e-2
        assert np.quantile(np.abs(run(copy.uv, at) - where[k]), 0.95) < 1e-2
        assert run(copy.weight, at)[:, 0] == pytest.approx(weights[k], abs=1e-5)
    shares = run(grid.shares(copies), at)
    powers = weights.T**7
    assert shares == pytest.approx(powers / powers.sum(axis=1, keepdims=True), abs=1e-4)


@pytest.mark.parametrize("falloff", [0.2, 0.8])
def test_falloff_keeps_shares(falloff):
    node = Node("ND_hextiledimage_color3").give(file="a.png", falloff=falloff)
    grid = images._Grid(node.call("out"))
    shares = run(grid.shares(grid.copies()), points())
    assert shares.sum(axis=1) == pytest.approx(np.ones(len(shares)), abs=1e-5)
    assert (shares >= 0).all()


def test_copies_of_what_is_even_are_that():
    at = points()
    for kind, width in (("color3", 3), ("color4", 4)):
        node = Node(f"ND_hextiledimage_{kind}").give(file="a.png")
        assert node.run(at) == pytest.approx(np.ones((len(at), width)), abs=1e-5)
        assert node.textures.uses == [("a.png", "raw", "repeat", "repeat", False)]
        assert node.run(at, kind="colour").shape == (len(at), width)


def test_normals_turn_with_their_copies():
    """With a map of constant slope, each tile is rotated back by its own angle."""
    at = points()
    node = Node("ND_hextilednormalmap_vector3").give(
        file="a.png", strength="0.5", rotationrange="90,90", rotation="0"
    )
    got = node.run(at, kind="normal")
    # White is the slope (1, 1), which a rotation by -90 degrees turns into (1, -1).
    assert got == pytest.approx(np.tile((0.5, -0.5, 1.0), (len(at), 1)), abs=1e-5)
