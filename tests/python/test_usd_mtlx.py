# SPDX-License-Identifier: Apache-2.0
"""Tests MaterialX files in stages: composition, and messages about broken files."""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest
from parts import asset
from pxr import Sdf, Usd, UsdShade
from usd_recorder import Recorder

from wavecomb.image.files.image import write_png
from wavecomb.usd import LoadReport, load_stage, mtlx, open_stage
from wavecomb.usd.materialx.files import MAX_DEPTH, MtlxError
from wavecomb.usd.materialx.references import translate
from wavecomb.usd.stage.report import capture_diagnostics

GOLD = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <standard_surface name="SR" type="surfaceshader">
    <input name="base_color" type="color3" value="0.9, 0.7, 0.3"/>
    <input name="metalness" type="float" value="1"/>
  </standard_surface>
  <surfacematerial name="Gold" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR"/>
  </surfacematerial>
</materialx>"""

STAGE = """#usda 1.0
( subLayers = [@./sub.mtlx@] )
def "A" ( references = @./gold.mtlx@</MaterialX> ) {}
def "B" ( references = @gold.mtlx@ ) {}
def "C" ( payload = @./gold.mtlx@</MaterialX/Materials/Gold> ) {}
def "V" (
    variants = { string look = "none" }
    prepend variantSets = "look"
) {
    variantSet "look" = {
        "none" {}
        "gold" {
            def "M" ( references = @./more/red.mtlx@</MaterialX/Materials> ) {}
        }
    }
}
def "I" ( instanceable = true
    references = @./inner.usda@</Inner> ) {}
"""


def write(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


def value(stage: Usd.Stage, path: str, name: str) -> object:
    """Returns the value of an input of a material's surface shader."""
    shader = UsdShade.Material(stage.GetPrimAtPath(path)).ComputeSurfaceSource("mtlx")[0]
    assert shader, path
    found = UsdShade.Utils.GetValueProducingAttributes(shader.GetInput(name))
    return found[0].Get() if found else None


def said(stage: Usd.Stage) -> list[str]:
    report = LoadReport()
    mtlx.report_problems(stage, report)
    return [finding.line() for finding in report.warnings]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path, "gold.mtlx", GOLD)
    write(tmp_path, "sub.mtlx", GOLD.replace('"Gold"', '"Sub"'))
    write(tmp_path, "more/red.mtlx", GOLD.replace("0.9, 0.7, 0.3", "1 0 0"))
    write(
        tmp_path,
        "inner.usda",
        '#usda 1.0\ndef "Inner" {\n    def "M" ( references = @./gold.mtlx@</MaterialX> ) {}\n}\n',
    )
    write(tmp_path, "stage.usda", STAGE.replace("{}", "{\n}"))
    return tmp_path


def test_every_arc_composes(folder: Path) -> None:
    report = LoadReport()
    with capture_diagnostics(report):
        stage = open_stage(folder / "stage.usda")
    assert not report.warnings
    assert not said(stage)
    gold = (0.9, 0.7, 0.3)
    for path in ("/A/Materials/Gold", "/B/Materials/Gold", "/C", "/MaterialX/Materials/Sub"):
        assert value(stage, path, "base_color") == pytest.approx(gold), path
    inside = stage.GetPrimAtPath("/I").GetPrototype().GetPath()
    assert value(stage, f"{inside}/M/Materials/Gold", "base_color") == pytest.approx(gold)
    assert not stage.GetPrimAtPath("/V/M")


def test_variants_and_opinions_above(folder: Path) -> None:
    overrides = Sdf.Layer.CreateAnonymous("o.usda")
    overrides.ImportFromString(
        '#usda 1.0\nover "V" {\n over "M" {\n  over "Gold" {\n'
        "   float inputs:specular_roughness = 0.75\n  }\n }\n}\n"
    )
    stage = open_stage(folder / "stage.usda", {"/V{look}": "gold"}, overrides)
    assert value(stage, "/V/M/Gold", "base_color") == pytest.approx((1, 0, 0))
    assert value(stage, "/V/M/Gold", "specular_roughness") == 0.75


def test_variants_that_are_not_selected(folder: Path) -> None:
    """The window changes variants of a stage whose layers are locked."""
    stage = open_stage(folder / "stage.usda")
    mtlx.resolve(stage, everywhere=True)
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath("/V").GetVariantSet("look").SetVariantSelection("gold")
    assert value(stage, "/V/M/Gold", "base_color") == pytest.approx((1, 0, 0))


