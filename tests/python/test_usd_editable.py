# SPDX-License-Identifier: Apache-2.0
"""Tests open stages that are loaded repeatedly: editable attributes, and shared data."""

import os
import shutil

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd
from usd_recorder import QUAD, Recorder, write

import wavecomb
from wavecomb.image.files.image import write_png
from wavecomb.usd import load_stage, open_stage
from wavecomb.usd.materials.parameters import (
    as_stored,
    light_values,
    material_parameters,
    surface_values,
)
from wavecomb.usd.materials.surface import DEFAULTS
from wavecomb.usd.materialx.surfaces.inputs import definitions
from wavecomb.usd.materialx.surfaces.openpbr import MODELS, layers_of

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
    from wavecomb.usd.materials import pixels

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
    # An unauthored input has its default, and the path where an edit would be written.
    assert red["clearcoat_roughness"].value == 0.01
    assert red["ior"].attribute == Sdf.Path("/W/Red/S.inputs:ior")
    wood = material_parameters(stage.GetPrimAtPath("/W/Wood"), time)
    assert wood["base_color"].driven_by == "texture wood.png"
    assert wood["roughness"].attribute == Sdf.Path("/W/Wood.inputs:polish")
    assert material_parameters(stage.GetPrimAtPath("/W/Key"), time) == {}


MTLX = """def Material "X" {
    token outputs:mtlx:surface.connect = </X/S.outputs:out>
    def Shader "S" {
        uniform token info:id = "ND_%s_surfaceshader"
        %s
        token outputs:out
    }
}"""


def test_materialx_inputs_are_its_own(tmp_path):
    inputs = """float inputs:base = 0
        color3f inputs:base_color = (0.8, 0.4, 0.2)
        color3f inputs:opacity = (0.5, 0.5, 0.5)
        float inputs:coat.connect = </X/Grey.outputs:out>"""
    stage = open_stage(write(tmp_path, MTLX % ("standard_surface", inputs)))
    found = material_parameters(stage.GetPrimAtPath("/X"), Usd.TimeCode.Default())
    # With a weight of 0, the weighted colour keeps its authored value.
    assert found["base"].value == 0 and found["base_color"].value == pytest.approx((0.8, 0.4, 0.2))
    assert found["base_color"].attribute == Sdf.Path("/X/S.inputs:base_color")
    assert found["base_color"].definition.group == "Base"
    assert found["opacity"].value == 0.5 and found["opacity"].authored(0.25) == Gf.Vec3f(0.25)
    assert found["specular_IOR"].attribute == Sdf.Path("/X/S.inputs:specular_IOR")
    assert found["thin_walled"].value is False
    assert found["thin_walled"].type_name == Sdf.ValueTypeNames.Bool
    assert "roughness" not in found and "transmission_dispersion" not in found


def test_a_colour_in_a_space_of_its_own_has_a_value(tmp_path):
    inputs = 'color3f inputs:diffuseColor = (0.5, 0.5, 0.5) ( colorSpace = "srgb_texture" )'
    stage = open_stage(write(tmp_path, material("Red", inputs).replace("</W/", "</")))
    base = material_parameters(stage.GetPrimAtPath("/Red"), Usd.TimeCode.Default())["base_color"]
    assert "colour space" in base.reason and base.attribute is None
    assert base.value == pytest.approx((0.2140,) * 3, abs=1e-3)


class Defaults:
    """Stand-in for ``openpbr.Inputs`` that records the defaults that the loader uses."""

    def __init__(self):
        self.found = {}

    def number(self, name, default):
        self.found[name] = default
        return 1.0

    def colour(self, name, default):
        self.found[name] = default
        return (1.0, 1.0, 1.0)

    def ignored(self, *names):
        pass

    def approximated(self, what):
        pass


@pytest.mark.parametrize("model", sorted(MODELS))
def test_defaults_of_the_loader_are_materialx_s(model):
    inputs = Defaults()
    layers_of(model, inputs)
    known = definitions(model)
    inputs.found.pop("dielectric_priority", None)
    assert inputs.found.keys() <= known.keys()
    for name, default in inputs.found.items():
        assert known[name].default == pytest.approx(default), name
    for row in MODELS[model].textured.values():
        for name, default in ((row.input, row.default), row.weight):
            if name:
                assert definitions(model)[name].default == pytest.approx(default), name
    assert all(one.soft_low < one.soft_high <= one.high for one in definitions(model).values())
    groups = [one.group for one in definitions(model).values()]
    assert len(set(groups)) >= 6 and groups == sorted(groups, key=groups.index)


