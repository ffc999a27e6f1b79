# SPDX-License-Identifier: Apache-2.0
"""Tests volumes from file to image, in the sandbox, and in comparison with Arnold."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import ASSETS, needs, needs_asset, only_where

import wavecomb
from wavecomb import vdb

pytestmark = [
    needs("wavecomb._core"),
    only_where(vdb.is_there(), "this build is without OpenVDB"),
]

SLAB = """#usda 1.0
def Volume "Fog" {
    rel field:density = </Fog/density>
    def OpenVDBAsset "density" {
        asset filePath = @./a.vdb@
    }
    rel material:binding = </Look>
}
def Material "Look" {
    token outputs:volume.connect = </Look/S.outputs:out>
    def Shader "S" {
        uniform token info:id = "standard_volume"
        float inputs:density = 0.5
        float inputs:scatter = 0
        float inputs:transparent_depth = 2
        color3f inputs:transparent = (0.5, 0.25, 0.125)
        token outputs:out
    }
}
def DomeLight "Sky" {
}
def Camera "Cam" {
    uniform token projection = "orthographic"
    float horizontalAperture = 10
    float verticalAperture = 10
    double3 xformOp:translate = (0.5, 0.5, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_a_slab_of_a_file_lets_through_what_it_should(tmp_path: Path) -> None:
    """The transmittance matches 8 voxels of density 1.5 whose density falls to 0 at both ends."""
    values = np.full((16, 8, 8, 8), 1.5, np.float16)
    cells = [[x, y, 0] for x in range(-2, 2) for y in range(-2, 2)]
    bricks = {"origins": np.array(cells, np.int32) * 8, "values": values}
    matrix = np.diag([0.25, 0.25, 0.25, 1.0])
    vdb.write(tmp_path / "a.vdb", [{"name": "density", **bricks, "index_to_object": matrix}])
    path = tmp_path / "s.usda"
    path.write_text(SLAB)
    loaded = wavecomb.load(path)
    assert loaded.volumes[0].grids[0].value == "half"
    image = wavecomb.render(loaded, size=(16, 16), spp=256).beauty
    found = image.reshape(-1, image.shape[-1])[:, :3].mean(axis=0)
    # The density is constant over the seven steps between eight voxels, and falls linearly to 0 at
    # both ends.
    depth = 0.5 * 1.5 * 0.25 * (7 + 2 * 0.5)
    wanted = np.exp(-depth * -np.log([0.5, 0.25, 0.125]) / 2)
    assert found == pytest.approx(wanted, abs=0.01)


ARNOLD = "reference/arnold-usd/test_0030"
VIEW = (
    (0.912120104, 0.0, 0.409923047, 0.0), (0.100129507, 0.969708741, -0.222798258, 0.0),
    (-0.397505939, 0.244264171, 0.884490848, 0.0), (-63.5111198, 138.246094, 375.207275, 1.0),
)  # fmt: skip
FIELD_OF_VIEW = 54.4322243
"""Field of view, in degrees, of the camera in Arnold's test.ass, which does not see the sky."""


def smoke_of_arnold(folder: Path, scatter: float) -> Any:
    wide = 70.0 * math.tan(math.radians(0.5 * FIELD_OF_VIEW))
    rows = ", ".join(str(row) for row in VIEW)
    path = folder / f"{scatter}.usda"
    path.write_text(f"""#usda 1.0
( subLayers = [@{ASSETS / ARNOLD}/data/scene.usda@] )
over "vol" {{
    float inputs:scatter = {scatter}
}}
def DomeLight "Sky" {{
}}
def Camera "Cam" {{
    matrix4d xformOp:transform = ({rows})
    uniform token[] xformOpOrder = ["xformOp:transform"]
    float focalLength = 35
    float horizontalAperture = {wide}
    float verticalAperture = {0.75 * wide}
}}
""")
    # Arnold's default is single scattering.
    picture = wavecomb.render(path, size=(160, 120), spp=16, max_depth=1)
    return picture.beauty[..., 0].astype(np.float64)


@pytest.mark.slow
@needs_asset(f"{ARNOLD}/ref/reference.tif", f"{ARNOLD}/data/scene.usda", f"{ARNOLD}/data/smoke.vdb")
def test_smoke_is_as_thick_and_as_bright_as_arnolds(tmp_path: Path) -> None:
    import OpenImageIO as oiio

    image = oiio.ImageBuf(str(ASSETS / ARNOLD / "ref/reference.tif")).get_pixels(oiio.FLOAT)
    red, alpha = image[..., 0].astype(np.float64), image[..., 3].astype(np.float64)
    light = np.where(red <= 0.04045, red / 12.92, ((red + 0.055) / 1.055) ** 2.4)
    through = smoke_of_arnold(tmp_path, 0.0)
    scattered = smoke_of_arnold(tmp_path, 1.0) - through
    assert (1.0 - through).sum() == pytest.approx(alpha.sum(), rel=0.005)
    assert scattered.sum() == pytest.approx(light.sum(), rel=0.03)
