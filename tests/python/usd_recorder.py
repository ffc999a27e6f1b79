# SPDX-License-Identifier: Apache-2.0
"""A scene builder that records calls and checks the preconditions of the native scene builder."""

from pathlib import Path

import numpy as np

from wavecomb import _core
from wavecomb.usd import LoadedStage, load_stage
from wavecomb.usd.graphs.values import Graph

INHERIT = 0xFFFFFFFF


class Recorder:
    """Replaces ``_core.SceneBuilder``."""

    def __init__(self):
        self.textures, self.materials, self.meshes, self.lights = [], [], [], []
        self.filters, self.profiles, self.sets = [], [], []
        self.mesh_lights, self.graphs = [], []
        self.groups = [{"name": "world", "meshes": [], "children": []}]
        self.camera = None
        self.grids, self.volumes = [], []
        self.visibility = []  # (path, rays)
        self.motions = []

    def add_texture(self, pixels, *, srgb, wrap_s="repeat", wrap_t="repeat", name=""):
        assert pixels.ndim == 3 and 1 <= pixels.shape[2] <= 4 and pixels.flags.c_contiguous
        assert pixels.dtype in (np.uint8, np.float16, np.float32)
        self.textures.append({"pixels": pixels, "srgb": srgb, "wrap": (wrap_s, wrap_t)})
        return len(self.textures) - 1

    def add_tiles(self, name, tiles, missing):
        assert tiles and all(1001 <= n <= 1100 and t < len(self.textures) for n, t in tiles)
        self.textures.append({"tiles": dict(tiles), "missing": missing, "name": name})
        return len(self.textures) - 1

    def add_graph(self, ops, constants, images, outputs, attributes=()):
        assert len(ops) % 16 == 0 and outputs
        names = tuple((name, 0) for name in attributes)
        self.graphs.append(Graph(ops, tuple(constants), tuple(images), tuple(outputs), names))
        return len(self.graphs) - 1

    def add_material(self, program, *, name="", textures=None, **parameters):
        self.materials.append(
            {"program": program, "name": name, "textures": textures or {}, **parameters}
        )
        return len(self.materials) - 1

    def add_mesh(
        self,
        positions,
        indices,
        *,
        normals=None,
        uvs=None,
        face_materials=None,
        material=INHERIT,
        attributes=(),
        name="",
        light_group="",
        asset_length=0,
        mesh_light=None,
    ):
        steps = positions.shape[:-2]
        n, m = positions.shape[-2], len(indices)
        assert positions.dtype == np.float32 and positions.shape == (*steps, n, 3)
        assert indices.dtype == np.uint32 and indices.shape == (m, 3)
        assert positions.flags.c_contiguous and indices.flags.c_contiguous
        assert m > 0 and indices.max() < n and np.isfinite(positions).all()
        for array, width, at in ((normals, 3, steps), (uvs, 2, ())):
            if array is not None:
                assert array.dtype == np.float32 and array.flags.c_contiguous
                assert array.shape in ((*at, n, width), (*at, m, 3, width))
                assert np.isfinite(array).all()
        if face_materials is not None:
            assert face_materials.shape == (m,) and face_materials.dtype == np.uint32
            assert face_materials.max() < len(self.materials) or face_materials.max() == INHERIT
        assert material == INHERIT or material < len(self.materials)
        assert mesh_light is None or mesh_light < len(self.mesh_lights)
        counts = {"constant": 1, "primitive": m, "vertex": n, "corner": 3 * m}
        for rate, values in dict(attributes).values():
            assert values.dtype == np.float32 and values.flags.c_contiguous
            assert len(values) == counts[rate] and 1 <= values.shape[1] <= 4
            assert np.isfinite(values).all()
        self.meshes.append(
            {
                "positions": positions,
                "indices": indices,
                "normals": normals,
                "uvs": uvs,
                "face_materials": face_materials,
                "material": material,
                "attributes": dict(attributes),
                "name": name,
                "light_group": light_group,
                "asset": name[:asset_length],
                "mesh_light": mesh_light,
            }
        )
        return len(self.meshes) - 1

    def add_meshes(
        self, positions, indices, points, triangles, materials, asset_lengths, groups, names
    ):
        first = len(self.meshes)
        ends = np.cumsum(points)[:-1], np.cumsum(triangles)[:-1]
        arrays = zip(np.split(positions, ends[0]), np.split(indices, ends[1]), strict=True)
        for (own, faces), material, length, group, name in zip(
            arrays, materials, asset_lengths, groups, names, strict=True
        ):
            number = self.add_mesh(
                own, faces, material=int(material), name=name, asset_length=int(length)
            )
            self.add_to_group(int(group), number)
        return first

    def replace_mesh(self, mesh, positions, indices, *, material=INHERIT, **arrays):
        names = ("name", "light_group", "asset", "mesh_light")
        kept = {key: self.meshes[mesh][key] for key in names}
        number = self.add_mesh(positions, indices, material=material, **arrays)
        self.meshes[mesh] = {**self.meshes.pop(number), **kept}

    def make_surfaces(self, descriptions, threads=0):
        builder = _core.SceneBuilder(1)
        for texture in self.textures:
            builder.add_texture(
                texture["pixels"], srgb=texture["srgb"],
                wrap_s=texture["wrap"][0], wrap_t=texture["wrap"][1],
            )  # fmt: skip
        return builder.make_surfaces(descriptions, threads)

    def add_curves(self, kind, positions, segments, radii, *, normals=None, **options):
        assert segments.dtype == np.uint32 and segments.ndim == 1 and len(segments) > 0
        first = segments & 0x3FFFFFFF
        points = 4 if kind.startswith("cubic") else 2
        before = (segments >> 31).astype(np.int64)
        after = (segments >> 30 & 1).astype(np.int64)
        assert (first >= before).all() and (first + points + after <= len(radii)).all()
        assert (normals is not None) == kind.endswith("ribbon")
        assert normals is None or normals.shape == positions.shape
        return self._add_curved(
            len(segments), (2, 2), positions, radii, options, kind=kind, segments=segments,
            normals=normals,
        )  # fmt: skip

    def add_points(self, positions, radii, **options):
        return self._add_curved(len(radii), (2,), positions, radii, options, kind="sphere")

    def add_splats(self, positions, scales, orientations, opacities, harmonics, **options):
        n = len(positions)
        assert positions.shape == scales.shape == (n, 3) and orientations.shape == (n, 4)
        assert opacities.shape == (n,) and harmonics.shape[::2] == (n, 3)
        assert harmonics.shape[1] in (1, 4, 9, 16)
        arrays = positions, scales, orientations, opacities, harmonics
        assert all(a.dtype == np.float32 and a.flags.c_contiguous for a in arrays)
        self.meshes.append(
            {
                "kind": "splat", "positions": positions, "scales": scales,
                "orientations": orientations, "opacities": opacities, "harmonics": harmonics,
                **options,
            }
        )  # fmt: skip
        return len(self.meshes) - 1

    def _add_curved(self, count, uv_shape, positions, radii, options, **what):
        assert positions.dtype == radii.dtype == np.float32 and positions.flags.c_contiguous
        assert positions.shape[-2:] == (len(radii), 3) and radii.shape == (len(radii),)
        assert np.isfinite(positions).all() and (radii >= 0).all() and np.isfinite(radii).all()
        uvs, faces = options["uvs"], options["face_materials"]
        assert uvs is None or (uvs.dtype == np.float32 and uvs.shape == (count, *uv_shape))
        assert faces is None or (faces.dtype == np.uint32 and faces.shape == (count,))
        self.meshes.append({"positions": positions, "radii": radii, **what, **options})
        return len(self.meshes) - 1

    def add_group(self, name="", root=""):
        self.groups.append({"name": name, "meshes": [], "children": []})
        return len(self.groups) - 1

    def add_to_group(self, group, mesh):
        self.groups[group]["meshes"].append(mesh)

    def add_instances(
        self, parent, child, transforms, materials=None, *, names, numbers=None, asset_lengths,
        motion=None,
    ):  # fmt: skip
        assert len(names) == len(asset_lengths) and len(names) in (1, len(transforms))
        assert all(length <= len(name) for name, length in zip(names, asset_lengths, strict=True))
        assert numbers is None or (numbers.dtype == np.uint32 and len(numbers) == len(transforms))
        assert transforms.dtype == np.float64 and transforms.shape == (len(transforms), 4, 4)
        assert materials.dtype == np.uint32 and materials.shape == (len(transforms),)
        assert np.isfinite(transforms).all() and child != 0
        assert motion is None or motion.shape == (len(transforms), motion.shape[1], 4, 4)
        self.groups[parent]["children"].append((child, transforms, materials))
        if motion is not None:
            self.motions.append((self.groups[child]["name"], motion))

    def add_light(self, kind, transform, **options):
        assert np.shape(transform) == (4, 4)
        self.lights.append({"kind": kind, "transform": np.asarray(transform), **options})
        return len(self.lights) - 1

    def make_volume_grid(self, origins, values, index_to_object, background=0.0, name="",
                         is_signed=False):  # fmt: skip
        assert origins.dtype == np.int32 and origins.shape == (len(values), 3)
        assert values.dtype in (np.float16, np.float32) and values.flags.c_contiguous
        assert values.shape[1:] in ((8, 8, 8), (8, 8, 8, 3)) and np.isfinite(values).all()
        assert (is_signed or (values >= 0).all()) and (origins % 8 == 0).all()
        assert len(np.unique(origins, axis=0)) == len(origins)
        assert index_to_object.shape == (4, 4) and background >= 0
        self.grids.append(
            {
                "origins": origins,
                "values": values,
                "matrix": index_to_object,
                "background": background,
                "signed": is_signed,
            }
        )
        return len(self.grids) - 1

    def add_volume(self, *, to_world, density=None, color=None, emission_grid=None, velocity=None,
                   bounds=None, **options):  # fmt: skip
        assert np.shape(to_world) == (4, 4) and (density is None) != (bounds is None)
        grids = [
            None if one is None else self.grids[one]
            for one in (density, color, emission_grid, velocity)
        ]
        self.volumes.append(
            {"to_world": to_world, "density": grids[0], "color": grids[1], "glow": grids[2],
             "velocity": grids[3], "bounds": bounds, **options}
        )  # fmt: skip
        return len(self.volumes) - 1

    def add_mesh_light(self, transform, material_sync, **options):
        assert np.shape(transform) == (4, 4)
        self.mesh_lights.append({"sync": material_sync, "transform": transform, **options})
        return len(self.mesh_lights) - 1

    def add_geometry_set(self, rules):
        self.sets.append(dict(rules))
        return len(self.sets) - 1

    def add_visibility(self, path, rays):
        self.visibility.append((path, rays))

    def add_ies(self, vertical, horizontal, candela):
        assert candela.shape == (len(horizontal), len(vertical)) and candela.dtype == np.float32
        self.profiles.append({"vertical": vertical, "horizontal": horizontal, "candela": candela})
        return len(self.profiles) - 1

    def add_light_filter(self, transform, distance, sides, *rest):
        assert transform.shape == (4, 4) and np.shape(sides) == (4, 3)
        self.filters.append((transform, distance, sides, *rest))
        return len(self.filters) - 1

    def set_camera(self, transform, **options):
        self.camera = {"transform": np.asarray(transform), **options}

    def build(self):
        return self

    # Queries for tests.

    def mesh(self, name):
        """Returns the mesh whose path ends with ``name``."""
        (found,) = [mesh for mesh in self.meshes if mesh["name"].endswith(name)]
        return found

    def material_of(self, name):
        """Returns the material of a mesh that has one material for all faces."""
        return self.materials[self.mesh(name)["material"]]

    def world_meshes(self):
        """Returns (mesh, transform, material id) for all visible meshes, once per instance."""

        def expand(group, matrix, inherited):
            for number in self.groups[group]["meshes"]:
                mesh = self.meshes[number]
                own = mesh["material"]
                yield mesh, matrix, inherited if own == INHERIT else own
            for child, transforms, materials in self.groups[group]["children"]:
                for transform, material in zip(transforms, materials, strict=True):
                    passed = inherited if material == INHERIT else int(material)
                    yield from expand(child, transform @ matrix, passed)

        return list(expand(0, np.eye(4), INHERIT))


def write(folder: Path, text: str, name: str = "stage.usda") -> Path:
    """Writes a stage with the given prims. Braces may be on one line with statements."""
    path = folder / name
    header = "" if text.startswith("#usda") else "#usda 1.0\n"
    path.write_text(header + text.replace("{", "{\n").replace("}", "\n}\n"))
    return path


def load(folder: Path, text: str, **options) -> tuple[Recorder, LoadedStage]:
    """Loads a stage with the given prims. Meshes stay as they are unless ``subdivision`` is
    given.
    """
    options.setdefault("subdivision", "off")
    loaded = load_stage(write(folder, text), builder_factory=Recorder, **options)
    return loaded.scene, loaded


def said(loaded: LoadedStage) -> str:
    """Returns all messages of the report."""
    return "\n".join(loaded.report.lines())


QUAD = """
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0,1,2,3]
    uniform token subdivisionScheme = "none"
"""
