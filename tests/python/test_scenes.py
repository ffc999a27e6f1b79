# SPDX-License-Identifier: Apache-2.0
"""Tests that procedural stages have the documented contents and valid meshes."""

from __future__ import annotations

import gzip
import re
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from parts import asset, written_scenes
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

import wavecomb
from wavecomb.scenes import SceneError, options, write_scene
from wavecomb.scenes.authoring.materials import PROGRAMS
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.authoring.textures import TEXTURES, sky
from wavecomb.scenes.models.dragon import MIN_TRIANGLES, dragon
from wavecomb.scenes.models.mesh import Mesh, face_areas, signed_volume
from wavecomb.scenes.models.mesh_file import TARGET_DIAGONAL, load_dragon
from wavecomb.scenes.models.sweep import Tube, tube_mesh
from wavecomb.scenes.models.teapot import teapot, teapot_patches
from wavecomb.usd import LoadedStage

SMALL = {
    "triangles": 12_000, "teapot_level": 4, "texture_size": 64, "texture_mb": 0.5, "voxels": 24,
    "splats": 2_000,
}  # fmt: skip


@pytest.fixture(scope="module", params=written_scenes())
def stage(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Usd.Stage:
    path = tmp_path_factory.mktemp("scenes") / f"{request.param}.usdc"
    write_scene(request.param, path, **SMALL)
    return Usd.Stage.Open(str(path))


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Usd.Stage]:
    folder = tmp_path_factory.mktemp("experiment")
    for name in ("mixed", "dragon"):
        write_scene(name, folder / f"{name}.usdc", **SMALL)
    return {name: Usd.Stage.Open(str(folder / f"{name}.usdc")) for name in ("mixed", "dragon")}


def assert_sound(mesh: Mesh, closed: bool = True) -> None:
    assert np.isfinite(mesh.points).all() and np.isfinite(mesh.uv).all()
    assert mesh.faces.min() == 0 and mesh.faces.max() < len(mesh.points)
    assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1.0).max() < 1e-5
    assert face_areas(mesh.points, mesh.faces).min() > 0.0
    assert signed_volume(mesh.points, mesh.faces) > 0.0
    if closed:
        assert_closed(mesh)


def assert_closed(mesh: Mesh) -> None:
    """Asserts that each edge, with seams welded, is used equally often in both directions."""
    _, weld = np.unique(mesh.points + np.float32(0.0), axis=0, return_inverse=True)
    faces = weld.ravel()[mesh.faces].astype(np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = np.sort(edges[:, 0] << 32 | edges[:, 1])
    back = np.sort(edges[:, 1] << 32 | edges[:, 0])
    assert np.array_equal(there, back)


def objects(stage: Usd.Stage) -> list[Usd.Prim]:
    return list(stage.GetPrimAtPath("/World/Objects").GetChildren())


def program(material: UsdShade.Material) -> str:
    return material.GetPrim().GetAttribute("wavecomb:program").Get()


# Stages


@pytest.mark.slow
def test_every_stage_is_complete(stage: Usd.Stage) -> None:
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    assert UsdGeom.GetStageMetersPerUnit(stage) > 0.0
    assert stage.GetDefaultPrim().GetPath() == "/World"
    name = Path(stage.GetRootLayer().realPath).stem
    prims = list(stage.Traverse())
    assert sum(prim.IsA(UsdGeom.Camera) for prim in prims) == 1
    assert any(prim.HasAPI(UsdLux.LightAPI) for prim in prims)
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh):
            bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            assert bound, prim.GetPath()
            if name in ("room", "kitchen"):
                assert program(bound) is None
            else:
                assert program(bound) in PROGRAMS or bound.GetSurfaceOutput("mtlx")
            assert UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
            counts = np.array(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get())
            indices = np.array(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get())
            points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
            assert counts.sum() == len(indices)
            assert indices.min() >= 0 and indices.max() < len(points)


@pytest.mark.slow
def test_textures_are_beside_the_stage(stage: Usd.Stage) -> None:
    folder = Path(stage.GetRootLayer().realPath).parent
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset and attribute.Get():
                written = attribute.Get().path
                assert re.fullmatch(
                    r"\./[\w-]+_(textures/\w+\.(png|exr)|volumes/\w+\.vdb)", written
                )
                assert (folder / written).is_file()
    assert not list(folder.rglob("*.part*"))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "teapots", "dragons"), [("mixed", 45, 45), ("dragon", 0, 90)])
