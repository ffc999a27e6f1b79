# SPDX-License-Identifier: Apache-2.0
"""Tests MaterialX nodes that convert between object space and world space."""

import numpy as np
import pytest
from graph_reference import evaluate
from materialx_nodes import Node, points

MATRIX = np.array([[1.5, 0.4, 0.0], [-0.3, 0.8, 0.2], [0.1, 0.0, 2.0]])
"""Object-to-world matrix for column vectors."""
SHIFT = np.array([3.0, -1.0, 0.5])


def hits(n=50):
    """Returns points on an object with a given transform, with orthonormal shading frames."""
    table = points(n).astype(np.float64)
    table[:, 3:6] = table[:, 6:9] @ MATRIX.T + SHIFT
    table[:, 21:30] = np.linalg.inv(MATRIX).ravel()
    normal = table[:, 9:12]
    tangent = table[:, 15:18] - normal * (table[:, 15:18] * normal).sum(axis=1, keepdims=True)
    table[:, 15:18] = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    return table


def unit(v):
    return v / np.linalg.norm(v, axis=1, keepdims=True)


V = np.array([[0.3, -0.5, 0.8]])


def led(category, start, end, kind="number"):
    node = Node(f"ND_{category}_vector3").give(**{"in": "0.3,-0.5,0.8"})
    node.give(fromspace=start, tospace=end)
    return evaluate(node.value(kind=kind), hits())


@pytest.mark.parametrize("space", ["object", "model"])
def test_vectors_normals_and_points_go_both_ways(space):
    at, inverse = hits(), np.linalg.inv(MATRIX)
    same = np.ones((len(at), 1))
    cases = [
        ("transformvector", V @ MATRIX.T, V @ inverse.T),
        ("transformnormal", unit(V @ inverse), unit(V @ MATRIX)),
        ("transformpoint", V @ MATRIX.T + SHIFT, (V - SHIFT) @ inverse.T),
    ]
    for category, there, back in cases:
        assert led(category, space, "world") == pytest.approx(there * same, abs=1e-6)
        assert led(category, "world", space) == pytest.approx(back * same, abs=1e-6)
        assert led(category, "world", "world") == pytest.approx(V * same, abs=1e-6)


def test_a_normal_in_object_space_is_in_that_of_tangents():
    """In tangent space, the normal is on the side of the surface normal."""
    at = hits()
    world = unit(V @ np.linalg.inv(MATRIX))
    normal, tangent = at[:, 9:12], at[:, 15:18]
    frame = (tangent, np.cross(normal, tangent), normal)
    wanted = np.stack([(axis * world).sum(axis=1) for axis in frame], axis=1)
    wanted *= np.where(wanted[:, 2:] < 0, -1, 1)
    assert led("transformnormal", "object", "world", "normal") == pytest.approx(wanted, abs=1e-6)
    vector = unit(V @ MATRIX.T)
    wanted = np.stack([(axis * vector).sum(axis=1) for axis in frame], axis=1)
    wanted *= np.where(wanted[:, 2:] < 0, -1, 1)
    assert led("transformvector", "object", "world", "normal") == pytest.approx(wanted, abs=1e-6)
