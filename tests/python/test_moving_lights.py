# SPDX-License-Identifier: Apache-2.0
"""Tests lights that move while the shutter is open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from usd_recorder import load, said, write

import wavecomb
from wavecomb.usd import load_stage

HEADER = """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 10
)
def Camera "Cam" {
    double shutter:open = 0
    double shutter:close = 1
    float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 1.5, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "Floor" {
    point3f[] points = [(-4,-1,-4), (4,-1,-4), (4,-1,4), (-4,-1,4)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [3,2,1,0]
    uniform token subdivisionScheme = "none"
    rel material:binding = </Look>
}
def Material "Look" {
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.5, 0.4, 0.3)
        float inputs:roughness = 0.3
        token outputs:surface
    }
}
"""

GOES = """
    double3 xformOp:translate.timeSamples = { 1: (-1.5, 0, 0), 2: (1.5, 1, 0) }
    float xformOp:rotateX.timeSamples = { 1: -120, 2: -60 }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
"""

LIGHTS = {
    "rect": 'def RectLight "Lamp" { float inputs:width = 1.5\n%s }',
    "disk": 'def DiskLight "Lamp" { %s }',
    "sphere": 'def SphereLight "Lamp" { float inputs:radius = 0.4\n%s }',
    "cylinder": 'def CylinderLight "Lamp" { float inputs:radius = 0.2\n%s }',
    "distant": 'def DistantLight "Lamp" { float inputs:angle = 20\n%s }',
    "inherited": 'def Xform "Arm" { %s\n def RectLight "Lamp" { float inputs:width = 1.5 } }',
    "shaped": """def DiskLight "Lamp" (prepend apiSchemas = ["ShapingAPI"]) {
        float inputs:shaping:cone:angle = 50
        float inputs:shaping:cone:softness = 0.5
        %s }""",
}

SETTINGS = {"size": (20, 20), "threads": 2, "max_depth": 2, "sampler": "independent"}


def stage(folder: Path, kind: str) -> Path:
    return write(folder, HEADER + LIGHTS[kind] % GOES)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rect", "inherited", "shaped", "sphere", "cylinder", "distant"])
def test_a_moving_light_is_the_mean_of_still_ones(tmp_path: Path, kind: str) -> None:
    path = stage(tmp_path, kind)
    loaded = load_stage(path, frame=1)
    assert loaded.scene.moves and "light" not in said(loaded)
    passes = 8
    blurred = np.array(
        [wavecomb.render(loaded, spp=32, seed=90 + k, **SETTINGS).beauty for k in range(passes)],
        np.float64,
    )
    stills = np.zeros_like(blurred)
    for k in range(16):
        still = load_stage(path, frame=1 + (k + 0.5) / 16, motion_blur=False)
        for n in range(passes):
            picture = wavecomb.render(still, spp=4, seed=100 * k + n, **SETTINGS).beauty
            stills[n] += picture / np.float64(16)
    # Compare means over blocks of 4 x 4 pixels. The noise is measured over the passes.
    blocks = [p.reshape(passes, 5, 4, 5, 4, 3).mean(axis=(2, 4)) for p in (blurred, stills)]
    means = [b.mean(axis=0) for b in blocks]
    variance = sum(b.var(axis=0, ddof=1) / passes for b in blocks)
    # Sixteen still images approximate the shutter interval with an error below one per cent.
    z = np.abs(means[0] - means[1]) / np.sqrt(variance + (0.01 * means[1] + 1e-4) ** 2)
    assert z.max() < 6.0, z.max()
    wholes = [p.mean(axis=(1, 2, 3)) for p in (blurred, stills)]
    noise = np.sqrt(sum(x.var(ddof=1) / passes for x in wholes))
    assert abs(wholes[0].mean() - wholes[1].mean()) < 5.0 * noise + 0.005 * wholes[1].mean()
    middle = wavecomb.render(
        load_stage(path, frame=1.5, motion_blur=False), spp=64, seed=5, **SETTINGS
    ).beauty
    assert np.abs(middle - blurred.mean(axis=0)).max() > 0.1 * blurred.mean()


def test_one_picture_for_all_schedules(tmp_path: Path) -> None:
    both = (
        HEADER
        + LIGHTS["rect"] % GOES
        + """
def DomeLight "Sky" {
    float inputs:intensity = 0.1
    asset inputs:texture:file = @./sky.exr@
    float xformOp:rotateY.timeSamples = { 1: 0, 2: 90 }
    uniform token[] xformOpOrder = ["xformOp:rotateY"]
}
"""
        + LIGHTS["shaped"].replace("Lamp", "Spot") % GOES
    )
    oiio = pytest.importorskip("OpenImageIO")
    sky = oiio.ImageBuf(np.random.default_rng(3).random((16, 32, 3), np.float32) ** 4)
    sky.write(str(tmp_path / "sky.exr"))
    loaded = load_stage(write(tmp_path, both), frame=1)
    for light_selection in ("power", "tree"):
        pictures = [
            wavecomb.render(
                loaded, size=(24, 24), spp=4, light_selection=light_selection, **options
            ).beauty.tobytes()
            for options in (
                {"integrator": "reference"},
                {"policy": "none", "threads": 1},
                {"policy": "material", "threads": 2, "wave_size": 128},
                {"policy": "cost-benefit", "lanes": 1},
            )
        ]
        assert len(set(pictures)) == 1


def test_steps_follow_the_motion(tmp_path: Path) -> None:
    scene, _ = load(tmp_path, HEADER + LIGHTS["inherited"] % GOES, frame=1)
    light = scene.lights[0]
    assert light["transform"][3, 0] == 0.0
    assert light["motion"][[0, -1], 3, 0].tolist() == [-1.5, 1.5] and len(light["motion"]) > 2
    assert not load_stage(stage(tmp_path, "rect"), frame=1, motion_blur=False).scene.moves


def test_a_light_that_moves_within_an_instance_that_does(tmp_path: Path) -> None:
    arm = """
class Xform "Arm" {
    def SphereLight "Lamp" {
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (0, 2, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def Xform "One" (instanceable = true
    inherits = </Arm>) {
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (4, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "Two" (instanceable = true
    inherits = </Arm>) {}
"""
    scene, _ = load(tmp_path, HEADER + arm, frame=1)
    ends = sorted(light["motion"][-1, 3, :3].tolist() for light in scene.lights)
    assert ends == [[0.0, 2.0, 0.0], [4.0, 2.0, 0.0]]
    assert sorted(light["transform"][3, 0] for light in scene.lights) == [0.0, 2.0]


def test_what_cannot_be_is_listed(tmp_path: Path) -> None:
    grows = """
    float3 xformOp:scale.timeSamples = { 1: (1, 1, 1), 2: (2, 2, 2) }
    uniform token[] xformOpOrder = ["xformOp:scale"]
"""
    loaded = load_stage(write(tmp_path, HEADER + LIGHTS["rect"] % grows), frame=1)
    assert "lights that change their size" in said(loaded)


def test_bad_motion_is_one_line() -> None:
    builder = wavecomb._core.SceneBuilder()
    with pytest.raises(ValueError, match="light 'Lamp': motion has 1 transforms"):
        builder.add_light("rect", np.eye(4), name="Lamp", motion=np.eye(4)[None])
