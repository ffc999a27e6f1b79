# SPDX-License-Identifier: Apache-2.0
"""Tests AOVs of volumes: transmittance, depth of half opacity, scattered light, Cryptomatte."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs

import wavecomb

pytestmark = needs("wavecomb._core")

SIZE, SPP = (16, 16), 256
STAGE = """#usda 1.0
( metersPerUnit = 1 )
def Volume "Fog" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    float3[] extent = [(-5, -5, -1), (5, 5, 1)]
    rel material:binding = </M>
}
def Material "M"
{
    token outputs:mtlx:volume.connect = </M/V.outputs:out>
    def Shader "V"
    {
        uniform token info:id = "ND_volume"
        token inputs:vdf.connect = </M/A.outputs:out>
        token inputs:edf.connect = </M/E.outputs:out>
        token outputs:out
    }
    def Shader "A"
    {
        uniform token info:id = "ND_anisotropic_vdf"
        vector3f inputs:absorption = (0.1, 0.2, 0.3)
        vector3f inputs:scattering = SCATTERING
        token outputs:out
    }
    def Shader "E"
    {
        uniform token info:id = "ND_uniform_edf"
        color3f inputs:color = (0.2, 0.1, 0.05)
        token outputs:out
    }
}
def Mesh "Wall"
{
    point3f[] points = [(-9, -9, -2), (9, -9, -2), (9, 9, -2), (-9, 9, -2)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
}
def SphereLight "Lamp"
{
    float inputs:radius = 0.2
    float inputs:intensity = 400
    double3 xformOp:translate = (0, 2.5, 1.6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "Cam"
{
    token projection = "orthographic"
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
ABSORPTION, SCATTERING = np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.3, 0.2])
LAYERS = {"volume": "C(V.*|E)", "glow": "CE", "rest": "C[^VE].*"}


def _load(folder: Path, scattering: Any) -> Any:
    path = folder / "fog.usda"
    text = str(tuple(map(float, scattering)))
    path.write_text(STAGE.replace("SCATTERING", text))
    return wavecomb.load(path)


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return _load(tmp_path_factory.mktemp("fog"), SCATTERING)


def _render(loaded: Any, **options: Any) -> wavecomb.Picture:
    aovs = [
        "transmittance",
        "half_depth",
        "samples",
        "crypto",
        "depth",
        "light_groups",
        "material_id",
    ]
    asked = [f"lpe:{name}={text}" for name, text in LAYERS.items()]
    return wavecomb.render(
        loaded, **{"size": SIZE, "spp": SPP, "max_depth": 3, "aovs": [*aovs, *asked], **options}
    )


@pytest.fixture(scope="module")
def picture(loaded: Any) -> wavecomb.Picture:
    return _render(loaded)


def test_transmittance_is_the_exponential(picture: wavecomb.Picture) -> None:
    seen = picture.aovs["transmittance"].reshape(-1, 3).astype(np.float64)
    error = seen.std(axis=0) / math.sqrt(len(seen))
    assert (error < 5e-3).all()
    assert (abs(seen.mean(axis=0) - np.exp(-2 * (ABSORPTION + SCATTERING))) < 4.2 * error).all()


@pytest.mark.slow
def test_opacity_is_half_where_it_should_be(tmp_path: Path, picture: wavecomb.Picture) -> None:
    """Depth of half opacity: ln 2 / extinction behind the face of thick fog, else at the wall."""
    thick = _load(tmp_path, 1.5 - ABSORPTION)
    depth = _render(thick, spp=512).aovs["half_depth"].astype(np.float64)
    assert depth.mean() == pytest.approx(3 + math.log(2) / 1.5, rel=0.01)
    assert depth.std() < 0.08
    assert 4.2 < picture.aovs["half_depth"].mean() < 4.55
    thin = _load(tmp_path, 0.001 + 0 * ABSORPTION)
    np.testing.assert_allclose(_render(thin).aovs["half_depth"], 6, rtol=0.015)


def test_light_of_volumes_is_a_layer(picture: wavecomb.Picture) -> None:
    volume, rest = picture.aovs["lpe_volume"], picture.aovs["lpe_rest"]
    np.testing.assert_allclose(volume + rest, picture.beauty, rtol=1e-5, atol=1e-6)
    # Emission: int_0^2 e exp(-sigma x) dx.
    sigma = ABSORPTION + SCATTERING
    glow = picture.aovs["lpe_glow"].reshape(-1, 3).mean(axis=0)
    exact = np.array([0.2, 0.1, 0.05]) / sigma * (1 - np.exp(-2 * sigma))
    assert glow == pytest.approx(exact, rel=0.02)
    assert (volume.mean(axis=(0, 1)) > 1.2 * glow).all()
    groups = picture.aovs["light_other"]
    np.testing.assert_allclose(groups, picture.beauty, rtol=1e-5, atol=1e-6)


def test_cryptomatte_covers_by_opacity(picture: wavecomb.Picture) -> None:
    fog = wavecomb.cryptomatte.matte(
        picture.aovs["crypto_object"], picture.manifests["crypto_object"]["/Fog"]
    )
    wall = wavecomb.cryptomatte.matte(
        picture.aovs["crypto_object"], picture.manifests["crypto_object"]["/Wall"]
    )
    np.testing.assert_allclose(fog + wall, 1, atol=1e-6)
    through = np.exp(-2 * (ABSORPTION + SCATTERING)).mean()
    assert wall.mean() == pytest.approx(through, abs=0.01)
    material = wavecomb.cryptomatte.matte(
        picture.aovs["crypto_material"], picture.manifests["crypto_material"]["/Fog"]
    )
    np.testing.assert_array_equal(material, fog)


def test_every_schedule_gives_the_same_bits(loaded: Any) -> None:
    first = _render(loaded, spp=8)
    for schedule in ({"integrator": "reference"}, {"threads": 1, "wave_size": 64}, {"lanes": 1}):
        other = _render(loaded, spp=8, **schedule)
        for name, layer in first.aovs.items():
            np.testing.assert_array_equal(other.aovs[name], layer, err_msg=f"{schedule} {name}")


def test_nothing_between_surfaces_lets_all_through(tmp_path: Path) -> None:
    path = tmp_path / "clear.usda"
    path.write_text(
        STAGE.replace('def Volume "Fog"', 'over "Fog"').replace("SCATTERING", "(0, 0, 0)")
    )
    picture = _render(wavecomb.load(path), spp=4)
    assert (picture.aovs["transmittance"] == 1).all()
    np.testing.assert_allclose(picture.aovs["half_depth"], 6, rtol=1e-5)


def test_merged_depths_are_between(tmp_path: Path, loaded: Any) -> None:
    from wavecomb.image.files.image import read_layers
    from wavecomb.image.merge import merge

    paths = []
    for seed in (1, 2):
        paths.append(tmp_path / f"{seed}.exr")
        _render(loaded, spp=16, seed=seed).save(paths[-1])
    merged = merge(paths).layers["half_depth"]
    both = [read_layers(str(path))["half_depth"] for path in paths]
    np.testing.assert_allclose(merged, (both[0] + both[1]) / 2, rtol=1e-5)
