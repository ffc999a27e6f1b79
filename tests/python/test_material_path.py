# SPDX-License-Identifier: Apache-2.0
"""Tests that a material passes through few files from USD to its kernel."""

import functools
import sys
from pathlib import Path

import numpy as np
import pytest
from test_texture_limit import write_image
from usd_recorder import QUAD, load

import wavecomb
import wavecomb.usd.materialx.nodes.network
import wavecomb.usd.materialx.surfaces.openpbr
from wavecomb.usd.materials.assignment import Assigner
from wavecomb.usd.materials.material import MaterialTable

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path(wavecomb.__file__).parent

MOST = 23
"""Maximum number of Python and C++ files through which a material passes."""

NOT_ON_THE_PATH = {"isa.py", "usd/stage/report.py"}
"""Files that are not counted, which choose the native library or report messages."""

NATIVE = (
    "bindings/materials.cpp",
    "bindings/scene_values.cpp",
    "src/wavecomb/material/description/material.h",  # Material and MaterialRecord
    "src/wavecomb/material/description/simplified_material.cpp",
    "src/wavecomb/material/description/scene_materials.cpp",  # Material to MaterialRecord
    "src/wavecomb/material/inputs/inputs.inl",
    "src/wavecomb/material/params.h",
)
KERNELS = {
    "UsdPreviewSurface": (
        "src/wavecomb/material/description/material_table.h",
        "src/wavecomb/material/programs/principled.h",
    ),
    "ND_open_pbr_surface_surfaceshader": (
        "src/wavecomb/material/description/openpbr_inputs.h",
        "src/wavecomb/material/openpbr_params.h",
        "src/wavecomb/material/programs/openpbr.h",
    ),
}

PREVIEW = """
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        float inputs:roughness = 0.3
        token outputs:surface
    }
    def Shader "T" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./map.png@
        float2 inputs:st.connect = </M/R.outputs:result>
        float3 outputs:rgb
    }
    def Shader "R" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
"""
OPEN_PBR = """
    def Shader "S" {
        uniform token info:id = "ND_open_pbr_surface_surfaceshader"
        color3f inputs:base_color.connect = </M/T.outputs:out>
        float inputs:specular_roughness = 0.3
        token outputs:surface
    }
    def Shader "T" {
        uniform token info:id = "ND_image_color3"
        asset inputs:file = @./map.png@
        color3f outputs:out
    }
"""


@pytest.fixture
def traced(monkeypatch):
    """Collects the files whose functions run while materials are read and added."""
    files, depth = set(), [0]

    def note(frame, event, _):
        name = Path(frame.f_code.co_filename)
        if event == "call" and PACKAGE in name.parents:
            files.add(name.relative_to(PACKAGE).as_posix())

    def watched(function):
        @functools.wraps(function)
        def call(*arguments, **options):
            depth[0] += 1
            if depth[0] == 1:
                sys.setprofile(note)
            try:
                return function(*arguments, **options)
            finally:
                depth[0] -= 1
                if depth[0] == 0:
                    sys.setprofile(None)

        return call

    for owner, names in (
        (MaterialTable, ("expect", "surface", "add")),
        (Assigner, ("assign", "uv_names")),
    ):
        for name in names:
            monkeypatch.setattr(owner, name, watched(getattr(owner, name)))
    return files


@pytest.mark.parametrize("shader", KERNELS)
def test_a_material_passes_few_files(tmp_path, traced, shader):
    write_image(tmp_path / "map.png", np.full((4, 4, 3), 90, np.uint8))
    text = PREVIEW if shader == "UsdPreviewSurface" else OPEN_PBR
    output = "" if shader == "UsdPreviewSurface" else "mtlx:"
    scene, _ = load(
        tmp_path,
        f"""def Mesh "Q" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            {QUAD}
            texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")
            rel material:binding = </M>
        }}
        def Material "M" {{
            token outputs:{output}surface.connect = </M/S.outputs:surface>
            {text}
        }}""",
    )
    material = scene.material_of("/Q")
    assert material["textures"]["base_color"] and material["roughness"] == pytest.approx(0.3)
    native = [*NATIVE, *KERNELS[shader]]
    assert [name for name in native if not (ROOT / name).is_file()] == []
    python = sorted(traced - NOT_ON_THE_PATH)
    assert len(python) + len(native) <= MOST, "\n".join([*python, *native])
