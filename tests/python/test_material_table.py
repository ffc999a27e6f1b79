# SPDX-License-Identifier: Apache-2.0
"""What follows from the core's table of materials; a row that is added is found everywhere."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from added_rows import add_rows, made_again

from wavecomb import _core as core
from wavecomb.material_table import MaterialParameter, material_parameters

ROOT = Path(__file__).parents[2]

ADDED = (
    MaterialParameter("graininess", "number", 0.5),
    MaterialParameter("sheen_tint", "colour", (1.0, 0.5, 0.0)),
    MaterialParameter("one_sided", "flag", False),
)


@pytest.fixture
def with_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """The table with a few rows more, as if the core had them."""
    add_rows(monkeypatch, material_parameters, ADDED, ("wavecomb.run.boxed.calls",))


def build(**values: Any) -> Any:
    """A scene with one triangle, whose material is told this."""
    builder = core.SceneBuilder(1)
    builder.add_material("principled", name="/M", **values)
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(triangle, faces, material=0, name="/T"))
    builder.set_camera(np.eye(4), window=(-1, 1, -1, 1))
    return builder.build()


def another(row: MaterialParameter) -> Any:
    """A value that a row takes and that is not its default."""
    return {"number": 0.25, "colour": (0.25, 0.5, 0.75), "flag": not row.default}[row.kind]


def test_rows_are_the_cores() -> None:
    usual = build()
    for name, row in material_parameters().items():
        changed = build(**{name: another(row)})
        assert changed.fingerprint() != usual.fingerprint(), name
        assert usual.material(0)[name] == pytest.approx(row.default), name
        assert changed.material(0)[name] == pytest.approx(another(row)), name
        assert build(**{name: row.default}).fingerprint() == usual.fingerprint(), name


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


def test_an_added_row_may_come_from_a_sandbox(with_rows: None) -> None:
    more = made_again("wavecomb.run.boxed.calls").CALLS["add_material"].more
    assert {row.name for row in ADDED} <= more.keys()
    assert more["graininess"](1, []) == 1.0
    assert more["sheen_tint"]([1, 2, 3], []) == (1.0, 2.0, 3.0)
    with pytest.raises(Exception, match="switch"):
        more["one_sided"](3, [])


def test_an_added_row_is_in_the_stub(with_rows: None) -> None:
    stub = runpy.run_path(str(ROOT / "tools" / "update_stub"))
    text = stub["updated"](stub["STUB"].read_text())
    keywords = text.partition("def add_material(")[2].partition("->")[0]
    assert "        graininess: float = 0.5,\n" in keywords
    assert "        sheen_tint: tuple[float, float, float] = (1, 0.5, 0),\n" in keywords
    assert "        one_sided: bool = False,\n" in keywords
