# SPDX-License-Identifier: Apache-2.0
"""Tests light path expressions: light per layer, layers that sum to the beauty, and syntax."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from usd_recorder import load, write

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import read_layers
from wavecomb.run import expressions

_core = pytest.importorskip("wavecomb._core")

SIZE, SPP = (32, 24), 16
ROOM = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World" {
    def Camera "Cam" {
        float focalLength = 30
        double3 xformOp:translate = (0, 1, 7)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def RectLight "Key" {
        float inputs:intensity = 9
        float inputs:width = 2
        float inputs:specular = SPECULAR
        string primvars:wavecomb:lightGroup = "key"
        float3 xformOp:rotateXYZ = (-90, 0, 0)
        double3 xformOp:translate = (0, 4, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def DomeLight "Sky" {
        float inputs:intensity = 0.4
        float inputs:specular = SPECULAR
    }
    def Cube "Floor" {
        double3 xformOp:translate = (0, -1.1, 0)
        float3 xformOp:scale = (6, 0.1, 6)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        rel material:binding = </World/Matte>
    }
    def Sphere "Shiny" {
        double3 xformOp:translate = (-2.2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel material:binding = </World/Plastic>
    }
    def Sphere "Mirror" {
        rel material:binding = </World/Chrome>
    }
    def Sphere "Lens" {
        double3 xformOp:translate = (2.2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel material:binding = </World/Glass>
    }
    def Sphere "Lamp" {
        double radius = 0.3
        double3 xformOp:translate = (1, 2, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel material:binding = </World/Glow>
    }
    MATERIALS
}
"""


def _material(name: str, inputs: str) -> str:
    program = 'custom string wavecomb:program = "dielectric"' if name == "Glass" else ""
    return f"""
    def Material "{name}" {{
        {program}
        token outputs:surface.connect = </World/{name}/S.outputs:surface>
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface
        }}
    }}"""


_MATERIALS = {
    "Matte": "color3f inputs:diffuseColor = (0.6, 0.3, 0.2)\nint inputs:useSpecularWorkflow = 1\n"
    "color3f inputs:specularColor = (0, 0, 0)",
    "Plastic": "color3f inputs:diffuseColor = (0.1, 0.5, 0.2)\nfloat inputs:roughness = 0.3",
    "Chrome": "color3f inputs:diffuseColor = (0.9, 0.9, 0.9)\nfloat inputs:roughness = 0\n"
    "float inputs:metallic = 1",
    "Glass": "float inputs:roughness = 0\nfloat inputs:ior = 1.5",
    "Glow": "color3f inputs:emissiveColor = (3, 1, 0.5)",
}
PARTITIONS = {
    "lobes": {"a": "C[LO]", "b": "C<RD>.*", "c": "C<RG>.*", "d": "C<RS>.*", "e": "C<T.>.*"},
    "lights": {"a": "C.*<L.'key'>", "b": "C.*B", "c": "C.*O"},
    "bounces": {"a": "C[LO]", "b": "C.[LO]", "c": "C..[LO]", "d": "C.{3,}[LO]"},
    "order": {"a": "C[^D]*[LO]", "b": "C[^D]*D[^D]*[LO]", "c": "C[^D]*D[^D]*D.*[LO]"},
}


def _stage(folder: Path, specular: float = 1) -> Path:
    materials = "".join(_material(*one) for one in _MATERIALS.items())
    text = ROOM.replace("SPECULAR", str(specular)).replace("MATERIALS", materials)
    return write(folder, text)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _stage(tmp_path_factory.mktemp("lpe"))


@pytest.fixture(scope="module")
def loaded(stage: Path) -> Any:
    return wavecomb.load(stage)


def _render(loaded: Any, asked: dict[str, str], **options: Any) -> wavecomb.Picture:
    aovs = [f"lpe:{name}={text}" for name, text in asked.items()]
    return wavecomb.render(
        loaded, **{"size": SIZE, "spp": SPP, "aovs": [*aovs, *options.pop("aovs", ())], **options}
    )


def _layer(picture: wavecomb.Picture, name: str) -> np.ndarray[Any, Any]:
    return picture.aovs[expressions.LAYER + name].astype(np.float64)


@pytest.mark.parametrize("partition", PARTITIONS)
def test_partitions_add_up_to_the_beauty(loaded: Any, partition: str) -> None:
    asked = PARTITIONS[partition]
    picture = _render(loaded, asked)
    total = sum(_layer(picture, name) for name in asked)
    np.testing.assert_allclose(total, picture.beauty, rtol=2e-6, atol=1e-7)
    for name in asked:
        assert _layer(picture, name).max() > 0.01, (partition, name)


def test_they_are_what_other_layers_say(loaded: Any) -> None:
    asked = {"a": "C[LO]", "b": "C.[LO]", "c": "C..+[LO]", "d": "C.*<L.'key'>", "e": "C.*"}
    also = ("emission", "direct", "indirect", "light_key")
    picture = _render(loaded, asked, aovs=also)
    for name, other in zip("abcd", also, strict=True):
        np.testing.assert_allclose(
            _layer(picture, name), picture.aovs[other], rtol=1e-5, atol=1e-6, err_msg=other
        )
    np.testing.assert_allclose(_layer(picture, "e"), picture.beauty, rtol=2e-6, atol=1e-7)


