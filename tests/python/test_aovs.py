# SPDX-License-Identifier: Apache-2.0
"""Tests AOVs from stage to file: allowed names, values and layer names."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from click.testing import CliRunner
from usd_recorder import QUAD, load, write

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.image import cryptomatte
from wavecomb.image.files.image import read_layers, read_metadata
from wavecomb.run import aovs

_core = pytest.importorskip("wavecomb._core")

RIG = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World" {
    def Camera "Cam" {
        float focalLength = 30
        double3 xformOp:translate = (0.2, 0.6, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def RectLight "Key" (prepend apiSchemas = ["CollectionAPI:lightLink"]) {
        float inputs:intensity = 9
        float inputs:width = 2
        string primvars:wavecomb:lightGroup = "key"
        float3 xformOp:rotateXYZ = (-60, 0, 0)
        double3 xformOp:translate = (0, 4, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def Scope "Rig" {
        string primvars:wavecomb:lightGroup = "rig 1"
        def SphereLight "A" {
            float inputs:intensity = 30
            float inputs:radius = 0.2
            double3 xformOp:translate = (-1.7, 1.4, 1)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
    }
    def DomeLight "Sky" {
        float inputs:intensity = 0.2
        string karma:light:lpetag = "sky"
    }
    def DistantLight "Sun" {
        float inputs:intensity = 3000
        float3 xformOp:rotateXYZ = (-40, 30, 0)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    }
    def Sphere "Ball" {
        double radius = 0.8
    }
    def Xform "Tree" (kind = "component") {
        def Cone "Top" {
            double3 xformOp:translate = (1.6, 0.4, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
    }
    def Mesh "Lamp" {
        string primvars:arnold:aov = "lamp"
        point3f[] points = [(-2, 0, -1), (-1, 0, -1), (-1, 1, -1), (-2, 1, -1)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        uniform token subdivisionScheme = "none"
        rel material:binding = </World/Glow>
    }
    def Material "Glow" {
        token outputs:surface.connect = </World/Glow/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = (3, 1, 0.5)
            token outputs:surface
        }
    }
}
"""
GROUPS = ["other", "key", "rig_1", "sky", "lamp"]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("rig"), RIG)


@pytest.fixture(scope="module")
def loaded(stage: Path) -> Any:
    return wavecomb.load(stage)


@pytest.fixture(scope="module")
def picture(loaded: Any) -> wavecomb.Picture:
    return wavecomb.render(loaded, size=(64, 48), spp=16, aovs=["all"])


def test_names_are_expanded() -> None:
    assert aovs.expand(["uv", "beauty", "depth"]) == ("beauty", "depth", "uv")
    assert aovs.expand(["all", "light_key"]) == aovs.names()
    assert aovs.expand(["light_b", "light_a"]) == ("beauty", "light_b", "light_a")
    assert set(aovs.names()) == {"beauty", "samples", "error", "variance", *aovs.core_aovs()}
    with pytest.raises(WavecombError, match=r"AOV 'albdo' is not known; there are beauty, albedo"):
        aovs.expand(["albdo"])


def test_every_row_of_the_table_finds_its_value(picture: wavecomb.Picture) -> None:
    """Every AOV of the table gets a value. An AOV without a value would be an empty layer."""
    layers = {**picture.layers(), **picture.aovs}
    elsewhere = {
        "guided_share": "test_guiding.py", "by_light_paths": "test_techniques.py",
        "motion": "test_lens.py",
    }  # fmt: skip
    for name, row in aovs.core_aovs().items():
        if name in elsewhere:
            assert not layers[name].any(), elsewhere[name]
            continue
        if name == "transmittance":
            assert (layers[name] == 1).all()
            continue
        kept = [n for n in layers if n.startswith("light_")] if row.kind == "groups" else [name]
        for one in kept:
            layer = layers[one]
            if row.channels:
                assert layer.shape[2:] == ((row.channels,) if row.channels > 1 else ()), one
            # The ids of a Cryptomatte layer are bit patterns.
            values = layer.view(np.uint32) if row.kind == "coverage" else layer
            assert values.max() > values.min(), one


def test_nothing_else_than_the_beauty(loaded: Any, picture: wavecomb.Picture) -> None:
    plain = wavecomb.render(loaded, size=(64, 48), spp=16, aovs=[])
    assert plain.albedo is plain.normal is plain.depth is None
    assert list(plain.layers()) == ["beauty"]
    assert plain.stats["memory_bytes"]["film"] == 64 * 48 * 32
    assert plain.beauty.tobytes() == picture.beauty.tobytes()


