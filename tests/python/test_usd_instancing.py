# SPDX-License-Identifier: Apache-2.0
"""Tests native instances and point instancers: transforms and materials of the copies."""

import numpy as np
import pytest
from usd_recorder import INHERIT, QUAD, load

BIND = '(prepend apiSchemas = ["MaterialBindingAPI"])'


def move(x, y=0, z=0):
    return (
        f"double3 xformOp:translate = ({x}, {y}, {z})\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]'
    )


def look(name, roughness):
    return f"""def Material "{name}" {{
        token outputs:surface.connect = </{name}/S.outputs:surface>
        def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
            float inputs:roughness = {roughness}
            token outputs:surface }} }}
    """


LOOKS = look("A", 0.125) + look("B", 0.25)


def origins(scene):
    """Returns the world position of each mesh's first point, sorted."""
    out = [
        (np.append(mesh["positions"][0], 1) @ matrix)[:3].round(5).tolist()
        for mesh, matrix, _ in scene.world_meshes()
    ]
    return sorted(out)


def names(scene):
    """Returns the material names of the visible meshes, sorted by x of their first points."""
    out = {}
    for mesh, matrix, material in scene.world_meshes():
        x = float((np.append(mesh["positions"][0], 1) @ matrix)[0])
        out[x] = "" if material == INHERIT else scene.materials[material]["name"]
    return out


PROTO = f"""class "P" {{ def Xform "X" {{ {move(0, 1)}
    def Mesh "M" {{ {QUAD} }} }} }}
"""


def instance(name, x, body="", meta="", target="/P"):
    return (
        f'def Xform "{name}" (references = <{target}>\n instanceable = true\n {meta}) '
        f"{{ {move(x)}\n {body} }}\n"
    )


def test_native_instances_share_geometry(tmp_path):
    scene, _ = load(tmp_path, PROTO + "".join(instance(f"I{k}", 10 * k) for k in range(5)))
    assert len(scene.meshes) == 1 and len(scene.groups) == 2
    ((_, transforms, _),) = scene.groups[0]["children"]
    assert len(transforms) == 5
    assert origins(scene) == [[10 * k, 1, 0] for k in range(5)]


def test_an_only_instance_is_baked(tmp_path):
    scene, _ = load(tmp_path, PROTO + instance("I", 7))
    assert len(scene.groups) == 1 and origins(scene) == [[7, 1, 0]]


def test_nested_instances(tmp_path):
    text = PROTO + 'class "Q" {' + instance("A", 1) + instance("B", 2) + "}"
    text += instance("I", 10, target="/Q") + instance("J", 20, target="/Q")
    scene, _ = load(tmp_path, text)
    assert len(scene.meshes) == 1 and len(scene.groups) == 3
    assert origins(scene) == [[11, 1, 0], [12, 1, 0], [21, 1, 0], [22, 1, 0]]


def test_instances_bring_materials(tmp_path):
    api = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    text = LOOKS + PROTO
    text += instance("I", 0, "rel material:binding = </A>", api)
    text += instance("J", 10, "rel material:binding = </B>", api)
    text += instance("K", 20)
    text += f'def Xform "Up" {BIND} {{ rel material:binding = </B>\n {instance("L", 30)} }}'
    scene, _ = load(tmp_path, text)
    assert names(scene) == {0: "/A", 10: "/B", 20: "displayColor", 30: "/B"}
    assert len(scene.meshes) <= 2


def test_own_bindings_of_a_prototype_win_unless_weaker(tmp_path):
    api = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    proto = f"""class "P" {{ def Mesh "M" {BIND} {{ {QUAD} rel material:binding = </P/Own> }}
        {look("Own", 0.5).replace("</Own", "</P/Own")} }}"""
    strong = 'rel material:binding = </A> (bindMaterialAs = "strongerThanDescendants")'
    text = LOOKS + proto
    text += instance("I", 0, "rel material:binding = </A>", api)
    text += instance("J", 10, strong, api)
    text += instance("K", 20, strong.replace("</A>", "</B>"), api)
    scene, _ = load(tmp_path, text)
    found = names(scene)
    assert found[10] == "/A" and found[20] == "/B"
    assert "Own" in found[0]
    assert len(scene.meshes) == 2


def test_collections_reach_into_instances(tmp_path):
    text = LOOKS + PROTO
    text += f"""def Xform "Set" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:c"]) {{
        rel collection:c:includes = </Set/J/X/M>
        rel material:binding:collection:c = [</Set.collection:c>, </A>]
        {instance("I", 0)} {instance("J", 10)} {instance("K", 20)} }}"""
    scene, _ = load(tmp_path, text)
    assert names(scene) == {0: "displayColor", 10: "/A", 20: "displayColor"}


def test_display_colours_of_instances(tmp_path):
    text = PROTO + "".join(
        instance(f"I{k}", 10 * k, f"color3f[] primvars:displayColor = [({k}, 0, 0)]")
        for k in range(3)
    )
    scene, _ = load(tmp_path, text)
    assert len(scene.meshes) == 1
    got = [scene.materials[m]["base_color"][0] for _, _, m in scene.world_meshes()]
    assert got == [0, 1, 2]


