# SPDX-License-Identifier: Apache-2.0
"""Tests interpolated tangents, and normal maps on mirrored geometry, in images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import wavecomb
from wavecomb.image.files.image import write_png


def new_stage(path: Path, eye: tuple[float, float, float]) -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, "Y")
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.CreateHorizontalApertureAttr(24)
    camera.CreateVerticalApertureAttr(24)
    UsdGeom.Xformable(camera).AddTranslateOp().Set(Gf.Vec3d(*eye))
    return stage


def add_mesh(
    stage: Usd.Stage,
    path: str,
    material: UsdShade.Material,
    points: list[tuple[float, float, float]],
    normals: list[tuple[float, float, float]],
    st: list[tuple[float, float]],
    quads: list[int],
) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([4] * (len(quads) // 4))
    mesh.CreateFaceVertexIndicesAttr(quads)
    mesh.CreateNormalsAttr(normals)
    mesh.SetNormalsInterpolation("vertex")
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex"
    )
    primvar.Set(st)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return mesh


def brushed_cone(path: Path, sides: int, rows: int) -> None:
    """Writes a cone of brushed metal with circular grain; the texture seam is at the back."""
    pytest.importorskip("MaterialX")
    stage = new_stage(path, (0, 0, 5))
    material = UsdShade.Material.Define(stage, "/Metal")
    shader = UsdShade.Shader.Define(stage, "/Metal/Surface")
    shader.CreateIdAttr("ND_open_pbr_surface_surfaceshader")
    for name, value in (
        ("base_metalness", 1.0),
        ("specular_roughness", 0.35),
        ("specular_roughness_anisotropy", 0.9),
    ):
        shader.CreateInput(name, Sdf.ValueTypeNames.Float).Set(value)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.ConnectableAPI(), "out")
    points, normals, st, quads = [], [], [], []
    for row in range(rows + 1):
        for side in range(sides + 1):
            t, angle = row / rows, 2 * np.pi * (side + 0.5) / sides + np.pi
            x, z = float(np.sin(angle)), float(np.cos(angle))
            points.append(((1 - 0.9 * t) * x, 2 * t - 1, (1 - 0.9 * t) * z))
            normals.append(tuple(np.array([x, 0.45, z]) / np.hypot(1, 0.45)))
            st.append((side / sides, t))
    for row in range(rows):
        for side in range(sides):
            a = row * (sides + 1) + side
            quads += [a, a + 1, a + sides + 2, a + sides + 1]
    add_mesh(stage, "/Cone", material, points, normals, st, quads)
    lamp = UsdLux.SphereLight.Define(stage, "/Lamp")
    lamp.CreateRadiusAttr(0.4)
    lamp.CreateIntensityAttr(20)
    UsdGeom.Xformable(lamp).AddTranslateOp().Set(Gf.Vec3d(0.3, 3.6, 3.2))
    stage.Save()


@pytest.mark.slow
def test_a_coarse_cone_shines_as_a_fine_one(tmp_path: Path) -> None:
    """With a constant tangent per triangle, highlights would break at every edge."""
    brushed_cone(tmp_path / "coarse.usda", 16, 2)
    brushed_cone(tmp_path / "fine.usda", 120, 20)
    coarse, fine = (
        wavecomb.render(
            wavecomb.load(tmp_path / f"{name}.usda"),
            size=(48, 48),
            spp=256,
            max_depth=1,
        ).beauty[..., 1]
        for name in ("coarse", "fine")
    )
    # Pixels on the front of both cones, away from the silhouette.
    rows, columns = np.mgrid[0:48, 0:48]
    inside = (rows > 15) & (rows < 33) & (np.abs(columns - 23.5) < 3)
    assert fine[inside].max() > 1  # there is a highlight
    # With values clipped as on a display, the difference is 0.04; a constant tangent per triangle
    # would give 0.09.
    a, b = np.minimum(coarse, 0.3)[inside], np.minimum(fine, 0.3)[inside]
    assert np.abs(a - b).mean() / b.mean() < 0.06


def mapped(path: Path, mirrored: bool, transform: bool = False) -> None:
    """Writes a normal-mapped square, optionally mirrored in x by a transform or its points."""
    write_png(path.parent / "normal.png", np.full((4, 4, 3), (0.7, 0.8, 0.85), np.float32))
    stage = new_stage(path, (0, 0, 4))
    material = UsdShade.Material.Define(stage, "/M")
    surface = UsdShade.Shader.Define(stage, "/M/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.6)
    image = UsdShade.Shader.Define(stage, "/M/Image")
    image.CreateIdAttr("UsdUVTexture")
    image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./normal.png")
    image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("raw")
    image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
    image.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
    reader = UsdShade.Shader.Define(stage, "/M/Reader")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    st_input = image.CreateInput("st", Sdf.ValueTypeNames.Float2)
    st_input.ConnectToSource(reader.ConnectableAPI(), "result")
    normal = surface.CreateInput("normal", Sdf.ValueTypeNames.Normal3f)
    normal.ConnectToSource(image.ConnectableAPI(), "rgb")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    side = -1.0 if mirrored else 1.0
    at = side if not transform else 1.0
    points = [(-at, -1.0, 0.0), (at, -1.0, 0.0), (at, 1.0, 0.0), (-at, 1.0, 0.0)]
    quads = [0, 1, 2, 3] if at > 0 else [3, 2, 1, 0]
    st = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    mesh = add_mesh(stage, "/Square", material, points, [(0, 0, 1)] * 4, st, quads)
    if transform:
        UsdGeom.Xformable(mesh).AddScaleOp().Set(Gf.Vec3f(side, 1, 1))
    sun = UsdLux.DistantLight.Define(stage, "/Sun")
    sun.CreateAngleAttr(0)
    UsdGeom.Xformable(sun).AddRotateXYZOp().Set(Gf.Vec3f(-30, 40 * side, 0))
    stage.Save()


@pytest.mark.parametrize("transform", [False, True])
def test_a_mirrored_normal_map_is_lit_as_in_a_mirror(tmp_path: Path, transform: bool) -> None:
    mapped(tmp_path / "a.usda", mirrored=False)
    mapped(tmp_path / "b.usda", mirrored=True, transform=transform)
    a, b = (
        wavecomb.render(wavecomb.load(tmp_path / f"{name}.usda"), size=(16, 16), spp=4).beauty
        for name in ("a", "b")
    )
    assert a[8, 8, 0] > 0.05
    assert np.allclose(a[4:12, 4:12], b[4:12, 4:12][:, ::-1], rtol=0.02)