@pytest.mark.parametrize("model", sorted(MODELS))
def test_surface_values_are_what_the_loader_gives_the_core(tmp_path, model):
    """Tests each input with a value other than its default, one at a time and all together."""
    known, time = definitions(model), Usd.TimeCode.Default()

    def stage_of(values, file):
        lines = "\n".join(_authored(known[name], value) for name, value in values.items())
        text = (MTLX % (model, lines)).replace("/X", "/W/X")
        return write(tmp_path, 'def Xform "W" {' + text + mesh("X") + "}", file)

    plain = open_stage(stage_of({}, "plain.usda"))
    for names in [*([name] for name in known), list(known)]:
        values = {name: _other(known[name]) for name in names}
        path = stage_of(values, f"{names[0]}{len(names)}.usda")
        loaded, stage = load_stage(path, editable=True, builder_factory=Recorder), open_stage(path)
        (have,) = [m for m in loaded.scene.materials if m["name"] == "/W/X"]
        have = {**DEFAULTS, **have, **have["openpbr"]}
        by_stage = surface_values(stage.GetPrimAtPath("/W/X"), time)
        by_value = surface_values(plain.GetPrimAtPath("/W/X"), time, values)
        for key, value in by_stage.constants.items():
            assert have[key] == pytest.approx(value), (names, key)
            assert by_value.constants[key] == pytest.approx(value, rel=1e-6), (names, key)


def _other(definition):
    if definition.kind == "switch":
        return not definition.default
    if definition.kind == "colour":
        return (0.25, 0.5, 0.75)
    return 0.375 if definition.default != 0.375 else 0.5


def _authored(definition, value):
    kind = {"float": "float", "color3": "color3f", "boolean": "bool"}[definition.type_name]
    if definition.type_name == "color3" and not isinstance(value, tuple):
        value = (value, value, value)
    return f"{kind} inputs:{definition.name} = {value if kind != 'bool' else str(value).lower()}"


LAMPS = """
def RectLight "Rect" {
    float inputs:width = 3
    bool inputs:normalize = 1
    float inputs:diffuse = 2
}
def DiskLight "Disk" ( prepend apiSchemas = ["ShapingAPI"] ) {
    float inputs:radius = 0.2
    float inputs:shaping:focus = 3
    color3f inputs:shaping:focusTint = (0.1, 0.2, 0.3)
    float inputs:shaping:cone:angle = 40
    float inputs:shaping:cone:softness = 0.5
}
def SphereLight "Point" { bool treatAsPoint = 1 }
def CylinderLight "Tube" {
    float inputs:radius = 0
    float inputs:length = 2
}
def DistantLight "Sun" { float inputs:angle = 700 }
def DomeLight "Sky" { color3f inputs:color = (0.1, 0.2, 0.3) }
"""


def test_light_values_are_what_the_loader_reads(path, tmp_path):
    lamps = write(tmp_path, LAMPS, name="lamps.usda")
    for name, count in ((path, 2), (lamps, 6)):
        loaded, stage = load_stage(name, editable=True), open_stage(name)
        assert len(loaded.light_paths) == count
        for number, at in enumerate(loaded.light_paths):
            values = light_values(stage.GetPrimAtPath(at), Usd.TimeCode.Default())
            have = loaded.scene.light(number)
            assert {one: as_stored(value) for one, value in values.items()} == {
                one: as_stored(have[one]) for one in values
            }
    stage = open_stage(path)
    key = light_values(stage.GetPrimAtPath("/W/Key"), Usd.TimeCode.Default())
    assert key["color"] == (3, 3, 3) and key["width"] == 1
    assert light_values(stage.GetPrimAtPath("/W/Red"), Usd.TimeCode.Default()) is None


def test_the_report_lists_many_places(tmp_path):
    points = "".join(f'def GeometryLight "P{i}" {{ }}\n' for i in range(9))
    loaded = load_stage(write(tmp_path, points), builder_factory=Recorder)
    (finding,) = loaded.report.unsupported
    assert len(finding.all_places) == 9 and finding.places == ["/P0", "/P1", "/P2"]
    assert finding.line() == "GeometryLight: /P0, /P1, /P2 and 6 more"