def test_visibility_purpose_and_reset(tmp_path):
    scene, _ = load(
        tmp_path,
        f"""
        def Xform "Hidden" {{ token visibility = "invisible"
            def Mesh "A" {{ {QUAD} }} }}
        def Xform "Guide" {{ uniform token purpose = "guide"
            def Mesh "B" {{ {QUAD} }}
            def Mesh "C" {{ {QUAD} uniform token purpose = "render" }} }}
        def Xform "Far" {{ {move(100)}
            def Mesh "D" {{ {QUAD} double3 xformOp:translate = (1, 0, 0)
                uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"] }} }}
        def Mesh "E" (active = false) {{ {QUAD} }}
        """,
    )
    assert [mesh["name"] for mesh in scene.meshes] == ["/Guide/C", "/Far/D"]
    assert scene.mesh("D")["positions"][0].tolist() == [1, 0, 0]
    scene, _ = load(
        tmp_path,
        f'def Mesh "B" {{ {QUAD} uniform token purpose = "guide" }}',
        purposes=("default", "guide"),
    )
    assert len(scene.meshes) == 1


INSTANCER = f"""
def Xform "World" {{ {move(100)}
def PointInstancer "P" {{
    rel prototypes = [</World/P/A>, </B>]
    int[] protoIndices = [0, 1, 0, 1, 0]
    point3f[] positions = [(0,0,0), (1,0,0), (2,0,0), (3,0,0), (4,0,0)]
    int64[] ids = [10, 11, 12, 13, 14]
    EXTRA
    def Mesh "A" {{ {QUAD} {move(0, 5)} }}
}} }}
over "B" {{ def Mesh "M" {{ {QUAD} }} }}
"""


def test_point_instances(tmp_path):
    scene, _ = load(tmp_path, INSTANCER.replace("EXTRA", ""))
    assert len(scene.meshes) == 2
    assert origins(scene) == [[100, 5, 0], [101, 0, 0], [102, 5, 0], [103, 0, 0], [104, 5, 0]]


def test_point_instances_can_be_hidden(tmp_path):
    scene, _ = load(tmp_path, INSTANCER.replace("EXTRA", "int64[] invisibleIds = [12, 13]"))
    assert [x for x, _, _ in origins(scene)] == [100, 101, 104]
    text = INSTANCER.replace("EXTRA", "").replace('"P" {', '"P" (inactiveIds = [10]) {')
    scene, _ = load(tmp_path, text)
    assert [x for x, _, _ in origins(scene)] == [101, 102, 103, 104]


@pytest.mark.parametrize("kind", ["quath[] orientations", "quatf[] orientationsf"])
def test_point_instance_transforms_are_usds_own(tmp_path, kind):
    from pxr import Usd, UsdGeom

    rng = np.random.default_rng(3)
    quats = rng.normal(size=(5, 4))
    quats /= np.linalg.norm(quats, axis=1)[:, None]
    scales = rng.random((5, 3)) + 0.5
    extra = f"{kind} = [{', '.join(str(tuple(q)) for q in quats.tolist())}]\n"
    extra += f"float3[] scales = [{', '.join(str(tuple(s)) for s in scales.tolist())}]"
    scene, _ = load(tmp_path, INSTANCER.replace("EXTRA", extra).replace(move(0, 5), ""))
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/P"))
    time = Usd.TimeCode.Default()
    expected = np.array(instancer.ComputeInstanceTransformsAtTime(time, time))
    expected[:, 3, 0] += 100
    got = np.array([matrix for _, matrix, _ in scene.world_meshes()])
    order = np.argsort(got[:, 3, 0])
    assert got[order] == pytest.approx(expected, abs=2e-3)


def test_nested_point_instancers_and_instances(tmp_path):
    text = f"""
    def PointInstancer "Outer" {{
        rel prototypes = </Outer/Inner>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0,0,0), (100,0,0)]
        def PointInstancer "Inner" {{
            rel prototypes = </Outer/Inner/M>
            int[] protoIndices = [0, 0, 0]
            point3f[] positions = [(1,0,0), (2,0,0), (3,0,0)]
            def Mesh "M" {{ {QUAD} }} }} }}
    """
    scene, _ = load(tmp_path, text)
    assert len(scene.meshes) == 1
    assert [x for x, _, _ in origins(scene)] == [1, 2, 3, 101, 102, 103]