def test_diffuse_light_is_what_lights_without_specular_give(loaded: Any, tmp_path: Path) -> None:
    """The diffuse layer equals a render whose lights affect only diffuse reflection."""
    seen = _render(loaded, {"a": "C<RD><L.'key'>", "b": "C<RD>B"}, spp=256)
    other = wavecomb.load(_stage(tmp_path, 0))
    only = _render(other, {"a": "C.<L.'key'>", "b": "C.B"}, spp=256)
    ball = np.s_[8:17, 3:11]
    for name in "ab":
        want = _layer(only, name)[ball].mean(axis=(0, 1))
        assert _layer(seen, name)[ball].mean(axis=(0, 1)) == pytest.approx(want, rel=0.03), name


SHINY = """#usda 1.0
def DomeLight "Sky" { float inputs:diffuse = DIFFUSE }
def Sphere "Ball" { rel material:binding = </Plastic> }
def Camera "Cam" { float focalLength = 20
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
"""


def test_multipliers_go_to_the_lobe_that_they_are_of(tmp_path: Path) -> None:
    """Multipliers also apply to light that bounces find, such as sky light on plastic."""
    asked = {"diffuse": "C<RD>B", "glossy": "C<RG>B", "seen": "CB"}
    found = {}
    for diffuse in (1, 0.25):
        text = SHINY.replace("DIFFUSE", str(diffuse)) + _material("Plastic", _MATERIALS["Plastic"])
        text = text.replace("/World/", "/")
        folder = tmp_path / str(diffuse)
        folder.mkdir()
        picture = _render(wavecomb.load(write(folder, text)), asked, spp=256, max_depth=1)
        total = sum(_layer(picture, name) for name in asked)
        np.testing.assert_allclose(total, picture.beauty, rtol=2e-6, atol=1e-7)
        found[diffuse] = {name: _layer(picture, name).mean(axis=(0, 1)) for name in asked}
    assert found[0.25]["diffuse"] == pytest.approx(0.25 * found[1]["diffuse"], rel=0.01)
    assert found[0.25]["glossy"] == pytest.approx(found[1]["glossy"], rel=0.01)


def test_the_beauty_is_as_without(loaded: Any) -> None:
    plain = wavecomb.render(loaded, size=SIZE, spp=SPP, aovs=[])
    assert _render(loaded, PARTITIONS["lobes"]).beauty.tobytes() == plain.beauty.tobytes()


def test_every_schedule_gives_the_same_bits(loaded: Any) -> None:
    asked = {**PARTITIONS["lobes"], "f": "C.*<L.'key'>", "g": "C<RD>.+<TS>.*[LO]"}
    first = _render(loaded, asked)
    schedules: tuple[dict[str, Any], ...] = (
        {"integrator": "reference"},
        {"threads": 1, "wave_size": 64},
        {"policy": "material", "ray_order": "morton"},
        {"lanes": 1},
    )
    for schedule in schedules:
        other = _render(loaded, asked, **schedule)
        for name in asked:
            np.testing.assert_array_equal(
                _layer(other, name), _layer(first, name), err_msg=f"{schedule} {name}"
            )


def test_names_of_other_renderers() -> None:
    for name, text in expressions.NAMED.items():
        _core.Settings(aovs=[f"lpe:{name}={text}"]).check()
        assert expressions.spelled(f"lpe:{name}") == f"lpe:{name}={text}"


def test_in_a_file(stage: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.exr"
    result = CliRunner().invoke(
        main,
        ["render", str(stage), "-o", str(output), "--size", "8", "8", "--spp", "4",
         "--aov", "lpe:diffuse", "--aov", "lpe:mine=C.*<L.'key'>", "--half"],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    layers = read_layers(output)
    assert layers["lpe_diffuse"].shape == layers["lpe_mine"].shape == (8, 8, 3)


@pytest.mark.parametrize(
    ("aov", "message"),
    [
        ("lpe:a=C<RX>L", "light path expression a=C<RX>L: at character 4 ('X')"),
        ("lpe:a", "AOV 'lpe:a' has no expression; write lpe:NAME=EXPRESSION"),
        ("lpe:a=C.*<L.'rim'>", "the scene has no light group 'rim'; it has "),
        ("lpe:a=RDL", "it does not begin with a camera; write C first"),
    ],
)
def test_refused_in_one_line(stage: Path, tmp_path: Path, aov: str, message: str) -> None:
    result = CliRunner().invoke(
        main, ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--aov", aov, "--spp", "1"]
    )
    assert result.exit_code == 2
    errors = [line for line in result.stderr.splitlines() if line.startswith("error:")]
    assert len(errors) == 1 and message in errors[0], result.stderr


def test_vars_of_a_stage(tmp_path: Path) -> None:
    text = """#usda 1.0
    ( renderSettingsPrimPath = "/Render/S" )
    def Sphere "Ball" {}
    def Scope "Render" {
        def RenderSettings "S" { rel products = </Render/P> }
        def RenderProduct "P" {
            rel orderedVars = [</Render/Spec>, </Render/Arnold>, </Render/Bad>, </Render/Sum>]
        }
        def RenderVar "Spec" {
            string sourceName = "C<R[GS]>.*[LO]"
            token sourceType = "lpe"
        }
        def RenderVar "Arnold" { string sourceName = "diffuse_indirect" }
        def RenderVar "Bad" { string sourceName = "unoccluded;C.*"; token sourceType = "lpe" }
        def RenderVar "Sum" { string sourceName = "lpe:C[LO]" }
    }
    """
    _, found = load(tmp_path, text)
    assert found.render.aovs == (
        "beauty", "lpe:Spec=C<R[GS]>.*[LO]", "lpe:diffuse_indirect=C<RD>.+[LO]", "emission",
    )  # fmt: skip
