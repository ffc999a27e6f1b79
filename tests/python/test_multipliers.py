# SPDX-License-Identifier: Apache-2.0
"""Tests that bounces and light samples apply the same multipliers and light links."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from usd_recorder import write

import wavecomb
from wavecomb.usd import load_stage

STAGE = """
def Camera "Cam" {
    float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 1, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "Floor" {
    point3f[] points = [(-4,-1,-4), (4,-1,-4), (4,-1,4), (-4,-1,4)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [3,2,1,0]
    uniform token subdivisionScheme = "none"
    rel material:binding = </Look>
}
def Sphere "Other" {
    double3 xformOp:translate = (20, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Material "Look" {
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.3, 0.2, 0.1)
        float inputs:roughness = 0.1
        token outputs:surface
    }
}
%s
"""
RECT = """
def RectLight "Lamp" (%s) {
    float inputs:width = 3
    float inputs:height = 2
    double3 xformOp:translate = (0, 1.5, -3)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX:turn"]
    float xformOp:rotateX:turn = 180
    %s
}
"""
MULTIPLIED = "float inputs:diffuse = %s\nfloat inputs:specular = %s"
LINK = """
    uniform bool collection:lightLink:includeRoot = 0
    rel collection:lightLink:includes = </Floor>
"""
SETTINGS: dict[str, Any] = {
    "size": (20, 20), "threads": 2, "max_depth": 1, "sampler": "independent", "aovs": [],
}  # fmt: skip


def lamp(folder: Path, body: str = "", light: str = RECT) -> Any:
    api = 'prepend apiSchemas = ["CollectionAPI:lightLink"]' if "collection" in body else ""
    return load_stage(write(folder, STAGE % (light % (api, body))))


def passes(loaded: Any, seed: int, count: int = 8, spp: int = 16) -> np.ndarray:
    """Returns (count, 20, 20, 3) pixels of independent renders."""
    return np.array(
        [wavecomb.render(loaded, spp=spp, seed=seed + k, **SETTINGS).beauty for k in range(count)],
        np.float64,
    )


def agree(a: np.ndarray, b: np.ndarray) -> None:
    """Asserts that two means agree over blocks of 4 x 4 pixels, within the measured noise."""
    blocks = [p.reshape(len(p), 5, 4, 5, 4, 3).mean(axis=(2, 4)) for p in (a, b)]
    variance = sum(x.var(axis=0, ddof=1) / len(x) for x in blocks)
    z = np.abs(blocks[0].mean(axis=0) - blocks[1].mean(axis=0)) / np.sqrt(variance + 1e-10)
    assert z.max() < 6.0, z.max()
    wholes = [p.mean(axis=(1, 2, 3)) for p in (a, b)]
    noise = np.sqrt(sum(x.var(ddof=1) / len(x) for x in wholes))
    assert abs(wholes[0].mean() - wholes[1].mean()) < 5.0 * noise


def test_parts_add_up_to_the_whole(tmp_path: Path) -> None:
    """Multipliers of 0.5 and 2 scale the diffuse and the specular part."""
    diffuse = passes(lamp(tmp_path, MULTIPLIED % (1, 0)), 100)
    specular = passes(lamp(tmp_path, MULTIPLIED % (0, 1)), 200)
    mixed = passes(lamp(tmp_path, MULTIPLIED % (0.5, 2)), 300)
    whole = passes(lamp(tmp_path), 400)
    floor = np.s_[:, 12:]
    seen = whole[:, :12].mean()
    assert diffuse[:, :12].mean() > 0 and seen > 0

    def padded(p: np.ndarray) -> np.ndarray:
        out = np.zeros_like(p)
        out[floor] = p[floor]
        return out

    agree(padded(diffuse + specular), padded(whole))
    agree(padded(0.5 * diffuse + 2 * specular), padded(mixed))


@pytest.mark.parametrize("body", [MULTIPLIED % (0.999, 1.001), LINK], ids=["multiplied", "linked"])
def test_noise_is_that_of_a_plain_light(tmp_path: Path, body: str) -> None:
    plain = passes(lamp(tmp_path), 500, 16)[:, 12:]
    other = passes(lamp(tmp_path, body), 500, 16)[:, 12:]
    ratio = other.var(axis=0, ddof=1).mean() / plain.var(axis=0, ddof=1).mean()
    assert ratio < 1.3, ratio
    assert other.mean() == pytest.approx(plain.mean(), rel=2e-3)


def test_one_picture_for_all_schedules(tmp_path: Path) -> None:
    sky = 'def DomeLight "Sky" {\nfloat inputs:intensity = 0.2\nfloat inputs:specular = 0.3\n}\n'
    loaded = lamp(tmp_path, MULTIPLIED % (0.5, 2), RECT + sky)
    pictures = [
        wavecomb.render(loaded, size=(24, 24), spp=4, max_depth=4, **options).beauty.tobytes()
        for options in (
            {"integrator": "reference"},
            {"policy": "none", "threads": 1},
            {"policy": "material", "threads": 2, "wave_size": 128},
            {"policy": "cost-benefit", "lanes": 1},
        )
    ]
    assert len(set(pictures)) == 1
