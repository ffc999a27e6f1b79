# SPDX-License-Identifier: Apache-2.0
"""Tests ``--texture-limit`` without a texture store: the mip levels that textures omit."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_recorder import QUAD, Recorder, load, said, write

from wavecomb import WavecombError, _core
from wavecomb.usd import load_stage
from wavecomb.usd.materials.colour_space import halve
from wavecomb.usd.materials.texture_limit import pyramid_bytes


class NoStore:
    """Replaces ``_core.TextureStore`` as on a system without userfaultfd."""

    @staticmethod
    def obstacle():
        return "the system allows no userfaultfd (Operation not permitted)"


def write_image(path, pixels):
    height, width, channels = pixels.shape
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), oiio.ImageSpec(width, height, channels, str(pixels.dtype)))
    assert out.write_image(pixels)
    out.close()


MOVING_CAMERA = """def DistantLight "Sun" {}
    def Camera "C" {
        float focalLength = 20
        float horizontalAperture = 20
        double3 xformOp:translate.timeSamples = {1: (0, 0, 0), 4: (0, 0, -0.5)}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    """
"""A sun, and a camera along -Z that moves over four frames."""


def textured(name, file, distance):
    """Returns a textured unit square at a distance along -Z."""
    return f"""def Material "{name}Mat" {{
        token outputs:surface.connect = </{name}Mat/S.outputs:surface>
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </{name}Mat/T.outputs:rgb>
            token outputs:surface
        }}
        def Shader "T" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st.connect = </{name}Mat/R.outputs:result>
            float3 outputs:rgb
        }}
        def Shader "R" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
    def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        {QUAD}
        texCoord2f[] primvars:st = [(0,0),(1,0),(1,1),(0,1)] (interpolation = "vertex")
        rel material:binding = </{name}Mat>
        float3[] extent = [(0, 0, 0), (1, 1, 0)]
        double3 xformOp:translate = (0, 0, {-distance})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    """


@pytest.fixture
def stage(tmp_path):
    """Two textures of 256 x 256: one near, one at 64 times the distance."""
    rng = np.random.default_rng(1)
    for name in ("near", "far"):
        pixels = rng.integers(0, 256, (256, 256, 3), np.uint8)
        write_image(tmp_path / f"{name}.png", pixels)
    return (
        textured("Near", "near.png", 1)
        + textured("Far", "far.png", 64)
        + 'def Camera "C" { float focalLength = 20\n float horizontalAperture = 20 }'
    )


WHOLE = pyramid_bytes(256, 256, 3, np.uint8)


def sizes(scene):
    return {
        name: scene.textures[scene.material_of(name)["textures"]["base_color"]["texture"]][
            "pixels"
        ].shape[0]
        for name in ("Near", "Far")
    }


def test_what_is_small_in_the_picture_goes_first(tmp_path, stage):
    def at(limit, **options):
        scene, loaded = load(tmp_path, stage, texture_limit=limit, **options)
        return sizes(scene), said(loaded)

    assert at(None) == ({"Near": 256, "Far": 256}, at(None)[1])
    assert at(2 * WHOLE / 1e6)[0] == {"Near": 256, "Far": 256}
    got, words = at(1.3 * WHOLE / 1e6)
    assert got == {"Near": 256, "Far": 128} and "1 of 2 textures without their finest" in words
    # The image shows 64 times fewer texels of texture Far, so Far loses six mip levels before Near
    # loses one.
    assert at(1.02 * WHOLE / 1e6)[0] == {"Near": 256, "Far": 32}
    got, words = at(0.2 * WHOLE / 1e6)
    assert got["Near"] == 64 and got["Far"] <= 4
    assert "2 of them coarser than the image shows" in at(0.01 * WHOLE / 1e6)[1]


def test_the_scene_takes_what_was_planned(tmp_path, stage, monkeypatch):
    monkeypatch.setattr(_core, "TextureStore", NoStore)
    limit = 0.9 * WHOLE
    loaded = load_stage(write(tmp_path, stage), texture_limit=limit / 1e6, size=(64, 64))
    total = sum(size for _, size in loaded.scene.textures) - pyramid_bytes(128, 64, 3, np.float32)
    assert total <= limit
    halved = pyramid_bytes(128, 128, 3, np.uint8)
    assert total in {halved + pyramid_bytes(2**k, 2**k, 3, np.uint8) for k in range(9)}


def test_the_limit_is_kept_within_5_per_cent_where_there_are_many(tmp_path):
    text = ""
    for i in range(24):
        pixels = np.full((64 + 8 * i, 64, 3), i, np.uint8)
        write_image(tmp_path / f"{i}.png", pixels)
        text += textured(f"M{i}", f"{i}.png", 1 + i)
    text += 'def Camera "C" { float focalLength = 20\n float horizontalAperture = 20 }'
    whole = sum(pyramid_bytes(64, 64 + 8 * i, 3, np.uint8) for i in range(24))
    for share in (0.9, 0.5, 0.3):
        scene, _ = load(tmp_path, text, texture_limit=share * whole / 1e6)
        textures = [t["pixels"] for t in scene.textures if t["pixels"].dtype == np.uint8]
        assert len(textures) == 24
        total = sum(pyramid_bytes(p.shape[1], p.shape[0], 3, np.uint8) for p in textures)
        assert 0.95 * share * whole < total <= share * whole


@pytest.mark.parametrize(
    ("size", "channels", "dtype"),
    [((1, 1), 1, np.uint8), ((37, 19), 3, np.float16), ((64, 128), 1, np.float32)],
)
def test_bytes_are_those_of_the_core(size, channels, dtype):
    builder = _core.SceneBuilder(1)
    width, height = size
    builder.add_texture(np.zeros((height, width, channels), dtype), srgb=False, name="t")
    builder.set_camera(np.eye(4), window=(-1, 1, -1, 1))
    assert builder.build().textures == [("t", pyramid_bytes(width, height, channels, dtype))]


def test_halves_are_boxes_in_linear_light():
    chess = np.array([[0, 255], [255, 0]], np.uint8)[..., None].repeat(4, axis=2)
    assert halve(chess, srgb=False)[0, 0].tolist() == [128, 128, 128, 128]
    # 188 is the sRGB code of half the light; alpha is linear.
    assert halve(chess, srgb=True)[0, 0].tolist() == [188, 188, 188, 128]
    odd = np.arange(5, dtype=np.float32).reshape(1, 5, 1)
    # Box filters of 2 1/2 texels: (0 + 1 + 2/2) / 2.5, (2/2 + 3 + 4) / 2.5.
    assert halve(odd, srgb=False)[0, :, 0].tolist() == pytest.approx([0.8, 3.2])
    tall = np.random.default_rng(2).random((1024, 3, 3)).astype(np.float16)
    exact = tall.astype(np.float64).reshape(512, 2, 3, 3).mean(axis=(1, 2))
    assert np.allclose(halve(tall, srgb=False)[:, 0], exact, atol=1e-3)


def test_limits_that_cannot_be(tmp_path, stage):
    with pytest.raises(WavecombError, match="texture limit -1 MB: must be a number above 0"):
        load_stage(write(tmp_path, stage), texture_limit=-1, builder_factory=Recorder)
    _, loaded = load(tmp_path, stage, texture_limit=1e-6)
    assert "even without detail" in said(loaded)
