# SPDX-License-Identifier: Apache-2.0
"""Convert Mitsuba 3's XML scenes to USD stages.

Mitsuba's parser reads the file, and Mitsuba's loaders read the meshes; this module translates each
plugin. Exact equivalents: diffuse, smooth conductors by index, smooth dielectrics, plastic, GGX
with little multiple scattering, all emitters except spots and projectors, and cameras.
Approximations, listed in ``Film.notes``: Beckmann becomes GGX of the same alpha, plastic is linear,
and emitters do not reflect. ``mitsuba_scene.referee`` applies the same approximations to the
Mitsuba scene, so that Mitsuba shows their effect on the image.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reference_scenes.mitsuba_scene import Scene
from reference_scenes.shapes import as_rectangle, cube, rectangle, write_checker, write_dome
from reference_scenes.stage import TURN, Image, Inexpressible, Matrix, StageWriter

MESHES = ("obj", "ply", "serialized")
GAUSSIAN_WIDTH = 3.0
"""Width that gives our Gaussian filter Mitsuba's default standard deviation of half a pixel."""


@dataclass
class Film:
    """Image settings of a scene.

    Attributes:
        size: Width and height.
        filter: Name of the pixel filter for Wavecomb.
        filter_width: Pixels.
        max_depth: Scattering vertices, as Wavecomb counts them.
        left_out: Mask (height, width) of pixels that show objects which cannot be translated.
        notes: Approximations in the translation of the scene.
    """

    size: tuple[int, int]
    filter: str = "box"
    filter_width: float = 1.0
    max_depth: int = 64
    left_out: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), bool))
    notes: list[str] = field(default_factory=list)


def to_stage(scene: Scene, file: Path) -> Film:
    """Write the stage of a scene; return its image settings.

    Raises:
        Inexpressible: A stage cannot express a feature of the scene.
    """
    return _Translator(scene, file).film


