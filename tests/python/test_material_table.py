# SPDX-License-Identifier: Apache-2.0
"""Tests that every user of the core's table of material parameters picks up new rows."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from added_rows import add_rows
from pxr import Usd, UsdShade

from wavecomb import _core as core
from wavecomb.core_table import (
    MaterialParameter,
    material_parameters,
    preview_programs,
    programs,
)
from wavecomb.usd.materials.parameters import material_parameters as traced_parameters
from wavecomb.usd.materials.preview_surface import INPUTS, PreviewReader
from wavecomb.usd.stage.report import LoadReport

ROOT = Path(__file__).parents[2]

ADDED = (
    MaterialParameter("graininess", "number", 0.5),
    MaterialParameter("sheen_tint", "colour", (1.0, 0.5, 0.0)),
    MaterialParameter("one_sided", "flag", False),
    MaterialParameter("dustiness", "number", 0.25, "diffuse", 0.0, 0.75),
)


@pytest.fixture
def with_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adds rows to the table, as if the core had them."""
    add_rows(monkeypatch, material_parameters, ADDED)


def build(program: str = "principled", **values: Any) -> Any:
    """Returns a scene with one triangle whose material has the given parameters."""
    builder = core.SceneBuilder(1)
    builder.add_material(program, name="/M", **values)
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(triangle, faces, material=0, name="/T"))
    builder.set_camera(np.eye(4), window=(-1, 1, -1, 1))
    return builder.build()


def another(row: MaterialParameter) -> Any:
    """Returns a valid value other than the default."""
    if row.least is not None and row.most is not None:
        return row.most if row.default != row.most else row.least
    return {"number": 0.25, "colour": (0.25, 0.5, 0.75), "flag": not row.default}[row.kind]


def test_rows_are_the_cores() -> None:
    for name, row in material_parameters().items():
        program = row.program or "principled"
        usual = build(program)
        changed = build(program, **{name: another(row)})
        assert changed.fingerprint() != usual.fingerprint(), name
        assert usual.material(0)[name] == pytest.approx(row.default), name
        assert changed.material(0)[name] == pytest.approx(another(row)), name
        same = build(program, **{name: row.default})
        assert same.fingerprint() == usual.fingerprint(), name


def test_what_a_program_has_to_itself_is_no_others() -> None:
    for name, row in material_parameters().items():
        for program in programs():
            is_told = row.program in ("", program)
            assert (name in build(program).material(0)) == is_told, (name, program)
            if not is_told:
                with pytest.raises(core.Error, match=f"has no parameter '{name}'"):
                    build(program, **{name: row.default})
        if row.most is not None:
            with pytest.raises(core.Error, match=f"{name} is .*; it must be from"):
                build(row.program, **{name: row.most + 1.0})


def test_what_programs_read_is_what_the_loaders_own_table_said() -> None:
    every = {
        "base_color", "specular_color", "emission", "roughness", "metallic", "clearcoat",
        "clearcoat_roughness", "opacity", "normal", "ior", "opacity_threshold",
    }  # fmt: skip
    said = {
        "diffuse": {"base_color", "normal"},
        "metal": {"base_color", "specular_color", "roughness", "normal"},
        "dielectric": {"base_color", "roughness", "ior", "normal"},
        "plastic": {"base_color", "roughness", "ior", "normal"},
        "emissive": {"emission"},
        "principled": every,
    }
    assert {name: programs()[name].reads for name in said} == said
    assert preview_programs()[: len(said)] == tuple(said)
    assert "openpbr" in programs() and "openpbr" not in preview_programs()
    assert every == {parameter for parameter, _ in INPUTS.values()}


def test_the_fingerprint_is_that_of_before_there_was_a_table() -> None:
    scene = build(
        base_color=(0.1, 0.2, 0.3), specular_color=(0.4, 0.5, 0.6), emission=(1, 2, 3),
        roughness=0.3, metallic=0.2, clearcoat=0.7, clearcoat_roughness=0.05, opacity=0.9, ior=1.4,
        opacity_threshold=0.1, conductor_eta=(1, 2, 3), conductor_k=(4, 5, 6),
        specular_workflow=True, presence=True,
    )  # fmt: skip
    assert scene.fingerprint()["materials"] == "bee3b6e2a278c2e4"


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"roughness": "big"}, "material '/M': roughness must be a number"),
        ({"base_color": (1, 2)}, "material '/M': base_color must be 3 numbers"),
        ({"presence": "no"}, "material '/M': presence must be True or False"),
        ({"teatime": 4}, "material '/M' has no parameter 'teatime'; there are 'base_color', "),
        ({"emission": (1, float("nan"), 1)}, "material '/M' has a colour that is not finite; "),
        ({"ior": float("inf")}, "material '/M' has a parameter that is not finite; "),
    ],
)
def test_what_is_wrong_is_said_with_the_materials_name(values: dict[str, Any], line: str) -> None:
    with pytest.raises(core.Error) as caught:
        build(**values)
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_an_added_row_is_in_the_stub(with_rows: None) -> None:
    stub = runpy.run_path(str(ROOT / "tools" / "update_stub"))
    text = stub["updated"](stub["STUB"].read_text())
    keywords = text.partition("def add_material(")[2].partition("->")[0]
    assert "        graininess: float = 0.5,\n" in keywords
    assert "        sheen_tint: tuple[float, float, float] = (1, 0.5, 0),\n" in keywords
    assert "        one_sided: bool = False,\n" in keywords
    assert "        dustiness: float = 0.25,\n" in keywords


STAGE = """#usda 1.0
def Material "M" {
    custom token wavecomb:program = "%s"
    %s
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize(
    ("authored", "value"), [("", None), ("0.5", 0.5), ("-2", 0.0), ("7", 0.75), ("nan", 0.25)]
)
def test_an_added_row_of_a_program_is_read_from_its_attribute(
    with_rows: None, authored: str, value: float | None
) -> None:
    attribute = f"float wavecomb:dustiness = {authored}" if authored else ""
    for program in ("diffuse", "plastic"):
        stage = Usd.Stage.CreateInMemory()
        stage.GetRootLayer().ImportFromString(STAGE % (program, attribute))
        prim, time = stage.GetPrimAtPath("/M"), Usd.TimeCode.Default()
        textures: Any = None
        reader = PreviewReader(prim, time, textures, LoadReport())
        read = reader.read(UsdShade.Shader(stage.GetPrimAtPath("/M/S"))).parameters
        traced = traced_parameters(prim, time)
        if program != "diffuse":
            assert "dustiness" not in read and "dustiness" not in traced
            continue
        assert read.get("dustiness") == value
        assert traced["dustiness"].value == (0.25 if value is None else value)
        assert str(traced["dustiness"].attribute) == "/M.wavecomb:dustiness"
        bounds = pytest.importorskip("wavecomb.gui.scene.materials_model").range_of(
            traced["dustiness"]
        )
        assert (bounds.low, bounds.high) == (0.0, 0.75)
