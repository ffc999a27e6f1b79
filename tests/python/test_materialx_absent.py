# SPDX-License-Identifier: Apache-2.0
"""Tests loading of stages if MaterialX is not installed or its package is incomplete."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Usd
from test_material_graphs import node, standard
from test_usd_material import surface
from usd_recorder import Recorder, said, write

from wavecomb.usd import load_stage, mtlx
from wavecomb.usd.materials.parameters import material_parameters, surface_values
from wavecomb.usd.materialx.surfaces.openpbr import MODELS

PREVIEW = surface("color3f inputs:diffuseColor = (0.1, 0.2, 0.3)\nfloat inputs:roughness = 0.25")
STANDARD = standard("color3f inputs:base_color = (0.1, 0.2, 0.3)")
MIXED = surface(
    "float inputs:roughness.connect = </Mat/P.outputs:out>",
    node("P", "ND_multiply_float", "float inputs:in1 = 0.5", "float outputs:out"),
)
PACKAGES = ("MaterialX", "wavecomb.usd.materialx")


def cut_off(package, monkeypatch):
    for name in list(sys.modules):
        if name.startswith(package + "."):
            monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, package, None)
    assert not mtlx.is_there()


@pytest.fixture(params=PACKAGES)
def absent(request, monkeypatch):
    """Hides the wheel of MaterialX, or the package that reads its documents."""
    cut_off(request.param, monkeypatch)


def loaded_of(path):
    return load_stage(path, builder_factory=Recorder)


def lines(loaded):
    return [line for line in said(loaded).splitlines() if "materialx" in line.lower()]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_stage_without_materialx_loads_as_before(tmp_path, monkeypatch, package):
    path = write(tmp_path, PREVIEW)
    before = loaded_of(path)
    cut_off(package, monkeypatch)
    after = loaded_of(path)
    assert after.scene.materials == before.scene.materials
    assert said(after) == said(before) and not lines(after)


def test_its_surfaces_are_grey_and_said_in_one_line(tmp_path, absent):
    two = STANDARD + STANDARD.replace('"Mat"', '"Other"').replace("/Mat", "/Other").replace(
        '"M"', '"N"'
    )
    loaded = loaded_of(write(tmp_path, two))
    assert len(lines(loaded)) == 1
    assert (
        "pip install materialx" in lines(loaded)[0]
        and "displayColor in its place" in lines(loaded)[0]
    )
    assert "/Mat" in lines(loaded)[0] and "/Other" in lines(loaded)[0]
    assert loaded.scene.material_of("M")["program"] == "diffuse"
    assert loaded.scene.material_of("M")["base_color"] == (0.5, 0.5, 0.5)


def test_its_nodes_are_left_out_of_preview_surfaces(tmp_path, absent):
    loaded = loaded_of(write(tmp_path, MIXED))
    assert len(lines(loaded)) == 1 and "nodes left out: /Mat/P" in lines(loaded)[0]
    assert loaded.scene.material_of("M")["roughness"] == 0.5


def test_its_files_are_left_out_and_said_in_one_line(tmp_path, absent):
    (tmp_path / "a.mtlx").write_text('<?xml version="1.0"?><materialx version="1.39"/>')
    text = 'def "%s" ( references = @./a.mtlx@</MaterialX> ) {}\n'
    loaded = loaded_of(write(tmp_path, PREVIEW + text % "A" + text % "B"))
    told = [line for line in said(loaded).splitlines() if "mtlx" in line or "aterial" in line]
    assert len(told) == 1 and "pip install materialx" in told[0]
    assert "/A" in told[0] and "/B" in told[0]
    assert loaded.scene.material_of("M")["base_color"] == pytest.approx((0.1, 0.2, 0.3))


def test_its_inputs_cannot_be_edited(tmp_path, absent):
    stage = Usd.Stage.Open(str(write(tmp_path, STANDARD)))
    prim = stage.GetPrimAtPath("/Mat")
    assert material_parameters(prim, Usd.TimeCode.Default()) == {}
    assert surface_values(prim, Usd.TimeCode.Default()) is None
    mtlx.reload(stage)


def test_the_door_knows_the_models():
    assert set(mtlx.MODELS) == MODELS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("text", [PREVIEW, STANDARD])
def test_stages_without_its_graphs_read_no_library(tmp_path, text):
    code = (
        "import sys; sys.path.insert(0, sys.argv[2])\n"
        "from usd_recorder import Recorder\n"
        "from wavecomb.usd import load_stage\n"
        "load_stage(sys.argv[1], builder_factory=Recorder)\n"
        "print('MaterialX' in sys.modules)\n"
    )
    arguments = [sys.executable, "-c", code, write(tmp_path, text), Path(__file__).parent]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "False"
