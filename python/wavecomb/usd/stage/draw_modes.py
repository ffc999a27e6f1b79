# SPDX-License-Identifier: Apache-2.0
"""Draw modes of models (UsdGeomModelAPI): the simple geometry that replaces a model.

Geometry and textures follow OpenUSD's imaging code (drawModeStandin.cpp).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade

from wavecomb.usd.materials.network import colour, word
from wavecomb.usd.stage.report import LoadReport

MODES = ("origin", "bounds", "cards")

THICK = 0.004
"""Line width as a fraction of the box diagonal; lines of unit-length axes are 5 times as wide."""

_GAP = 1e-5
"""Distance between the back-to-back cards of a cross, as a fraction of the box diagonal."""

_CARDS = ("XPos", "YPos", "ZPos", "XNeg", "YNeg", "ZNeg")
_RIGHT = ((1, 1.0), (0, -1.0), (0, 1.0), (1, -1.0), (0, 1.0), (0, -1.0))
"""Axis and sign of the direction to the right in the texture of each card."""

_CORNERS = ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0), (1.0, 0.0))
"""Corners of a texture, starting at the upper right."""

_MODEL_PURPOSES = ["default", "proxy", "render"]


@dataclass(frozen=True)
class StandIn:
    """Geometry that replaces a model.

    Attributes:
        prim: Prim at the model's path on a separate stage, in the model's space.
        kind: Kind of the geometry, "mesh" or "curves".
        subsets: Subsets of the geometry's faces.
        materials: Materials of the face subsets.
    """

    prim: Usd.Prim
    kind: str
    subsets: tuple[Usd.Prim, ...] = ()
    materials: tuple[UsdShade.Material, ...] = ()


class DrawModes:
    """Factory of stand-ins for the models of one stage."""

    def __init__(self, time: Usd.TimeCode, report: LoadReport) -> None:
        self._time = time
        self._report = report
        self._stage: Usd.Stage | None = None
        self._boxes: UsdGeom.BBoxCache | None = None

    def mode(self, prim: Usd.Prim, above: str) -> str:
        """Returns the draw mode that a prim passes to its children.

        ``above`` is the draw mode of the prim's parent.
        """
        mode = word(prim.GetAttribute("model:drawMode").Get(), "inherited")
        if mode in ("default", *MODES):
            return mode
        if mode != "inherited":
            self._report.missing(f"model:drawMode {mode}", prim.GetPath())
        return above

    def applies(self, prim: Usd.Prim) -> bool:
        """Returns whether the inherited draw mode applies to a prim."""
        attribute = prim.GetAttribute("model:applyDrawMode")
        if attribute.HasAuthoredValue():
            return prim.IsModel() and bool(attribute.Get())
        kind = Usd.ModelAPI(prim).GetKind()
        return prim.IsModel() and Kind.Registry.IsA(kind, Kind.Tokens.component)

    def stand_in(self, prim: Usd.Prim, mode: str) -> StandIn | None:
        """Returns the stand-in for a model in one of ``MODES``; None if it has no extent."""
        self._report.note(f"models drawn as {mode}", prim.GetPath())
        if self._stage is None:
            self._stage = Usd.Stage.CreateInMemory()
        made = self._made(prim, mode)
        if made is not None:
            # Copy the kind of the model, by which the prim's asset is found.
            Usd.ModelAPI(made.prim).SetKind(Usd.ModelAPI(prim).GetKind())
        return made

    def _made(self, prim: Usd.Prim, mode: str) -> StandIn | None:
        if mode == "origin":
            axes = np.eye(3)
            lines = [(np.zeros(3), axis) for axis in axes]
            return self._lines(prim, lines, [tuple(axis) for axis in axes], 5 * THICK)
        box = self._extent(prim)
        if box is None:
            self._report.warn("a model without extent has no stand-in", prim.GetPath())
            return None
        if mode == "bounds":
            return self._bounds(prim, box)
        return self._cards(prim, box)

    def _path(self, prim: Usd.Prim) -> Sdf.Path:
        """Returns a stand-in's path, with a prototype's path replaced by its first instance's."""
        return Sdf.Path(self._report.place(prim.GetPath()))

    def _extent(self, prim: Usd.Prim) -> np.ndarray | None:
        """Returns the extent (2, 3) of a model in its own space."""
        hint = UsdGeom.ModelAPI(prim).GetExtentsHint(self._time)
        if hint is not None and len(hint) >= 2:
            box = np.array(hint[:2], np.float64)
        else:
            if self._boxes is None:
                self._boxes = UsdGeom.BBoxCache(self._time, _MODEL_PURPOSES, True)
            found = self._boxes.ComputeUntransformedBound(prim).ComputeAlignedRange()
            box = np.array([found.GetMin(), found.GetMax()], np.float64)
        good = np.isfinite(box).all() and bool((box[0] <= box[1]).all()) and box.max() < 1e30
        return box if good and bool((box[0] < box[1]).any()) else None

    def _colour(self, prim: Usd.Prim) -> Gf.Vec3f:
        value = prim.GetAttribute("model:drawModeColor").Get(self._time)
        return Gf.Vec3f(*colour(value, (0.18, 0.18, 0.18)))

    def _bounds(self, prim: Usd.Prim, box: np.ndarray) -> StandIn:
        corners = [np.array([box[i >> k & 1, k] for k in range(3)]) for i in range(8)]
        lines = [
            (corners[i], corners[i | bit]) for bit in (1, 2, 4) for i in range(8) if not i & bit
        ]
        thick = THICK * float(np.linalg.norm(box[1] - box[0]))
        return self._lines(prim, lines, [self._colour(prim)], thick)

    def _lines(self, prim: Usd.Prim, lines: list, colours: list, width: float) -> StandIn:
        curves = UsdGeom.BasisCurves.Define(self._stage, self._path(prim))
        curves.CreateTypeAttr("linear")
        curves.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for line in lines for p in line])
        curves.CreateCurveVertexCountsAttr([2] * len(lines))
        curves.CreateWidthsAttr([width])
        curves.SetWidthsInterpolation("constant")
        kind = "constant" if len(colours) == 1 else "uniform"
        curves.CreateDisplayColorPrimvar(kind).Set([Gf.Vec3f(*map(float, c)) for c in colours])
        return StandIn(curves.GetPrim(), "curves")

    def _textures(self, prim: Usd.Prim) -> dict[int, str]:
        """Returns the texture files of cards by card index."""
        found = {}
        for number, card in enumerate(_CARDS):
            attribute = prim.GetAttribute(f"model:cardTexture{card}")
            value = attribute.Get(self._time)
            if isinstance(value, Sdf.AssetPath) and value.path:
                found[number] = value.resolvedPath or value.path
        return found

    def _cards(self, prim: Usd.Prim, box: np.ndarray) -> StandIn:
        geometry = word(prim.GetAttribute("model:cardGeometry").Get(self._time), "cross")
        if geometry not in ("cross", "box"):
            self._report.missing(f"cards of geometry {geometry} (drawn as a cross)", prim.GetPath())
        if word(prim.GetAttribute("model:cardVisibility").Get(), "inherited") != "inherited":
            self._report.missing("model:cardVisibility", prim.GetPath())
        textures = self._textures(prim)
        faces = [n for n in range(6) if not textures or n in textures or (n + 3) % 6 in textures]
        points, uvs = [], []
        for number in faces:
            axis, (right, way) = number % 3, _RIGHT[number]
            up = 1 if axis == 2 else 2
            side = 1 if number < 3 else 0
            gap = _GAP * float(np.linalg.norm(box[1] - box[0])) * (1 if side else -1)
            flat = box[side, axis] if geometry == "box" else box[:, axis].mean() + gap
            mirrored = bool(textures) and number not in textures
            for u, v in _CORNERS:
                point = np.empty(3)
                point[axis] = flat
                point[right] = box[int(u if way > 0 else 1 - u), right]
                point[up] = box[int(v), up]
                points.append(Gf.Vec3f(*map(float, point)))
                uvs.append(Gf.Vec2f(1 - u if mirrored else u, v))
        mesh = UsdGeom.Mesh.Define(self._stage, self._path(prim))
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreatePointsAttr(points)
        mesh.CreateFaceVertexCountsAttr([4] * len(faces))
        mesh.CreateFaceVertexIndicesAttr(list(range(4 * len(faces))))
        coordinates = Sdf.ValueTypeNames.TexCoord2fArray
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", coordinates, "faceVarying")
        st.Set(uvs)
        subsets, materials = [], []
        for place, number in enumerate(faces):
            own = textures.get(number) or textures.get((number + 3) % 6)
            subset = UsdGeom.Subset.Define(
                self._stage, mesh.GetPath().AppendChild(f"card{_CARDS[number]}")
            )
            subset.CreateElementTypeAttr("face")
            subset.CreateIndicesAttr([place])
            subsets.append(subset.GetPrim())
            name = f"cardLook{_CARDS[number]}"
            materials.append(
                self._add_material(mesh.GetPath().AppendChild(name), own, self._colour(prim))
            )
        return StandIn(mesh.GetPrim(), "mesh", tuple(subsets), tuple(materials))

    def _add_material(
        self, path: Sdf.Path, texture: str | None, colour: Gf.Vec3f
    ) -> UsdShade.Material:
        """Creates a diffuse material with a texture that has cut-out alpha, or with a colour."""
        kinds = Sdf.ValueTypeNames
        material = UsdShade.Material.Define(self._stage, path)
        surface = UsdShade.Shader.Define(self._stage, path.AppendChild("Surface"))
        surface.CreateIdAttr("UsdPreviewSurface")
        surface.CreateInput("useSpecularWorkflow", kinds.Int).Set(1)
        surface.CreateInput("specularColor", kinds.Color3f).Set(Gf.Vec3f(0))
        surface.CreateInput("roughness", kinds.Float).Set(1.0)
        material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        diffuse = surface.CreateInput("diffuseColor", kinds.Color3f)
        if texture is None:
            diffuse.Set(colour)
            return material
        reader = UsdShade.Shader.Define(self._stage, path.AppendChild("St"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", kinds.String).Set("st")
        image = UsdShade.Shader.Define(self._stage, path.AppendChild("Image"))
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", kinds.Asset).Set(Sdf.AssetPath(texture))
        for wrap in ("wrapS", "wrapT"):
            image.CreateInput(wrap, kinds.Token).Set("clamp")
        image.CreateInput("st", kinds.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        diffuse.ConnectToSource(image.ConnectableAPI(), "rgb")
        opacity = surface.CreateInput("opacity", kinds.Float)
        opacity.ConnectToSource(image.ConnectableAPI(), "a")
        surface.CreateInput("opacityThreshold", kinds.Float).Set(0.1)
        return material
