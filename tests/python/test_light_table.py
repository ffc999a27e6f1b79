# SPDX-License-Identifier: Apache-2.0
"""Tests that every user of the core's table of light parameters picks up new rows."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from added_rows import add_rows
from pxr import Sdf, Usd, UsdLux

from wavecomb import _core as core
from wavecomb.core_table import EDITABLE, MESH, LightParameter, light_parameters, of_kind

ROOT = Path(__file__).parents[2]

KINDS = tuple(kind for kind, _ in core.light_kinds() if kind != MESH)

ADDED = (
    LightParameter("blades", "blades", "Of its aperture.", "wavecomb:blades", "shape", "number",
                   "", 6.0, 3.0, 9.0, 9.0, (), ("disk", MESH)),
    LightParameter("rim", "rim", "Colour of its edge.", "wavecomb:rim", "shaping", "colour",
                   "", (1.0, 1.0, 1.0), 0.0, None, 1.0, (), KINDS),
    LightParameter("flicker", "flicker", "As candles do.", "wavecomb:flicker", "response", "flag",
                   "", False, None, None, 1.0, (), ("disk",)),
    LightParameter("halo", "halo", "What is around it.", "", "shape", "id", "texture", None, None,
                   None, 1.0, (), ("disk",)),
)  # fmt: skip

FOLLOW = ("wavecomb.gui.scene.light_inputs",)
"""Modules that derive data from the table."""


@pytest.fixture
def with_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adds rows to the table, as if the core had them."""
    add_rows(monkeypatch, light_parameters, ADDED, FOLLOW)


def another(row: LightParameter) -> Any:
    """Returns a valid value other than the default."""
    if row.refers == "group":
        return "key"
    values = {
        "number": 0.25 if row.default != 0.25 else 0.5, "colour": (0.25, 0.5, 0.75),
        "flag": not row.default, "id": 0,
        "transforms": np.stack([np.eye(4), np.eye(4)]),
    }  # fmt: skip
    return values[row.kind]


def build(*lights: dict[str, Any], mesh_light: dict[str, Any] | None = None) -> Any:
    """Returns a scene with the given lights, and with objects that the lights may refer to."""
    builder = core.SceneBuilder(1)
    builder.add_texture(np.full((4, 8, 3), 0.5, np.float32), srgb=False, name="/sky.exr")
    builder.add_ies([0.0, 90.0], [0.0], np.array([[100, 0]], np.float32))
    builder.add_geometry_set({"/": "expand", "/A": "exclude"})
    window = ((0.0, 0.0, 1.0),) * 4
    builder.add_light_filter(
        np.eye(4), 1.0, window, (1.0, 0.0, 0.5), (0.0, 1.0, 0.5), None, (0.0,) * 4, 0.5, None
    )
    for light in lights:
        builder.add_light(**{"transform": np.eye(4), **light})
    if mesh_light is not None:
        builder.add_mesh_light(**{"transform": np.eye(4), **mesh_light})
        builder.add_material("diffuse")
        triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
        faces = np.array([[0, 1, 2]], np.uint32)
        builder.add_to_group(
            0, builder.add_mesh(triangle, faces, material=0, mesh_light=0, name="/T")
        )
    builder.set_camera(np.eye(4), window=(-1, 1, -1, 1))
    return builder.build()


def test_rows_are_the_cores() -> None:
    rows = light_parameters()
    assert {name for row in rows.values() for name in row.kinds} == {*KINDS, MESH}
    plain = {kind: build({"kind": kind}) for kind in KINDS}
    for name, row in rows.items():
        assert row.help.endswith("."), name
        assert row.label, name
        for kind in set(row.kinds) - {MESH}:
            changed, usual = build({"kind": kind, name: another(row)}), plain[kind]
            assert changed.fingerprint()["lights"] != usual.fingerprint()["lights"], name
            if row.kind in EDITABLE:
                assert usual.light(0)[name] == pytest.approx(row.default), name
                assert changed.light(0)[name] == pytest.approx(another(row)), name
            again = build({"kind": kind, name: row.default})
            assert again.fingerprint() == usual.fingerprint(), name
    assert plain["rect"].light(0).keys() >= {
        "name", "kind", "transform", "group", "texture", "ies",
        *(row.name for row in of_kind("rect") if row.kind in EDITABLE),
    }  # fmt: skip


def test_meshes_have_what_is_theirs() -> None:
    plain = build(mesh_light={"material_sync": "independent"}).fingerprint()["lights"]
    for row in of_kind(MESH):
        if row.kind == "choice":
            others = [{"material_sync": one} for one in row.choices if one != "independent"]
        else:
            others = [{"material_sync": "independent", row.name: another(row)}]
        for one in others:
            assert build(mesh_light=one).fingerprint()["lights"] != plain, one


def test_fingerprints_stay_as_they_are() -> None:
    at = np.eye(4)
    at[3, :3] = (1, 2, 3)
    scene = build(
        {"kind": "rect", "name": "/R", "color": (1, 2, 3), "width": 2, "height": 3, "texture": 0,
         "group": "key", "diffuse": 0.5, "specular": 0.25, "visible": False, "normalize": True,
         "transform": at},
        {"kind": "disk", "name": "/D", "radius": 0.3, "focus": 2, "focus_tint": (0.1, 0.2, 0.3),
         "cone_angle": 40, "cone_softness": 0.5, "light_link": 0, "transform": at},
        {"kind": "sphere", "name": "/S", "radius": 0, "ies": 0, "ies_angle_scale": -0.5,
         "ies_normalize": True, "shadow_link": 0, "transform": at},
        {"kind": "cylinder", "name": "/C", "length": 4, "radius": 0.1, "transform": at},
        {"kind": "distant", "name": "/Sun", "angle": 2, "transform": at},
        {"kind": "dome", "name": "/Sky", "texture": 0, "portals": np.stack([at, np.eye(4)]),
         "transform": at},
        mesh_light={"material_sync": "independent", "name": "/M", "color": (3, 2, 1),
                    "normalize": True, "focus": 1, "visible": False, "transform": at},
    )  # fmt: skip
    assert scene.fingerprint()["lights"] == "fbe5bb3c2e3690f4"


