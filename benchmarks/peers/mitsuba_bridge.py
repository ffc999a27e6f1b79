# SPDX-License-Identifier: Apache-2.0
"""Convert a recorded scene to Mitsuba 3: the same arrays, lights, camera and closest materials.

Exact equivalents: geometry; rect, disk, sphere and dome lights; closed emissive meshes (Wavecomb's
emit to both sides, Mitsuba's outwards); diffuse, smooth metal with measured index, smooth
dielectric, UsdPreviewSurface with constant opacity below 1 (mitsuba_preview.py); the camera with a
box filter. GGX agrees within noise where multiple scattering between microfacets, which Mitsuba
ignores, is small. Approximations: metal defined by colours (Mitsuba has no Schlick reflectance),
plastic, principled, and OpenPBR except for its glass and its metal without a tint. A distant light
with an angle becomes a distant sphere.
"""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from mitsuba_media import Media
from mitsuba_preview import preview_surface
from numpy.typing import NDArray
from recorded import INHERIT, Mesh, Placed, Recorded

Matrix = NDArray[np.float64]
_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Half a turn about y, since Mitsuba's objects point along +z and USD's along -z."""

MOST_PATHS = 1 << 25
"""Maximum number of paths per pass: the vectorised variants hold all paths of a pass in memory,
about 100 bytes each. A timed image must fit into one pass, as 600 x 600 pixels with 64 samples do,
because each further pass has another seed and compiles its kernels again.
"""

_FAR = 1e4
"""Distance of the sphere that replaces a distant light, as a multiple of the scene size."""


def find_llvm() -> bool:
    """Set the path of a libLLVM that Dr.Jit can use (16 or newer), unless the environment sets it.

    Returns whether a usable libLLVM exists; Dr.Jit would end the process with an older version.
    """
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return True
    for folder in ("/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib64"):
        for version in (19, 20, 18, 17, 16):
            for name in (
                f"libLLVM-{version}.so",
                f"libLLVM.so.{version}",
                f"libLLVM-{version}.so.1",
            ):
                if (Path(folder) / name).exists():
                    os.environ["DRJIT_LIBLLVM_PATH"] = str(Path(folder) / name)
                    return True
    return False


def load_mitsuba(variant: str | None = None, threads: int | None = None) -> ModuleType:
    """Import Mitsuba in a variant, which is llvm_ad_rgb by default, or scalar_rgb without LLVM.

    Raises:
        ImportError: Mitsuba or the variant is missing.
    """
    has_llvm = find_llvm()
    if not has_llvm and (variant or "").startswith("llvm"):
        raise ImportError("Mitsuba's llvm variants need libLLVM 16 or newer: tools/setup test")
    mi = importlib.import_module("mitsuba")
    usual = ["llvm_ad_rgb", "scalar_rgb"] if has_llvm else ["scalar_rgb"]
    for name in [variant] if variant else usual:
        try:
            mi.set_variant(name)
            if name.startswith("llvm"):
                dr = importlib.import_module("drjit")
                if threads:
                    dr.set_thread_count(threads)
                dr.eval(dr.arange(mi.Float, 3) + 1)
            mi.set_log_level(mi.LogLevel.Error)
            return mi
        except Exception as error:  # Dr.Jit raises various exceptions without LLVM
            last = error
    raise ImportError(f"Mitsuba has no variant that runs here: {last}")


@dataclass(frozen=True)
class PeerSettings:
    """Render settings of Mitsuba.

    Attributes:
        width: Pixels.
        height: Pixels.
        max_depth: Scattering vertices, as Wavecomb counts them.
        rr_depth: Path vertex at which Russian roulette starts; by default there is no roulette.
        instancing: Use shape groups where Mitsuba supports them; otherwise copy all instances.
        sampler: Name of a Mitsuba sampler.
        integrator: Name of the integrator for scenes with volumes, or ptracer to trace light paths.
        same_preview: Render all UsdPreviewSurfaces by Wavecomb's formulas (mitsuba_preview.py),
            instead of only those with opacity below 1.
    """

    width: int
    height: int
    max_depth: int = 8
    rr_depth: int = 1_000_000
    instancing: bool = False
    sampler: str = "independent"
    integrator: str = "volpathmis"
    same_preview: bool = False


class MitsubaScene:
    """A recorded scene in Mitsuba."""

    def __init__(self, mi: ModuleType, recorded: Recorded, settings: PeerSettings) -> None:
        self.mi = mi
        self.recorded = recorded
        self.settings = settings
        self._bsdfs: dict[int, Any] = {}
        self._textures: dict[str, Any] = {}
        media = Media(mi, recorded)
        scene: dict[str, Any] = {
            "type": "scene",
            **media.entries,
            "integrator": {
                "type": settings.integrator
                if recorded.volumes or settings.integrator == "ptracer"
                else "path",
                "max_depth": settings.max_depth + 1,
                "rr_depth": settings.rr_depth,
            },
            "sensor": self._sensor(),
        }
        if media.of_camera is not None:
            scene["sensor"]["medium"] = {"type": "ref", "id": media.of_camera}
        for k, light in enumerate(recorded.lights):
            scene[f"light{k}"] = self._light(light)
        scene.update(self._geometry())
        self.scene = mi.load_dict(scene)

    def render(self, spp: int, seed: int = 0) -> NDArray[np.float32]:
        """Render an image (height, width, 3), in passes whose paths fit into memory."""
        pixels = self.settings.width * self.settings.height
        passes = -(-spp * pixels // MOST_PATHS)
        most = -(-spp // passes)
        total: Any = 0.0
        for number in range(passes):
            count = min(most, spp - number * most)
            if count > 0:
                taken = seed if number == 0 else seed + 1_000_003 * number
                image = np.array(self.mi.render(self.scene, spp=count, seed=taken))
                total = total + image * np.float32(count / spp)
        picture: NDArray[np.float32] = total
        return picture.reshape(self.settings.height, self.settings.width, -1)[:, :, :3]

    # ---- camera ----------------------------------------------------------------------------------

    def _sensor(self) -> dict[str, Any]:
        camera = self.recorded.camera
        x0, x1, y0, y1 = camera["window"]
        if abs(x0 + x1) > 1e-6 or abs(y0 + y1) > 1e-6:
            raise NotImplementedError("a camera with an aperture offset")
        half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        half_x = max(half_x, half_y * self.settings.width / self.settings.height)
        sensor = {
            "type": "perspective",
            "to_world": self._transform(_TURN @ camera["transform"]),
            "fov": float(np.degrees(2.0 * np.arctan(half_x))),
            "fov_axis": "x",
            "near_clip": max(camera.get("near_clip", 0.0), 1e-6),
            "far_clip": min(camera.get("far_clip", 1e30), 1e7),
            "film": {
                "type": "hdrfilm",
                "width": self.settings.width,
                "height": self.settings.height,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
            "sampler": {"type": self.settings.sampler},
        }
        if camera.get("lens_radius", 0.0) > 0.0:
            sensor["type"] = "thinlens"
            sensor["aperture_radius"] = camera["lens_radius"]
            sensor["focus_distance"] = camera["focus_distance"]
        if camera.get("projection") == "orthographic":
            if camera.get("lens_radius", 0.0) > 0:
                raise NotImplementedError("an orthographic camera with a lens")
            # Mitsuba's orthographic window extends from -1 to 1, so the transform scales it to its
            # size.
            del sensor["fov"], sensor["fov_axis"]
            window = np.diag([half_x, half_x, 1.0, 1.0])
            sensor["type"] = "orthographic"
            sensor["to_world"] = self._transform(window @ _TURN @ camera["transform"])
        elif camera.get("projection", "perspective") != "perspective":
            raise NotImplementedError(f"a {camera['projection']} camera")
        return sensor

    def _transform(self, rows: Matrix) -> Any:
        """Convert a matrix for row vectors (translation in the last row) for Mitsuba."""
        return self.mi.ScalarTransform4f(np.ascontiguousarray(rows.T))

    # ---- lights ----------------------------------------------------------------------------------

    def _light(self, light: dict[str, Any]) -> dict[str, Any]:
        kind, rows = light["kind"], light["transform"]
        colour = np.asarray(light.get("color", (1, 1, 1)), np.float64)
        if light.get("texture") is not None and kind != "dome":
            raise NotImplementedError("textured area lights")
        if kind == "rect":
            half = np.diag([0.5 * light["width"], 0.5 * light["height"], 1.0, 1.0])
            to_world = _TURN @ half @ rows
            area = 4.0 * np.linalg.norm(np.cross(to_world[0, :3], to_world[1, :3]))
            radiance = colour / area if light.get("normalize") else colour
            return self._lamp(
                {"type": "rectangle", "to_world": self._transform(to_world)}, radiance
            )
        if kind == "disk":
            to_world = _TURN @ np.diag([light["radius"], light["radius"], 1.0, 1.0]) @ rows
            area = np.pi * np.linalg.norm(np.cross(to_world[0, :3], to_world[1, :3]))
            radiance = colour / area if light.get("normalize") else colour
            return self._lamp({"type": "disk", "to_world": self._transform(to_world)}, radiance)
        if kind == "sphere":
            radius = light["radius"] * abs(np.linalg.det(rows[:3, :3])) ** (1 / 3)
            if radius == 0.0:
                position = [float(v) for v in rows[3, :3]]
                return {"type": "point", "position": position, "intensity": self._rgb(colour)}
            area = 4.0 * np.pi * radius**2
            radiance = colour / area if light.get("normalize") else colour
            centre = [float(v) for v in rows[3, :3]]
            return self._lamp({"type": "sphere", "center": centre, "radius": radius}, radiance)
        if kind == "distant":
            return self._distant(light, rows, colour)
        if kind == "dome":
            return self._dome(light, rows, colour)
        raise NotImplementedError(f"light of kind {kind}")

    def _rgb(self, colour: NDArray[Any]) -> dict[str, Any]:
        return {"type": "rgb", "value": [float(v) for v in colour]}

    def _lamp(self, shape: dict[str, Any], radiance: NDArray[Any]) -> dict[str, Any]:
        """Return an emissive shape with a black BSDF; Mitsuba's default BSDF reflects 50 %."""
        shape["emitter"] = {"type": "area", "radiance": self._rgb(radiance)}
        shape["bsdf"] = {"type": "diffuse", "reflectance": self._rgb(np.zeros(3))}
        return shape

    def _distant(
        self, light: dict[str, Any], rows: Matrix, colour: NDArray[np.float64]
    ) -> dict[str, Any]:
        along = -rows[2, :3] / np.linalg.norm(rows[2, :3])
        half = np.radians(light.get("angle", 0.53)) / 2.0
        if half == 0.0:
            direction = [float(v) for v in along]
            return {"type": "directional", "direction": direction, "irradiance": self._rgb(colour)}
        radiance = colour / (np.pi * np.sin(half) ** 2) if light.get("normalize") else colour
        distance = _FAR * self._extent()
        centre = [float(v) for v in -along * distance]
        sphere = {"type": "sphere", "center": centre, "radius": float(distance * np.sin(half))}
        return self._lamp(sphere, radiance)

    def _extent(self) -> float:
        return float(np.abs(self.recorded.bounds).max())

    def _dome(
        self, light: dict[str, Any], rows: Matrix, colour: NDArray[np.float64]
    ) -> dict[str, Any]:
        if light.get("texture") is None:
            return {"type": "constant", "radiance": self._rgb(colour)}
        texture = self.recorded.textures[light["texture"]]
        image = _linear(texture)[:, :, :3] * colour
        frame = rows.copy()
        frame[:3, :3] /= np.linalg.norm(frame[:3, :3], axis=1)[:, None]
        return {
            "type": "envmap",
            "bitmap": self.mi.Bitmap(np.ascontiguousarray(_rows_to_poles(image), np.float32)),
            "to_world": self._transform(frame),
        }

    # ---- geometry --------------------------------------------------------------------------------

    def _geometry(self) -> dict[str, Any]:
        out: dict[str, Any] = {}
        groups: dict[tuple[int, int], str] = {}
        for k, placed in enumerate(self.recorded.placed()):
            mesh = self.recorded.meshes[placed.mesh]
            key = (placed.mesh, placed.material)
            if self.settings.instancing and self._may_be_instanced(mesh, placed):
                if key not in groups:
                    groups[key] = f"group{len(groups)}"
                    parts = self._parts(mesh, placed.material, np.eye(4), groups[key])
                    out[groups[key]] = {"type": "shapegroup", **parts}
                out[f"instance{k}"] = {
                    "type": "instance",
                    "group": {"type": "ref", "id": groups[key]},
                    "to_world": self._transform(placed.transform),
                }
            else:
                out.update(self._parts(mesh, placed.material, placed.transform, f"mesh{k}"))
        return out

    def _may_be_instanced(self, mesh: Mesh, placed: Placed) -> bool:
        """Whether the mesh may be instanced: Mitsuba allows no emitters in a shape group."""
        ids = [placed.material] if mesh.face_materials is None else np.unique(mesh.face_materials)
        unit = np.array_equal(placed.transform, np.eye(4))
        return not unit and not any(self._emission(int(number)) for number in ids)

    def _parts(self, mesh: Mesh, inherited: int, transform: Matrix, name: str) -> dict[str, Any]:
        """Split a mesh by material."""
        if mesh.curves is not None:
            raise NotImplementedError("curves")
        if mesh.face_materials is None:
            return {name: self._mesh(mesh, None, inherited, transform, name)}
        parts = {}
        for number in np.unique(mesh.face_materials):
            faces = np.flatnonzero(mesh.face_materials == number)
            chosen = inherited if number == INHERIT else int(number)
            part = f"{name}_{number}"
            parts[part] = self._mesh(mesh, faces, chosen, transform, part)
        return parts

    def _mesh(
        self,
        mesh: Mesh,
        faces: NDArray[Any] | None,
        material: int,
        transform: Matrix,
        name: str,
    ) -> Any:
        indices = mesh.indices if faces is None else mesh.indices[faces]
        positions, normals, uvs = mesh.positions, mesh.normals, mesh.uvs
        corner = any(a is not None and a.ndim == 3 for a in (normals, uvs))
        if corner or faces is not None:
            flat = indices.reshape(-1)
            positions = positions[flat]
            chosen = slice(None) if faces is None else faces

            def spread(a: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
                if a is None:
                    return None
                return a[chosen].reshape(-1, a.shape[2]) if a.ndim == 3 else a[flat]

            normals, uvs = spread(normals), spread(uvs)
            indices = np.arange(len(flat), dtype=np.uint32).reshape(-1, 3)
        linear = transform[:3, :3]
        placed: NDArray[Any] = positions @ linear + transform[3, :3]
        if normals is not None:
            normals = normals @ np.linalg.inv(linear).T
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        if np.linalg.det(linear) < 0.0:
            indices = indices[:, ::-1]
        mi = self.mi
        properties = mi.Properties()
        properties["mesh_bsdf"] = self._bsdf(material)
        emission = self._emission(material)
        if emission:
            radiance = {"type": "area", "radiance": self._rgb(np.array(emission))}
            properties["mesh_emitter"] = mi.load_dict(radiance)
        made = mi.Mesh(
            name,
            vertex_count=len(placed),
            face_count=len(indices),
            has_vertex_normals=normals is not None,
            has_vertex_texcoords=uvs is not None,
            props=properties,
        )
        params = mi.traverse(made)
        params["vertex_positions"] = np.ascontiguousarray(placed, np.float32).ravel()
        params["faces"] = np.ascontiguousarray(indices, np.uint32).ravel()
        if normals is not None:
            params["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
        if uvs is not None:
            up = np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)
            params["vertex_texcoords"] = np.ascontiguousarray(up, np.float32).ravel()
        params.update()
        return made

    # ---- materials -------------------------------------------------------------------------------

    def _emission(self, number: int) -> tuple[float, ...] | None:
        if number == INHERIT:
            return None
        emission = self.recorded.materials[number].get("emission", (0, 0, 0))
        return tuple(float(v) for v in emission) if any(v > 0 for v in emission) else None

    def _bsdf(self, number: int) -> Any:
        if number not in self._bsdfs:
            made = self._material(number)
            self._bsdfs[number] = self.mi.load_dict(made) if isinstance(made, dict) else made
        return self._bsdfs[number]

    def _material(self, number: int) -> Any:
        if number == INHERIT:
            return {"type": "twosided", "bsdf": {"type": "diffuse"}}
        m = self.recorded.materials[number]
        program = m["program"]
        if program == "dielectric":
            return self._dielectric(m)
        if program == "openpbr" and m.get("openpbr", {}).get("transmission_weight", 0.0) >= 0.5:
            colour = m["openpbr"].get("transmission_color", (1.0,) * 3)
            absorbs = m["openpbr"].get("transmission_depth", 0.0) > 0
            plain = {"base_color": (1.0,) * 3 if absorbs else colour}
            return self._dielectric({"roughness": m["roughness"], "ior": m["ior"], **plain})
        makers = {
            "diffuse": self._diffuse,
            "metal": self._metal,
            "plastic": self._plastic,
            "principled": self._principled,
            "openpbr": self._principled,
        }
        if program == "emissive":
            inner: Any = {"type": "diffuse", "reflectance": self._rgb(np.zeros(3))}
        elif program == "principled" and (self.settings.same_preview or see_through(m)):
            inner = self._preview(m)
        else:
            inner = makers[program](m)
        if m.get("textures", {}).get("normal"):
            use = m["textures"]["normal"]
            image = 0.5 + 0.5 * self._values(use)
            inner = {"type": "normalmap", "normalmap": self._bitmap(use, image), "bsdf": inner}
        # Mitsuba's twosided refuses surfaces that transmit light.
        return inner if see_through(m) else {"type": "twosided", "bsdf": inner}

    def _diffuse(self, m: dict[str, Any]) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": self._colour(m, "base_color", (0.18,) * 3)}

    def _metal(self, m: dict[str, Any]) -> dict[str, Any]:
        out: dict[str, Any] = {"type": "conductor"}
        if any(m.get("conductor_eta", (0, 0, 0))):
            out["eta"] = self._rgb(np.array(m["conductor_eta"]))
            out["k"] = self._rgb(np.array(m["conductor_k"]))
        else:
            out["material"] = "none"
            out["specular_reflectance"] = self._colour(m, "base_color", (0.18,) * 3)
        return self._rough(out, m)

    def _rough(self, out: dict[str, Any], m: dict[str, Any]) -> dict[str, Any]:
        """Return the rough variant of a plugin if the roughness requires it."""
        use = m.get("textures", {}).get("roughness")
        roughness = m.get("roughness", 0.5)
        if use is None and roughness < 0.0317:
            return out
        out["type"] = "rough" + out["type"]
        out["distribution"] = "ggx"
        if use is None or out["type"] == "roughplastic":
            out["alpha"] = float(roughness) ** 2
        else:
            out["alpha"] = self._bitmap(use, np.maximum(self._values(use), 0.02) ** 2)
        return out

    def _dielectric(self, m: dict[str, Any]) -> dict[str, Any]:
        out = {
            "type": "dielectric",
            "int_ior": float(m.get("ior", 1.5)),
            "ext_ior": 1.0,
            "specular_transmittance": self._colour(m, "base_color", (1.0,) * 3),
        }
        return self._rough(out, m)

    def _plastic(self, m: dict[str, Any]) -> dict[str, Any]:
        out = {
            "type": "plastic",
            "int_ior": float(m.get("ior", 1.5)),
            "ext_ior": 1.0,
            "nonlinear": True,
            "diffuse_reflectance": self._colour(m, "base_color", (0.18,) * 3),
        }
        return self._rough(out, m)

    def _principled(self, m: dict[str, Any]) -> dict[str, Any]:
        coat_alpha = float(m.get("clearcoat_roughness", 0.01)) ** 2
        return {
            "type": "principled",
            "base_color": self._colour(m, "base_color", (0.18,) * 3),
            "roughness": self._number(m, "roughness", 0.5),
            "metallic": self._number(m, "metallic", 0.0),
            "eta": max(float(m.get("ior", 1.5)), 1.01),
            # Mitsuba divides clearcoat by 4, and its alpha is 0.1 - 0.099 gloss.
            "clearcoat": 4.0 * float(m.get("clearcoat", 0.0)),
            "clearcoat_gloss": float(np.clip((0.1 - coat_alpha) / 0.099, 0.0, 1.0)),
        }

    def _preview(self, m: dict[str, Any]) -> Any:
        """Return UsdPreviewSurface by Wavecomb's formulas."""
        if self.mi.variant().startswith("scalar"):
            raise NotImplementedError("UsdPreviewSurface with opacity in a scalar variant")

        def made(value: Any) -> Any:
            return self.mi.load_dict(value) if isinstance(value, dict) else value

        inputs = {
            "base_color": made(self._colour(m, "base_color", (0.18,) * 3)),
            "roughness": self._number(m, "roughness", 0.5),
            "metallic": self._number(m, "metallic", 0.0),
            "ior": float(m.get("ior", 1.5)),
            "clearcoat": float(m.get("clearcoat", 0.0)),
            "clearcoat_roughness": float(m.get("clearcoat_roughness", 0.01)),
            "opacity": float(m.get("opacity", 1.0)),
        }
        return preview_surface(self.mi)(inputs)

    # ---- textures --------------------------------------------------------------------------------

    def _colour(self, m: dict[str, Any], parameter: str, default: tuple[float, ...]) -> Any:
        use = m.get("textures", {}).get(parameter)
        if use is None:
            return self._rgb(np.array(m.get(parameter, default)))
        return self._bitmap(use, np.clip(self._values(use), 0.0, 1.0))

    def _number(self, m: dict[str, Any], parameter: str, default: float) -> Any:
        use = m.get("textures", {}).get(parameter)
        if use is None:
            return float(m.get(parameter, default))
        return self._bitmap(use, np.clip(self._values(use), 0.0, 1.0))

    def _values(self, use: dict[str, Any]) -> NDArray[np.float32]:
        """Texels (h, w, 1 or 3) of a texture after channel selection, scale and bias."""
        pixels = _linear(self.recorded.textures[use["texture"]])
        four = np.ones((*pixels.shape[:2], 4), np.float32)
        four[:, :, : pixels.shape[2]] = pixels
        if pixels.shape[2] <= 2:
            four[:, :, 1:3] = pixels[:, :, :1]
        scale, bias = (
            np.asarray(use.get(k, d), np.float32) for k, d in (("scale", 1), ("bias", 0))
        )
        four = four * scale + bias
        channel = use.get("channel", "rgb")
        return four[:, :, :3] if channel == "rgb" else four[:, :, ["rgba".index(channel)]]

    def _bitmap(self, use: dict[str, Any], values: NDArray[np.float32]) -> Any:
        a, b, c, d, e, f = use.get("uv", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
        key = repr((sorted(use.items()), float(values.mean()), values.shape))
        if key not in self._textures:
            texture = self.recorded.textures[use["texture"]]
            wrap = {"repeat": "repeat", "mirror": "mirror"}.get(texture.get("wrap_s", ""), "clamp")
            # Mitsuba's v points down: w = 1 - v.
            to_uv = np.array([[a, -b, b + c], [-d, e, 1.0 - e - f], [0.0, 0.0, 1.0]])
            self._textures[key] = self.mi.load_dict(
                {
                    "type": "bitmap",
                    "bitmap": self.mi.Bitmap(np.ascontiguousarray(values, np.float32)),
                    "raw": True,
                    "wrap_mode": wrap,
                    "to_uv": self.mi.ScalarTransform3f(to_uv),
                }
            )
        return self._textures[key]


def see_through(m: dict[str, Any]) -> bool:
    """Whether a UsdPreviewSurface transmits light without refraction.

    Raises:
        NotImplementedError: The opacity has a texture or cuts out the surface.
    """
    if m["program"] != "principled":
        return False
    is_textured = m.get("textures", {}).get("opacity") is not None
    is_below_one = float(m.get("opacity", 1.0)) < 1.0
    if is_textured or (is_below_one and m.get("presence")):
        raise NotImplementedError("opacity by a texture or as presence")
    return is_below_one


def _linear(texture: dict[str, Any]) -> NDArray[np.float32]:
    """Return the texels of a recorded texture as linear float32."""
    pixels = texture["pixels"]
    if pixels.dtype != np.uint8:
        return np.asarray(pixels, np.float32)
    values = pixels.astype(np.float32) / 255.0
    if not texture["srgb"]:
        return values
    low = values[:, :, :3] <= 0.04045
    curve = np.where(low, values[:, :, :3] / 12.92, ((values[:, :, :3] + 0.055) / 1.055) ** 2.4)
    values[:, :, :3] = curve
    return values


def _rows_to_poles(image: NDArray[Any]) -> NDArray[np.float32]:
    """Resample a latlong image to Mitsuba's convention, with the first and last rows at the poles.

    In Wavecomb and OpenEXR the first and last rows are centred half a row away from the poles.
    """
    height = len(image)
    at = np.arange(height) * (height / (height - 1)) - 0.5
    low = np.clip(np.floor(at).astype(int), 0, height - 1)
    high = np.minimum(low + 1, height - 1)
    part = np.clip(at - low, 0.0, 1.0)[:, None, None]
    return (image[low] * (1.0 - part) + image[high] * part).astype(np.float32)
