# SPDX-License-Identifier: Apache-2.0
"""Write USD stages for translated reference scenes: cameras, lights, meshes and materials.

Matrices are for column vectors, (4, 4), and map to world space. The names of prims end in a running
number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

Matrix = NDArray[np.float64]
Colour = Sequence[float]

TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Half a turn about y, which maps between USD's direction -z and the +z of other renderers."""


class Inexpressible(Exception):
    """A feature that a Wavecomb stage cannot express; the message is one sentence."""


@dataclass(frozen=True)
class Image:
    """A texture that repeats.

    Attributes:
        file: Image file.
        space: "raw" or "sRGB".
        scale: Scale of the texture coordinates.
        translation: Offset added after the scale.
        uv: Primvar of the texture coordinates.
    """

    file: Path
    space: str = "raw"
    scale: tuple[float, float] = (1.0, 1.0)
    translation: tuple[float, float] = (0.0, 0.0)
    uv: str = "st"


class StageWriter:
    """Writer of a stage; ``stage`` is a USD stage to add prims to, by default a new one."""

    def __init__(self, file: Path, stage: Usd.Stage | None = None) -> None:
        self.file = file
        self.stage = stage or Usd.Stage.CreateInMemory()
        if stage is None:
            UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        self._count = 0

    def save(self) -> None:
        """Write the file."""
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self.stage.GetRootLayer().Export(str(self.file))

    def _path(self, kind: str) -> str:
        self._count += 1
        return f"/{kind}{self._count}"

    @staticmethod
    def _place(prim: Any, to_world: Matrix) -> None:
        UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d(to_world.T.tolist()))

    # ---- camera and lights -----------------------------------------------------------------------

    def camera(
        self,
        to_world: Matrix,
        half: tuple[float, float],
        clip: tuple[float, float] = (1e-4, 1e6),
        orthographic: bool = False,
    ) -> None:
        """Add a camera along -z; ``half`` is the half extent of its view at distance 1."""
        camera = UsdGeom.Camera.Define(self.stage, "/camera")
        camera.CreateFocalLengthAttr(10.0)
        camera.CreateHorizontalApertureAttr(20.0 * half[0])
        camera.CreateVerticalApertureAttr(20.0 * half[1])
        camera.CreateClippingRangeAttr(Gf.Vec2f(*clip))
        if orthographic:
            camera.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
        self._place(camera, to_world)

    def _light(self, light: Any, to_world: Matrix, colour: Colour) -> Any:
        """Set intensity to the largest channel, so that the UsdLux colour is between 0 and 1."""
        most = max(*(float(c) for c in colour), 1e-12)
        light.CreateIntensityAttr(most)
        light.CreateColorAttr(Gf.Vec3f(*(float(c) / most for c in colour)))
        self._place(light, to_world)
        return light

    def rect_light(self, to_world: Matrix, colour: Colour, width: float, height: float) -> None:
        """Add a rect light that emits radiance ``colour`` along its -z axis."""
        light = UsdLux.RectLight.Define(self.stage, self._path("rectLight"))
        self._light(light, to_world, colour)
        light.CreateWidthAttr(width)
        light.CreateHeightAttr(height)

    def disk_light(self, to_world: Matrix, colour: Colour) -> None:
        """Add a disk light of radius 1 that emits radiance ``colour`` along its -z axis."""
        light = UsdLux.DiskLight.Define(self.stage, self._path("diskLight"))
        self._light(light, to_world, colour).CreateRadiusAttr(1.0)

    def sphere_light(self, centre: Sequence[float], radius: float, colour: Colour) -> None:
        """Add a sphere light of radiance ``colour``, or of radiant intensity for radius 0."""
        light = UsdLux.SphereLight.Define(self.stage, self._path("sphereLight"))
        to_world = np.eye(4)
        to_world[:3, 3] = centre
        light.CreateRadiusAttr(radius)
        if radius == 0.0:
            # A normalised sphere has radiance I / (4 pi r^2) over a visible area of pi r^2.
            light.CreateTreatAsPointAttr(True)
            light.CreateNormalizeAttr(True)
            colour = [4.0 * float(c) for c in colour]
        self._light(light, to_world, colour)

    def distant_light(self, along: Sequence[float], irradiance: Colour) -> None:
        """Add a distant light with irradiance ``colour`` on a perpendicular surface."""
        light = UsdLux.DistantLight.Define(self.stage, self._path("distantLight"))
        z = -np.asarray(along, np.float64) / np.linalg.norm(along)
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        x /= np.linalg.norm(x)
        to_world = np.eye(4)
        to_world[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        self._light(light, to_world, irradiance).CreateAngleAttr(0.0)

    def dome_light(self, to_world: Matrix, colour: Colour, image: Path | None = None) -> None:
        """Add a dome light of radiance ``colour``, multiplied by the dome's image if it has one."""
        light = UsdLux.DomeLight.Define(self.stage, self._path("domeLight"))
        self._light(light, to_world, colour)
        if image is not None:
            light.CreateTextureFileAttr(str(image.resolve()))
            light.CreateTextureFormatAttr(UsdLux.Tokens.latlong)

    # ---- geometry --------------------------------------------------------------------------------

    def mesh(
        self,
        points: NDArray[Any],
        faces: NDArray[Any],
        material: str,
        normals: NDArray[Any] | None = None,
        uv: NDArray[Any] | None = None,
        colours: tuple[NDArray[Any], str] | None = None,
    ) -> None:
        """Add a mesh of world-space triangles or quads; v of texture coordinates points up."""
        mesh = UsdGeom.Mesh.Define(self.stage, self._path("mesh"))
        counts = np.full(len(faces), faces.shape[1], np.int32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(_floats(points)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
        mesh.CreateFaceVertexIndicesAttr(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(faces, np.int32).ravel())
        )
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        if normals is not None:
            mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(_floats(normals)))
            mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        primvars = UsdGeom.PrimvarsAPI(mesh)
        if uv is not None:
            st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
            st.Set(Vt.Vec2fArray.FromNumpy(_floats(uv)))
        if colours is not None:
            colour = mesh.CreateDisplayColorPrimvar(colours[1])
            colour.Set(Vt.Vec3fArray.FromNumpy(_floats(colours[0])))
        self.bind(mesh, material)

    def sphere(self, to_world: Matrix, radius: float, material: str) -> None:
        """Add a sphere at the origin of ``to_world``."""
        sphere = UsdGeom.Sphere.Define(self.stage, self._path("sphere"))
        sphere.CreateRadiusAttr(radius)
        self._place(sphere, to_world)
        self.bind(sphere, material)

    def bind(self, gprim: Any, material: str) -> None:
        """Bind a material to a gprim."""
        prim = gprim.GetPrim()
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material.Get(self.stage, material))

    # ---- materials -------------------------------------------------------------------------------

    def material(
        self,
        program: str,
        inputs: dict[str, Any],
        own: dict[str, Colour] | None = None,
        textures: dict[str, Image] | None = None,
        primvar: str = "",
        path: str = "",
    ) -> str:
        """Add a UsdPreviewSurface that selects a shading program of Wavecomb; return its path.

        ``own`` has values of Wavecomb's own attributes, such as wavecomb:eta. ``primvar`` is the
        source of diffuseColor. ``path`` names an existing material; by default a new material is
        made.
        """
        path = path or self._path("material")
        material = UsdShade.Material.Define(self.stage, path)
        prim = material.GetPrim()
        prim.CreateAttribute("wavecomb:program", Sdf.ValueTypeNames.String).Set(program)
        for name, value in (own or {}).items():
            attribute = prim.CreateAttribute(name, Sdf.ValueTypeNames.Color3f)
            attribute.Set(Gf.Vec3f(*(float(v) for v in value)))
        surface = UsdShade.Shader.Define(self.stage, f"{path}/preview")
        surface.CreateIdAttr("UsdPreviewSurface")
        _set(surface, inputs)
        material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        for name, texture in (textures or {}).items():
            self._texture(f"{path}/{name}", surface, name, texture)
        if primvar:
            reader = UsdShade.Shader.Define(self.stage, f"{path}/reader")
            reader.CreateIdAttr("UsdPrimvarReader_float3")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
            result = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
            surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(result)
        return path

    def materialx(self, model: str, inputs: dict[str, Any]) -> str:
        """Add a MaterialX open_pbr_surface or standard_surface; return its path."""
        path = self._path("material")
        material = UsdShade.Material.Define(self.stage, path)
        surface = UsdShade.Shader.Define(self.stage, f"{path}/surface")
        surface.CreateIdAttr(f"ND_{model}_surfaceshader")
        _set(surface, inputs)
        out = surface.CreateOutput("out", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput("mtlx").ConnectToSource(out)
        return path

    def _texture(self, path: str, surface: Any, name: str, image: Image) -> None:
        pair = Sdf.ValueTypeNames.Float2
        reader = UsdShade.Shader.Define(self.stage, f"{path}_st")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(image.uv)
        placed = UsdShade.Shader.Define(self.stage, f"{path}_placed")
        placed.CreateIdAttr("UsdTransform2d")
        placed.CreateInput("in", pair).ConnectToSource(reader.CreateOutput("result", pair))
        placed.CreateInput("scale", pair).Set(Gf.Vec2f(*image.scale))
        placed.CreateInput("translation", pair).Set(Gf.Vec2f(*image.translation))
        texture = UsdShade.Shader.Define(self.stage, f"{path}_texture")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(str(image.file.resolve()))
        texture.CreateInput("st", pair).ConnectToSource(placed.CreateOutput("result", pair))
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(image.space)
        for wrap in ("wrapS", "wrapT"):
            texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("repeat")
        rgb = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
        surface.CreateInput(name, Sdf.ValueTypeNames.Color3f).ConnectToSource(rgb)


def _set(shader: Any, inputs: dict[str, Any]) -> None:
    for name, value in inputs.items():
        if isinstance(value, (int, float)):
            shader.CreateInput(name, Sdf.ValueTypeNames.Float).Set(float(value))
        else:
            colour = Gf.Vec3f(*(float(v) for v in value))
            shader.CreateInput(name, Sdf.ValueTypeNames.Color3f).Set(colour)


def _floats(values: NDArray[Any]) -> NDArray[np.float32]:
    return np.ascontiguousarray(values, np.float32)
