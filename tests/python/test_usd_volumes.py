# SPDX-License-Identifier: Apache-2.0
"""Tests UsdVol volumes: fields, files, materials, transforms and invalid input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import ASSETS, asset, needs, only_where
from usd_recorder import Recorder, load, said, write

from wavecomb import vdb
from wavecomb.errors import WavecombError
from wavecomb.usd.volumes.grids import radiance

pytestmark = needs("wavecomb._core")
with_vdb = only_where(vdb.is_there(), "this build is without OpenVDB")

EDGE = vdb.BRICK
HALF = (0.5, 0.5, 0.5)


def grid(value: Any = 1.0, channels: int = 1, name: str = "density", **more: Any) -> dict[str, Any]:
    shape = (1, EDGE, EDGE, EDGE, *((3,) if channels == 3 else ()))
    values = np.broadcast_to(np.float32(value), shape).copy()
    return {
        "name": name, "origins": np.zeros((1, 3), np.int32), "values": values,
        "index_to_object": np.diag([0.25, 0.25, 0.25, 1.0]), **more,
    }  # fmt: skip


def field(name: str = "density", file: str = "a.vdb", more: str = "") -> str:
    return f"""
        rel field:{name} = </V/{name}>
        def OpenVDBAsset "{name}" {{
            asset filePath = @./{file}@
            {more}
        }}
    """


def volume(fields: str, more: str = "") -> str:
    return f'def Volume "V" {{ {more}\n {fields} }}'


BOUND = "rel material:binding = </M>"


def material(shader: str, context: str = "mtlx:") -> str:
    return f"""def Material "M" {{
        token outputs:{context}volume.connect = </M/S.outputs:out>
        def Shader "S" {{ token outputs:out
            {shader} }}
    }}"""


def the_volume(folder: Path, text: str, **options: Any) -> tuple[dict[str, Any], Recorder, str]:
    scene, loaded = load(folder, text, **options)
    (found,) = scene.volumes
    return found, scene, said(loaded)


# Fields


@with_vdb
def test_a_volume_without_a_material(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(0.5)])
    found, scene, report = the_volume(
        tmp_path, 'def Xform "X" { double3 xformOp:translate = (1, 2, 3)\n'
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n' + volume(field()).replace(
            "</V", "</X/V") + "}"
    )  # fmt: skip
    assert found["extinction"] == (1, 1, 1) and found["albedo"] == pytest.approx((0.8,) * 3)
    assert found["anisotropy"] == 0 and found["emission"] == (0, 0, 0)
    assert found["name"] == "/X/V"
    assert (found["density"]["values"] == 0.5).all()
    assert np.allclose(found["density"]["matrix"], np.diag([0.25, 0.25, 0.25, 1]))
    assert found["to_world"][3, :3].tolist() == [1, 2, 3]
    # Without camera and light, the volume is framed and lit by a default dome.
    assert scene.camera is not None and scene.lights[0]["kind"] == "dome"
    assert "not supported" not in report and "nothing to draw" not in report


@with_vdb
def test_volumes_are_listed(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(0.5)])
    _, loaded = load(tmp_path, volume(field()))
    (facts,) = loaded.volumes
    assert (facts.name, facts.count) == ("/V", 1)
    assert facts.low == (-0.125, -0.125, -0.125) and facts.high == (1.875, 1.875, 1.875)
    (one,) = facts.grids
    assert (one.use, one.field, one.grid, one.value) == ("density", "density", "density", "float")
    assert one.voxels == EDGE**3 and one.file.endswith("a.vdb")
    assert loaded.report.counts["volumes"] == 1


@with_vdb
def test_grids_of_several_files_and_of_one_name(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(2, name="fog"), grid(3, name="fog")])
    vdb.write(tmp_path / "b.vdb", [grid(0.25, 3, name="tint"), grid(7, name="other")])
    text = volume(
        field(more='token fieldName = "fog"\nint fieldIndex = 1')
        + field("albedo", "b.vdb", 'token fieldName = "tint"'),
        BOUND,
    ) + material('uniform token info:id = "arnold:standard_volume"\n'
                 'string inputs:scatter_color_channel = "tint"', "arnold:")  # fmt: skip
    values = {head.index: float(vdb.read(tmp_path / "a.vdb", head).values.max())
              for head in vdb.grid_heads(tmp_path / "a.vdb")}  # fmt: skip
    found, _, _ = the_volume(tmp_path, text)
    assert (found["density"]["values"] == values[1]).all()
    assert found["color"]["values"].shape[-1] == 3 and (found["color"]["values"] == 0.25).all()


@with_vdb
def test_files_change_over_time(tmp_path: Path) -> None:
    for number in (1, 2):
        vdb.write(tmp_path / f"{number}.vdb", [grid(number)])
    times = "asset filePath.timeSamples = { 1: @./1.vdb@, 2: @./2.vdb@ }"
    text = volume(f'rel field:density = </V/density>\ndef OpenVDBAsset "density" {{ {times} }}')
    for frame in (1, 2):
        found, _, _ = the_volume(tmp_path, text, frame=frame)
        assert (found["density"]["values"] == frame).all()
    _, _, report = the_volume(tmp_path, text, frame=1, shutter=(0, 1))
    assert "volumes whose files change while the shutter is open" in report


@with_vdb
def test_half_stays_half(tmp_path: Path) -> None:
    one = grid(0.1)
    one["values"] = one["values"].astype(np.float16)
    vdb.write(tmp_path / "a.vdb", [one])
    found, _, _ = the_volume(tmp_path, volume(field()))
    assert found["density"]["values"].dtype == np.float16


@with_vdb
def test_the_density_is_the_first_field_that_is_no_temperature(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(2, name="temperature"), grid(3, name="thick"),
                                   grid(1, 3, name="flow")])  # fmt: skip
    found, _, _ = the_volume(
        tmp_path, volume("".join(map(field, ("flow", "temperature", "thick"))))
    )
    assert (found["density"]["values"] == 3).all()


def test_a_volume_without_fields_fills_its_extent(tmp_path: Path) -> None:
    found, _, _ = the_volume(tmp_path, volume("", "float3[] extent = [(-1, -2, -3), (1, 2, 3)]"))
    assert found["bounds"] == ((-1, -2, -3), (1, 2, 3))
    _, loaded = load(tmp_path, volume(""))
    assert "without fields and without an extent" in said(loaded)


@with_vdb
def test_purpose_and_visibility(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid()])
    for hidden in ('token visibility = "invisible"', 'uniform token purpose = "guide"'):
        scene, _ = load(tmp_path, volume(field(), hidden))
        assert not scene.volumes
    scene, _ = load(tmp_path, volume(field(), 'uniform token purpose = "proxy"'),
                    purposes=("default", "proxy"))  # fmt: skip
    assert len(scene.volumes) == 1


@with_vdb
def test_instances_share_a_grid(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid()])
    text = (
        """
    def PointInstancer "I" {
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(10, 0, 0), (20, 0, 0), (30, 0, 0)]
        rel prototypes = </I/V>
    """
        + volume(field()).replace("</V", "</I/V")
        + "}"
    )
    text += (
        """
    class Xform "P" {"""
        + volume(field()).replace("</V", "</P/V")
        + """}
    def "A" (instanceable = true; references = </P>) {
        double3 xformOp:translate = (0, 5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def "B" (instanceable = true; references = </P>) {}
    """
    )
    scene, loaded = load(tmp_path, text)
    assert len(scene.grids) == 1
    places = sorted(tuple(one["to_world"][3, :3]) for one in scene.volumes)
    assert places == [(0, 0, 0), (0, 5, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)]
    assert {facts.count for facts in loaded.volumes} == {2, 3}
    assert loaded.outline is not None and loaded.outline[:, 0].max() == pytest.approx(31.875)


# Looks


@with_vdb
def test_standard_volume(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(2), grid(0.4, name="temperature")])
    shader = """uniform token info:id = "arnold:standard_volume"
        float inputs:density = 3
        float inputs:scatter = 0.5
        color3f inputs:scatter_color = (1, 0.5, 0.25)
        float inputs:scatter_anisotropy = 0.3
        color3f inputs:transparent = (0.5, 0.25, 0.125)
        float inputs:transparent_depth = 2
        float inputs:temperature = 1.5
        float inputs:blackbody_kelvin = 2000
        float inputs:blackbody_intensity = 4
    """
    text = volume(field() + field("temperature"), BOUND) + material(shader, "arnold:")
    found, _, report = the_volume(tmp_path, text)
    ln2 = np.log(2)
    assert found["extinction"] == pytest.approx((1.5 * ln2, 3 * ln2, 4.5 * ln2))
    assert found["albedo"] == pytest.approx((0.5, 0.25, 0.125))
    assert found["anisotropy"] == pytest.approx(0.3)
    assert found["emission"] == pytest.approx((4, 4, 4))
    glow = found["glow"]["values"][0, 0, 0, 0]
    assert glow == pytest.approx(radiance(np.float32(0.4 * 1.5 * 2000)), rel=1e-5)
    assert "not supported" not in report


@with_vdb
@pytest.mark.parametrize(
    ("mode", "emission", "has_grid"),
    [("none", (0, 0, 0), False), ("density", (2, 1, 0), False), ("channel", (2, 1, 0), True)],
)
def test_modes_of_emission(
    tmp_path: Path, mode: str, emission: tuple[float, ...], has_grid: bool
) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(), grid(name="heat")])
    shader = f"""uniform token info:id = "standard_volume"
        token inputs:emission_mode = "{mode}"
        float inputs:emission = 2
        color3f inputs:emission_color = (1, 0.5, 0)
    """
    text = volume(field() + field("heat"), BOUND) + material(shader, "")
    found, scene, _ = the_volume(tmp_path, text)
    assert found["emission"] == pytest.approx(emission)
    assert (found["glow"] is not None) == has_grid
    assert bool(scene.lights) == (mode == "none")


CLOSURE = """uniform token info:id = "ND_volume"
    token inputs:vdf.connect = </M/Vdf.outputs:out>
    token inputs:edf.connect = </M/Edf.outputs:out>
"""


def closures(vdf: str, edf: str = "", more: str = "") -> str:
    inner = f"""def Shader "Vdf" {{ token outputs:out
        {vdf} }}
        def Shader "Edf" {{ token outputs:out
        {edf} }} {more}"""
    text = material(CLOSURE)
    return text[: text.rindex("}")] + inner + "}"


@with_vdb
def test_materialx_volumes_are_per_metre(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(), grid(name="heat")])
    vdf = """uniform token info:id = "ND_anisotropic_vdf"
        vector3f inputs:absorption = (1, 2, 0)
        vector3f inputs:scattering = (3, 2, 4)
        float inputs:anisotropy = -0.4
    """
    edf = """uniform token info:id = "ND_uniform_edf"
        color3f inputs:color.connect = </M/Times.outputs:out>
    """
    times = """def Shader "Times" { uniform token info:id = "ND_multiply_color3FA"
        color3f inputs:in1 = (5, 6, 7)
        float inputs:in2.connect = </M/Heat.outputs:out>
        color3f outputs:out }
        def Shader "Heat" { uniform token info:id = "ND_geompropvalue_float"
        string inputs:geomprop = "heat"
        float outputs:out }"""
    text = ("#usda 1.0\n(metersPerUnit = 0.1)\n" + volume(field() + field("heat"), BOUND)
            + closures(vdf, edf, times))  # fmt: skip
    found, _, report = the_volume(tmp_path, text)
    assert found["extinction"] == pytest.approx((0.4, 0.4, 0.4))
    assert found["albedo"] == pytest.approx((0.75, 0.5, 1.0))
    assert found["anisotropy"] == pytest.approx(-0.4)
    assert found["emission"] == pytest.approx((0.5, 0.6, 0.7))
    assert found["glow"] is not None
    assert "not supported" not in report


@with_vdb
def test_absorption_alone_and_sums(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid()])
    head = "#usda 1.0\n(metersPerUnit = 1)\n"
    vdf = """uniform token info:id = "ND_absorption_vdf"
        vector3f inputs:absorption = (1, 2, 3)"""
    found, _, _ = the_volume(tmp_path, head + volume(field(), BOUND) + closures(vdf))
    assert found["extinction"] == (1, 2, 3) and found["albedo"] == (0, 0, 0)
    add = """uniform token info:id = "ND_add_vdf"
        token inputs:in1.connect = </M/One.outputs:out>
        token inputs:in2.connect = </M/Two.outputs:out>"""
    both = """def Shader "One" { uniform token info:id = "ND_absorption_vdf"
        vector3f inputs:absorption = (1, 0, 0)
        token outputs:out }
        def Shader "Two" { uniform token info:id = "ND_anisotropic_vdf"
        vector3f inputs:scattering = (1, 1, 0)
        float inputs:anisotropy = 0.5
        token outputs:out }"""
    text = head + volume(field(), BOUND) + closures(add, more=both)
    found, _, _ = the_volume(tmp_path, text)
    assert found["extinction"] == (2, 1, 0) and found["albedo"] == (0.5, 1, 0)
    assert found["anisotropy"] == 0.5


@with_vdb
def test_a_shader_that_is_not_known_is_said(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid()])
    text = volume(field(), BOUND) + material('uniform token info:id = "PxrVolume"', "")
    found, _, report = the_volume(tmp_path, text)
    assert found["extinction"] == (1, 1, 1)
    assert "not supported: volume shader PxrVolume (default used): /M" in report


@with_vdb
def test_colours_are_those_of_the_working_space(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(), grid((1, 0, 0), 3, name="tint")])
    shader = """uniform token info:id = "standard_volume"
        string inputs:scatter_color_channel = "tint"
        color3f inputs:scatter_color = (1, 1, 1)"""
    text = volume(field() + field("tint"), BOUND) + material(shader, "")
    found, _, _ = the_volume(tmp_path, text, working_space="acescg")
    assert found["albedo"] == pytest.approx((1, 1, 1), abs=1e-3)
    assert found["color"]["values"][0, 0, 0, 0] == pytest.approx((0.613, 0.07, 0.02), abs=2e-3)


def test_black_bodies() -> None:
    light = radiance(np.array([0, 1000, 5000, 1e9]))
    luminance = light @ np.array([0.2126, 0.7152, 0.0722])
    assert luminance[0] == 0 and np.isfinite(light).all()
    assert luminance[2] == pytest.approx(5.670374e-8 * 1e-6 * 5000.0**4 / np.pi, rel=1e-5)
    assert light[1, 0] > 2 * light[1, 1] and light[1, 2] == 0


# Errors


@with_vdb
@pytest.mark.parametrize(
    ("made", "line"),
    [
        (grid(np.nan), "/V/density: .*a.vdb: grid 'density' has 512 values that are infinite"),
        (grid(np.inf), "infinite"),
        (grid(-1), "512 numbers below 0, down to -1: a density has none"),
    ],
)
def test_values_that_no_density_has(tmp_path: Path, made: dict[str, Any], line: str) -> None:
    vdb.write(tmp_path / "a.vdb", [made])
    with pytest.raises(WavecombError, match=line):
        load(tmp_path, volume(field()))


@with_vdb
def test_slightly_below_zero_is_zero(tmp_path: Path) -> None:
    made = grid(1)
    made["values"][0, 0, 0, 0] = -1e-5
    vdb.write(tmp_path / "a.vdb", [made])
    found, _, report = the_volume(tmp_path, volume(field()))
    assert found["density"]["values"].min() == 0
    assert "density slightly below 0" in report


@with_vdb
def test_what_is_left_out(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(0), grid((1, 1, 1), 3, name="flow")])
    cases = {
        volume(field()): "empty grid 'density': left out",
        volume(field(file="gone.vdb")): "gone.vdb is missing",
        volume(field(more='token fieldName = "smoke"')): "has no grid 'smoke' 0 (there are 'd",
        volume(field(more='token fieldName = "flow"')): "",
        volume(field().replace("OpenVDBAsset", "Field3DAsset")): "Field3DAsset as a volume field",
        volume("rel field:density = </Nowhere>"): "without its asset /Nowhere",
    }
    for text, line in cases.items():
        scene, loaded = load(tmp_path, text)
        assert not scene.volumes and line in said(loaded), text


@with_vdb
def test_a_broken_file_is_one_line(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(np.random.default_rng(1).random((8, 8, 8)))])
    data = (tmp_path / "a.vdb").read_bytes()
    (tmp_path / "a.vdb").write_bytes(data[:-200])
    with pytest.raises(WavecombError, match=r"^/V/density: .*a\.vdb: .* ends too early$"):
        load(tmp_path, volume(field()))


def test_without_openvdb_volumes_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vdb, "is_there", lambda: False)
    scene, loaded = load(tmp_path, volume(field()) + 'def Sphere "S" {}')
    assert not scene.volumes and len(scene.meshes) == 1
    assert f"not supported: Volume without {vdb.ABSENT}: left out: /V" in said(loaded)
    assert "tools/setup_openvdb" in vdb.ABSENT


# Stages of others


@with_vdb
def test_smoke_in_instances_of_arnold(tmp_path: Path) -> None:
    asset("reference/arnold-usd/test_0030/data/scene.usda")
    folder = ASSETS / "reference/arnold-usd/test_0030/data"
    text = (folder / "scene.usda").read_text().replace("./smoke.vdb", f"{folder}/smoke.vdb")
    scene, _ = load(tmp_path, text)
    assert [one["to_world"][3, 0] for one in scene.volumes] == [100, 200, 300]
    assert len(scene.grids) == 1
    assert scene.volumes[0]["extinction"] == pytest.approx((1, 1, 1))
    assert scene.volumes[0]["albedo"] == HALF


@with_vdb
def test_torus_of_arnold(tmp_path: Path) -> None:
    file = asset("reference/arnold-usd/test_2239/data/test.usda")
    text = file.read_text().replace("@./", f"@{file.parent}/")
    (tmp_path / "s.usda").write_text(text)
    from wavecomb.usd import load_stage

    loaded = load_stage(tmp_path / "s.usda", builder_factory=Recorder, frame=2)
    (found,) = loaded.scene.volumes
    assert found["density"] is not None
    missing = load_stage(tmp_path / "s.usda", builder_factory=Recorder, frame=1)
    assert not missing.scene.volumes and "plane01.vdb is missing" in said(missing)


def test_files_of_volumes_are_listed(tmp_path: Path) -> None:
    from wavecomb.usd.layers.dependencies import dependencies

    (tmp_path / "a.vdb").write_bytes(b"x")
    times = "asset filePath.timeSamples = { 1: @./a.vdb@, 2: @./gone.vdb@ }"
    text = volume(f'rel field:density = </V/density>\ndef OpenVDBAsset "density" {{ {times} }}')
    found = dependencies(write(tmp_path, text))
    assert str(tmp_path / "a.vdb") in found.files
    assert any("gone.vdb" in line for line in found.missing)


MIST = """<?xml version="1.0"?>
<materialx version="1.39">
  <anisotropic_vdf name="medium" type="VDF">
    <input name="absorption" type="vector3" value="1, 2, 3"/>
    <input name="scattering" type="vector3" value="1, 2, 1"/>
  </anisotropic_vdf>
  <volume name="vol" type="volumeshader">
    <input name="vdf" type="VDF" nodename="medium"/>
  </volume>
  <volumematerial name="Mist" type="material">
    <input name="volumeshader" type="volumeshader" nodename="vol"/>
  </volumematerial>
</materialx>
"""


@needs("MaterialX")
def test_volumes_of_materialx_files(tmp_path: Path) -> None:
    (tmp_path / "mist.mtlx").write_text(MIST)
    extent = "float3[] extent = [(0, 0, 0), (1, 1, 1)]"
    text = (
        "#usda 1.0\n(metersPerUnit = 1)\n"
        'def "Looks" (references = @mist.mtlx@</MaterialX>) {}\n'
        + volume("", f"{extent}\nrel material:binding = </Looks/Materials/Mist>")
    )
    found, _, report = the_volume(tmp_path, text)
    assert found["extinction"] == (2, 4, 4) and found["albedo"] == (0.5, 0.5, 0.25)
    assert "not supported" not in report
