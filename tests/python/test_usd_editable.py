# SPDX-License-Identifier: Apache-2.0
"""Stages that are open and read again: what is known of them, and what is shared."""

import os
import shutil

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd
from usd_recorder import QUAD, Recorder, write

import wavecomb
from wavecomb.image import write_png
from wavecomb.usd import load_stage, open_stage
from wavecomb.usd.parameters import light_radiance, material_parameters

MATERIAL = """
def Material "%s" {
    token outputs:surface.connect = </W/%s/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        %s
        token outputs:surface
    }
    %s
}
"""
TEXTURE = """
def Shader "T" {
    uniform token info:id = "UsdUVTexture"
    asset inputs:file = @wood.png@
    float3 outputs:rgb
}
"""


def material(name, inputs, more=""):
    return MATERIAL % (name, name, inputs, more)


def mesh(name):
    bind = f"rel material:binding = </W/{name}>"
    schema = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    return f'def Mesh "M{name}" ( {schema} ) {{ {bind}\n{QUAD} }}'


@pytest.fixture
def path(tmp_path):
    rows = np.linspace(0.1, 0.9, 16, dtype=np.float32)
    write_png(tmp_path / "wood.png", np.broadcast_to(rows[:, None, None], (16, 16, 3)).copy())
    red = "color3f inputs:diffuseColor = (0.8, 0.1, 0.1)"
    wood = "color3f inputs:diffuseColor.connect = </W/Wood/T.outputs:rgb>"
    wood += "\nfloat inputs:roughness.connect = </W/Wood.inputs:polish>"
    text = (
        'def Xform "W" {'
        + material("Red", red)
        + material("Twin", red)
        + material("Wood", wood, TEXTURE + "float inputs:polish = 0.25")
        + mesh("Red")
        + mesh("Twin")
        + mesh("Wood")
        + 'def Mesh "Bare" {' + QUAD + "}"
        + 'def RectLight "Key" { float inputs:intensity = 3 }'
        + 'def SphereLight "Off" { token visibility = "invisible" }'
        + 'def DomeLight "Sky" { asset inputs:texture:file = @wood.png@ }'
        + "}"
    )  # fmt: skip
    return write(tmp_path, text)


def test_an_open_stage_is_read_like_its_file(path):
    stage = open_stage(path)
    before = stage.GetSessionLayer().ExportToString()
    from_file, from_stage = load_stage(path), load_stage(stage)
    assert from_file.scene.fingerprint() == from_stage.scene.fingerprint()
    assert from_stage.stage_path == path and from_stage.textures is None
    assert stage.GetSessionLayer().ExportToString() == before
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath("/W/MRed").SetActive(False)
    assert load_stage(stage).scene.mesh_count == from_file.scene.mesh_count - 1
    in_memory = Usd.Stage.CreateInMemory()
    in_memory.GetRootLayer().TransferContent(stage.GetRootLayer())
    assert load_stage(in_memory, builder_factory=Recorder).scene.meshes


def test_where_materials_and_lights_come_from(path):
    merged, apart = load_stage(path), load_stage(path, editable=True)
    assert merged.material_paths == ("/W/Red", "/W/Wood", "")
    assert apart.material_paths == ("/W/Red", "/W/Twin", "/W/Wood", "")
    assert [name for name, _ in apart.scene.materials][:3] == ["/W/Red", "/W/Twin", "/W/Wood"]
    assert apart.light_paths == ("/W/Key", "/W/Sky")
    assert apart.lights == ("/W/Key", "/W/Off", "/W/Sky") == merged.lights
    settings = {"size": (24, 24), "spp": 2}
    one, two = (wavecomb.render(loaded, **settings).beauty for loaded in (merged, apart))
    assert (one == two).all()


def test_materials_in_instances_are_named_by_the_instance(tmp_path):
    inside = (material("Red", "float inputs:roughness = 0.3") + mesh("Red")).replace("</W/", "</P/")
    text = """
    class "P" { INSIDE }
    def Xform "A" ( instanceable = true
        prepend inherits = </P> ) { }
    def Xform "B" ( instanceable = true
        prepend inherits = </P> ) { }
    """
    loaded = load_stage(write(tmp_path, text.replace("INSIDE", inside)), editable=True)
    assert loaded.material_paths[0] == "/A/Red"