@pytest.mark.parametrize(
    ("light", "line"),
    [
        ({"radius": -1}, "light '/L': radius is -1; it must be 0 or more"),
        ({"radius": "big"}, "light '/L': radius must be a number"),
        ({"color": (1, 2)}, "light '/L': color must be 3 numbers"),
        ({"visible": "no"}, "light '/L': visible must be True or False"),
        ({"texture": 3}, "light '/L': texture is texture 3, which was never added; "),
        ({"texture": "a.exr"}, "light '/L': texture must be a whole number of 0 or more, or None"),
        ({"light_link": 1}, "light '/L': light_link is set 1, which was never added; "),
        ({"portals": np.eye(4)}, "light '/L': portals must be an array (k, 4, 4) of float64"),
        ({"group": 3}, "light '/L': group must be a name"),
        (
            {"teatime": 4},
            "light '/L': there is no parameter 'teatime'; there are 'name', 'color', ",
        ),
        ({"material_sync": "independent"}, "light '/L': there is no parameter 'material_sync'"),
        ({"kind": "sun"}, "light kind is 'sun'; it must be one of rect, disk, sphere, "),
    ],
)
def test_what_is_wrong_is_said_with_the_lights_name(light: dict[str, Any], line: str) -> None:
    with pytest.raises(core.Error) as caught:
        build({"kind": "rect", "name": "/L", **light})
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_what_is_wrong_of_a_mesh_light_is_said() -> None:
    with pytest.raises(core.Error, match=r"'/M': material_sync must be one of mat.*, ind"):
        build(mesh_light={"material_sync": "glow", "name": "/M"})
    with pytest.raises(core.Error, match="light '/M': there is no parameter 'radius'"):
        build(mesh_light={"material_sync": "independent", "name": "/M", "radius": 1})


def test_inputs_are_those_of_usdlux() -> None:
    stage = Usd.Stage.CreateInMemory()
    usual = {"number": "float", "colour": "color3f", "flag": "bool", "id": "asset"}
    seen = 0
    for number, (kind, prims) in enumerate(core.light_kinds()):
        for type_name in prims:
            prim = stage.DefinePrim(f"/P{number}", type_name)
            if not prim.HasAPI(UsdLux.LightAPI):
                continue  # not in UsdLux
            seen += 1
            UsdLux.ShapingAPI.Apply(prim)
            UsdLux.ShadowAPI.Apply(prim)
            for row in of_kind(kind):
                if not row.input or row.input.startswith("wavecomb:"):
                    continue
                attribute = prim.GetAttribute(f"inputs:{row.input}")
                assert attribute, row.input
                assert attribute.GetTypeName() == Sdf.ValueTypeNames.Find(usual[row.kind])
                if row.group in ("shape", "response"):
                    assert attribute.Get() == pytest.approx(row.default), row.input
    assert seen == 7


def test_prims_are_drawn_as_kinds() -> None:
    from wavecomb.usd.lights.light import KINDS as PRIMS

    assert PRIMS["SphereLight"] == "sphere"
    assert PRIMS["DomeLight_1"] == "dome"
    assert set(PRIMS.values()) == set(KINDS)


def test_an_added_row_is_in_the_stub(with_rows: None) -> None:
    stub = runpy.run_path(str(ROOT / "tools" / "update_stub"))
    text = stub["updated"](stub["STUB"].read_text())
    light, mesh = (text.partition(f"def {name}(")[2].partition("->")[0] for name in
                   ("add_light", "add_mesh_light"))  # fmt: skip
    assert "        rim: tuple[float, float, float] = (1, 1, 1),\n" in light
    assert "        halo: int | None = None,\n" in light
    assert "        blades: float = 6,\n" in light
    assert "        blades: float = 6,\n" in mesh
    assert "flicker" not in mesh


def test_an_added_row_is_read_from_a_stage_and_is_a_field(with_rows: None) -> None:
    from wavecomb.gui.scene.light_inputs import inputs_of, light_inputs
    from wavecomb.usd.materials.parameters import light_values

    stage = Usd.Stage.CreateInMemory()
    prim = UsdLux.DiskLight.Define(stage, "/D").GetPrim()
    for row, name, value in zip(ADDED, ("Float", "Color3f", "Bool"), (7, (0, 1, 2), True),
                                strict=False):  # fmt: skip
        attribute = prim.CreateAttribute(f"inputs:{row.input}", getattr(Sdf.ValueTypeNames, name))
        attribute.Set(value)
    values = light_values(prim, Usd.TimeCode.Default())
    assert values is not None
    assert (values["blades"], values["rim"], values["flicker"]) == (7, (0, 1, 2), True)
    fields = {one.name: one for one in inputs_of(prim)}
    assert {"blades", "rim", "flicker"} <= fields.keys()
    assert (fields["blades"].bounds.low, fields["blades"].bounds.high) == (3, 9)
    assert fields["rim"].group == "shaping"
    assert fields["flicker"].read(prim, Usd.TimeCode.Default()) is True
    assert "halo" not in light_inputs()
    tube = UsdLux.CylinderLight.Define(stage, "/C").GetPrim()
    assert "blades" not in {one.name for one in inputs_of(tube)}