def test_files_stay_as_they_are(folder: Path) -> None:
    stage = open_stage(folder / "stage.usda")
    root = stage.GetRootLayer()
    assert not root.permissionToSave
    assert "gold.mtlx@" in (folder / "stage.usda").read_text(encoding="utf-8")


def test_reload_keeps_what_did_not_change(folder: Path) -> None:
    stage = open_stage(folder / "stage.usda")
    before = value(stage, "/A/Materials/Gold", "base_color")
    mtlx.reload(stage)
    assert value(stage, "/A/Materials/Gold", "base_color") == before
    assert value(open_stage(folder / "stage.usda"), "/A/Materials/Gold", "base_color") == before


def test_reload_reads_what_changed(folder: Path) -> None:
    stage = open_stage(folder / "stage.usda")
    write(folder, "gold.mtlx", GOLD.replace("0.9, 0.7, 0.3", "0.25, 0.5, 0.125"))
    mtlx.reload(stage)
    assert value(stage, "/A/Materials/Gold", "base_color") == pytest.approx((0.25, 0.5, 0.125))
    write(folder, "gold.mtlx", "<materialx")
    mtlx.reload(stage)
    assert not stage.GetPrimAtPath("/A/Materials")
    assert any("gold.mtlx cannot be read (it is not XML" in line for line in said(stage))


def test_missing_and_broken_files_are_named(tmp_path: Path) -> None:
    write(tmp_path, "bad.mtlx", "<?xml version='1.0'?><html/>")
    file = write(
        tmp_path,
        "s.usda",
        '#usda 1.0\ndef "A" ( references = @./no.mtlx@</MaterialX> ) {\n}\n'
        'def "B" ( references = @./bad.mtlx@</MaterialX> ) {\n}\n',
    )
    report = LoadReport()
    with capture_diagnostics(report):
        stage = open_stage(file)
    mtlx.report_problems(stage, report)
    lines = sorted(finding.line() for finding in report.warnings)
    assert len(lines) == 2
    assert "bad.mtlx cannot be read (it is <html>, not <materialx>): /B" in lines[0]
    assert "no.mtlx cannot be read (there is no such file): /A" in lines[1]


def test_a_stage_that_is_open_is_not_changed(folder: Path) -> None:
    report = LoadReport()
    with capture_diagnostics(report):
        stage = Usd.Stage.Open(str(folder / "inner.usda"))
    assert len(said(stage)) == 1
    assert "give Wavecomb its file instead" in said(stage)[0]
    assert not stage.GetRootLayer().dirty


def test_inside_of_a_package(tmp_path: Path) -> None:
    text = GOLD.replace(
        '"color3" value="0.9, 0.7, 0.3"/>', '"color3" nodegraph="NG" output="o"/>'
    ).replace(
        "<standard_surface",
        '<nodegraph name="NG"><image name="i" type="color3">'
        '<input name="file" type="filename" value="t/c.png" colorspace="srgb_texture"/></image>'
        '<output name="o" type="color3" nodename="i"/></nodegraph><standard_surface',
        1,
    )
    write(tmp_path, "gold.mtlx", text)
    write(tmp_path, "r.usda", '#usda 1.0\ndef "A" ( references = @./gold.mtlx@ ) {\n}\n')
    (tmp_path / "t").mkdir()
    write_png(str(tmp_path / "t" / "c.png"), np.ones((2, 2, 3), np.float32))
    with Sdf.ZipFileWriter.CreateNew(str(tmp_path / "p.usdz")) as package:
        for name in ("r.usda", "gold.mtlx", "t/c.png"):
            package.AddFile(str(tmp_path / name), name)
    stage = open_stage(tmp_path / "p.usdz")
    node = UsdShade.Shader(stage.GetPrimAtPath("/A/Materials/Gold/NG/i"))
    image = node.GetInput("file")
    assert image.Get().resolvedPath == f"{tmp_path}/p.usdz[t/c.png]"
    assert image.GetAttr().GetColorSpace() == "srgb_texture"


