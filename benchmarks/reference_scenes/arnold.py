# SPDX-License-Identifier: Apache-2.0
"""Convert the tests of Autodesk's arnold-usd to stages for Wavecomb.

The USD file of a test is used unchanged. A layer over it adds the camera and the light of the .ass
file, and UsdShade equivalents of Arnold's shaders. The notes list everything that is translated.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade
from reference_scenes.shapes import write_checker, write_magnified
from reference_scenes.stage import Image, StageWriter

SIZE = (160, 120)
"""Size of all reference images."""
GAUSSIAN_WIDTH = 3.0
"""Width of our Gaussian filter that equals Arnold's filter of width 2, exp(-2 r^2)."""


@dataclass
class Test:
    """A test of arnold-usd: its stage, and how to compare the images.

    Attributes:
        stage: The file to render.
        covered_only: Compare only pixels with nonzero alpha in the reference, for tests with an
            invisible dome.
        space: Colour space that Arnold rendered in; the stored reference image is in Rec.709.
        notes: Description of the translation.
    """

    stage: Path
    space: str = "rec709"
    covered_only: bool = False
    notes: list[str] = field(default_factory=list)


def to_stage(folder: Path, file: Path) -> Test:
    """Write the stage of a test."""
    return _Translator(folder, file).test


def ass_nodes(text: str) -> dict[str, dict[str, list[str]]]:
    """Parse the last node of each type in an .ass file; return type -> parameter -> words."""
    nodes: dict[str, dict[str, list[str]]] = {}
    for kind, body in re.findall(r"^(\w+)\s*\{(.*?)^\s*\}", text, re.MULTILINE | re.DOTALL):
        found: dict[str, list[str]] = {}
        words: list[str] = []
        for line in body.splitlines():
            parts = line.split()
            if parts and re.match(r"[A-Za-z]", parts[0]):
                words = found.setdefault(parts[0], [])
                parts = parts[1:]
            words.extend(parts)
        nodes[kind] = found
    return nodes


