#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds a scene from NumPy arrays, without USD: a glossy quad on the floor under a light."""

from __future__ import annotations

import numpy as np

import wavecomb


def at(x: float, y: float, z: float) -> np.ndarray:
    """Returns a translation for row vectors, as in USD."""
    matrix = np.eye(4)
    matrix[3, :3] = x, y, z
    return matrix


builder = wavecomb.SceneBuilder()
floor = builder.add_material("diffuse", name="Floor", base_color=(0.6, 0.6, 0.6))
gold = builder.add_material("metal", name="Gold", base_color=(1.0, 0.71, 0.29), roughness=0.2)

triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
ground = np.array([[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]], np.float32)
panel = np.array([[-1, 0, -1], [1, 0, -1], [1, 1.6, -1.4], [-1, 1.6, -1.4]], np.float32)
for points, material, name in ((ground, floor, "Ground"), (panel, gold, "Panel")):
    mesh = builder.add_mesh(points, triangles, material=material, name=name)
    builder.add_to_group(0, mesh)  # group 0 contains the objects in world space

builder.add_light("sphere", at(1.5, 2.5, 1.0), name="Key", color=(30, 28, 25), radius=0.3)
builder.add_light("dome", np.eye(4), name="Sky", color=(0.2, 0.25, 0.35))
builder.set_camera(at(0.0, 0.9, 4.0), window=(-0.5, 0.5, -0.4, 0.4))

image = wavecomb.render(builder.build(), size=(400, 320), spp=32)
image.save("no_usd.png")