GRAPH = """<?xml version="1.0"?>
<materialx version="1.39" xmlns:xi="http://www.w3.org/2001/XInclude" fileprefix="tex/">
  <xi:include href="lib/defs.mtlx"/>
  <nodegraph name="NG">
    <input name="amount" type="float" value="0.5"/>
    <image name="img" type="color3">
      <input name="file" type="filename" value="a.png" colorspace="acescg"/>
    </image>
    <multiply name="mul" type="color3">
      <input name="in1" type="color3" nodename="img"/>
      <input name="in2" type="float" interfacename="amount"/>
    </multiply>
    <separate3 name="sep" type="multioutput"><input name="in" type="color3" nodename="mul"/>
    </separate3>
    <output name="c" type="color3" nodename="mul"/>
    <output name="g" type="float" nodename="sep" output="outg"/>
  </nodegraph>
  <constant name="loose" type="color3"><input name="value" type="color3" value="0,0,1"/></constant>
  <twice name="custom" type="color3"><input name="in" type="color3" nodename="loose"/></twice>
  <open_pbr_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG" output="c"/>
    <input name="specular_roughness" type="float" nodegraph="NG" output="g"/>
    <input name="emission_color" type="color3" nodename="custom"/>
    <input name="coat_weight" type="float" value="much"/>
    <input name="coat_color" type="color3" nodename="nowhere"/>
  </open_pbr_surface>
  <surfacematerial name="ns:M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S"/>
  </surfacematerial>
</materialx>"""

DEFS = """<?xml version="1.0"?>
<materialx version="1.39">
  <nodedef name="ND_twice" node="twice">
    <input name="in" type="color3" value="0.5, 0.5, 0.5"/><output name="out" type="color3"/>
  </nodedef>
  <nodegraph name="NG_twice" nodedef="ND_twice">
    <add name="sum" type="color3">
      <input name="in1" type="color3" interfacename="in"/>
      <input name="in2" type="color3" interfacename="in"/>
    </add>
    <output name="out" type="color3" nodename="sum"/>
  </nodegraph>
</materialx>"""


def test_graphs_and_includes(tmp_path: Path) -> None:
    write(tmp_path, "lib/defs.mtlx", DEFS)
    layer, report = translate(str(write(tmp_path, "g.mtlx", GRAPH)))
    stage = Usd.Stage.Open(layer)
    top = "/MaterialX/Materials/ns__M"
    shader, name, _ = UsdShade.Material(stage.GetPrimAtPath(top)).ComputeSurfaceSource("mtlx")
    assert (name, shader.GetShaderId()) == ("surface", "ND_open_pbr_surface_surfaceshader")

    def source(prim: str, name: str) -> str:
        attributes = UsdShade.Utils.GetValueProducingAttributes(
            UsdShade.Shader(stage.GetPrimAtPath(prim)).GetInput(name)
        )
        return str(attributes[0].GetPath())

    assert source(f"{top}/S", "base_color") == f"{top}/NG/mul.outputs:out"
    assert source(f"{top}/S", "specular_roughness") == f"{top}/NG/sep.outputs:outg"
    assert source(f"{top}/NG/mul", "in2") == f"{top}/NG.inputs:amount"
    assert source(f"{top}/S", "emission_color") == f"{top}/NodeGraphs/custom/sum.outputs:out"
    assert source(f"{top}/NodeGraphs/custom/sum", "in1") == f"{top}/NodeGraphs/loose.outputs:out"
    # A node definition of the document becomes the graph that implements it.
    assert stage.GetPrimAtPath("/MaterialX/NodeGraphs/ND_twice").GetTypeName() == "NodeGraph"
    image = UsdShade.Shader(stage.GetPrimAtPath(f"{top}/NG/img"))
    assert image.GetShaderId() == "ND_image_color3"
    assert image.GetInput("file").Get().path == f"{tmp_path}/tex/a.png"
    assert image.GetInput("file").GetAttr().GetColorSpace() == "acescg"
    assert sorted(finding.what for finding in report.warnings) == [
        "MaterialX connection has no target (left out)",
        "MaterialX value 'much' is no float (left out)",
    ]


LOOKS = """
  <collection name="c_all" includegeom="/a, /b" excludegeom="/b/x" geomprefix="/world"/>
  <variantset name="vs"><variant name="dull">
    <input name="specular_roughness" type="float" value="0.875"/></variant></variantset>
  <look name="plain">
    <materialassign name="ma" material="Gold" collection="c_all">
      <variantassign name="va" variantset="vs" variant="dull"/></materialassign>
    <materialassign name="mb" material="Gold" geom="/c"/>
    <materialassign name="mc" material="None" geom="/c, /d*"/>
  </look>
  <look name="more" inherit="plain"><materialassign name="md" material="Gold"/></look>
</materialx>"""


