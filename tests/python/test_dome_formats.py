# SPDX-License-Identifier: Apache-2.0
"""Tests dome textures in formats other than latlong: pixel directions, and irradiance."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_recorder import load, said

from wavecomb.usd.lights.dome import format_of, to_latlong

SIZE = 256


def sky(d):
    """Returns a smooth radiance without any symmetry."""
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack(
        [np.exp(0.8 * x + 0.5 * y + 0.33 * z), 1 + 0.4 * z + 0.2 * x, 2 + y - x * z], -1
    )


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def plane(n):
    """Returns the x (right) and y (up) coordinates of an image's pixels, in [-1, 1]."""
    at = (np.arange(n) + 0.5) / n * 2 - 1
    return np.meshgrid(at, -at)


def angular():
    """Returns directions and solid angles of the pixels of an angular map."""
    x, y = plane(SIZE)
    r = np.hypot(x, y)
    t = np.pi * r
    d = np.stack([-np.sin(t) * x / r, np.sin(t) * y / r, np.cos(t)], -1)
    return d, np.where(r < 1, np.sin(t) * np.pi / r * (2 / SIZE) ** 2, 0)


def mirrored_ball():
    """Returns directions and solid angles (4 dA) of a mirrored-ball image, seen from +z."""
    x, y = plane(SIZE)
    z2 = 1 - x * x - y * y
    n = np.stack([x, y, np.sqrt(np.maximum(z2, 0))], -1)
    d = 2 * n[..., 2:] * n - np.array((0, 0, 1))
    return d, np.where(z2 > 0, 4 * (2 / SIZE) ** 2, 0)


FACES = {
    (1, 1): ((0, 0, 1), (-1, 0, 0), (0, 1, 0)),
    (1, 0): ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
    (1, 2): ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
    (1, 3): ((0, 0, -1), (-1, 0, 0), (0, -1, 0)),
    (0, 1): ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    (2, 1): ((-1, 0, 0), (0, 0, -1), (0, 1, 0)),
}


def cross():
    n = SIZE // 4
    d, part = np.zeros((4 * n, 3 * n, 3)), np.zeros((4 * n, 3 * n))
    x, y = plane(n)
    for (column, row), (ahead, right, up) in FACES.items():
        v = np.array(ahead) + x[..., None] * np.array(right) + y[..., None] * np.array(up)
        where = slice(row * n, row * n + n), slice(column * n, column * n + n)
        d[where] = unit(v)
        part[where] = (2 / n) ** 2 / np.linalg.norm(v, axis=-1) ** 3
    return d, part


IMAGES = {"angular": angular, "mirroredBall": mirrored_ball, "cubeMapVerticalCross": cross}


def latlong(rows):
    """Returns directions and solid angles of a latlong image in OpenEXR's convention."""
    lat = np.pi / 2 - (np.arange(rows) + 0.5) * np.pi / rows
    lon = np.pi - (np.arange(2 * rows) + 0.5) * np.pi / rows
    lat, lon = np.meshgrid(lat, lon, indexing="ij")
    d = np.stack([np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon)], -1)
    return d, np.cos(lat) * (np.pi / rows) ** 2


@pytest.mark.parametrize("form", IMAGES)
def test_what_is_seen_and_how_much_light_it_gives(form):
    directions, part = IMAGES[form]()
    assert part.sum() == pytest.approx(4 * np.pi, rel=2e-3)
    image = np.where(part[..., None] > 0, sky(directions), 0).astype(np.float32)
    made = to_latlong(image, form)
    d, weight = latlong(len(made))
    exact = sky(d)
    # The edge of a mirrored ball is a single direction, -z; pixels near it cover wide angles.
    ahead = d[..., 2] > -0.8 if form == "mirroredBall" else np.full(d.shape[:2], True)
    ahead &= d[..., 2] > -0.98
    assert np.abs(made / exact - 1)[ahead].max() < 0.02
    # Irradiance on surfaces of several orientations, from the original and the converted image.
    for normal in unit(np.array([(0, 1, 0), (1, 0, 0), (0, 0, 1), (-1, -1, 1), (0.2, -1, 0.5)])):
        cosine = np.maximum(d @ normal, 0) * weight
        found = (made * cosine[..., None]).sum((0, 1))
        truth = (exact * cosine[..., None]).sum((0, 1))
        assert np.abs(found / truth - 1).max() < (4e-3 if form == "mirroredBall" else 1e-3)


def test_automatic():
    assert format_of("automatic", (64, 128)) == format_of("automatic", (64, 64)) == "latlong"
    assert format_of("automatic", (128, 96)) == "cubeMapVerticalCross"
    assert format_of("angular", (128, 96)) == "angular"


def test_in_a_stage(tmp_path):
    directions, _ = cross()
    image = oiio.ImageBuf(oiio.ImageSpec(directions.shape[1], directions.shape[0], 3, "float"))
    image.set_pixels(oiio.ROI(), sky(directions).astype(np.float32))
    image.write(str(tmp_path / "sky.exr"))
    text = """def DomeLight "A" { asset inputs:texture:file = @sky.exr@
            token inputs:texture:format = "FORMAT" }
        def DomeLight "B" { asset inputs:texture:file = @sky.exr@
            token inputs:texture:format = "cubeMapVerticalCross" }"""
    scene, loaded = load(tmp_path, text.replace("FORMAT", "automatic"))
    assert scene.lights[0]["texture"] == scene.lights[1]["texture"]
    made = scene.textures[scene.lights[0]["texture"]]["pixels"]
    d, _ = latlong(len(made))
    assert np.abs(made / sky(d) - 1).max() < 0.02
    assert not loaded.report.unsupported
    _, loaded = load(tmp_path, text.replace("FORMAT", "fisheye"))
    assert "unknown texture format fisheye" in said(loaded)