def test_errors_are_there_where_asked_for(loaded: Any, picture: wavecomb.Picture) -> None:
    assert picture.error is not None and picture.variance is not None
    plain = wavecomb.render(loaded, size=(16, 16), spp=16)
    assert plain.error is plain.variance is None
    adaptive = wavecomb.render(loaded, size=(16, 16), spp=32, adaptive=0.1)
    assert {"error", "variance"} < set(adaptive.layers())
    chosen = wavecomb.render(loaded, size=(16, 16), spp=32, adaptive=0.1, aovs=["uv", "error"])
    assert set(chosen.layers()) == {"beauty", "uv", "error"}


@pytest.mark.parametrize("names", [("all",), aovs.DEFAULT, ("light_key", "uv")])
def test_memory_is_as_stated(loaded: Any, names: tuple[str, ...]) -> None:
    chosen = aovs.expand(names)
    memory = wavecomb.render(loaded, size=(16, 16), spp=1, aovs=chosen).stats["memory_bytes"]
    assert memory["film"] + memory["picture"] == 256 * aovs.bytes_per_pixel(chosen, len(GROUPS))


def test_many_light_groups_count(monkeypatch: pytest.MonkeyPatch) -> None:
    from wavecomb.run.settings import check_memory

    monkeypatch.setattr("wavecomb.run.settings.machine_limit", lambda: 2**30)
    settings = _core.Settings(width=1500, height=1500, spp=1, transport="path")
    check_memory(settings, aovs.expand(["light_groups"]), 4)
    with pytest.raises(WavecombError, match=r"needs about 5 GiB .*smaller size or fewer AOVs"):
        check_memory(settings, aovs.expand(["light_groups"]), 64)


def test_light_groups_of_a_stage(loaded: Any, picture: wavecomb.Picture) -> None:
    assert sorted(loaded.scene.light_groups) == sorted(GROUPS)
    lights = {name: picture.aovs[f"light_{name}"] for name in GROUPS}
    total = sum(light.astype(np.float64) for light in lights.values())
    assert total == pytest.approx(picture.beauty, rel=1e-5, abs=1e-6)
    for name, light in lights.items():
        assert light.max() > 0.01, name
    parts = [picture.aovs[name].astype(np.float64) for name in ("emission", "direct", "indirect")]
    assert sum(parts) == pytest.approx(picture.beauty, rel=1e-5, abs=1e-6)
    sky = lights["sky"][:5].mean(axis=(0, 1))
    assert sky == pytest.approx(picture.aovs["emission"][:5].mean(axis=(0, 1)), rel=1e-5)


def test_one_light_group_is_the_same(loaded: Any, picture: wavecomb.Picture) -> None:
    one = wavecomb.render(loaded, size=(64, 48), spp=16, aovs=["light_rig_1"])
    assert list(one.layers()) == ["beauty", "light_rig_1"]
    assert one.aovs["light_rig_1"].tobytes() == picture.aovs["light_rig_1"].tobytes()
    with pytest.raises(ValueError, match=r"^the scene has no light group 'rim'; it has other, "):
        wavecomb.render(loaded, size=(8, 8), spp=1, aovs=["light_rim"])


def test_positions_lie_where_the_matrices_say(picture: wavecomb.Picture) -> None:
    hit = picture.aovs["material_id"] > 0
    y, x = np.nonzero(hit)
    points = np.column_stack([picture.aovs["position"][hit], np.ones(len(x))]).astype(np.float64)
    clip = points @ picture.metadata["worldToNDC"]
    ndc = clip[:, :2] / clip[:, 3:]
    place = np.column_stack([(ndc[:, 0] + 1) * 32 - 0.5 - x, (1 - ndc[:, 1]) * 24 - 0.5 - y])
    assert np.abs(place).max() < 1.0
    assert np.sqrt((place**2).sum(axis=1)).mean() < 0.3
    camera = points @ picture.metadata["worldToCamera"]
    assert picture.depth is not None
    inside = np.abs(camera[:, 2] + picture.depth[hit]) < 0.3
    assert inside.mean() > 0.9


def test_matrices_are_finite_without_a_far_plane() -> None:
    from wavecomb.image.files.render_output import scene_metadata

    builder = wavecomb.SceneBuilder()
    builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5), far_clip=float("inf"))
    assert np.isfinite(scene_metadata(builder.build(), 4, 3)["worldToNDC"]).all()