def test_object_counts(
    experiment: dict[str, Usd.Stage], name: str, teapots: int, dragons: int
) -> None:
    prims = objects(experiment[name])
    kinds = Counter(prim.GetName().split("_")[0] for prim in prims)
    assert (kinds["Teapot"], kinds["Dragon"], len(prims)) == (teapots, dragons, 90)
    assert all(prim.IsInstance() for prim in prims)
    assert len(experiment[name].GetPrototypes()) == (2 if teapots else 1)


@pytest.mark.slow
def test_mixed_has_many_materials_over_all_programs(experiment: dict[str, Usd.Stage]) -> None:
    stage = experiment["mixed"]
    bound = {
        str(UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPath()): program(
            UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        )
        for prim in objects(stage)
    }
    assert len(bound) >= 12
    assert set(bound.values()) == set(PROGRAMS)
    files = {
        UsdShade.Shader(prim).GetInput("file").Get().path
        for prim in stage.Traverse()
        if prim.IsA(UsdShade.Shader) and UsdShade.Shader(prim).GetInput("file")
    }
    assert len(files) >= 6
    dragon_looks = {
        str(UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPath())
        for prim in objects(experiment["dragon"])
    }
    assert len(dragon_looks) >= 8


@pytest.mark.parametrize("name", ["mixed", "dragon"])
@pytest.mark.slow
def test_mirror_sky_and_ground(experiment: dict[str, Usd.Stage], name: str) -> None:
    stage = experiment[name]
    mirror = stage.GetPrimAtPath("/World/Set/Mirror")
    corners = np.array(UsdGeom.Mesh(mirror).GetPointsAttr().Get())
    a, b, c, d = corners
    assert abs(np.dot(np.cross(b - a, c - a), d - a)) < 1e-3
    assert np.linalg.norm(np.cross(b - a, d - a)) > 100.0
    look = UsdShade.MaterialBindingAPI(mirror).ComputeBoundMaterial()[0]
    surface = UsdShade.Shader(look.GetSurfaceOutput().GetConnectedSource()[0].GetPrim())
    assert program(look) == "metal" and surface.GetInput("roughness").Get() == 0.0
    assert any(prim.IsA(UsdLux.DomeLight) for prim in stage.Traverse())
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    for prim in objects(stage):
        assert abs(cache.ComputeWorldBound(prim).ComputeAlignedRange().GetMin()[1]) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mixed", "dragon"])
def test_lamps_stand_in_for_ceiling_and_sky(
    experiment: dict[str, Usd.Stage], tmp_path: Path, name: str
) -> None:
    write_scene(name, tmp_path / "lamps.usdc", lamps=True, **SMALL)
    lit = Usd.Stage.Open(str(tmp_path / "lamps.usdc"))
    lights = [p for p in lit.Traverse() if p.HasAPI(UsdLux.LightAPI)]
    assert [p.GetName() for p in lights] == ["Key", "Fill", "Dome"]
    assert not UsdLux.DomeLight(lights[2]).GetTextureFileAttr().Get()
    paths = [
        {str(p.GetPath()) for p in stage.Traverse() if "/Lights" not in str(p.GetPath())}
        for stage in (lit, experiment[name])
    ]
    assert paths[0] == paths[1]


def test_objects_of_the_mixed_stage_keep_apart(experiment: dict[str, Usd.Stage]) -> None:
    places = np.array(
        [
            UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())[3][:3]
            for prim in objects(experiment["mixed"])
        ]
    )
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2) + 1e9 * np.eye(90)
    assert gaps.min() > 1.8


