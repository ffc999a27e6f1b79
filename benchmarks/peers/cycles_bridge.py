# SPDX-License-Identifier: Apache-2.0
"""Convert a recorded scene to Cycles: same arrays, lights and camera, closest materials.

This module needs the Python environment of benchmarks/peers/setup and a separate process.

Rect and disk lights become area lights (one-sided, invisible to rays), spheres become point lights
with a radius, distant lights become suns, and the dome becomes the world. Emissive meshes emit to
both sides, as in Wavecomb. Instances of one mesh and material share their data; Cycles copies a
mesh for each material. Metal uses the F82-tint model with multiple scattering, as in Wavecomb. The
programs `dielectric`, `plastic` and `principled` become Cycles' Principled BSDF, whose layers are
the closest equivalent.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from cycles_nodes import Images, Nodes, image, make_material
from cycles_volumes import make_volume
from mathutils import Matrix as BlenderMatrix
from numpy.typing import NDArray
from recorded import INHERIT, Curves, Mesh, Recorded

Matrix = NDArray[np.float64]

_DOME = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from a dome light's frame (pole +Y, centre +Z) to that of Cycles (pole +Z, centre
+X)."""


@dataclass(frozen=True)
class CyclesSettings:
    """Render settings of Cycles.

    Attributes:
        width: Pixels.
        height: Pixels.
        max_depth: Scattering vertices, as Wavecomb counts them.
        threads: Threads of the render.
        light_tree: Select lights by a tree instead of uniformly.
        shadow_caustics: Find light through glass by manifold walks (MNEE).
        pattern: Cycles' sampler: TABULATED_SOBOL, BLUE_NOISE, SOBOL_BURLEY.
    """

    width: int
    height: int
    max_depth: int
    threads: int
    light_tree: bool = True
    shadow_caustics: bool = False
    pattern: str = "TABULATED_SOBOL"


