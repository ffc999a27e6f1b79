# SPDX-License-Identifier: Apache-2.0
"""Tests the generated room: it is closed, furnished, in real size, with many plain materials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import wavecomb
from wavecomb.scenes import write_scene
from wavecomb.scenes.models.shapes import disc, pillow, rounded_box, tube, turned
from wavecomb.scenes.rooms.room_materials import MATERIALS, ROOM_TEXTURES

SMALL: dict[str, Any] = {"triangles": 12_000, "teapot_level": 4, "texture_size": 64}
ROOM = ((0.0, 0.0, 0.0), (5.0, 2.7, 4.0))


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("room") / "room.usdc"
    write_scene("room", path, **SMALL)
    return path


@pytest.fixture(scope="module")
def stage(room: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(room))


def meshes(stage: Usd.Stage) -> list[UsdGeom.Mesh]:
    prims = stage.Traverse(Usd.TraverseInstanceProxies())
    return [UsdGeom.Mesh(prim) for prim in prims if prim.IsA(UsdGeom.Mesh)]


def look_of(mesh: UsdGeom.Mesh) -> str:
    material, _ = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()
    return str(material.GetPrim().GetName())


@pytest.mark.slow
def test_the_room_is_furnished(stage: Usd.Stage) -> None:
    names = [prim.GetName() for prim in stage.GetPrimAtPath("/World/Objects").GetChildren()]
    assert len(names) >= 40
    kinds = {name.split("_")[0] for name in names}
    assert kinds >= {
        "Table", "Chair", "Sofa", "Cushion", "Rug", "Bookcase", "Book", "Teapot", "Cup", "Saucer",
        "Bowl", "Apple", "Vase", "Statue", "Tumbler", "Mirror", "Picture", "FloorLamp", "Plant",
        "Door",
    }  # fmt: skip
    assert names.count("Door") == 1
    assert sum(name.startswith("Chair_") for name in names) == 4
    assert sum(name.startswith("Book_") for name in names) >= 12


@pytest.mark.slow
def test_every_material_is_bound_and_plain(stage: Usd.Stage) -> None:
    assert len(MATERIALS) >= 12
    assert {look_of(mesh) for mesh in meshes(stage)} == set(MATERIALS)
    for prim in stage.GetPrimAtPath("/World/Looks").GetChildren():
        assert not prim.GetAttribute("wavecomb:program")
        surface = UsdShade.Shader(stage.GetPrimAtPath(f"{prim.GetPath()}/Surface"))
        assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
        assert not surface.GetInput("useSpecularWorkflow") and not surface.GetInput("specularColor")
    inputs = [info.inputs for info in MATERIALS.values()]
    assert any(values.get("metallic") == 1.0 for values in inputs)
    assert any(values.get("clearcoat", 0.0) != 0.0 for values in inputs)
    assert any(values.get("opacity", 1.0) == 0.0 for values in inputs)
    assert any("normal" in info.textures for info in MATERIALS.values())


@pytest.mark.slow
def test_plain_changes_nothing(room: Path, tmp_path: Path) -> None:
    write_scene("room", tmp_path / "room.usdc", plain=True, **SMALL)
    plain, ordinary = (Sdf.Layer.FindOrOpen(str(path)) for path in (tmp_path / "room.usdc", room))
    assert plain.ExportToString() == ordinary.ExportToString()


def test_all_images_are_there(room: Path, stage: Usd.Stage) -> None:
    files = {
        UsdShade.Shader(prim).GetInput("file").Get().path
        for prim in stage.Traverse()
        if prim.IsA(UsdShade.Shader) and UsdShade.Shader(prim).GetInput("file")
    }
    assert len(files) >= 15
    assert all((room.parent / file).is_file() for file in files)


@pytest.mark.parametrize("name", sorted(ROOM_TEXTURES))
def test_images_are_sound(name: str) -> None:
    info = ROOM_TEXTURES[name]
    image = info.make(96, np.random.default_rng(0))
    assert image.shape == (96, 96, 3) and image.dtype == np.float32
    assert np.isfinite(image).all() and image.min() >= 0.0 and image.max() <= 1.0
    if info.normal:
        normal = 2.0 * image - 1.0
        assert np.allclose(np.linalg.norm(normal, axis=2), 1.0, atol=1e-5)
        assert (normal[..., 2] > 0.5).all() and normal[..., :2].std() > 0.005
    else:
        assert image.std() > 0.005


@pytest.mark.parametrize("name", ["plaster", "planks", "planks_roughness", "walnut", "wool"])
def test_images_tile(name: str) -> None:
    """Opposite edges of a texture differ no more than neighbouring rows and columns."""
    image = ROOM_TEXTURES[name].make(128, np.random.default_rng(0))[..., 0]
    for lines in (image, image.T):
        inside = np.abs(np.diff(lines, axis=0)).mean(axis=1)
        assert np.abs(lines[0] - lines[-1]).mean() <= 1.05 * inside.max()


@pytest.mark.parametrize(
    "look", ["Plaster", "Planks", "Walnut", "Wool", "Linen", "Twill", "Leather", "Marble"]
)
def test_texture_coordinates_are_metres(stage: Usd.Stage, look: str) -> None:
    """Texture coordinates are in metres; they are slightly stretched on folded or rounded parts."""
    areas, scales = [], []
    for mesh in meshes(stage):
        # Skip small meshes: the floor of the partition's reveal, and rims of pillows.
        if look_of(mesh) != look or len(set(mesh.GetFaceVertexCountsAttr().Get())) > 1:
            continue
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get())
        corners = corners.reshape(-1, mesh.GetFaceVertexCountsAttr().Get()[0])[:, :3]
        a, b, c = (np.array(mesh.GetPointsAttr().Get(), float)[corners[:, k]] for k in range(3))
        st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get(), float)
        p, q, r = (st[corners[:, k]] for k in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        (qx, qy), (rx, ry) = (q - p).T, (r - p).T
        areas.append(area)
        scales.append(np.sqrt(0.5 * np.abs(qx * ry - qy * rx) / area))
    area, scale = np.concatenate(areas), np.concatenate(scales)
    assert area[(scale > 0.7) & (scale < 1.4)].sum() > 0.8 * area.sum()


def test_things_stand_in_the_room(stage: Usd.Stage) -> None:
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    for prim in stage.GetPrimAtPath("/World/Objects").GetChildren():
        box = cache.ComputeWorldBound(prim).ComputeAlignedRange()
        low, high = np.array(box.GetMin()), np.array(box.GetMax())
        if prim.GetName() == "LampPanel":
            assert high[0] < 0.0
            continue
        assert (low > np.array(ROOM[0]) - [0.05, 0.001, 0.001]).all(), prim.GetName()
        assert (high < np.array(ROOM[1]) + 0.003).all(), prim.GetName()
        if prim.GetName().split("_")[0] in ("Sofa", "Bookcase", "Plant", "Ottoman", "FloorLamp"):
            assert low[1] == pytest.approx(0.0, abs=0.002)
        if prim.GetName().split("_")[0] in ("Chair", "Table"):
            assert low[1] == pytest.approx(0.011, abs=0.001)


CAMERAS = (
    ((4.6, 1.5, 0.4), (1.2, 0.8, 2.6)),
    ((0.4, 2.3, 3.7), (4.9, 0.1, 0.1)),
    ((2.5, 0.3, 0.2), (2.4, 2.6, 3.9)),
    ((4.8, 2.6, 3.8), (0.1, 0.0, 2.4)),
    ((-0.4, 1.4, 1.1), (-3.1, 0.4, 4.4)),
    ((-3.0, 2.4, 4.4), (0.3, 0.9, 2.3)),
)


def dark_room(room: Path, file: Path, is_open: bool) -> Path:
    """Writes the room without its lamp under a bright sky, with or without a ceiling."""
    layer = Usd.Stage.CreateNew(str(file))
    layer.GetRootLayer().subLayerPaths.append(str(room))
    layer.GetPrimAtPath("/World/Lights/Panel").SetActive(False)
    UsdLux.DomeLight.Define(layer, "/World/Lights/Sky").CreateIntensityAttr(1000.0)
    if is_open:
        layer.GetPrimAtPath("/World/Set/Ceiling").SetActive(False)
    for index, (eye, target) in enumerate(CAMERAS):
        camera = UsdGeom.Camera.Define(layer, f"/Eyes/Eye_{index}")
        camera.CreateFocalLengthAttr(12.0)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 100.0))
        view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), Gf.Vec3d(0, 1, 0))
        camera.AddTransformOp().Set(view.GetInverse())
    layer.Save()
    return file


@pytest.mark.slow
@needs("wavecomb._core")
def test_no_ray_leaves_the_room(room: Path, tmp_path: Path) -> None:
    dark = dark_room(room, tmp_path / "dark.usda", is_open=False)
    for index in range(len(CAMERAS)):
        loaded = wavecomb.load(dark, camera=f"/Eyes/Eye_{index}")
        picture = wavecomb.render(loaded, size=(60, 40), spp=32, max_depth=6)
        assert np.isfinite(picture.depth).all()
        assert picture.beauty.max() == 0.0
    bright = wavecomb.load(dark_room(room, tmp_path / "open.usda", is_open=True))
    assert wavecomb.render(bright, size=(30, 20), spp=2).beauty.max() > 1.0


@pytest.mark.slow
@needs("wavecomb._core")
def test_the_picture_is_neither_dark_nor_burnt(room: Path) -> None:
    beauty = wavecomb.render(wavecomb.load(room), size=(60, 40), spp=256).beauty
    light = beauty @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    assert 0.05 < np.median(light) < 0.3
    assert (light > 1.0).mean() < 0.12


@pytest.mark.parametrize(
    "mesh",
    [
        rounded_box((-1, 0, 0), (2, 0.5, 1.5), 0.1, 3),
        rounded_box((0, 0, 0), (1, 1, 1), 0.1, 2, (0.0, 0.1, 0.05)),
        turned([(0, 0), (1, 0), (1, 0), (1.2, 1), (0, 1.5)], 16),
        tube([(0, 0, 0), (0, 1, 0), (0.5, 2, 0)], [0.1, 0.2, 0.1], 12, 16),
        pillow(0.5, 0.4, 0.2),
    ],
    ids=["box", "cushioned box", "turned", "tube", "pillow"],
)
def test_shapes_are_closed_and_face_outwards(mesh: Any) -> None:
    from wavecomb.scenes.models.mesh import face_areas, signed_volume

    assert face_areas(mesh.points, mesh.faces).min() > 0.0
    assert signed_volume(mesh.points, mesh.faces) > 0.0
    _, weld = np.unique(np.round(mesh.points, 5) + 0.0, axis=0, return_inverse=True)
    faces = weld.ravel()[mesh.faces].astype(np.int64)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = edges[:, 0] << 32 | edges[:, 1], edges[:, 1] << 32 | edges[:, 0]
    assert np.array_equal(np.sort(there), np.sort(back))
    a, b, c = (mesh.points[mesh.faces[:, k]].astype(float) for k in range(3))
    facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces].sum(axis=1))
    assert (facing > 0.0).mean() > 0.99


def test_a_disc_is_seen_from_above() -> None:
    mesh = disc(0.5, 0.2, 12)
    assert np.allclose(mesh.normals, (0.0, 1.0, 0.0), atol=1e-6)
    assert np.allclose(mesh.points[:, 1], 0.2)