def test_cornell_is_the_measured_box(tmp_path: Path) -> None:
    write_scene("cornell", tmp_path / "c.usda")
    stage = Usd.Stage.Open(str(tmp_path / "c.usda"))
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    box = cache.ComputeWorldBound(stage.GetPrimAtPath("/World/Set")).ComputeAlignedRange()
    assert np.allclose(box.GetMax(), (556.0, 548.8, 559.2), atol=1e-3)
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera()
    frustum = camera.frustum
    assert np.allclose(frustum.GetPosition(), (278, 273, -800))
    assert np.allclose(frustum.ComputeViewDirection(), (0, 0, 1), atol=1e-12)
    assert np.isclose(camera.GetFieldOfView(camera.FOVHorizontal), 39.3077, atol=1e-3)
    light = UsdLux.RectLight(stage.GetPrimAtPath("/World/Lights/Ceiling"))
    matrix = np.array(UsdGeom.Xformable(light).ComputeLocalToWorldTransform(0.0))
    assert np.allclose(-matrix[2, :3], (0, -1, 0), atol=1e-12)
    radiance = np.array(light.GetColorAttr().Get()) * light.GetIntensityAttr().Get()
    assert np.allclose(radiance, (17, 12, 4), rtol=1e-6)


def test_walls_of_the_cornell_box_face_inwards(tmp_path: Path) -> None:
    write_scene("cornell", tmp_path / "c.usda")
    stage = Usd.Stage.Open(str(tmp_path / "c.usda"))
    middle = np.array([278.0, 274.4, 279.6])
    for prim in stage.GetPrimAtPath("/World/Set").GetChildren():
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        assert np.dot(normal, middle - points.mean(axis=0)) > 0.0, prim.GetName()
    for prim in objects(stage):
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
        indices = np.array(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)
        for a, b, c, d in points[indices]:
            normal = np.cross(b - a, c - a)
            assert np.dot(normal, 0.25 * (a + b + c + d) - points.mean(axis=0)) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("material", ["gold", "glass"])
def test_cornell_dragon_stands_in_the_box(tmp_path: Path, material: str) -> None:
    write_scene("cornell-dragon", tmp_path / "c.usdc", material=material, triangles=12_000)
    stage = Usd.Stage.Open(str(tmp_path / "c.usdc"))
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    box = cache.ComputeWorldBound(stage.GetPrimAtPath("/World/Objects")).ComputeAlignedRange()
    low, high = np.array(box.GetMin()), np.array(box.GetMax())
    assert abs(low[1]) < 1e-2
    assert (low[[0, 2]] > 0.0).all() and (high < (549.6, 548.8, 559.2)).all()