class _Translator:
    """Translator of one test of arnold-usd to a stage."""

    def __init__(self, folder: Path, file: Path) -> None:
        self.test = Test(file)
        (source,) = (folder / "data").glob("*.usd*")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.unlink(missing_ok=True)
        root = Sdf.Layer.CreateNew(str(file))
        root.subLayerPaths.append(str(source.resolve()))
        self.stage = Usd.Stage.Open(root)
        self.out = StageWriter(file, self.stage)
        scenes = list((folder / "data").glob("*.ass"))
        if not scenes:
            self.test.space = "acescg"
            self._note("without an .ass file Arnold rendered in ACEScg")
        for scene in scenes:
            self._ass(ass_nodes(scene.read_text(encoding="utf-8")))
        for prim in list(self.stage.Traverse()):
            if prim.IsA(UsdShade.Material):
                self._material(UsdShade.Material(prim))
            elif prim.IsA(UsdLux.DomeLight):
                self._dome(prim)
            elif prim.IsA(UsdGeom.Mesh):
                self._mesh(UsdGeom.Mesh(prim))
        root.Save()

    def _note(self, text: str) -> None:
        if text not in self.test.notes:
            self.test.notes.append(text)

    # ---- what the .ass file has ------------------------------------------------------------------

    def _ass(self, nodes: dict[str, dict[str, list[str]]]) -> None:
        placed = _matrix(nodes.get("usd", {}))
        camera = UsdGeom.Camera.Define(self.stage, "/ass_camera")
        # The Arnold file moves the scene; the USD stage moves the camera by the inverse transform
        # instead.
        camera.AddTransformOp().Set(_matrix(nodes["persp_camera"]) * placed.GetInverse())
        half = math.tan(math.radians(float(nodes["persp_camera"]["fov"][0])) / 2)
        camera.CreateFocalLengthAttr(10.0)
        camera.CreateHorizontalApertureAttr(20.0 * half)
        camera.CreateVerticalApertureAttr(20.0 * half)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 1e4))
        settings = self.stage.DefinePrim("/Render/Ass", "RenderSettings")
        settings.GetRelationship("camera").SetTargets(["/ass_camera"])
        settings.GetAttribute("resolution").Set(Gf.Vec2i(*SIZE))
        aspect = float(nodes["options"].get("pixel_aspect_ratio", ["1"])[0])
        settings.GetAttribute("pixelAspectRatio").Set(aspect)
        # Arnold's fov is horizontal for any aspect ratio.
        settings.GetAttribute("aspectRatioConformPolicy").Set("adjustApertureHeight")
        self.stage.SetMetadata("renderSettingsPrimPath", "/Render/Ass")
        light = nodes.get("distant_light")
        if light is not None:
            distant = UsdLux.DistantLight.Define(self.stage, "/ass_light")
            distant.CreateAngleAttr(float(light["angle"][0]))
            distant.CreateExposureAttr(float(light["exposure"][0]))
            distant.CreateIntensityAttr(float(light.get("intensity", ["1"])[0]))
            distant.CreateNormalizeAttr(True)
            distant.AddTransformOp().Set(_matrix(light))
        for prim in list(self.stage.Traverse()):
            if (
                prim.IsA(UsdGeom.Gprim)
                and not UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
            ):
                self._standard_surface(UsdGeom.Gprim(prim))

    def _standard_surface(self, gprim: UsdGeom.Gprim) -> None:
        """Make Arnold's default shader, or the shader in the .ass file, with MaterialX."""
        colours = gprim.GetDisplayColorAttr().Get()
        colour = colours[0] if colours else (0.8, 0.8, 0.8)
        inputs = {"base": 1.0, "base_color": colour}
        self.out.bind(gprim, self.out.materialx("standard_surface", inputs))
        self._note("Arnold's default standard_surface is MaterialX's")

    # ---- Arnold's shaders ------------------------------------------------------------------------

    def _material(self, material: UsdShade.Material) -> None:
        shader = _source(material, "outputs:arnold:surface")
        kind = _kind(shader)
        if kind in ("arnold:flat", "arnold:utility"):
            self._flat(material, shader)
        elif kind == "arnold:lambert":
            colour = Gf.Vec3f(shader.GetInput("Kd_color").Get()) * shader.GetInput("Kd").Get()
            path = str(material.GetPath())
            self.out.material("diffuse", {"diffuseColor": colour}, path=path)
            self._note("arnold:lambert becomes diffuse")
        elif kind == "arnold:standard_surface":
            self._coloured_instances(_source(shader, "inputs:base_color"))
        elif kind:
            self._note(f"{kind} becomes grey")

    def _flat(self, material: UsdShade.Material, shader: UsdShade.Shader) -> None:
        """Translate Arnold's flat shader, which shows a colour without lighting, to emission."""
        image = _source(shader, "inputs:color")
        kind, path = _kind(image), str(material.GetPath())
        uv, repeats = "st", 1.0
        if kind == "arnold:checkerboard":
            file = self.test.stage.with_name(f"{self.test.stage.stem}_checker.exr")
            colours = [list(image.GetInput(name).Get()) for name in ("color1", "color2")]
            # Arnold's checkerboard has its second colour at uv 0.
            write_checker(file, colours[1], colours[0])
            uv, repeats = "uv", float(image.GetInput("u_frequency").Get())
            space = "raw"
        elif kind == "arnold:image":
            value = image.GetInput("filename").GetAttr()
            layer = value.GetPropertyStack()[0].layer
            source = Path(layer.ComputeAbsolutePath(str(value.Get())))
            file, space = self.test.stage.with_name(f"{self.test.stage.stem}_image.exr"), "raw"
            write_magnified(source, file)
            self._note("the image is magnified by a cubic B-spline, as Arnold does it")
        elif kind == "UsdUVTexture":
            file, space = Path(str(image.GetInput("file").Get().resolvedPath)), "raw"
            self._note("a .tx file is linear for Arnold")
            reader = _source(image, "inputs:st")
            uv = str(reader.GetInput("varname").Get())
        else:
            raise NotImplementedError(f"{kind} below {_kind(shader)}")
        use = Image(file, space, (repeats, repeats), uv=uv)
        self.out.material("emissive", {}, textures={"emissiveColor": use}, path=path)
        self._note(f"{_kind(shader)} of {kind} becomes emission by its image")

    def _coloured_instances(self, reader: UsdShade.Shader) -> None:
        """Convert colours read by user_data_rgb to displayColor, for instances without material."""
        name = str(reader.GetInput("attribute").Get())
        for prim in list(self.stage.Traverse()) + list(self.stage.TraverseAll()):
            primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
            if prim.IsA(UsdGeom.PointInstancer) and primvar:
                shown = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
                    "displayColor", Sdf.ValueTypeNames.Color3fArray, primvar.GetInterpolation()
                )
                shown.Set(primvar.Get(Usd.TimeCode.EarliestTime()))
            elif prim.IsA(UsdGeom.Gprim) and primvar:
                UsdShade.MaterialBindingAPI(prim).UnbindAllBindings()
        self._note(
            f"the instances' {name} becomes displayColor, without standard_surface's reflection"
        )

    def _mesh(self, mesh: UsdGeom.Mesh) -> None:
        """Convert meshes without a subdivisionScheme to smooth polygons, as Arnold does."""
        scheme = mesh.GetSubdivisionSchemeAttr()
        if scheme.HasAuthoredValue():
            return
        scheme.Set(UsdGeom.Tokens.none)
        self._note(
            "a mesh without an authored subdivisionScheme is drawn as polygons, not catmullClark"
        )
        normals = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
        if normals and normals.HasValue() and normals.GetInterpolation() == "vertex":
            return
        if normals:
            self._note("normals with an elementSize that USD cannot read are replaced by averages")
            for name in ("primvars:normals", "primvars:normals:indices"):
                mesh.GetPrim().GetAttribute(name).Block()
        found = averaged_normals(
            np.array(mesh.GetPointsAttr().Get(), np.float64),
            np.array(mesh.GetFaceVertexCountsAttr().Get()),
            np.array(mesh.GetFaceVertexIndicesAttr().Get()),
        )
        mesh.CreateNormalsAttr([Gf.Vec3f(*(float(v) for v in n)) for n in found])
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)

    def _dome(self, prim: Usd.Prim) -> None:
        seen = prim.GetAttribute("primvars:arnold:camera")
        if seen and seen.Get() == 0:
            self.test.covered_only = True
            self._note(
                "primvars:arnold:camera = 0: only pixels that the reference covers are compared"
            )


