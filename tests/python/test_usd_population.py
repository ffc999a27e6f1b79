# SPDX-License-Identifier: Apache-2.0
"""Tests the population of stages: masks, session layers, purposes, payloads, inactive prims."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from usd_recorder import QUAD, Recorder, load, write

from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.usd import load_stage

BIND = '(prepend apiSchemas = ["MaterialBindingAPI"])'

STAGE = f"""
def Xform "World" {{
    def Xform "Car" {{
        double3 xformOp:translate = (5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Mesh "Door" {BIND} {{ {QUAD}
            rel material:binding = </Looks/Red> }}
        def Mesh "Wheel" {{ {QUAD} }} }}
    def Mesh "House" {{ {QUAD} }}
    def PointInstancer "Trees" {{
        rel prototypes = </Protos/Tree>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0,0,0), (9,0,0)] }} }}
def Scope "Looks" {{
    def Material "Red" {{ token outputs:surface.connect = </Shaders/S.outputs:surface> }}
    def Material "Blue" {{ }} }}
def Scope "Shaders" {{
    def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        token outputs:surface }} }}
def Scope "Protos" {{ over "Tree" {{ def Mesh "Crown" {{ {QUAD} }} }} }}
def Scope "Rig" {{
    def SphereLight "Key" {{ }}
    def Camera "Shot" {{ }}
    def Mesh "Marker" {{ {QUAD} }} }}
"""


def drawn(scene):
    """Returns the names of the visible meshes, once per instance."""
    return sorted(mesh["name"].rsplit("/", 1)[1] for mesh, _, _ in scene.world_meshes())


@pytest.mark.parametrize(
    ("mask", "names"),
    [
        ([], ["Crown", "Crown", "Door", "House", "Marker", "Wheel"]),
        (["/World/Car"], ["Door", "Wheel"]),
        (["/World/Car/Door"], ["Door"]),
        (["/World/Car/Wheel", "/World/House"], ["House", "Wheel"]),
        (["/World/Trees"], ["Crown", "Crown"]),
        (["/World"], ["Crown", "Crown", "Door", "House", "Wheel"]),
        (["/"], ["Crown", "Crown", "Door", "House", "Marker", "Wheel"]),
        (["/World/*"], ["Crown", "Crown", "Door", "House", "Wheel"]),
        (["/World/[CH]*"], ["Door", "House", "Wheel"]),
        (["/*/Car/W????"], ["Wheel"]),
        (["//Door"], ["Door"]),
        (["/World//[!A-C]oo[r]"], ["Door"]),
        (["/World//*e*"], ["Crown", "Crown", "House", "Wheel"]),
    ],
)
def test_a_mask_leaves_what_it_names(tmp_path, mask, names):
    scene, loaded = load(tmp_path, STAGE, mask=mask)
    assert drawn(scene) == names
    assert loaded.cameras == ("/Rig/Shot",) and loaded.camera_path == "/Rig/Shot"
    assert loaded.lights == ("/Rig/Key",) and len(scene.lights) == 1
    if "Door" in names:
        assert scene.material_of("Door")["base_color"] == (1, 0, 0)
        ((_, matrix, _),) = [m for m in scene.world_meshes() if m[0]["name"].endswith("Door")]
        low = scene.mesh("Door")["positions"].min(axis=0) + matrix[3, :3]
        assert np.allclose(low, (5, 0, 0))
    assert not loaded.report.warnings


@pytest.mark.parametrize(
    ("mask", "says"),
    [
        ("/Nowhere", "has no such prim"),
        ("World", "absolute path"),
        ("/World.x", "absolute path"),
        ("/World/No*", "has no such prim"),
        ("Wor*", "pattern of absolute paths"),
        ("//[z-a]oor", "has no such prim"),
        ("/World/[z-a]ar", "has no such prim"),
        ("/World/[", "pattern of absolute paths"),
    ],
)
def test_bad_masks_are_named(tmp_path, mask, says):
    with pytest.raises(WavecombError, match=says):
        load(tmp_path, STAGE, mask=[mask])


def test_a_mask_into_an_instance_keeps_the_instance(tmp_path):
    text = f"""class "P" {{ def Mesh "A" {{ {QUAD} }} def Mesh "B" {{ {QUAD} }} }}
    def Xform "I" (references = </P>
     instanceable = true) {{ }}
    def Xform "J" (references = </P>
     instanceable = true) {{ }}"""
    scene, _ = load(tmp_path, text, mask=["/I/A"])
    assert drawn(scene) == ["A", "B"]


def test_a_collection_binding_asks_for_its_material_only(tmp_path):
    text = f"""def Xform "World" (
        prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:all"]) {{
        uniform token collection:all:expansionRule = "expandPrims"
        rel collection:all:includes = </World>
        rel material:binding:collection:all = [</World.collection:all>, </Look>]
        def Mesh "A" {{ {QUAD} }}
        def Mesh "B" {{ {QUAD} }} }}
    def Material "Look" {{ token outputs:surface.connect = </Look/S.outputs:surface>
        def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 1, 0)
            token outputs:surface }} }}"""
    scene, _ = load(tmp_path, text, mask=["/World/A"])
    assert drawn(scene) == ["A"]
    assert scene.material_of("A")["base_color"] == (0, 1, 0)


def test_session_layers_are_stronger_and_variants_stronger_still(tmp_path):
    stage = write(
        tmp_path,
        f"""#usda 1.0