def test_cryptomatte_in_a_file(picture: wavecomb.Picture, tmp_path: Path) -> None:
    file = tmp_path / "a.exr"
    picture.save(file, compression="piz", tile=32, half=True)
    layers, attributes = read_layers(file), read_metadata(file)
    keys = {key.split("/")[1] for key in attributes if key.startswith("cryptomatte/")}
    assert len(keys) == 3 and all(len(key) == 7 for key in keys)
    for key in keys:
        name = attributes[f"cryptomatte/{key}/name"]
        assert key == f"{_core.crypto_id(name):08x}"[:7]
        assert attributes[f"cryptomatte/{key}/hash"] == "MurmurHash3_32"
        assert attributes[f"cryptomatte/{key}/conversion"] == "uint32_to_float32"
        manifest = json.loads(attributes[f"cryptomatte/{key}/manifest"])
        assert all(int(value, 16) == _core.crypto_id(name) for name, value in manifest.items())
        assert layers[f"{name}00"].shape == layers[f"{name}02"].shape == (48, 64, 4)
    manifests = cryptomatte.manifests(attributes)
    assert manifests == picture.manifests
    assert set(manifests["crypto_object"]) == {
        "/World/Ball",
        "/World/Tree/Top",
        "/World/Lamp",
        "/World/Rig/A",
    }
    assert {"/World/Tree", "/World/Ball"} < set(manifests["crypto_asset"])
    pairs = cryptomatte.gather(layers)["crypto_object"]
    assert pairs.tobytes() == picture.aovs["crypto_object"].tobytes()
    covered = sum(cryptomatte.matte(pairs, i) for i in manifests["crypto_object"].values())
    assert covered == pytest.approx(pairs[:, :, 1::2].sum(axis=2), abs=1e-6)
    ball = cryptomatte.matte(pairs, manifests["crypto_object"]["/World/Ball"])
    assert ball.max() == 1
    assert 0 < ((ball > 0) & (ball < 1)).mean() < 0.2, "edges are shared"
    assert (np.diff(pairs[:, :, 1::2], axis=2) <= 0).all(), "most coverage first"
    # With half precision, ids and counts are exact and colours are not.
    assert layers["samples"].min() == 16
    assert layers["position"].tobytes() == picture.aovs["position"].tobytes()
    assert layers["direct"].tobytes() != picture.aovs["direct"].tobytes()


def test_channels_in_a_file(picture: wavecomb.Picture, tmp_path: Path) -> None:
    picture.save(tmp_path / "a.exr")
    source = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    names = set(source.spec().channelnames)
    source.close()
    assert {"R", "albedo.R", "normal.X", "depth.Z", "position.Z", "uv.U", "uv.V"} < names
    assert {"CryptoObject00.R", "CryptoAsset02.A", "light_key.G", "indirect.B"} < names
    assert {"samples", "cost", "material_id", "instance_id", "error", "variance.G"} < names
    back = read_layers(tmp_path / "a.exr")
    for name, layer in picture.layers().items():
        want = layer.astype(np.float32)
        assert back[name].reshape(want.shape).tobytes() == want.tobytes(), name


def test_one_file_each(picture: wavecomb.Picture, tmp_path: Path) -> None:
    files = picture.save(tmp_path / "a.exr", split=True, compression="dwaa", half=True)
    assert {file.name for file in files} == {file.name for file in tmp_path.iterdir()}
    assert {"a.exr", "a.crypto_object.exr", "a.light_key.exr"} < {file.name for file in files}
    # Ids survive every compression.
    crypto = tmp_path / "a.crypto_object.exr"
    assert read_metadata(crypto)["compression"] == "zip"
    assert read_metadata(tmp_path / "a.exr")["compression"].startswith("dwaa")
    pairs = cryptomatte.gather(read_layers(crypto))["crypto_object"]
    assert pairs.tobytes() == picture.aovs["crypto_object"].tobytes()
    assert list(cryptomatte.manifests(read_metadata(crypto))) == ["crypto_object"]
    position = read_layers(tmp_path / "a.position.exr")["position"]
    assert position.tobytes() == picture.aovs["position"].tobytes()


def test_one_file_each_of_a_long_name(picture: wavecomb.Picture, tmp_path: Path) -> None:
    path = tmp_path / ("n" * 200 + ".exr")
    for file in picture.save(path, split=True):
        assert read_layers(file)