def _matrix(node: dict[str, list[str]]) -> Gf.Matrix4d:
    values = [float(v) for v in node.get("matrix", [])]
    return Gf.Matrix4d(*values) if values else Gf.Matrix4d(1.0)


def _source(owner: Any, attribute: str) -> UsdShade.Shader:
    """The shader that an attribute is connected to."""
    found = owner.GetPrim().GetAttribute(attribute)
    paths = found.GetConnections() if found else []
    stage = owner.GetPrim().GetStage()
    return UsdShade.Shader(stage.GetPrimAtPath(paths[0].GetPrimPath()) if paths else Usd.Prim())


def _kind(shader: UsdShade.Shader) -> str:
    return str(shader.GetIdAttr().Get()) if shader else ""


def averaged_normals(
    points: NDArray[np.float64], counts: NDArray[Any], indices: NDArray[Any]
) -> NDArray[np.float64]:
    """Point normals: area-weighted means of the adjacent face normals."""
    starts = np.cumsum(counts) - counts
    following = np.arange(len(indices)) + 1
    following[starts + counts - 1] = starts
    edges = np.cross(points[indices], points[indices[following]])
    faces = np.add.reduceat(edges, starts, axis=0)
    normals = np.zeros_like(points)
    np.add.at(normals, indices, faces.repeat(counts, axis=0))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return normals