def test_looks(tmp_path: Path) -> None:
    file = write(tmp_path, "l.mtlx", GOLD.replace("</materialx>", LOOKS))
    write(
        tmp_path,
        "s.usda",
        '#usda 1.0\ndef "M" (\n references = @./l.mtlx@</ModelRoot>\n'
        ' variants = { string LookVariant = "more" }\n) {\n'
        ' def "world" {\n  def Sphere "a" {\n  }\n }\n}\n',
    )
    layer, report = translate(str(file))
    stage = Usd.Stage.Open(layer)
    collection = Usd.CollectionAPI(stage.GetPrimAtPath("/MaterialX/Collections"), "c_all")
    at = "/MaterialX/Collections/world"
    assert collection.GetIncludesRel().GetTargets() == [Sdf.Path(f"{at}/a"), Sdf.Path(f"{at}/b")]
    assert collection.GetExcludesRel().GetTargets() == [Sdf.Path(f"{at}/b/x")]
    assert value(stage, "/MaterialX/Looks/plain/Materials/ma", "specular_roughness") == 0.875
    assert value(stage, "/MaterialX/Looks/plain/Materials/mb", "specular_roughness") is None
    assert sorted(finding.what for finding in report.warnings) == [
        "MaterialX geometry /d* is no path of a prim (left out)",
        "MaterialX material None does not exist (not assigned)",
    ]
    stage = open_stage(tmp_path / "s.usda")
    bound, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/M/world/a")).ComputeBoundMaterial()
    assert bound.GetPath() == "/M/Materials/ma"
    bound, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/M")).ComputeBoundMaterial()
    assert bound.GetPath() == "/M/Materials/md"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "not XML"),
        (
            "<materialx>" + "<a>" * MAX_DEPTH + "</a>" * MAX_DEPTH + "</materialx>",
            "elements are nested",
        ),
        ('<!DOCTYPE x [<!ENTITY a "b">]><materialx/>', "entities"),
        (
            '<materialx xmlns:xi="http://www.w3.org/2001/XInclude">'
            '<xi:include href="f.mtlx"/></materialx>',
            "which includes it",
        ),
        (
            '<materialx xmlns:xi="http://www.w3.org/2001/XInclude">'
            '<xi:include href="none.mtlx"/></materialx>',
            "which does not exist",
        ),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(MtlxError, match=why):
        translate(str(write(tmp_path, "f.mtlx", text)))


def test_damaged_files_never_crash(tmp_path: Path) -> None:
    write(tmp_path, "lib/defs.mtlx", DEFS)
    chance = random.Random(4)
    read = 0
    for text in (GOLD, GRAPH):
        words = re.split(r"(\W+)", text)
        for _ in range(60):
            new = list(words)
            for _ in range(chance.randint(1, 4)):
                new[chance.randrange(len(new))] = chance.choice([*words, "NG", "\0", "1e999", "S"])
            file = write(tmp_path, "f.mtlx", "".join(new))
            try:
                translate(str(file))
                read += 1
            except MtlxError:
                pass
    assert read > 10


@pytest.mark.parametrize("name", ["basic", "basicTextured"])
def test_as_openusd_reads_it(name: str) -> None:
    """Materials have the same interfaces, graphs and values as with OpenUSD's plug-in."""
    folder = "usd/wg_test_assets/MaterialXTest"
    ours = open_stage(asset(f"{folder}/{name}.usda"))
    theirs = Usd.Stage.Open(str(asset(f"{folder}/{name}_flatten.usda")))
    compared = 0
    for scope in ("Materials", "NodeGraphs"):
        top = theirs.GetPrimAtPath(f"/MaterialX/{scope}")
        for prim in Usd.PrimRange(top) if top else ():
            if prim.GetName().startswith("ND_"):
                continue
            for attribute in prim.GetAttributes():
                other = ours.GetAttributeAtPath(attribute.GetPath())
                assert other and other.GetTypeName() == attribute.GetTypeName(), attribute
                assert other.GetColorSpace() == attribute.GetColorSpace()
                mine, wanted = other.Get(), attribute.Get()
                if isinstance(wanted, Sdf.AssetPath):
                    mine, wanted = Path(mine.path).name, Path(wanted.path).name
                assert mine == wanted, attribute
                compared += 1
    assert compared > 10


def test_materialx_counts_before_the_preview(tmp_path: Path) -> None:
    """MaterialX takes precedence over UsdPreviewSurface, without a message about unused inputs."""
    write(tmp_path, "gold.mtlx", GOLD)
    file = write(
        tmp_path,
        "s.usda",
        """#usda 1.0
def Material "M" (
    references = @./gold.mtlx@</MaterialX/Materials/Gold>
) {
    token outputs:surface.connect = </M/P.outputs:surface>
    def Shader "P" {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
def Sphere "S" (
    prepend apiSchemas = ["MaterialBindingAPI"]
) {
    rel material:binding = </M>
}
""",
    )
    recorder = Recorder()
    loaded = load_stage(file, builder_factory=lambda: recorder)
    assert [material["program"] for material in recorder.materials] == ["openpbr"]
    assert not loaded.report.unsupported