def test_textures_are_shared_until_their_file_changes(path, tmp_path, monkeypatch):
    from wavecomb.usd import pixels

    read = []
    real = pixels._read_file
    monkeypatch.setattr(
        pixels, "_read_file", lambda name, *rest: read.append(name) or real(name, *rest)
    )
    first = load_stage(path, editable=True)
    count = len(read)
    again = load_stage(path, editable=True, reuse=first.textures)
    assert count > 0 and len(read) == count
    assert again.scene.fingerprint() == first.scene.fingerprint()
    assert again.report.counts == first.report.counts
    fingerprint = first.scene.fingerprint()
    del first
    third = load_stage(path, editable=True, reuse=again.textures)
    assert len(read) == count and third.scene.fingerprint() == fingerprint
    other = tmp_path / "other.png"
    write_png(other, np.full((16, 16, 3), 0.5, np.float32))
    shutil.copyfile(other, tmp_path / "wood.png")
    os.utime(tmp_path / "wood.png", ns=(1, 1))
    changed = load_stage(path, editable=True, reuse=third.textures)
    assert len(read) > count
    assert changed.scene.fingerprint()["textures"] != fingerprint["textures"]
    fresh = load_stage(path, editable=True)
    assert changed.scene.fingerprint() == fresh.scene.fingerprint()


def test_a_texture_that_is_not_there_is_refused():
    scene = wavecomb._core.SceneBuilder().build()
    with pytest.raises(wavecomb._core.Error, match="texture 3 is not in a scene of 0 textures"):
        wavecomb._core.SceneBuilder().share_texture(scene, 3)


def test_parameters_are_traced_to_attributes(path):
    stage = open_stage(path)
    time = Usd.TimeCode.Default()
    red = material_parameters(stage.GetPrimAtPath("/W/Red"), time)
    base = red["base_color"]
    assert base.attribute == Sdf.Path("/W/Red/S.inputs:diffuseColor")
    assert base.value == pytest.approx((0.8, 0.1, 0.1)) and base.authored(base.value) == Gf.Vec3f(
        *base.value
    )
    # Not authored: the default, and where it would be.
    assert red["clearcoat_roughness"].value == 0.01
    assert red["ior"].attribute == Sdf.Path("/W/Red/S.inputs:ior")
    wood = material_parameters(stage.GetPrimAtPath("/W/Wood"), time)
    assert wood["base_color"].driven_by == "texture wood.png"
    assert wood["roughness"].attribute == Sdf.Path("/W/Wood.inputs:polish")
    assert material_parameters(stage.GetPrimAtPath("/W/Key"), time) == {}


def test_materialx_weights_are_factors(tmp_path):
    text = """def Material "X" {
        token outputs:mtlx:surface.connect = </X/S.outputs:out>
        def Shader "S" {
            uniform token info:id = "ND_standard_surface_surfaceshader"
            float inputs:base = 0.5
            color3f inputs:base_color = (0.8, 0.4, 0.2)
            float inputs:emission = 0
            token outputs:out
        }
    }"""
    stage = open_stage(write(tmp_path, text))
    found = material_parameters(stage.GetPrimAtPath("/X"), Usd.TimeCode.Default())
    base = found["base_color"]
    assert base.value == pytest.approx((0.4, 0.2, 0.1)) and base.factor == 0.5
    assert tuple(base.authored((0.1, 0.2, 0.3))) == pytest.approx((0.2, 0.4, 0.6))
    assert "weight" in found["emission"].reason and found["emission"].attribute is None


def test_light_radiance_is_what_the_loader_reads(path):
    loaded = load_stage(path, editable=True)
    stage = open_stage(path)
    key = light_radiance(stage.GetPrimAtPath("/W/Key"), Usd.TimeCode.Default(), "Y")
    assert tuple(loaded.scene.light(0)["color"]) == key == (3, 3, 3)
    assert light_radiance(stage.GetPrimAtPath("/W/Red"), Usd.TimeCode.Default(), "Y") is None


def test_the_report_lists_many_places(tmp_path):
    points = "".join(f'def NurbsPatch "P{i}" {{ }}\n' for i in range(9))
    loaded = load_stage(write(tmp_path, points), builder_factory=Recorder)
    (finding,) = loaded.report.unsupported
    assert len(finding.all_places) == 9 and finding.places == ["/P0", "/P1", "/P2"]
    assert finding.line() == "NurbsPatch: /P0, /P1, /P2 and 6 more"