@pytest.mark.slow
def test_same_seed_same_bytes(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        options.dragon.cache_clear()  # type: ignore[attr-defined]
        write_scene("mixed", tmp_path / folder / "s.usda", seed=3, **SMALL)
    write_scene("mixed", tmp_path / "other.usda", seed=4, **SMALL)
    a, b = (sorted((tmp_path / folder).rglob("*.*")) for folder in ("a", "b"))
    assert [p.name for p in a] == [p.name for p in b]
    for left, right in zip(a, b, strict=True):
        if left.suffix == ".usda":
            assert left.read_bytes() == right.read_bytes()
        elif left.is_file():
            pixels = [oiio.ImageBuf(str(p)).get_pixels(oiio.FLOAT) for p in (left, right)]
            assert np.array_equal(*pixels)
    assert (tmp_path / "other.usda").read_bytes() != a[0].read_bytes()


@pytest.mark.parametrize(
    ("name", "file", "options", "words"),
    [
        ("cellar", "k.usda", {}, "cellar"),
        ("cornell", "k.obj", {}, "k.obj"),
        ("cornell", "k.usda", {"colour": 1}, "colour"),
        ("mixed", "k.usda", {"triangles": 10}, "10"),
        ("mixed", "k.usda", {"teapot_level": 0, "triangles": 12_000}, "teapot level"),
        ("mixed", "k.usda", {"texture_size": 0}, "texture size"),
        ("mixed", "k.usda", {"aspect": -1.0}, "aspect"),
        ("cornell-dragon", "k.usda", {"material": "cheese"}, "cheese"),
        ("dragon", "k.usda", {"dragon": "nowhere.obj"}, "nowhere.obj"),
    ],
)
def test_bad_requests_say_why(
    tmp_path: Path, name: str, file: str, options: dict[str, object], words: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        write_scene(name, tmp_path / file, **{"texture_size": 64, **options})
    assert "\n" not in str(caught.value)
    assert not (tmp_path / file).exists()


# Spread


def spread_stage(folder: Path, **options: Any) -> tuple[Usd.Stage, LoadedStage]:
    path = folder / "spread.usdc"
    write_scene("spread", path, texture_size=64, **options)
    return Usd.Stage.Open(str(path)), wavecomb.load(path)


@pytest.mark.slow
def test_spread_has_what_was_asked_for(tmp_path: Path) -> None:
    stage, loaded = spread_stage(
        tmp_path, materials=200, texture_mb=6.0, triangles=40_000, shader_cost=50.0, programs=3
    )
    scene = loaded.scene
    stones = [name for name, _ in scene.materials if "Stone_" in name]
    assert len(stones) == 200
    assert {kind for name, kind in scene.materials if "Stone_" in name} == {
        "principled",
        "diffuse",
        "plastic",
    }
    assert scene.triangles == pytest.approx(40_000, rel=0.1)
    assert scene.instanced_triangles == scene.triangles
    own = [size for name, size in scene.textures if "stone_" in name]
    assert len(own) == 200 and sum(own) == pytest.approx(6e6, rel=0.2)
    dear = {
        prim.GetName(): sum(
            shader.GetInput("octaves").Get()
            for child in prim.GetChildren()
            if (shader := UsdShade.Shader(child)).GetIdAttr().Get() == "ND_fractal3d_float"
        )
        for prim in stage.GetPrimAtPath("/World/Looks").GetChildren()
        if prim.GetName().startswith("Stone_")
    }
    assert dear["Stone_0000"] == 0 and dear["Stone_0199"] == 50
    assert list(dear.values()) == sorted(dear.values())
    assert not loaded.report.warnings


@pytest.mark.slow
def test_stones_are_closed_and_their_charts_lie_apart(tmp_path: Path) -> None:
    stage, _ = spread_stage(tmp_path, materials=2, texture_mb=8.0, triangles=20_000)
    prim = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Objects/Stone_0007"))
    points = np.array(prim.GetPointsAttr().Get())
    faces = np.array(prim.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    normals = np.array(prim.GetNormalsAttr().Get())
    assert_sound(Mesh(points, faces, normals, np.zeros((len(points), 2), np.float32)))
    st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
    assert st.GetInterpolation() == UsdGeom.Tokens.faceVarying
    uv = np.array(st.Get()).reshape(-1, 3, 2)
    size = uv.max(axis=1) - uv.min(axis=1)
    assert len(uv) == len(faces) and size.max() < 4.0 / 800.0  # 4 texels of about 860
    steps = np.abs(np.diff(uv.mean(axis=1), axis=0)).mean()
    # The mean distance per axis is 1/3 for independent positions in the unit square.
    assert 0.25 < steps < 0.42


@pytest.mark.slow
def test_shader_cost_takes_time(tmp_path: Path) -> None:
    stages = []
    for cost in (1.0, 200.0):
        (tmp_path / str(cost)).mkdir()
        _, loaded = spread_stage(
            tmp_path / str(cost), materials=1, texture_mb=0.5, triangles=5_000, shader_cost=cost
        )
        assert not loaded.report.warnings
        stages.append(loaded)

    def stone_ns(loaded: Any) -> float:
        stats = wavecomb.render(loaded, size=(32, 32), spp=8, threads=1).stats
        return next(m["ns_per_record"] for m in stats["materials"] if "Stone_" in m["name"])

    # The minimum of several runs, since other processes only add time.
    rounds = [[stone_ns(loaded) for loaded in stages] for _ in range(5)]
    plain, dear = (min(times) for times in zip(*rounds, strict=True))
    assert dear > 5.0 * plain > 0.0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"materials": 0}, "materials must be from 1"),
        ({"programs": 6}, "programs must be from 1 to 5"),
        ({"texture_mb": -1.0}, "texture_mb must be from 0"),
        ({"shader_cost": 0.5}, "shader_cost must be from 1"),
        ({"triangles": 100}, "triangles must be from 4608"),
    ],
)
def test_bad_spreads_say_why(tmp_path: Path, options: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        write_scene("spread", tmp_path / "spread.usdc", **options)
    assert not (tmp_path / "spread.usdc").exists()


# Heavy


@pytest.mark.slow
def test_heavy_has_materials_of_all_weights(tmp_path: Path) -> None:
    path = tmp_path / "heavy.usdc"
    write_scene("heavy", path, materials=24, texture_mb=4.0, triangles=10_000, texture_size=64)
    stage, scene = Usd.Stage.Open(str(path)), wavecomb.load(path).scene
    stones = [kind for name, kind in scene.materials if "Stone_" in name]
    assert (len(stones), stones.count("openpbr"), stones.count("diffuse")) == (24, 21, 3)
    own = [size for name, size in scene.textures if "stone_" in name]
    # Diffuse materials read one of their three maps.
    assert sum(own) == pytest.approx(4e6 * (21 + 3 * 4 / 9) / 24, rel=0.2)
    ids = [
        [UsdShade.Shader(node).GetIdAttr().Get() for node in look.GetChildren()]
        for look in stage.GetPrimAtPath("/World/Looks").GetChildren()
    ]
    weights = [nodes.count("ND_fractal3d_float") for nodes in ids]
    assert max(weights) == 8 and len(set(weights)) == 9


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"materials": 2000}, "materials must be from 1 to 1024"),
        ({"texture_mb": 0.0}, "texture_mb must be from 0.1"),
        ({"triangles": 100}, "triangles must be from 4608"),
    ],
)
def test_bad_heavy_fields_say_why(tmp_path: Path, options: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        write_scene("heavy", tmp_path / "heavy.usdc", **options)


# Textures


@pytest.mark.parametrize("name", sorted(TEXTURES))
def test_textures_are_sound(name: str) -> None:
    info = TEXTURES[name]
    image = info.make(64, np.random.default_rng(0))
    assert image.shape == (64, 64, 3) and image.dtype == np.float32
    assert image.min() >= 0.0 and image.max() <= 1.0 and image.std() > 0.01
    if info.normal:
        normal = 2.0 * image - 1.0
        assert np.allclose(np.linalg.norm(normal, axis=2), 1.0, atol=1e-5)
        assert (normal[..., 2] > 0.0).all()


def test_texture_sizes() -> None:
    assert max(info.size for info in TEXTURES.values()) >= 2048
    assert any(info.normal for info in TEXTURES.values())
    assert any(not info.colour and info.channels == "r" for info in TEXTURES.values())


def test_sky_is_a_bright_half(tmp_path: Path) -> None:
    image = sky(256, 128, 1)
    assert np.isfinite(image).all() and image.min() >= 0.0
    assert image[:60].mean() > image[70:].mean()
    assert image.max() > 50.0
    step = np.abs(image[:, 0] - image[:, -1]).mean()
    assert step < 3.0 * np.abs(np.diff(image, axis=1)).mean() + 0.01


# Teapot


def test_teapot_patches_are_the_published_ones() -> None:
    lines = asset("meshes/teapot/teapot_patches.txt").read_text().splitlines()
    count = int(lines[0])
    indices = np.array([[int(word) for word in line.split(",")] for line in lines[1 : count + 1]])
    points = np.array([[float(w) for w in line.split(",")] for line in lines[count + 2 :] if line])
    published = points[indices - 1]

    def as_set(patches: np.ndarray) -> set[tuple]:
        rounded = np.round(patches.reshape(len(patches), 16, 3), 6) + 0.0
        return {tuple(sorted(map(tuple, patch.tolist()))) for patch in rounded}

    assert len(as_set(published)) == 32
    assert as_set(teapot_patches()) == as_set(published)


def test_teapot_surface_is_the_published_one() -> None:
    published = np.array(
        [
            [float(word) for word in line.split()[1:4]]
            for line in asset("meshes/teapot/teapot.obj").read_text().splitlines()
            if line.startswith("v ")
        ]
    )
    spatial = pytest.importorskip("scipy.spatial")
    mesh = teapot(10)
    assert len(mesh.faces) == 6320
    # The published mesh has ten cells per edge as well, so the vertices coincide.
    near, _ = spatial.cKDTree(mesh.points).query(published)
    assert near.max() < 2e-3
    back, _ = spatial.cKDTree(published).query(mesh.points)
    assert back.max() < 2e-3


@pytest.mark.parametrize("level", [1, 2, 3, 16])
def test_teapot_is_sound(level: int) -> None:
    mesh = teapot(level)
    assert_sound(mesh, closed=False)
    a, b, c = (mesh.points[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    if level >= 3:
        facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces].mean(1))
        assert facing.min() > 0.0
    low, _ = mesh.bounds
    assert low[1] == 0.0


# Dragon


@pytest.mark.slow
@pytest.mark.parametrize("triangles", [MIN_TRIANGLES, 40_000, 250_000])
def test_dragon_is_sound(triangles: int) -> None:
    mesh = dragon(triangles)
    assert abs(len(mesh.faces) / triangles - 1.0) < 0.05
    assert_sound(mesh)
    low, high = mesh.bounds
    assert low[1] == 0.0
    assert np.isclose(np.linalg.norm(high - low), TARGET_DIAGONAL, rtol=0.05)
    a, b, c = (mesh.points[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces].sum(1))
    assert (facing > 0.0).mean() > 0.98


@pytest.mark.slow
def test_more_triangles_show_more_relief() -> None:
    coarse, fine = (
        signed_volume(*(lambda m: (m.points, m.faces))(dragon(n))) for n in (40_000, 400_000)
    )
    assert np.isclose(coarse, fine, rtol=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("count", [700_000, pytest.param(7_000_000, marks=pytest.mark.long)])
def test_a_huge_dragon(count: int) -> None:
    mesh = dragon(count)
    assert abs(len(mesh.faces) / count - 1.0) < 0.05
    assert np.isfinite(mesh.points).all()
    assert face_areas(mesh.points, mesh.faces).min() > 0.0


def test_a_ball_has_the_volume_of_a_ball() -> None:
    points = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    one = np.ones(3)
    mesh = tube_mesh(Tube(points, one, one, np.array([0.0, 1.0, 0.0])), 100, 100)
    assert len(mesh.faces) == 2 * 100 * 100
    assert_sound(mesh)
    assert np.isclose(signed_volume(mesh.points, mesh.faces), 4.0 / 3.0 * np.pi, rtol=0.02)


# Imported meshes

CUBE = np.array([[x, y, z] for x in (0, 2) for y in (5, 7) for z in (0, 2)], float)
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def obj_text() -> str:
    lines = ["# a cube", *[f"v {x} {y} {z}" for x, y, z in CUBE]]
    return "\n".join(lines + ["f " + " ".join(f"{k + 1}" for k in quad) for quad in QUADS]) + "\n"


def ply_bytes(style: str) -> bytes:
    head = (
        f"ply\nformat {style} 1.0\ncomment a cube\nelement vertex 8\nproperty float x\n"
        "property float y\nproperty float z\nproperty uchar red\nelement face 6\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if style == "ascii":
        rows = [f"{x} {y} {z} 9" for x, y, z in CUBE]
        rows += ["4 " + " ".join(map(str, quad)) for quad in QUADS]
        return head + "\n".join(rows).encode() + b"\n"
    order = "<" if "little" in style else ">"
    body = b"".join(struct.pack(f"{order}3fB", *point, 9) for point in CUBE)
    return head + body + b"".join(struct.pack(f"{order}B4i", 4, *quad) for quad in QUADS)


def write_usd(path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    mesh = UsdGeom.Mesh.Define(stage, "/Cube")
    mesh.CreatePointsAttr(CUBE.tolist())
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr([k for quad in QUADS for k in quad])
    mesh.AddTranslateOp().Set((9.0, 0.0, 0.0))
    stage.Save()


@pytest.mark.parametrize(
    "name", ["c.obj", "c.obj.gz", "a.ply", "l.ply", "b.ply", "l.ply.gz", "c.usda", "c.usdc"]
)
def test_meshes_are_imported(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if "usd" in name:
        write_usd(path)
    else:
        styles = {"a": "ascii", "l": "binary_little_endian", "b": "binary_big_endian"}
        data = obj_text().encode() if "obj" in name else ply_bytes(styles[name[0]])
        path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    mesh = load_dragon(path)
    assert len(mesh.faces) == 12 and len(mesh.points) == 8
    assert_sound(mesh)
    low, high = mesh.bounds
    side = TARGET_DIAGONAL / np.sqrt(3.0)
    assert np.allclose(low, (-side / 2, 0, -side / 2), atol=1e-5)
    assert np.allclose(high, (side / 2, side, side / 2), atol=1e-5)


def test_texture_coordinates_of_an_obj_are_kept(tmp_path: Path) -> None:
    (tmp_path / "t.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\n"
        "vt 0 0\nvt .5 0\nvt .5 .5\nvt 1 1\nf 1/1 2/2 3/3\nf -4/-4 -2/-1 -1/-2\n"
    )
    mesh = load_dragon(tmp_path / "t.obj")
    # Vertex 3 has two texture coordinates.
    assert len(mesh.points) == 5
    assert {tuple(row) for row in mesh.uv.tolist()} == {(0, 0), (0.5, 0), (0.5, 0.5), (1, 1)}


def test_triangle_ply_is_read_at_once(tmp_path: Path) -> None:
    faces = [[a, b, c] for a, b, c, _ in QUADS] + [[a, c, d] for a, _, c, d in QUADS]
    head = (
        b"ply\r\nformat binary_little_endian 1.0\r\nelement vertex 8\r\nproperty double x\r\n"
        b"property double y\r\nproperty double z\r\nelement face 12\r\n"
        b"property uchar flags\r\nproperty list uchar uint vertex_index\r\nend_header\r\n"
    )
    body = b"".join(struct.pack("<3d", *point) for point in CUBE)
    body += b"".join(struct.pack("<BB3I", 1, 3, *face) for face in faces)
    (tmp_path / "t.ply").write_bytes(head + body)
    assert_sound(load_dragon(tmp_path / "t.ply"))


GOOD_PLY = ply_bytes("binary_little_endian")
BAD_FILES = {
    "empty.obj": b"",
    "points.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "words.obj": b"v 0 0 zero\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "range.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "nan.obj": b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "flat.obj": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "point.obj": b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n",
    "empty.ply": b"",
    "headless.ply": b"ply\nformat ascii 1.0\n",
    "short.ply": GOOD_PLY[:-30],
    "vertices.ply": GOOD_PLY[: GOOD_PLY.index(b"end_header") + 40],
    "huge.ply": GOOD_PLY.replace(b"element vertex 8", b"element vertex 999999999999"),
    "type.ply": GOOD_PLY.replace(b"property float x", b"property quad x"),
    "broken.ply.gz": b"\x1f\x8b nonsense",
    "half.ply.gz": gzip.compress(GOOD_PLY)[:60],
    "broken.usda": b"#usda 1.0\n{{{",
    "empty.usda": b"#usda 1.0\n",
    "crate.usdc": b"PXR-USDC then nothing",
    "mesh.stl": b"solid",
    "nothing": b"",
}


@pytest.mark.parametrize("name", sorted(BAD_FILES))
def test_bad_meshes_are_one_clear_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(BAD_FILES[name])
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        load_dragon(path)
    assert "\n" not in str(caught.value)


def test_a_folder_is_no_mesh(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such mesh file"):
        load_dragon(tmp_path)


def test_an_imported_mesh_takes_the_dragons_place(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(obj_text())
    write_scene("dragon", tmp_path / "d.usda", dragon=tmp_path / "cube.obj", texture_size=64)
    stage = Usd.Stage.Open(str(tmp_path / "d.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/_Prototype_Dragon/Mesh"))
    assert len(mesh.GetFaceVertexCountsAttr().Get()) == 12


def test_a_place_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="cannot write") as caught:
        write_scene("cornell", tmp_path / "file" / "c.usda")
    assert "\n" not in str(caught.value)


def test_a_broken_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "c.usda"
    target.write_text("kept")
    monkeypatch.setattr(StageWriter, "rect_light", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_scene("cornell", target)
    assert target.read_text() == "kept"


@pytest.mark.parametrize(
    "file", ["xyzrgb_dragon/xyzrgb_dragon.obj", "dragon/dragon_vrip_res4.ply.gz"]
)
def test_stanford_dragons_are_imported(file: str) -> None:
    mesh = load_dragon(asset(f"meshes/{file}"))
    assert_sound(mesh, closed=False)
    assert len(mesh.faces) > 10_000