class _Translator:
    """Translator of one Mitsuba scene to a stage."""

    def __init__(self, scene: Scene, file: Path) -> None:
        self.scene = scene
        self.mi = scene.mi
        self.out = StageWriter(file)
        self._materials: dict[int, str] = {}
        self._dropped: list[NDArray[np.float64]] = []
        top = scene.children(0)
        sensors = [n for n in top.values() if scene.category(n) == "Sensor"]
        if len(sensors) != 1:
            raise Inexpressible(f"the scene has {len(sensors)} sensors")
        self.film = self._film(sensors[0])
        self.film.max_depth = self._depth(top)
        for number in top.values():
            if scene.category(number) == "Emitter":
                self._emitter(number)
            elif scene.category(number) == "Shape":
                self._shape(number)
        self.film.left_out = self._left_out(sensors[0])
        self.out.save()

    # ---- camera ----------------------------------------------------------------------------------

    def _depth(self, top: dict[str, int]) -> int:
        for number in top.values():
            while self.scene.category(number) == "Integrator":
                inner = list(self.scene.all_of(number, "Integrator"))
                if not inner:
                    kind, props = self.scene.kind(number), self.scene.props(number)
                    if kind not in ("path", "direct", "ptracer"):
                        raise Inexpressible(f"Wavecomb has no integrator {kind}")
                    most = int(props["max_depth"]) if "max_depth" in props else -1
                    return 1 if kind == "direct" else (64 if most < 0 else most - 1)
                number = inner[0]
        return 64

    def _film(self, sensor: int) -> Film:
        (number,) = self.scene.all_of(sensor, "Film")
        props = self.scene.props(number)
        film = Film((int(props["width"]), int(props["height"])))
        kinds = [self.scene.kind(n) for n in self.scene.all_of(number, "ReconstructionFilter")]
        if kinds in ([], ["gaussian"]):
            film.filter, film.filter_width = "gaussian", GAUSSIAN_WIDTH
        elif kinds != ["box"]:
            raise Inexpressible(f"Wavecomb has no reconstruction filter {kinds[0]}")
        to_world, half, orthographic = self._view(sensor, film)
        props = self.scene.props(sensor)
        near, far = (
            float(props[key]) if key in props else default
            for key, default in (("near_clip", 1e-2), ("far_clip", 1e4))
        )
        self.out.camera(to_world @ TURN, half, (near, far), orthographic)
        return film

    def _view(self, sensor: int, film: Film) -> tuple[Matrix, tuple[float, float], bool]:
        """Return a camera's unscaled transform, half extent, and whether it is orthographic."""
        kind, props = self.scene.kind(sensor), self.scene.props(sensor)
        to_world = self._matrix(sensor)
        scale = np.linalg.norm(to_world[:3, :3], axis=0)
        to_world[:3, :3] /= scale
        width, height = film.size
        if kind == "orthographic":
            return to_world, (float(scale[0]), float(scale[0]) * height / width), True
        if kind != "perspective":
            raise Inexpressible(f"Wavecomb has no sensor {kind}")
        x_fov = float(np.array(self.mi.parse_fov(props, width / height)).item())
        half = math.tan(math.radians(x_fov) / 2)
        return to_world, (half, half * height / width), False

    def _left_out(self, sensor: int) -> NDArray[np.bool_]:
        """Return a mask of the projected bounding boxes of objects that are not translated."""
        width, height = self.film.size
        mask = np.zeros((height, width), bool)
        to_world, half, orthographic = self._view(sensor, self.film)
        for points in self._dropped:
            seen = (points - to_world[:3, 3]) @ to_world[:3, :3]
            depth = np.ones(len(seen)) if orthographic else np.maximum(seen[:, 2], 1e-6)
            x = (0.5 - 0.5 * seen[:, 0] / depth / half[0]) * width
            y = (0.5 - 0.5 * seen[:, 1] / depth / half[1]) * height
            low = max(math.floor(y.min()) - 1, 0), max(math.floor(x.min()) - 1, 0)
            mask[low[0] : math.ceil(y.max()) + 1, low[1] : math.ceil(x.max()) + 1] = True
        return mask

    def _matrix(self, number: int, key: str = "to_world") -> Matrix:
        props = self.scene.props(number)
        if key not in props:
            return np.eye(4)
        return np.array(props[key].matrix, np.float64).reshape(4, 4)

    # ---- emitters --------------------------------------------------------------------------------

    def _emitter(self, number: int) -> None:
        kind, props = self.scene.kind(number), self.scene.props(number)
        if kind == "area":
            return  # an area light is converted with the shape that refers to it
        if missing := self.scene.missing_file(number):
            raise Inexpressible(f"{missing}, which lights the scene, is not among the assets")
        if kind == "constant":
            self.out.dome_light(np.eye(4), self.scene.colour(number, "radiance", 1.0, True))
        elif kind == "envmap":
            scale = float(props["scale"]) if "scale" in props else 1.0
            image = self.out.file.with_name(f"{self.out.file.stem}_dome.exr")
            source = self.scene.path(str(props["filename"]))
            assert source is not None
            write_dome(source, image)
            to_world = self._matrix(number)
            to_world[:3, 3] = 0.0
            self.out.dome_light(to_world, [scale] * 3, image)
        elif kind == "point":
            centre = props["position"] if "position" in props else self._matrix(number)[:3, 3]
            colour = self.scene.colour(number, "intensity", 1.0, True)
            self.out.sphere_light([float(v) for v in centre], 0.0, colour)
        elif kind == "directional":
            along = props["direction"] if "direction" in props else self._matrix(number)[:3, 2]
            colour = self.scene.colour(number, "irradiance", 1.0, True)
            self.out.distant_light([float(v) for v in along], colour)
        elif kind == "spot":
            raise Inexpressible(
                "a spot light's brightness falls linearly with the angle and passes an image; "
                "UsdLux's cone falls by smoothstep, and only RectLight and DomeLight have textures"
            )
        elif kind == "projector":
            raise Inexpressible("UsdLux has no projector light")
        else:
            raise Inexpressible(f"the emitter {kind} has no counterpart in UsdLux")

    # ---- shapes ----------------------------------------------------------------------------------

    def _shape(self, number: int) -> None:
        emitters = list(self.scene.all_of(number, "Emitter"))
        if missing := self.scene.missing_file(number):
            if emitters or missing == str(self.scene.props(number).get("filename", "")):
                raise Inexpressible(f"{missing} is not among the assets")
            self._dropped.append(self._arrays(number)[0])
            self.film.notes.append(
                f"{missing} is not among the assets: pixels that it covers are not compared"
            )
            return
        if emitters:
            self._lamp(number, emitters[0])
            return
        bsdfs = list(self.scene.all_of(number, "BSDF"))
        material, colours = self._material(bsdfs[0]) if bsdfs else self._plain()
        if self.scene.kind(number) == "sphere":
            centre, radius = self._sphere(number)
            to_world = np.eye(4)
            to_world[:3, 3] = centre
            self.out.sphere(to_world, radius, material)
            return
        points, faces, normals, uv, mesh = self._arrays(number)
        found = None if colours is None else colours(self.mi.traverse(mesh))
        self.out.mesh(points, faces, material, normals, uv, found)

    def _sphere(self, number: int) -> tuple[NDArray[np.float64], float]:
        props, to_world = self.scene.props(number), self._matrix(number)
        centre = np.array([*(props.get("center", [0.0, 0.0, 0.0])), 1.0], np.float64)
        size = float(np.cbrt(abs(np.linalg.det(to_world[:3, :3]))))
        return (to_world @ centre)[:3], float(props.get("radius", 1.0)) * size

    def _arrays(self, number: int) -> tuple[Any, Any, Any, Any, Any]:
        """World-space points and normals, triangles, uv with v up, and Mitsuba's mesh."""
        kind, props = self.scene.kind(number), self.scene.props(number)
        to_world = self._matrix(number)
        if kind in ("rectangle", "cube"):
            points, faces, normals, uv = (rectangle if kind == "rectangle" else cube)(to_world)
            return points, faces, normals, uv * (1, -1) + (0, 1), None
        if kind not in MESHES:
            raise Inexpressible(f"the shape {kind} is not translated")
        made = {"type": kind, "filename": str(self.scene.path(str(props["filename"])))}
        for key in ("shape_index", "face_normals", "flip_normals"):
            if key in props:
                made[key] = props[key]
        mesh = self.mi.load_dict({**made, "to_world": self.mi.ScalarTransform4f(to_world)})
        found = self.mi.traverse(mesh)
        points = np.array(found["vertex_positions"], np.float64).reshape(-1, 3)
        faces = np.array(found["faces"]).reshape(-1, 3)
        normals = np.array(found["vertex_normals"]).reshape(-1, 3)
        uv = np.array(found["vertex_texcoords"]).reshape(-1, 2)
        up = np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1) if len(uv) else None
        return points, faces, normals if len(normals) else None, up, mesh

    def _lamp(self, number: int, emitter: int) -> None:
        if self.scene.kind(emitter) != "area" or self.scene.children(emitter):
            raise Inexpressible("an emitter of a shape with a texture is not translated")
        radiance = self.scene.colour(emitter, "radiance", 1.0, True)
        kind = self.scene.kind(number)
        for bsdf in self.scene.all_of(number, "BSDF"):
            if any(self.scene.colour(bsdf, "reflectance")):
                self.film.notes.append("lights do not reflect")
        if kind == "sphere":
            centre, radius = self._sphere(number)
            self.out.sphere_light([float(v) for v in centre], radius, radiance)
        elif kind == "disk":
            self.out.disk_light(self._matrix(number) @ TURN, radiance)
        else:
            points, faces, *_ = self._arrays(number)
            to_world, width, height = as_rectangle(points, faces)
            self.out.rect_light(to_world, radiance, width, height)

    # ---- materials -------------------------------------------------------------------------------

    def _plain(self) -> tuple[str, None]:
        return self.out.material("diffuse", {"diffuseColor": (0.5, 0.5, 0.5)}), None

    def _material(self, number: int) -> tuple[str, Callable[[Any], Any] | None]:
        """Return the material's path and, if meshes need colours, a function that makes them."""
        scene, kind, props = self.scene, self.scene.kind(number), self.scene.props(number)
        if kind == "twosided":
            return self._material(next(scene.all_of(number, "BSDF")))
        if kind == "diffuse":
            return self._diffuse(number)
        if kind == "blendbsdf":
            return self._blend(number)
        if kind == "normalmap":
            (image,) = scene.all_of(number, "Texture")
            flat = scene.kind(image) == "rawconstant"
            if not flat or [float(v) for v in scene.props(image)["value"]] != [0.5, 0.5, 1.0]:
                raise Inexpressible("normal maps are not translated")
            return self._material(next(scene.all_of(number, "BSDF")))
        if kind not in ("conductor", "dielectric", "plastic") and kind not in (
            "roughconductor",
            "roughdielectric",
            "roughplastic",
        ):
            raise Inexpressible(f"Wavecomb has no equivalent of the material {kind}")
        if scene.children(number) and any(scene.all_of(number, "Texture")):
            raise Inexpressible(f"{kind} with a roughness texture is not translated")
        return self._microfacets(kind, number, props), None

    def _microfacets(self, kind: str, number: int, props: Any) -> str:
        if kind.startswith("rough") and str(props.get("distribution", "beckmann")) != "ggx":
            self.film.notes.append("GGX of the same alpha replaces Beckmann")
        alpha = float(props.get("alpha", 0.1)) if kind.startswith("rough") else 0.0
        inputs: dict[str, Any] = {"roughness": math.sqrt(alpha)}
        if kind.endswith("conductor"):
            eta, k = self._index(number, props)
            if "alpha_u" in props:
                return self._brushed(eta, k, float(props["alpha_u"]), float(props["alpha_v"]))
            return self.out.material("metal", inputs, {"wavecomb:eta": eta, "wavecomb:k": k})
        ior = {key: props[key] for key in ("int_ior", "ext_ior") if key in props}
        default = {} if kind.endswith("dielectric") else {"int_ior": "polypropylene"}
        made = self.mi.load_dict({"type": "dielectric", **default, **ior})
        inputs["ior"] = float(self.mi.traverse(made)["eta"])
        if kind.endswith("dielectric"):
            return self.out.material("dielectric", {**inputs, "diffuseColor": (1.0, 1.0, 1.0)})
        if props.get("nonlinear", False):
            self.film.notes.append(
                "plastic is linear: interreflection does not change the hue of its base"
            )
        colour = self.scene.colour(number, "diffuse_reflectance")
        return self.out.material("plastic", {**inputs, "diffuseColor": colour})

    def _index(self, number: int, props: Any) -> tuple[list[float], list[float]]:
        if "eta" in props:
            return self.scene.colour(number, "eta"), self.scene.colour(number, "k")
        made = self.mi.load_dict(
            {"type": "conductor", "material": str(props.get("material", "Cu"))}
        )
        found = self.mi.traverse(made)
        eta, k = (np.array(found[f"{key}.value"], np.float64).reshape(-1) for key in ("eta", "k"))
        return eta.tolist(), k.tolist()

    def _brushed(self, eta: list[float], k: list[float], u: float, v: float) -> str:
        """Add OpenPBR metal that looks like metal of a complex index; u and v are GGX alphas."""
        along, across = max(u, v), min(u, v)
        anisotropy = 1.0 - across / along
        roughness = math.sqrt(along / math.sqrt(2.0 / (1.0 + (1.0 - anisotropy) ** 2)))
        normal, edge = (conductor_reflectance(eta, k, angle) for angle in (0.0, 82.0))
        cosine = math.cos(math.radians(82.0))
        schlick = normal + (1.0 - normal) * (1.0 - cosine) ** 5
        self.film.notes.append("the metal is OpenPBR's, with F82 fitted to the index")
        inputs = {
            "base_metalness": 1.0,
            "base_color": normal,
            "specular_color": np.minimum(edge / schlick, 1.0),
            "specular_roughness": roughness,
            "specular_roughness_anisotropy": anisotropy,
        }
        return self.out.materialx("open_pbr_surface", inputs)

    def _diffuse(self, number: int) -> tuple[str, Callable[[Any], Any] | None]:
        textures = list(self.scene.all_of(number, "Texture"))
        if not textures:
            colour = self.scene.colour(number, "reflectance")
            return self.out.material("diffuse", {"diffuseColor": colour}), None
        (texture,) = textures
        kind, props = self.scene.kind(texture), self.scene.props(texture)
        if kind == "mesh_attribute":
            primvar = self.out.material("diffuse", {}, primvar="displayColor")
            return primvar, _attribute(str(props["name"]))
        if kind == "bitmap":
            file = self.scene.path(str(props["filename"]))
            assert file is not None
            use = Image(file, "raw" if props.get("raw", False) else "sRGB")
        elif kind == "checkerboard":
            file = self.out.file.with_name(f"{self.out.file.stem}_checker.exr")
            scale = self._matrix(texture, "to_uv")
            write_checker(
                file,
                self.scene.colour(texture, "color0", 0.4),
                self.scene.colour(texture, "color1", 0.2),
            )
            # Mitsuba's v points down, so v = 1 - t.
            u, v = float(scale[0, 0]), float(scale[1, 1])
            use = Image(file, "raw", (u, -v), (0.0, v))
        else:
            raise Inexpressible(f"the texture {kind} is not translated")
        return self.out.material("diffuse", {}, textures={"diffuseColor": use}), None

    def _blend(self, number: int) -> tuple[str, Callable[[Any], Any] | None]:
        """Convert two diffuse BSDFs, blended by a mesh attribute, to one with blended colours."""
        parts = list(self.scene.all_of(number, "BSDF"))
        (texture,) = self.scene.all_of(number, "Texture")
        simple = all(self.scene.kind(p) == "diffuse" and not self.scene.children(p) for p in parts)
        if not simple or self.scene.kind(texture) != "mesh_attribute":
            raise Inexpressible("only blends of plain diffuse BSDFs are translated")
        first, second = (np.array(self.scene.colour(p, "reflectance")) for p in parts)
        weight = _attribute(str(self.scene.props(texture)["name"]))

        def mixed(found: Any) -> tuple[NDArray[np.float64], str]:
            values, interpolation = weight(found)
            share = values[:, :1]
            return first * (1.0 - share) + second * share, interpolation

        return self.out.material("diffuse", {}, primvar="displayColor"), mixed


def _attribute(name: str) -> Callable[[Any], tuple[NDArray[np.float64], str]]:
    width = 3 if name.endswith("color") else 1

    def values(found: Any) -> tuple[NDArray[np.float64], str]:
        array = np.array(found[name], np.float64).reshape(-1, width)
        return array, "uniform" if name.startswith("face") else "vertex"

    return values


def conductor_reflectance(eta: Any, k: Any, degrees: float) -> NDArray[np.float64]:
    """Unpolarised Fresnel reflectance of a conductor (PBRT, 4th edition, 9.3.6)."""
    cosine = math.cos(math.radians(degrees))
    index = np.asarray(eta, np.float64) + 1j * np.asarray(k, np.float64)
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    parallel = (index * cosine - inner) / (index * cosine + inner)
    perpendicular = (cosine - index * inner) / (cosine + index * inner)
    mean: NDArray[np.float64] = 0.5 * (abs(parallel) ** 2 + abs(perpendicular) ** 2)
    return mean
