# SPDX-License-Identifier: Apache-2.0
"""Tests that adding simple meshes together gives the same result as one at a time."""

import pytest
from usd_recorder import QUAD, write

from wavecomb.usd import load_stage
from wavecomb.usd.instances.mesh_batch import MeshBatches

TRIANGLES = """
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,1), (9,9,9)]
    int[] faceVertexCounts = [3,3]
    int[] faceVertexIndices = [0,1,2,0,2,3]
    uniform token subdivisionScheme = "none"
"""
MATERIAL = """
def Material "%s" {
    token outputs:surface.connect = </Looks/%s/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:%s = (0.8, 0.1, 0.1)
        token outputs:surface
    }
}
"""
UNUSUAL = (
    QUAD.replace("0,1,2,3", "0,1,2,7"),
    QUAD.replace("(1,1,0)", "(1,nan,0)"),
    QUAD.replace("[4]", "[3]"),
    QUAD.replace('"none"', '"loop"'),
    QUAD.replace('"none"', '"sharp"'),
    QUAD.replace("(1,0,0)", "(1e8,0,0)"),
    QUAD.replace("points = [", "points = [(1e7,0,0), (1e7,1,0), (1e7,1,1), (1e7,0,1)] # ["),
    QUAD + "double3 xformOp:scale = (1,1,-1)\nuniform token[] xformOpOrder = [\"xformOp:scale\"]",
    QUAD + "double3 xformOp:scale = (1,0,1)\nuniform token[] xformOpOrder = [\"xformOp:scale\"]",
    QUAD + "uniform token orientation = \"leftHanded\"",
    QUAD + "normal3f[] normals = [(0,0,1), (0,0,1), (0,0,1), (0,0,1)]",
    QUAD + "color3f[] primvars:displayColor = [(1,0,0)]",
    QUAD + "bool primvars:wavecomb:visibility:camera = 0",
    QUAD + "int[] holeIndices = [0]",
    "uniform token subdivisionScheme = \"none\"",
)  # fmt: skip


def mesh(number: int, body: str, material: str = "", metadata: str = "") -> str:
    """Returns a mesh in a moved Xform."""
    if material:
        metadata += '\nprepend apiSchemas = ["MaterialBindingAPI"]'
        body += f"\nrel material:binding = </Looks/{material}>"
    return f"""
    def Xform "X{number}" (kind = "{"component" if number % 7 == 0 else "group"}") {{
        double3 xformOp:translate = ({number}, {number % 5}, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Mesh "M" ( {metadata} ) {{ {body} }}
    }}"""


def meshes(count: int) -> str:
    """Returns simple meshes with unusual meshes between them."""
    out = []
    for i in range(count):
        body = UNUSUAL[i // 9 % len(UNUSUAL)] if i % 9 == 8 else (QUAD, TRIANGLES)[i % 2]
        material = ("", "Red", "Blue", "Lamp")[i // 20 % 4]
        light = 'prepend apiSchemas = ["MeshLightAPI"]' if i == 100 and not material else ""
        out.append(mesh(i, body, material, light))
    return "".join(out)


@pytest.fixture
def batched(monkeypatch):
    """Numbers of meshes that were added together."""
    numbers = []
    add = MeshBatches._add

    def counted(self, rows):
        numbers.append(add(self, rows))
        return numbers[-1]

    monkeypatch.setattr(MeshBatches, "_add", counted)
    return numbers


@pytest.mark.parametrize("where", ["world", "prototype"])
def test_batches_change_nothing(tmp_path, monkeypatch, batched, where):
    looks = "".join(
        MATERIAL % (name, name, kind)
        for name, kind in (("Red", "diffuseColor"), ("Blue", "diffuseColor"),
                           ("Lamp", "emissiveColor"))
    )  # fmt: skip
    text = f'def Scope "Looks" {{ {looks} }}\n'
    if where == "world":
        text += f'def Xform "W" {{ {meshes(300)} }}'
    else:
        text += f'class Xform "P" {{ {meshes(300)} }}\n'
        for name in "AB":
            head = f'def Xform "{name}" ( instanceable = true\nreferences = </P> )'
            text += f"{head} {{ }}\n"
    path = write(tmp_path, text)
    counts = []
    together = load_stage(path, progress=lambda *numbers: counts.append(numbers))
    assert sum(batched) > 50
    monkeypatch.setattr(MeshBatches, "_fits", lambda *_: False)
    apart = load_stage(path)
    assert together.scene.fingerprint() == apart.scene.fingerprint()
    assert together.report.lines() == apart.report.lines()
    assert list(together.report.counts.items()) == list(apart.report.counts.items())
    assert together.material_paths == apart.material_paths
    assert (together.outline == apart.outline).all()


def test_progress(tmp_path, batched):
    path = write(tmp_path, "".join(mesh(i, QUAD) for i in range(1600)))
    counts = []
    load_stage(path, progress=lambda *numbers: counts.append(numbers))
    assert max(batched) > 512
    assert counts == [(512, 1600), (1024, 1600), (1536, 1600)]
