# SPDX-License-Identifier: Apache-2.0
"""Writer of generated stages: meshes, materials, lights, cameras, instances and texture files."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring.materials import MaterialInfo, plain
from wavecomb.scenes.authoring.textures import TEXTURES, TextureInfo, sky, write_image
from wavecomb.scenes.models.mesh import FloatArray, Mesh

SUFFIXES = (".usda", ".usdc", ".usd")
BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
BOX = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
"""Corners (8, 3) of a cube about the origin, and its outward faces."""
_INPUT_TYPES = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "specularColor": Sdf.ValueTypeNames.Color3f,
    "emissiveColor": Sdf.ValueTypeNames.Color3f,
    "normal": Sdf.ValueTypeNames.Normal3f,
    "useSpecularWorkflow": Sdf.ValueTypeNames.Int,
}


def _shine(light: Any, colour: Sequence[float]) -> None:
    """Sets intensity and colour of a light so that the largest channel of the colour is 1."""
    peak = max(colour)
    light.CreateIntensityAttr(peak)
    light.CreateColorAttr(_vec([v / peak for v in colour]))


def _vec(values: Sequence[float] | FloatArray) -> Gf.Vec3f:
    return Gf.Vec3f(*(float(v) for v in values))


class StageWriter:
    """Builder of a Y-up stage in memory. ``save`` writes the stage atomically.

    The builder writes a texture file when the first material uses it. The files are in
    ``<stem>_textures/`` next to the stage, which references them by relative paths.
    """

    def __init__(
        self,
        path: Path,
        metres_per_unit: float,
        texture_size: int = 2048,
        seed: int = 0,
        is_plain: bool = False,
    ) -> None:
        """Starts an empty stage.

        Args:
            path: File to write: .usda, .usdc or .usd (binary).
            metres_per_unit: Length of a scene unit, in metres.
            texture_size: Edge of the largest textures in texels; smaller textures are scaled in
                proportion.
            seed: Seed of the random patterns in textures.
            is_plain: Whether ``materials.plain`` converts all materials before they are written.
        """
        if path.suffix.lower() not in SUFFIXES:
            raise SceneError(f"{path}: a stage's name must end in .usda, .usdc or .usd")
        if not 16 <= texture_size <= 16384:
            raise SceneError(f"texture size must be from 16 to 16384, not {texture_size}")
        self._path = path
        self._texture_size = texture_size
        self._seed = seed
        self._is_plain = is_plain
        self._materials: dict[str, UsdShade.Material] = {}
        self._written: set[str] = set()
        self._own: dict[str, TextureInfo] = {}
        self.stage = Usd.Stage.CreateInMemory()
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, metres_per_unit)
        world = UsdGeom.Xform.Define(self.stage, "/World")
        self.stage.SetDefaultPrim(world.GetPrim())
        for scope in ("Looks", "Objects", "Lights", "Set"):
            UsdGeom.Scope.Define(self.stage, f"/World/{scope}")

    def save(self, comment: str) -> None:
        """Writes the stage file atomically."""
        self.stage.GetRootLayer().comment = comment
        suffix = ".usdc" if self._path.suffix.lower() == ".usd" else self._path.suffix.lower()
        part = self._path.with_name(f".{self._path.stem}.part{suffix}")
        try:
            if not self.stage.GetRootLayer().Export(str(part)):
                raise OSError(f"{self._path}: cannot write the stage")
            os.replace(part, self._path)
        except Tf.ErrorException as error:
            raise OSError(f"{self._path}: cannot write the stage") from error
        finally:
            with contextlib.suppress(FileNotFoundError):
                part.unlink()

    def mesh(self, path: str, mesh: Mesh, material: str | None = None) -> UsdGeom.Mesh:
        """Adds a triangle mesh with vertex normals and the primvar ``st``."""
        prim = UsdGeom.Mesh.Define(self.stage, path)
        low, high = mesh.bounds
        prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.points))
        prim.CreateFaceVertexCountsAttr(
            Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32))
        )
        prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.reshape(-1)))
        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        prim.CreateExtentAttr([_vec(low), _vec(high)])
        prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(mesh.normals))
        prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        st.Set(Vt.Vec2fArray.FromNumpy(mesh.uv))
        if material is not None:
            self.bind(prim.GetPrim(), material)
        return prim

    def polygons(
        self,
        path: str,
        points: FloatArray,
        polygons: Sequence[Sequence[int]],
        material: str | None = None,
        uv: FloatArray | None = None,
    ) -> UsdGeom.Mesh:
        """Adds flat polygons with points (n, 3) and texture coordinates (n, 2)."""
        prim = UsdGeom.Mesh.Define(self.stage, path)
        prim.CreatePointsAttr([_vec(p) for p in points])
        prim.CreateFaceVertexCountsAttr([len(p) for p in polygons])
        prim.CreateFaceVertexIndicesAttr([index for p in polygons for index in p])
        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        prim.CreateExtentAttr([_vec(points.min(axis=0)), _vec(points.max(axis=0))])
        if uv is not None:
            st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
            )
            st.Set([Gf.Vec2f(float(u), float(v)) for u, v in uv])
        if material is not None:
            self.bind(prim.GetPrim(), material)
        return prim

    def quad(
        self,
        path: str,
        corners: Sequence[Sequence[float]] | FloatArray,
        material: str,
        uv: FloatArray | None = None,
    ) -> None:
        """Adds a flat quadrilateral with corners (4, 3)."""
        self.polygons(path, np.asarray(corners), [[0, 1, 2, 3]], material, uv)

    def floor(
        self, name: str, half: float, material: str, y: float = 0.0, uv: FloatArray | None = None
    ) -> None:
        """Adds a horizontal square with edges of 2 * ``half``, centred on the y axis."""
        h = half
        corners = [[-h, y, h], [h, y, h], [h, y, -h], [-h, y, -h]]
        self.quad(f"/World/Set/{name}", corners, material, uv)

    def box(
        self,
        path: str,
        middle: Sequence[float] | FloatArray,
        half: Sequence[float] | FloatArray,
        material: str,
    ) -> None:
        """Adds a box of flat polygons from its centre (3,) and half its edge lengths (3,)."""
        self.polygons(path, np.asarray(middle) + BOX_CORNERS * np.asarray(half), BOX, material)

    def prototype(self, name: str, mesh: Mesh) -> str:
        """Adds a class prim with a mesh and no material; returns its path for ``instance``."""
        path = f"/_Prototype_{name}"
        self.stage.CreateClassPrim(path).SetTypeName("Xform")
        self.mesh(f"{path}/Mesh", mesh)
        return path

    def instance(
        self,
        path: str,
        prototype: str,
        material: str,
        position: Sequence[float] | FloatArray,
        turn_degrees: float = 0.0,
        scale: float = 1.0,
    ) -> Usd.Prim:
        """Adds a native instance of a prototype, rotated about Y, and binds a material to it."""
        xform = UsdGeom.Xform.Define(self.stage, path)
        xform.AddTranslateOp().Set(Gf.Vec3d(*(float(v) for v in position)))
        xform.AddRotateYOp().Set(float(turn_degrees))
        xform.AddScaleOp().Set(Gf.Vec3f(scale))
        prim = xform.GetPrim()
        prim.GetReferences().AddInternalReference(prototype)
        prim.SetInstanceable(True)
        self.bind(prim, material)
        return prim

    def bind(self, prim: Usd.Prim, material: str) -> None:
        """Binds a material that was added by ``material`` or ``own_material``."""
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(self._materials[material])

    def material(self, name: str, info: MaterialInfo) -> str:
        """Adds a material and its textures unless the name exists; returns the name."""
        if name in self._materials:
            return name
        if self._is_plain:
            info = plain(info)
        material = UsdShade.Material.Define(self.stage, f"/World/Looks/{name}")
        if info.program is not None:
            material.GetPrim().CreateAttribute(
                "wavecomb:program", Sdf.ValueTypeNames.String, custom=True
            ).Set(info.program)
        surface = UsdShade.Shader.Define(self.stage, f"/World/Looks/{name}/Surface")
        surface.CreateIdAttr("UsdPreviewSurface")
        for key, value in info.inputs.items():
            kind = _INPUT_TYPES.get(key, Sdf.ValueTypeNames.Float)
            surface.CreateInput(key, kind).Set(_vec(value) if isinstance(value, tuple) else value)
        material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        if info.textures:
            self._textures(f"/World/Looks/{name}", surface, info)
        self._materials[name] = material
        return name

    def own_material(self, name: str, material: UsdShade.Material) -> str:
        """Registers an existing material under a name for ``bind``; returns the name."""
        self._materials[name] = material
        return name

    def define_texture(self, name: str, info: TextureInfo) -> None:
        """Registers a texture under a name that materials can use.

        ``texture_size`` does not scale the texture; ``info.size`` is the texture's edge in texels.
        """
        self._own[name] = info

    def _textures(self, path: str, surface: UsdShade.Shader, info: MaterialInfo) -> None:
        reader = UsdShade.Shader.Define(self.stage, f"{path}/St")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        result = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        if info.repeat != 1.0:
            transform = UsdShade.Shader.Define(self.stage, f"{path}/Repeat")
            transform.CreateIdAttr("UsdTransform2d")
            transform.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(result)
            transform.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(info.repeat))
            result = transform.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        for key, name in info.textures.items():
            texture_info = self._own.get(name) or TEXTURES[name]
            texture = UsdShade.Shader.Define(self.stage, f"{path}/{key[0].upper()}{key[1:]}Map")
            texture.CreateIdAttr("UsdUVTexture")
            texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(self.texture_file(name))
            texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(result)
            space = "sRGB" if texture_info.colour else "raw"
            texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
            for wrap in ("wrapS", "wrapT"):
                texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("repeat")
            if texture_info.normal:
                float4 = Sdf.ValueTypeNames.Float4
                texture.CreateInput("scale", float4).Set(Gf.Vec4f(2.0, 2.0, 2.0, 1.0))
                texture.CreateInput("bias", float4).Set(Gf.Vec4f(-1.0, -1.0, -1.0, 0.0))
            single = texture_info.channels == "r"
            kind = Sdf.ValueTypeNames.Float if single else Sdf.ValueTypeNames.Float3
            output = texture.CreateOutput(texture_info.channels, kind)
            value = _INPUT_TYPES.get(key, Sdf.ValueTypeNames.Float)
            surface.CreateInput(key, value).ConnectToSource(output)

    def _texture_path(self, file_name: str) -> tuple[Path, Sdf.AssetPath]:
        return self._beside("textures", file_name)

    def volume_file(self, file_name: str) -> tuple[Path, Sdf.AssetPath]:
        """Returns the path of a file in ``<stem>_volumes/``, and its asset path in the stage."""
        return self._beside("volumes", file_name)

    def _beside(self, kind: str, file_name: str) -> tuple[Path, Sdf.AssetPath]:
        folder = self._path.with_name(f"{self._path.stem}_{kind}")
        folder.mkdir(parents=True, exist_ok=True)
        return folder / file_name, Sdf.AssetPath(f"./{folder.name}/{file_name}")

    def texture_file(self, name: str) -> Sdf.AssetPath:
        """Writes a texture unless it has been written; returns its asset path in the stage."""
        file, asset = self._texture_path(f"{name}.png")
        if name not in self._written:
            if name in self._own:
                info, size = self._own[name], self._own[name].size
                number = len(TEXTURES) + list(self._own).index(name)
            else:
                info, number = TEXTURES[name], list(TEXTURES).index(name)
                size = max(16, info.size * self._texture_size // 2048)
            rng = np.random.default_rng([self._seed, number])
            write_image(file, info.make(size, rng), "uint8")
            self._written.add(name)
        return asset

    def rect_light(
        self,
        name: str,
        position: Sequence[float],
        width: float,
        height: float,
        radiance: Sequence[float],
        tilt_degrees: float = -90.0,
    ) -> None:
        """Adds a rectangle light that emits along -Z, rotated about X; -90 emits straight down."""
        light = UsdLux.RectLight.Define(self.stage, f"/World/Lights/{name}")
        light.CreateWidthAttr(width)
        light.CreateHeightAttr(height)
        _shine(light, radiance)
        light.AddTranslateOp().Set(Gf.Vec3d(*position))
        light.AddRotateXOp().Set(tilt_degrees)

    def sphere_light(
        self, name: str, position: Sequence[float], radius: float, radiance: Sequence[float]
    ) -> None:
        """Adds a sphere light."""
        light = UsdLux.SphereLight.Define(self.stage, f"/World/Lights/{name}")
        light.CreateRadiusAttr(radius)
        _shine(light, radiance)
        light.AddTranslateOp().Set(Gf.Vec3d(*position))

    def sun(self, name: str, way: Sequence[float], angle: float, radiant: Sequence[float]) -> None:
        """Adds a distant light.

        Args:
            name: Name of the prim.
            way: Direction in which the light travels, (3,).
            angle: Angular diameter, in degrees.
            radiant: Irradiance of a surface that faces the light, as RGB.
        """
        light = UsdLux.DistantLight.Define(self.stage, f"/World/Lights/{name}")
        light.CreateAngleAttr(angle)
        light.CreateNormalizeAttr(True)
        _shine(light, radiant)
        turn = Gf.Rotation(Gf.Vec3d(0, 0, -1), Gf.Vec3d(*way))
        light.AddTransformOp().Set(Gf.Matrix4d().SetRotate(turn))

    def dome_light(self, name: str, turn_degrees: float, intensity: float = 1.0) -> None:
        """Adds an environment light with a procedural sky, half as wide as large textures."""
        file, asset = self._texture_path("sky.exr")
        height = max(16, self._texture_size // 4)
        write_image(file, sky(2 * height, height, self._seed), "half")
        light = UsdLux.DomeLight.Define(self.stage, f"/World/Lights/{name}")
        light.CreateTextureFileAttr(asset)
        light.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        light.CreateIntensityAttr(intensity)
        light.AddRotateYOp().Set(turn_degrees)

    def even_dome(self, name: str, radiance: float) -> None:
        """Adds a uniform white environment light."""
        light = UsdLux.DomeLight.Define(self.stage, f"/World/Lights/{name}")
        light.CreateIntensityAttr(radiance)

    def camera(
        self,
        position: Sequence[float],
        target: Sequence[float],
        fov_degrees: float,
        aspect: float,
        focal_mm: float = 35.0,
    ) -> None:
        """Adds ``/World/Camera``, a pinhole camera that looks at a point, with +Y up.

        Args:
            position: Position of the pinhole, (3,), in scene units.
            target: Point in the middle of the image, (3,), in scene units.
            fov_degrees: Horizontal angle of view.
            aspect: Width / height of the image.
            focal_mm: Focal length in mm; the aperture size is derived from ``focal_mm`` and
                ``fov_degrees``.
        """
        camera = UsdGeom.Camera.Define(self.stage, "/World/Camera")
        # USD's camera units are tenths of a scene unit. Since only the ratio of focal length to
        # aperture matters, the unit does not have to be exact.
        aperture = 2.0 * focal_mm * math.tan(math.radians(0.5 * fov_degrees))
        camera.CreateFocalLengthAttr(focal_mm)
        camera.CreateHorizontalApertureAttr(aperture)
        camera.CreateVerticalApertureAttr(aperture / aspect)
        distance = math.dist(position, target)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.001 * distance, 1000.0 * distance))
        camera.CreateFocusDistanceAttr(distance)
        view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*position), Gf.Vec3d(*target), Gf.Vec3d(0, 1, 0))
        camera.AddTransformOp().Set(view.GetInverse())