class CyclesScene:
    """A recorded scene in Cycles. Only one scene can exist, since Blender has one database."""

    def __init__(self, recorded: Recorded, settings: CyclesSettings, folder: Path) -> None:
        """``folder`` contains the volume files."""
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.recorded = recorded
        self._shadow_caustics = settings.shadow_caustics
        self.scene = bpy.context.scene
        self._images = Images(recorded)
        self._materials: dict[int, Any] = {}
        self._set(settings)
        self._world()
        for light in recorded.lights:
            if light["kind"] != "dome":
                self._lamp(light)
        self._geometry()
        for volume in recorded.volumes:
            self._object("volume", make_volume(volume, folder, self._images), volume["to_world"])
        self._camera(settings)

    def render(self, spp: int, seed: int = 0) -> NDArray[np.float32]:
        """(height, width, 3), linear."""
        self._start(spp, seed)
        with tempfile.TemporaryDirectory() as folder:
            file = str(Path(folder) / "picture.exr")
            bpy.data.images["Render Result"].save_render(file, scene=self.scene)
            read = bpy.data.images.load(file)
            width, height = read.size
            pixels = np.empty(width * height * 4, np.float32)
            read.pixels.foreach_get(pixels)
            bpy.data.images.remove(read)
        return pixels.reshape(height, width, 4)[::-1, :, :3].copy()

    def _start(self, spp: int, seed: int) -> None:
        # With persistent data, Cycles updates scene settings only when the frame changes.
        self.scene.cycles.samples = spp
        self.scene.cycles.seed = seed
        self.scene.update_tag()
        self.scene.frame_set(self.scene.frame_current + 1)
        bpy.ops.render.render(write_still=False)

    # ---- settings --------------------------------------------------------------------------------

    def _set(self, settings: CyclesSettings) -> None:
        scene, cycles, render = self.scene, self.scene.cycles, self.scene.render
        render.engine = "CYCLES"
        render.resolution_x, render.resolution_y = settings.width, settings.height
        render.resolution_percentage = 100
        render.threads_mode, render.threads = "FIXED", settings.threads
        render.use_persistent_data = True
        render.use_compositing = render.use_sequencer = False
        render.dither_intensity = 0.0
        render.film_transparent = False
        render.image_settings.file_format = "OPEN_EXR"
        render.image_settings.color_mode = "RGB"
        render.image_settings.color_depth = "32"
        render.image_settings.exr_codec = "NONE"
        scene.view_settings.view_transform = "Raw"
        scene.view_settings.look = "None"
        cycles.device = "CPU"
        scene.cycles_curves.shape = "THICK"
        cycles.use_denoising = False
        cycles.use_adaptive_sampling = False
        cycles.use_guiding = False
        cycles.use_fast_gi = False
        cycles.use_auto_tile = False
        cycles.use_light_tree = settings.light_tree
        cycles.sampling_pattern = settings.pattern
        cycles.light_sampling_threshold = 0.0
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.caustics_reflective = cycles.caustics_refractive = True
        cycles.blur_glossy = 0.0
        cycles.pixel_filter_type = "BOX"
        # Wavecomb's limit of n scattering vertices corresponds to n - 1 bounces in Cycles.
        bounces = settings.max_depth - 1
        cycles.max_bounces = bounces
        cycles.diffuse_bounces = cycles.glossy_bounces = bounces
        cycles.volume_bounces = bounces
        cycles.volume_biased = False
        cycles.transmission_bounces = cycles.transparent_max_bounces = bounces
        cycles.min_light_bounces = cycles.min_transparent_bounces = 0

    def _camera(self, settings: CyclesSettings) -> None:
        camera = self.recorded.camera
        x0, x1, y0, y1 = camera["window"]
        if abs(x0 + x1) > 1e-6 or abs(y0 + y1) > 1e-6:
            raise NotImplementedError("a camera with an aperture offset")
        half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        half_x = max(half_x, half_y * settings.width / settings.height)
        data = bpy.data.cameras.new("camera")
        data.sensor_fit = "HORIZONTAL"
        data.sensor_width = 2.0 * half_x * data.lens
        data.clip_start = max(camera.get("near_clip", 0.0), 1e-6)
        data.clip_end = min(camera.get("far_clip", 1e30), 1e7)
        if camera.get("lens_radius", 0.0) > 0.0:
            data.dof.use_dof = True
            data.dof.focus_distance = camera["focus_distance"]
            # Compute the f-number from the lens radius; Blender's focal length is in mm, the lens
            # radius in metres.
            data.dof.aperture_fstop = data.lens * 1e-3 / (2.0 * camera["lens_radius"])
        self.scene.camera = self._object("camera", data, camera["transform"])

    # ---- lights ----------------------------------------------------------------------------------

    def _world(self) -> None:
        world = bpy.data.worlds.new("world")
        self.scene.world = world
        world.use_nodes = True
        nodes = Nodes(world.node_tree, self._images)
        domes = [light for light in self.recorded.lights if light["kind"] == "dome"]
        if len(domes) > 1:
            raise NotImplementedError("more than one dome light")
        colour: Any = (0.0, 0.0, 0.0)
        if domes:
            colour = domes[0].get("color", (1.0, 1.0, 1.0))
            if domes[0].get("texture") is not None:
                colour = self._sky(nodes, domes[0])
        background = nodes.add("ShaderNodeBackground", Color=colour, Strength=1.0)
        nodes.out("ShaderNodeOutputWorld", background.outputs[0])

    def _sky(self, nodes: Nodes, dome: dict[str, Any]) -> Any:
        texture = self.recorded.textures[dome["texture"]]
        if texture["pixels"].dtype == np.uint8:
            raise NotImplementedError("an 8-bit dome image")
        colour = np.asarray(dome.get("color", (1.0, 1.0, 1.0)), np.float32)
        pixels = texture["pixels"][:, :, :3].astype(np.float32) * colour
        frame = dome["transform"][:3, :3]
        frame = frame / np.linalg.norm(frame, axis=1)[:, None]
        direction = nodes.add("ShaderNodeTexCoord").outputs["Generated"]
        # The rows of `frame` are the axes of the dome light, so this matrix maps world directions
        # to dome directions.
        turned = nodes.add("ShaderNodeMapping", Vector=direction)
        turn = BlenderMatrix((_DOME @ frame).tolist())
        turned.inputs["Rotation"].default_value = turn.to_euler("XYZ")
        node = nodes.add("ShaderNodeTexEnvironment", Vector=turned.outputs[0])
        node.image = image(pixels, "Non-Color", small=False)
        node.interpolation = "Linear"
        return node.outputs["Color"]

    def _lamp(self, light: dict[str, Any]) -> None:
        kind, rows = light["kind"], light["transform"]
        if light.get("texture") is not None:
            raise NotImplementedError("textured area lights")
        radiance = np.asarray(light.get("color", (1, 1, 1)), np.float64)
        size = np.linalg.norm(rows[:2, :3], axis=1)
        kinds = {"rect": "AREA", "disk": "AREA", "sphere": "POINT", "distant": "SUN"}
        data = bpy.data.lights.new(kind, kinds[kind])
        data.color = (1.0, 1.0, 1.0)
        if kind in ("rect", "disk"):
            if kind == "rect":
                data.shape = "RECTANGLE"
                data.size, data.size_y = light["width"], light["height"]
                area = light["width"] * light["height"] * size[0] * size[1]
            else:
                data.shape = "DISK"
                data.size = 2.0 * light["radius"]
                area = np.pi * light["radius"] ** 2 * size[0] * size[1]
            # The power of a one-sided Lambertian emitter of area A and radiance L is pi A L.
            power = np.pi * radiance * (1.0 if light.get("normalize") else area)
        elif kind == "sphere":
            radius = light["radius"] * abs(np.linalg.det(rows[:3, :3])) ** (1 / 3)
            data.shadow_soft_size = radius
            area = 4.0 * np.pi * radius**2
            # The colour of a point light is its radiant intensity I, so its power is 4 pi I. A
            # sphere light of area A and radiance L has the power pi A L.
            scale = (
                4.0 * np.pi if radius == 0 else np.pi * (1.0 if light.get("normalize") else area)
            )
            power = scale * radiance
        else:
            data.angle = np.radians(light.get("angle", 0.53))
            solid = np.pi * np.sin(data.angle / 2.0) ** 2
            power = radiance * (1.0 if light.get("normalize") or solid == 0.0 else solid)
        data.cycles.is_caustics_light = self._shadow_caustics
        data.energy = float(max(power))
        data.color = tuple(float(v) for v in power / max(float(max(power)), 1e-30))
        self._object(kind, data, rows).visible_camera = True

    # ---- geometry --------------------------------------------------------------------------------

    def _geometry(self) -> None:
        made: dict[tuple[int, int], Any] = {}
        shapes: dict[int, Any] = {}
        for placed in self.recorded.placed():
            key = (placed.mesh, placed.material)
            mesh = self.recorded.meshes[placed.mesh]
            if key not in made and placed.mesh in shapes and mesh.face_materials is None:
                # Copies share their arrays, so Cycles stores the triangles once.
                made[key] = shapes[placed.mesh].copy()
                made[key].materials[0] = self._material(placed.material)
            elif key not in made:
                made[key] = shapes[placed.mesh] = self._mesh(mesh, placed.material)
            thing = self._object("object", made[key], placed.transform)
            if self._shadow_caustics:
                is_glass = self.recorded.materials[placed.material].get("program") == "dielectric"
                thing.cycles.is_caustics_caster = is_glass
                thing.cycles.is_caustics_receiver = not is_glass

    def _object(self, name: str, data: Any, rows: Matrix) -> Any:
        made = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(made)
        made.matrix_world = BlenderMatrix(np.asarray(rows, float).T.tolist())
        return made

    def _mesh(self, mesh: Mesh, inherited: int) -> Any:
        if mesh.curves is not None:
            return self._curves(mesh, mesh.curves, inherited)
        made = bpy.data.meshes.new(mesh.name or "mesh")
        count, corners = len(mesh.indices), mesh.indices.reshape(-1)
        made.vertices.add(len(mesh.positions))
        made.vertices.foreach_set("co", np.ascontiguousarray(mesh.positions, np.float32).ravel())
        made.loops.add(3 * count)
        made.loops.foreach_set("vertex_index", corners.astype(np.int32))
        made.polygons.add(count)
        made.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
        chosen = np.full(count, inherited) if mesh.face_materials is None else mesh.face_materials
        chosen = np.where(chosen == INHERIT, inherited, chosen)
        used, slots = np.unique(chosen, return_inverse=True)
        for number in used:
            made.materials.append(self._material(int(number)))
        if len(used) > 1:
            made.polygons.foreach_set("material_index", slots.astype(np.int32))
        if mesh.uvs is not None:
            uvs = mesh.uvs.reshape(-1, 2) if mesh.uvs.ndim == 3 else mesh.uvs[corners]
            layer = made.uv_layers.new(name="uv", do_init=False)
            layer.uv.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())
        made.update(calc_edges=False)
        if mesh.normals is None:
            made.shade_flat()
        else:
            made.shade_smooth()
            place = "CORNER" if mesh.normals.ndim == 3 else "POINT"
            own = made.attributes.new("custom_normal", "FLOAT_VECTOR", place)
            own.data.foreach_set("vector", np.ascontiguousarray(mesh.normals, np.float32).ravel())
        return made

    def _curves(self, mesh: Mesh, curves: Curves, inherited: int) -> Any:
        points, counts = curves.strands()
        made = bpy.data.hair_curves.new(mesh.name or "curves")
        made.add_curves(counts.tolist())
        made.set_types(type="CATMULL_ROM" if curves.kind.startswith("cubic") else "POLY")
        made.points.foreach_set("position", np.ascontiguousarray(mesh.positions[points]).ravel())
        made.points.foreach_set("radius", np.ascontiguousarray(curves.radii[points]))
        made.materials.append(self._material(inherited))
        return made

    def _material(self, number: int) -> Any:
        if number == INHERIT:
            return None
        if number not in self._materials:
            self._materials[number] = make_material(self.recorded, number, self._images)
        return self._materials[number]
