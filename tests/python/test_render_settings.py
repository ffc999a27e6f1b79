# SPDX-License-Identifier: Apache-2.0
"""Tests UsdRender: settings, products and vars, and options that override them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from click.testing import CliRunner
from pxr import Sdf, Usd, UsdRender
from usd_recorder import load, said, write

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import read_layers, read_metadata
from wavecomb.usd.render_settings.reader import ProductSettings, aov_of, read_product_settings
from wavecomb.usd.stage.report import LoadReport

WORLD = """
def Camera "A" { float fStop = 2
    float focusDistance = 5
    double shutter:close = 0.5
    double3 xformOp:translate = (0, 0, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def Camera "B" { double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def Sphere "Ball" { double radius = 1 }
def Sphere "Proxy" { double radius = 1
    uniform token purpose = "proxy"
    double3 xformOp:translate = (2, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def DomeLight "Sky" { }
"""
PRODUCTS = """
rel products = [</Render/One>, </Render/Two>, </Render/Deep>] }
def RenderProduct "One" { token productName = "FOLDER/one.exr"
    rel orderedVars = [</Render/Ci>, </Render/z>, </Render/Odd>] }
def RenderProduct "Two" { token productName = "FOLDER/two.exr"
    rel camera = </B>
    uniform int2 resolution = (20, 10)
    uniform float4 dataWindowNDC = (0, 0.5, 0.5, 1) }
def RenderProduct "Deep" { token productType = "deepRaster" }
def RenderVar "Ci" { string sourceName = "Ci" }
def RenderVar "z" { string sourceName = "z" }
def RenderVar "Odd" { string sourceName = "curvature" }
"""


def stage_text(settings: str, *, folder: Path | str = "out") -> str:
    head = '#usda 1.0\n(renderSettingsPrimPath = "/Render/S")\n' + WORLD
    body = settings if "rel products" in settings else settings + "}"
    return head + f'def Scope "Render" {{ def RenderSettings "S" {{ {body} }}'.replace(
        "FOLDER", str(folder)
    )


def choices_of(
    tmp_path: Path, settings: str, **options
) -> tuple[list[ProductSettings], LoadReport]:
    report = LoadReport()
    stage = Usd.Stage.Open(str(write(tmp_path, stage_text(settings))))
    return read_product_settings(
        stage, options.get("wanted"), options.get("product"), report
    ), report


def run(*arguments) -> tuple[int, str]:
    result = CliRunner().invoke(main, [*map(str, arguments), "--isolate", "off"])
    assert "Traceback" not in result.output
    return result.exit_code, result.stderr


def test_products_over_settings(tmp_path):
    (one, two), report = choices_of(
        tmp_path,
        "uniform int2 resolution = (30, 20)\nrel camera = </A>\nuniform float pixelAspectRatio = 2"
        '\nuniform token aspectRatioConformPolicy = "cropAperture"' + PRODUCTS,
    )
    assert (one.camera, one.resolution, one.data_window) == ("/A", (30, 20), None)
    assert (two.camera, two.resolution, two.data_window) == ("/B", (20, 10), (0, 0.5, 0.5, 1))
    assert {(c.pixel_aspect, c.conform) for c in (one, two)} == {(2.0, "cropAperture")}
    assert one.aovs == ("beauty", "depth") and two.aovs is None
    lines = "\n".join(report.lines())
    assert "render product of type deepRaster: /Render/Deep" in lines
    assert "render var 'curvature': /Render/Odd" in lines


def test_what_is_no_good_is_named_and_left_out(tmp_path):
    (choice,), report = choices_of(
        tmp_path,
        "uniform int2 resolution = (0, 20)\nuniform float pixelAspectRatio = -1\n"
        "uniform float4 dataWindowNDC = (0.5, 0, 0.5, 1)\nrel camera = </Ball>\n"
        'uniform token aspectRatioConformPolicy = "squeeze"\n'
        'uniform token[] includedPurposes = ["default", "odd"]',
    )
    assert choice == ProductSettings(settings="/Render/S", purposes=("default",))
    lines = "\n".join(report.lines())
    for name in ("resolution", "pixelAspectRatio", "dataWindowNDC", "aspectRatioConformPolicy"):
        assert f"{name} of render settings is invalid: left out: /Render/S" in lines
    assert "render settings name /Ball, which is not a camera: /Render/S" in lines
    assert "no purpose 'odd'" in lines


@pytest.mark.parametrize(
    ("window", "region"),
    [
        ((0, 0, 1, 1), None),
        ((0, 0.5, 0.5, 1), (0, 0, 10, 5)),
        ((0.24, 0, 1, 0.26), (5, 7, 20, 10)),
        ((-1, -1, 2, 0.5), (0, 5, 20, 10)),
    ],
)
def test_data_windows(window, region):
    assert ProductSettings(data_window=window).region(20, 10) == region


def test_data_window_without_a_pixel():
    choice = ProductSettings("/Render/S", data_window=(0.01, 0, 0.02, 1))
    with pytest.raises(wavecomb.WavecombError, match="/Render/S: dataWindowNDC contains no pixel"):
        choice.region(20, 10)


@pytest.mark.parametrize(
    ("name", "kind", "aov"),
    [
        ("Ci", "raw", "beauty"), ("color", "raw", "beauty"), ("z", "raw", "depth"),
        ("N", "raw", "normal"), ("P", "raw", "position"), ("albedo", "raw", "albedo"),
        ("cryptomatte", "raw", "crypto"), ("crypto_asset", "raw", "crypto_asset"),
        ("st", "primvar", "uv"), ("primvars:st", "raw", "uv"), ("displayColor", "primvar", None),
        ("C.*", "lpe", "beauty"), ("C.*[LO]", "lpe", "beauty"), ("lpe:C.*[<L.>O]", "raw", "beauty"),
        ("C[<L.>O]", "lpe", "emission"), ("C<..>[<L.>O]", "lpe", "direct"),
        ("C . [LO]", "lpe", "direct"), ("C..+L", "lpe", "indirect"),
        ("C.*<L.'key'>", "lpe", "light_key"), ("C.<L.'key'>", "lpe", "lpe:V=C.<L.'key'>"),
        ("C<RD> L", "lpe", "lpe:V=C<RD>L"), ("C<RD", "lpe", None), ("a", "raw", "alpha"),
        ("diffuse_direct", "raw", "lpe:diffuse_direct=C<RD>[LO]"), ("", "raw", None),
    ],
)  # fmt: skip
def test_vars(name, kind, aov):
    stage = Usd.Stage.CreateInMemory()
    var = UsdRender.Var.Define(stage, "/V")
    var.GetSourceNameAttr().Set(name)
    var.GetSourceTypeAttr().Set(kind)
    assert aov_of(var) == aov


def test_loading_takes_what_settings_say_and_options_go_before(tmp_path):
    text = stage_text(
        'uniform token[] includedPurposes = ["default", "proxy"]\nrel camera = </A>\n'
        "uniform bool disableMotionBlur = 1\nuniform bool disableDepthOfField = 1\n"
        "uniform float pixelAspectRatio = 2"
    )
    scene, loaded = load(tmp_path, text, frame=1)
    assert loaded.camera_path == "/A" and loaded.shutter is None
    assert "lens_radius" not in scene.camera and scene.camera["pixel_aspect"] == 2
    assert len(scene.meshes) == 2
    scene, loaded = load(
        tmp_path, text, frame=1, purposes=("default",), camera="/A", depth_of_field=True,
        motion_blur=True,
    )  # fmt: skip
    assert loaded.shutter == (0.0, 0.5) and len(scene.meshes) == 1
    assert scene.camera["lens_radius"] == pytest.approx(50 / 10 / 4)
    assert load(tmp_path, text, frame=1, shutter=(0, 1))[1].shutter == (0, 1)


def test_material_purposes(tmp_path):
    bound = """def Material "M" { token outputs:surface.connect = </M/S.outputs:surface>
        def Shader "S" { uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = COLOUR
            token outputs:surface } }"""
    quad = """def Mesh "Q" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        point3f[] points = [(0,0,0), (1,0,0), (1,1,0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0,1,2]
        rel material:binding:full = </M>
        rel material:binding:preview = </P> }"""
    materials = bound.replace("COLOUR", "(1, 0, 0)")
    materials += bound.replace("COLOUR", "(0, 1, 0)").replace("/M", "/P").replace('"M"', '"P"')
    for purposes, path in ((None, "/M"), ('["preview", ""]', "/P"), ('[""]', "")):
        value = "" if purposes is None else f"uniform token[] materialBindingPurposes = {purposes}"
        _, loaded = load(tmp_path, stage_text(value) + materials + quad)
        assert {"/M", "/P"} & {*loaded.material_paths} == ({path} if path else set())


def test_which_settings(tmp_path):
    text = (
        WORLD
        + """def Scope "Render" { def RenderSettings "S" { rel camera = </B> }
        def RenderSettings "T" { rel camera = </A>
            uniform int2 resolution = (8, 8) } }"""
    )
    path = write(tmp_path, text)
    report = LoadReport()
    stage = Usd.Stage.Open(str(path))
    assert read_product_settings(stage, None, None, report) == [ProductSettings()]
    assert "several render settings" in "\n".join(report.lines())
    assert read_product_settings(stage, "T", None, report)[0].camera == "/A"
    assert read_product_settings(stage, "/Render/S", None, report)[0].camera == "/B"
    with pytest.raises(wavecomb.WavecombError, match="--render-settings U: no such prim"):
        read_product_settings(stage, "U", None, report)
    stage.RemovePrim(Sdf.Path("/Render/S"))
    assert read_product_settings(stage, None, None, report)[0].resolution == (8, 8)
    with pytest.raises(wavecomb.WavecombError, match="--product X: no such product"):
        read_product_settings(stage, None, "X", report)


def test_all_products_are_rendered_of_one_scene(tmp_path):
    """Each product equals a single render bit for bit."""
    settings = "uniform int2 resolution = (30, 20)\nrel camera = </A>" + PRODUCTS
    stage = write(tmp_path, stage_text(settings, folder=tmp_path))
    assert run("render", stage, "--spp", 2, "--output-dir", tmp_path) == (0, "")
    one, two = (read_layers(tmp_path / f"{name}.exr") for name in ("one", "two"))
    assert list(one) == ["beauty", "depth"] and one["beauty"].shape == (20, 30, 3)
    spec = oiio.ImageInput.open(str(tmp_path / "two.exr")).spec()
    assert (spec.x, spec.y, spec.width, spec.height) == (0, 0, 10, 5)
    assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, 20, 10)
    assert two["beauty"].shape == (5, 10, 3) and (two["beauty"] > 0).all()
    assert (two["samples"][:5, :10] == 2).all() and two["samples"].sum() == 100
    assert read_metadata(tmp_path / "two.exr")["wavecomb:camera"] == "/B"
    for name, whole in (("One", one), ("Two", two)):
        alone = tmp_path / f"alone{name}.exr"
        assert run("render", stage, "--spp", 2, "--product", name, "-o", alone) == (0, "")
        for layer, pixels in read_layers(alone).items():
            np.testing.assert_array_equal(pixels, whole[layer])


def test_options_go_before_settings(tmp_path):
    settings = "uniform int2 resolution = (30, 20)\nrel camera = </A>" + PRODUCTS
    stage = write(tmp_path, stage_text(settings, folder=tmp_path))
    out = tmp_path / "mine.exr"
    arguments = ("--product", "Two", "--size", 16, 8, "--region", 0, 0, 4, 4, "--camera", "/A")
    assert run("render", stage, "--spp", 1, "-o", out, *arguments, "--aov", "normal") == (0, "")
    layers = read_layers(out)
    assert list(layers) == ["beauty", "normal"] and layers["beauty"].shape == (8, 16, 3)
    assert (layers["beauty"][:4, :4] > 0).all() and not layers["beauty"][4:].any()
    assert read_metadata(out)["wavecomb:camera"] == "/A"
    assert not (tmp_path / "two.exr").exists()


def test_render_from_python_takes_the_first_product(tmp_path):
    settings = "uniform int2 resolution = (30, 20)\n" + PRODUCTS
    window = "uniform float4 dataWindowNDC = (0, 0, 0.5, 1)\nrel orderedVars"
    stage = write(tmp_path, stage_text(settings.replace("rel orderedVars", window, 1)))
    picture = wavecomb.render(stage, spp=1)
    assert picture.beauty.shape == (20, 15, 3) and picture.chosen == ("beauty", "depth")
    assert picture.samples.sum() == 300
    picture.save(tmp_path / "saved.exr")
    spec = oiio.ImageInput.open(str(tmp_path / "saved.exr")).spec()
    assert (spec.x, spec.width, spec.full_width) == (0, 15, 30)
    assert wavecomb.render(stage, spp=1, size=(8, 4), aovs=["uv"]).chosen == ("beauty", "uv")


@pytest.mark.parametrize(
    ("settings", "arguments", "words"),
    [
        ("", (), "-o is missing, and the stage has no render product"),
        (PRODUCTS.replace("one.exr", "one.jpg"), (), "/Render/One: productName out/one.jpg must"),
        (PRODUCTS, ("--png", "a.png"), "--png a.png: is of one picture and the stage has 2"),
        (PRODUCTS.replace("two.exr", "one.exr"), (), "productName out/one.exr is used by several"),
        ("uniform int2 resolution = (70000, 2)", ("-o", "a.exr"), "/Render/S: size 70000 x 2"),
        ("", ("-o", "a.exr", "--product", "X"), "--product X: no such product"),
        ("", ("-o", "a.exr", "--render-settings", "X"), "--render-settings X: no such prim"),
    ],
)
def test_errors_are_one_line(tmp_path, monkeypatch, settings, arguments, words):
    monkeypatch.chdir(tmp_path)
    stage = write(tmp_path, stage_text(settings).replace("FOLDER", "out"))
    code, stderr = run("render", stage, *arguments)
    assert code == 2
    assert stderr.startswith(f"error: {words}") and stderr.count("\n") == 1


def test_what_is_said_of_products_that_are_not_chosen(tmp_path):
    _, loaded = load(tmp_path, stage_text(PRODUCTS))
    assert "render product /Render/One is the first of 2" in said(loaded)