(defaultPrim = "M")
def Mesh "M" ( variants = {{ string c = "one" }}
    prepend variantSets = "c" ) {{ {QUAD}
    variantSet "c" = {{
        "one" {{ color3f[] primvars:displayColor = [(1, 0, 0)] }}
        "two" {{ color3f[] primvars:displayColor = [(0, 1, 0)] }}
        "three" {{ color3f[] primvars:displayColor = [(0, 0, 1)] }} }} }}
""",
    )
    session = write(tmp_path, 'over "M" ( variants = { string c = "two" } ) { }', "session.usda")

    def colour(**options):
        loaded = load_stage(stage, builder_factory=Recorder, **options)
        return loaded.scene.material_of("M")["base_color"]

    assert colour() == (1, 0, 0)
    assert colour(session_layer=session) == (0, 1, 0)
    assert colour(session_layer=session, variants={"c": "three"}) == (0, 0, 1)
    with pytest.raises(WavecombError, match=r"gone\.usda: no such file"):
        colour(session_layer=tmp_path / "gone.usda")
    broken = tmp_path / "broken.usda"
    broken.write_text("#usda 1.0\ndef {")
    with pytest.raises(WavecombError, match=r"broken\.usda: cannot be read"):
        colour(session_layer=broken)


def test_the_command_takes_masks_and_session_layers(tmp_path):
    stage = write(tmp_path, STAGE)
    hides = write(tmp_path, 'over "World" { over "Car" (active = false) { } }', "session.usda")

    def count(*options):
        done = CliRunner().invoke(main, ["info", str(stage), "--json", *map(str, options)])
        assert done.exit_code == 0, done.output
        return json.loads(done.stdout)["meshes"]

    assert count("--mask", "/World/Car") == 2
    assert count("--mask", "/World/Car/Door", "--mask", "/World/House") == 2
    assert count("--mask", "/World/*ar/*") == 2
    assert count("--session-layer", hides) == 3
    assert count("--payloads", "none") == 5
    bad = CliRunner().invoke(main, ["info", str(stage), "--mask", "/X"])
    assert bad.exit_code == 2 and bad.output.startswith("error: mask /X")


def test_what_is_drawn_at_all(tmp_path):
    """Payloads are drawn; inactive, abstract and undefined prims and other purposes are not."""
    (tmp_path / "load.usda").write_text(
        f'#usda 1.0\n(defaultPrim = "P")\ndef Xform "P" {{\n def Mesh "Paid" {{ {QUAD} }}\n}}\n'
    )
    text = f"""
    def "Load" (payload = @./load.usda@) {{ }}
    def Mesh "Off" (active = false) {{ {QUAD} }}
    over "Over" {{ def Mesh "Undefined" {{ {QUAD} }} }}
    class Mesh "Class" {{ {QUAD} }}
    def Xform "Kinds" (kind = "group") {{ def Mesh "Sub" (kind = "subcomponent") {{ {QUAD} }} }}
    def Mesh "Proxy" {{ {QUAD}
        uniform token purpose = "proxy" }}
    def Mesh "Render" {{ {QUAD}
        uniform token purpose = "render" }}
    def Xform "Guides" {{ uniform token purpose = "guide"
        def Mesh "Guide" {{ {QUAD} }}
        def Mesh "Plain" {{ {QUAD}
            uniform token purpose = "default" }} }}
    def Xform "I" (references = </Protos>
        instanceable = true) {{ }}
    def Xform "J" (references = </Protos>
        instanceable = true
        active = false) {{ }}
    class "Protos" {{ def Mesh "Once" {{ {QUAD} }} }}"""
    assert drawn(load(tmp_path, text)[0]) == ["Once", "Paid", "Plain", "Render", "Sub"]
    shown = drawn(load(tmp_path, text, purposes=["default", "proxy", "guide"])[0])
    assert shown == ["Guide", "Once", "Paid", "Plain", "Proxy", "Sub"]


SET = f"""#usda 1.0
(defaultPrim = "Set")
def Xform "Set" {{
    def "Chair" (payload = @./piece.usda@) {{ }}
    def "Table" (payload = @./piece.usda@) {{ }}
    def Mesh "Floor" {{ {QUAD} }}
}}
"""
PIECE = f"""#usda 1.0
(defaultPrim = "P")
def Xform "P" {{
    def Mesh "Wood" {{ {QUAD} }}
    def "Nails" (payload = @./nails.usda@) {{ }}
}}
"""
NAILS = f'#usda 1.0\n(defaultPrim = "N")\ndef Xform "N" {{\n def Mesh "Nail" {{ {QUAD} }}\n}}\n'


@pytest.mark.parametrize(
    ("payloads", "names", "left"),
    [
        ([], ["Floor", "Nail", "Nail", "Wood", "Wood"], 0),
        (["none"], [], 1),
        (["/World"], ["Floor", "Nail", "Nail", "Wood", "Wood"], 0),
        (["/World/Chair"], ["Floor", "Nail", "Wood"], 1),
        (["/World/*able"], ["Floor", "Nail", "Wood"], 1),
        (["/*/Chair/Nails", "/World/Table"], ["Floor", "Nail", "Nail", "Wood", "Wood"], 0),
    ],
)
def test_payloads_are_loaded_by_patterns(tmp_path, payloads, names, left):
    for name, text in (("set", SET), ("piece", PIECE), ("nails", NAILS)):
        (tmp_path / f"{name}.usda").write_text(text)
    scene, loaded = load(tmp_path, 'def "World" (payload = @./set.usda@) { }', payloads=payloads)
    assert drawn(scene) == names
    assert len([n for n in loaded.report.notes if n.what == "payloads that are not loaded"]) == left


@pytest.mark.parametrize(
    ("payloads", "says"),
    [
        (["/World/Sofa"], "has no such payload"),
        (["none", "/World"], "cannot be combined with a pattern"),
        (["World"], "absolute path"),
    ],
)  # fmt: skip
def test_bad_payloads_are_named(tmp_path, payloads, says):
    (tmp_path / "set.usda").write_text(
        f'#usda 1.0\ndef Xform "S" {{\n def Mesh "F" {{ {QUAD} }}\n}}'
    )
    with pytest.raises(WavecombError, match=says):
        load(tmp_path, 'def "World" (payload = @./set.usda@</S>) { }', payloads=payloads)


@pytest.mark.parametrize("units", [0.01, 1.0])
def test_units_change_nothing(tmp_path: Path, units):
    """All lengths are in stage units, so metersPerUnit has no effect."""
    text = f"""#usda 1.0
(metersPerUnit = {units})
def Mesh "M" {{ {QUAD} }}
def Camera "C" {{ float fStop = 2
 float focusDistance = 3 }}
def SphereLight "L" {{ float inputs:intensity = 7 }}
"""
    scene, _ = load(tmp_path, text)
    assert scene.mesh("M")["positions"].max() == 1
    assert np.isclose(scene.camera["lens_radius"], 0.1 * 50 / 4)
    assert scene.lights[0]["color"] == (7, 7, 7)