def test_split_files_are_all_there_or_none(picture: wavecomb.Picture, tmp_path: Path) -> None:
    (tmp_path / "a.uv.exr").mkdir()
    with pytest.raises(IsADirectoryError, match=r"a\.uv\.exr: is a folder"):
        picture.save(tmp_path / "a.exr", split=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.uv.exr"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--aov", "albdo"], "AOV 'albdo' is not known"),
        (["--aov", "light_rim"], "the scene has no light group 'rim'"),
        (["--aov", "crypto", "--compression", "dwaa"], "compression dwaa would spoil Crypto"),
        (["--aov", "position", "--compression", "dwaa"], "compression dwaa would spoil position"),
        (["--exr-tile", "20"], "tiles of 20 pixels: must be a multiple of 16"),
    ],
)
def test_refused_in_one_line(stage: Path, tmp_path: Path, options: list[str], message: str) -> None:
    output = tmp_path / "a.exr"
    result = CliRunner().invoke(
        main, ["render", str(stage), "-o", str(output), "--size", "8", "8", "--spp", "1", *options]
    )
    assert result.exit_code == 2
    errors = [line for line in result.stderr.splitlines() if line.startswith("error:")]
    assert len(errors) == 1 and message in errors[0]
    assert not output.exists()


def test_objects_are_named_by_their_instances(tmp_path: Path) -> None:
    text = f"""
    def Xform "World" {{
        def Xform "Protos" {{
            over "Leaf" {{ def Mesh "Blade" {{ {QUAD} }} }}
        }}
        def Xform "Chair_1" (
            instanceable = true; kind = "component"; references = </Chair>
        ) {{}}
        def Xform "Chair_2" (
            instanceable = true; kind = "component"; references = </Chair>
        ) {{}}
        def PointInstancer "Points" {{
            rel prototypes = [</World/Protos/Leaf>]
            int[] protoIndices = [0, 0, 0]
            point3f[] positions = [(0,0,0), (5,0,0), (9,0,0)]
            int64[] ids = [10, 11, 12]
            int64[] invisibleIds = [10]
        }}
    }}
    class "Chair" {{ def Xform "Body" {{ def Mesh "Seat" {{ {QUAD} }} }} }}
    """
    scene = wavecomb.load(write(tmp_path, text)).scene
    objects = scene.object_names
    assert ("/World/Chair_1/Body/Seat", "/World/Chair_1") in objects
    assert ("/World/Chair_2/Body/Seat", "/World/Chair_2") in objects
    points = sorted(pair for pair in objects if "Points" in pair[0])
    assert points == [(f"/World/Points[{i}]/Blade", f"/World/Points[{i}]") for i in (1, 2)]


def test_light_groups_that_cannot_be_told_apart(tmp_path: Path) -> None:
    """Duplicate and excess light groups are reported, and no mesh is lost."""
    glow = """
    def Material "Glow" {
        token outputs:surface.connect = </World/Glow/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = (3, 1, 0.5)
            token outputs:surface
        }
    }"""

    def scene(names: list[str], bound: int) -> tuple[Any, str]:
        meshes = "".join(
            f"""def Mesh "M{i}" {{
                {QUAD}
                string primvars:arnold:aov = "{name}"
                {"rel material:binding = </World/Glow>" if i < bound else ""}
            }}
            """
            for i, name in enumerate(names)
        )
        loaded = wavecomb.load(write(tmp_path, f'def Xform "World" {{ {glow}\n{meshes} }}'))
        return loaded.scene, "\n".join(finding.line() for finding in loaded.report.warnings)

    both, said = scene(["rig 1", "rig-1", "rim"], 3)
    assert sorted(both.light_groups) == ["other", "rig_1", "rim"]
    assert "light groups 'rig 1' and 'rig-1' are one: channels call both 'rig_1': /World/M1" in said
    many, said = scene([f"g{i}" for i in range(70)], 70)
    assert many.mesh_count == 70
    assert len(many.light_groups) == 64
    assert "more than 63 light groups: light of the rest is in 'other': /World/M63" in said
    dark, said = scene([f"g{i}" for i in range(70)], 1)
    assert sorted(dark.light_groups) == ["g0", "other"], "only meshes that shine have one"
    assert "light groups" not in said


def test_light_groups_reach_the_builder(tmp_path: Path) -> None:
    recorder, _ = load(tmp_path, RIG)
    groups = {light["name"]: light.get("group", "") for light in recorder.lights}
    assert groups == {
        "/World/Key": "key",
        "/World/Rig/A": "rig_1",
        "/World/Sky": "sky",
        "/World/Sun": "",
    }
    assert recorder.mesh("Lamp")["light_group"] == "lamp"
    assert recorder.mesh("Top")["asset"] == "/World/Tree"