def test_point_instancer_colours_and_bindings(tmp_path):
    colours = "color3f[] primvars:displayColor = [(0,0,0), (1,0,0), (2,0,0), (3,0,0), (4,0,0)] (\n"
    colours += 'interpolation = "vertex")'
    scene, _ = load(tmp_path, INSTANCER.replace("EXTRA", colours))
    for _, matrix, material in scene.world_meshes():
        x = matrix[3, 0] - 100
        assert scene.materials[material]["base_color"][0] == pytest.approx(x)
    text = look("A", 0.125) + INSTANCER.replace("EXTRA", "rel material:binding = </A>")
    text = text.replace('def PointInstancer "P"', f'def PointInstancer "P" {BIND}')
    scene, _ = load(tmp_path, text)
    found = names(scene)
    assert found[100] == "/A" and found[101] == "displayColor"


def test_lights_in_instances_are_placed(tmp_path):
    text = 'class "P" { def SphereLight "L" {} }' + instance("I", 1) + instance("J", 2)
    scene, _ = load(tmp_path, text)
    assert [light["transform"][3, 0] for light in scene.lights] == [1, 2]
    assert len(scene.groups) == 1


def nested(depth):
    """Returns a prototype in alternating instancers and native instances, two copies per level."""
    text = f'class "L0" {{ def Mesh "M" {{ {QUAD} }} }}\n'
    for level in range(1, depth + 1):
        step, below = 2 ** (level - 1), f"L{level - 1}"
        if level % 2:
            inside = f"""def PointInstancer "P" {{
                rel prototypes = </L{level}/P/Proto>
                int[] protoIndices = [0, 0, 0, 0]
                point3f[] positions = [(0,0,0), (9,9,9), ({step},0,0), (9,9,9)]
                int64[] ids = [1, 2, 3, 4]
                int64[] invisibleIds = [4, 2]
                def Xform "Proto" (references = </{below}>
                    instanceable = true) {{ }} }}"""
        else:
            inside = instance("A", 0, target=f"/{below}") + instance("B", step, target=f"/{below}")
        text += f'class "L{level}" {{ {inside} }}\n'
    return text + f'def Xform "World" (references = </L{depth}>) {{ }}'


@pytest.mark.parametrize("depth", [1, 2, 3, 7, 8])
def test_instancers_and_instances_nest_to_any_depth(tmp_path, depth):
    scene, loaded = load(tmp_path, nested(depth))
    assert len(scene.meshes) == 1
    assert [x for x, _, _ in origins(scene)] == list(range(2**depth))
    assert not loaded.report.warnings


def test_colours_of_instances_reach_through_nested_ones(tmp_path):
    """Of nested instancers' colours, the innermost applies, also with indices and invisible ids."""
    text = f"""
    def PointInstancer "Outer" {{
        rel prototypes = [</Outer/Plain>, </Outer/Own>]
        int[] protoIndices = [0, 0, 1]
        point3f[] positions = [(0,0,0), (10,0,0), (20,0,0)]
        int64[] invisibleIds = [0]
        color3f[] primvars:displayColor = [(1,0,0), (0,1,0)] ( interpolation = "vertex" )
        int[] primvars:displayColor:indices = [0, 1, 0]
        def PointInstancer "Plain" {{
            rel prototypes = </Outer/Plain/M>
            int[] protoIndices = [0, 0]
            point3f[] positions = [(0,0,0), (1,0,0)]
            def Mesh "M" {{ {QUAD} }} }}
        def PointInstancer "Own" {{
            rel prototypes = </Outer/Own/M>
            int[] protoIndices = [0]
            point3f[] positions = [(0,0,0)]
            color3f[] primvars:displayColor = [(0,0,1)] ( interpolation = "vertex" )
            def Mesh "M" {{ {QUAD} }} }} }}
    """
    scene, _ = load(tmp_path, text)
    colours = {
        float(matrix[3, 0]): scene.materials[material]["base_color"]
        for _, matrix, material in scene.world_meshes()
    }
    assert colours == {10: (0, 1, 0), 11: (0, 1, 0), 20: (0, 0, 1)}


def test_many_instances_take_no_step_each(tmp_path):
    """The number of Python calls for a point instancer does not grow with its instances."""
    import sys

    from pxr import Usd, UsdGeom, Vt
    from usd_recorder import Recorder

    from wavecomb.usd import load_stage

    def calls(count):
        path = tmp_path / f"many{count}.usdc"
        stage = Usd.Stage.CreateNew(str(path))
        instancer = UsdGeom.PointInstancer.Define(stage, "/P")
        mesh = UsdGeom.Mesh.Define(stage, "/P/M")
        mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
        mesh.CreateFaceVertexCountsAttr([3])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
        instancer.CreatePrototypesRel().SetTargets(["/P/M"])
        instancer.CreateProtoIndicesAttr(Vt.IntArray(count, 0))
        places = np.arange(3 * count, dtype=np.float32).reshape(-1, 3)
        instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(places))
        stage.Save()
        made = []
        sys.setprofile(lambda frame, event, argument: made.append(event))
        try:
            scene = load_stage(path, builder_factory=Recorder).scene
        finally:
            sys.setprofile(None)
        assert len(scene.world_meshes()) == count
        return len(made)

    calls(10), calls(1000)  # imports and caches
    few, many = calls(10), calls(1000)
    assert many < few + 400
