# SPDX-License-Identifier: Apache-2.0
"""Tests materials in instances that read primvars of the instances and of their meshes."""

import numpy as np
import pytest
from test_usd_instancing import instance
from usd_recorder import INHERIT, QUAD, load, said

BIND = '(prepend apiSchemas = ["MaterialBindingAPI"])'


def reading(name, path=None):
    """Returns a material whose roughness is the primvar ``wear``."""
    path = path or f"/{name}"
    return f"""def Material "{name}" {{
        token outputs:surface.connect = <{path}/S.outputs:surface>
        def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
            float inputs:roughness.connect = <{path}/R.outputs:result>
            token outputs:surface
        }}
        def Shader "R" {{ uniform token info:id = "UsdPrimvarReader_float"
            string inputs:varname = "wear"
            float inputs:fallback = 0.875
            float outputs:result
        }}
    }}
    """


PROTO = f"""class "P" {{
    def Mesh "M" {BIND} {{ {QUAD}
        rel material:binding = </P/Own>
    }}
    {reading("Own", "/P/Own")}
}}
"""


def wear(value, kind="constant"):
    return f'float[] primvars:wear = {value} (interpolation = "{kind}")'


def roughness(scene):
    """Returns the roughness of the visible meshes, sorted by x of their first points."""
    out = {}
    for mesh, matrix, material in scene.world_meshes():
        x = float((np.append(mesh["positions"][0], 1) @ matrix)[0])
        out[x] = scene.materials[material]["roughness"] if material != INHERIT else None
    return out


def test_native_instances_bring_constant_primvars(tmp_path):
    text = PROTO + "".join(
        instance(f"I{k}", 10 * k, wear(f"[{value}]"))
        for k, value in enumerate((0.25, 0.5, 0.25, 0.5))
    )
    text += instance("Bare", 40)
    text += f'def Xform "Up" {{ {wear("[0.75]")}\n {instance("I", 50)} }}'
    scene, _ = load(tmp_path, text)
    assert roughness(scene) == {0: 0.25, 10: 0.5, 20: 0.25, 30: 0.5, 40: 0.875, 50: 0.75}
    # Instances with equal values share a group.
    assert len(scene.meshes) == 4


def test_what_nobody_reads_parts_no_prototype(tmp_path):
    text = PROTO.replace('"wear"', '"other"') + instance("I", 0, wear("[0.2]"))
    scene, _ = load(tmp_path, text + instance("J", 10, wear("[0.3]")) + instance("K", 20))
    assert len(scene.meshes) == 1


def test_a_mesh_s_own_primvar_goes_first(tmp_path):
    proto = PROTO.replace("rel material:binding", wear("[0.125]") + "\n rel material:binding")
    text = proto + instance("I", 0, wear("[0.2]")) + instance("J", 10, wear("[0.3]"))
    scene, _ = load(tmp_path, text)
    assert roughness(scene) == {0: 0.125, 10: 0.125}


def test_a_material_on_the_instance_reads_the_meshes_inside(tmp_path):
    proto = f"""class "P" {{
        def Mesh "A" {{ {QUAD}\n {wear("[0.25]")}\n }}
        def Mesh "B" {{ {QUAD}\n {wear("[0.1, 0.2, 0.3, 0.4]", "vertex")}\n }}
    }}"""
    api = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    text = reading("Look") + proto
    for name, x in (("I", 0), ("J", 10)):
        text += instance(name, x, "rel material:binding = </Look>", api)
    scene, _ = load(tmp_path, text)
    constant, varying = scene.mesh("A"), scene.mesh("B")
    assert scene.materials[constant["material"]]["roughness"] == 0.25
    assert set(varying["attributes"]) == {"wear"}
    assert len(scene.meshes) == 2


def test_a_stronger_material_on_the_instance_reads_them_too(tmp_path):
    api = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    strong = 'rel material:binding = </Look> (bindMaterialAs = "strongerThanDescendants")'
    proto = PROTO.replace("rel material:binding", wear("[0.125]") + "\n rel material:binding")
    text = reading("Look").replace("0.875", "0.75") + proto
    text += instance("I", 0, strong, api) + instance("J", 10, strong, api)
    scene, _ = load(tmp_path, text)
    assert roughness(scene) == {0: 0.125, 10: 0.125} and len(scene.meshes) == 1


@pytest.mark.parametrize("kind", ["vertex", "varying", "uniform"])
def test_point_instances_bring_theirs(tmp_path, kind):
    text = f"""def PointInstancer "I" {{
        rel prototypes = [</I/P>]
        int[] protoIndices = [0, 0, 0, 0]
        point3f[] positions = [(0,0,0), (10,0,0), (20,0,0), (30,0,0)]
        {wear("[0.25, 0.5, 0.5, 0.25]", kind)}
        {PROTO.replace("/P/", "/I/P/").replace("class", "def Xform")}
    }}"""
    scene, loaded = load(tmp_path, text)
    assert roughness(scene) == {0: 0.25, 10: 0.5, 20: 0.5, 30: 0.25}
    assert len(scene.meshes) == 2 and "wear" not in said(loaded)


def test_an_instancer_s_constant_primvar_is_all_of_theirs(tmp_path):
    text = f"""def PointInstancer "I" {{
        rel prototypes = [</I/P>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0,0,0), (10,0,0)]
        {wear("[0.5]")}
        {PROTO.replace("/P/", "/I/P/").replace("class", "def Xform")}
    }}"""
    scene, _ = load(tmp_path, text)
    assert roughness(scene) == {0: 0.5, 10: 0.5} and len(scene.meshes) == 1


def test_nested_instances_hand_primvars_down(tmp_path):
    text = PROTO + 'class "Q" {' + instance("A", 1) + instance("B", 2, wear("[0.125]")) + "}"
    text += instance("I", 10, wear("[0.25]"), target="/Q") + instance("J", 20, target="/Q")
    scene, _ = load(tmp_path, text)
    assert roughness(scene) == {11: 0.25, 12: 0.125, 21: 0.875, 22: 0.125}


def test_too_many_looks_are_listed(tmp_path, monkeypatch):
    monkeypatch.setattr("wavecomb.usd.instances.instance_materials.MAX_VARIATIONS", 3)
    text = PROTO + "".join(instance(f"I{k}", k, wear(f"[0.{k + 1}]")) for k in range(5))
    scene, loaded = load(tmp_path, text)
    assert "primvars of instances in more than 3 ways" in said(loaded)
    assert sorted(roughness(scene).values()) == pytest.approx([0.1, 0.2, 0.3, 0.875, 0.875])
