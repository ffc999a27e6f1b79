# SPDX-License-Identifier: Apache-2.0
"""A scene builder that records its arguments while it builds the native scene.

Other renderers read the recording, so that they use exactly Wavecomb's arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recorded import INHERIT, Curves, Group, Mesh, Recorded

from wavecomb import _core
from wavecomb.usd import load_stage


@dataclass(frozen=True)
class _Grid:
    """A native voxel grid and the arrays that it was made from."""

    native: _core.VolumeGrid
    arrays: dict[str, Any]


class RecordingBuilder(Recorded):
    """Records a scene in place of ``_core.SceneBuilder``. After ``build``, ``scene`` is native.

    The native builder is ``native``; direct calls of its functions are not recorded.
    """

    def __init__(self) -> None:
        super().__init__()
        self.native = _core.SceneBuilder()
        self.scene: _core.Scene | None = None

    def add_texture(self, pixels: NDArray[Any], **options: Any) -> int:
        """Record a texture."""
        self.textures.append({"pixels": pixels, **options})
        return self.native.add_texture(pixels, **options)

    def add_material(self, program: str, **parameters: Any) -> int:
        """Record a material."""
        self.materials.append({"program": program, **parameters})
        return self.native.add_material(program, **parameters)

    def add_graph(self, *arrays: Any) -> int:
        """Add a value graph to the native scene only; other renderers use constants."""
        return self.native.add_graph(*arrays)

    def add_mesh(
        self,
        positions: NDArray[np.float32],
        indices: NDArray[np.uint32],
        *,
        normals: NDArray[np.float32] | None = None,
        uvs: NDArray[np.float32] | None = None,
        face_materials: NDArray[np.uint32] | None = None,
        material: int = INHERIT,
        name: str = "",
        **labels: Any,
    ) -> int:
        """Record a mesh, and add it to the native scene, with labels for AOVs."""
        number = self.native.add_mesh(
            positions,
            indices,
            normals=normals,
            uvs=uvs,
            face_materials=face_materials,
            material=material,
            name=name,
            **labels,
        )
        self.meshes.append(Mesh(positions, indices, normals, uvs, face_materials, material, name))
        return number

    def add_meshes(
        self,
        positions: NDArray[np.float32],
        indices: NDArray[np.uint32],
        point_counts: NDArray[np.uint32],
        triangle_counts: NDArray[np.uint32],
        materials: NDArray[np.uint32],
        *labels: Any,
    ) -> int:
        """Record a batch of meshes; ``labels`` are asset lengths, groups and names."""
        first = len(self.meshes)
        own = np.split(positions, np.cumsum(point_counts)[:-1])
        faces = np.split(indices, np.cumsum(triangle_counts)[:-1])
        rows = zip(own, faces, materials, *labels, strict=True)
        for points, triangles, material, length, group, name in rows:
            number = self.add_mesh(
                points, triangles, material=int(material), name=name, asset_length=int(length)
            )
            self.add_to_group(int(group), number)
        return first

    def add_curves(
        self,
        kind: str,
        positions: NDArray[np.float32],
        segments: NDArray[np.uint32],
        radii: NDArray[np.float32],
        **options: Any,
    ) -> int:
        """Record curves as a mesh without triangles; normals of ribbons are ignored."""
        number = self.native.add_curves(kind, positions, segments, radii, **options)
        none = np.zeros((0, 3), np.uint32)
        inherited, name = options.get("material", INHERIT), options.get("name", "")
        curves = Curves(kind, segments, radii)
        self.meshes.append(Mesh(positions, none, None, None, None, inherited, name, curves))
        return number

    def make_surfaces(self, descriptions: list[dict[str, Any]], threads: int = 0) -> list[Any]:
        """Refine subdivision surfaces; return arrays for ``add_mesh``, and record nothing."""
        return self.native.make_surfaces(descriptions, threads)

    def replace_mesh(self, mesh: int, *arrays: Any, **options: Any) -> None:
        """Replace the arrays of a recorded mesh."""
        self.native.replace_mesh(mesh, *arrays, **options)
        old = self.meshes[mesh]
        names = ("normals", "uvs", "face_materials")
        given = [options.get(name) for name in names]
        self.meshes[mesh] = Mesh(
            *arrays[:2], *given, options.get("material", old.material), old.name
        )

    def add_group(self, name: str = "", root: str = "") -> int:
        """Record an empty group."""
        self.groups.append(Group())
        return self.native.add_group(name, root)

    def add_to_group(self, group: int, mesh: int) -> None:
        """Record that a mesh belongs to a group."""
        self.groups[group].meshes.append(mesh)
        self.native.add_to_group(group, mesh)

    def add_instances(
        self,
        parent: int,
        child: int,
        transforms: NDArray[Any],
        materials: NDArray[np.uint32] | None = None,
        **labels: Any,
    ) -> None:
        """Record instances of group `child`; only the native scene receives their names."""
        self.groups[parent].children.append((child, np.asarray(transforms), materials))
        self.native.add_instances(parent, child, transforms, materials, **labels)

    def add_light(self, kind: str, transform: NDArray[Any], **options: Any) -> int:
        """Record a light."""
        self.lights.append(
            {"kind": kind, "transform": np.asarray(transform, np.float64), **options}
        )
        return self.native.add_light(kind, transform, **options)

    def add_mesh_light(self, transform: NDArray[Any], material_sync: str, **options: Any) -> int:
        """Add a mesh light to the native scene only; other renderers use the mesh's material."""
        return self.native.add_mesh_light(transform, material_sync, **options)

    def make_volume_grid(
        self,
        origins: NDArray[np.int32],
        values: NDArray[Any],
        index_to_object: NDArray[np.float64],
        background: float = 0.0,
        name: str = "",
        is_signed: bool = False,
    ) -> _Grid:
        """Make a voxel grid. The grid is recorded when ``add_volume`` uses it."""
        native = _core.VolumeGrid(origins, values, index_to_object, background, name, is_signed)
        arrays = {"origins": origins, "values": values, "background": background,
                  "index_to_object": np.asarray(index_to_object, np.float64)}  # fmt: skip
        return _Grid(native, arrays)

    def add_volume(self, to_world: NDArray[Any], **options: Any) -> int:
        """Record a volume."""
        kept = {k: v.arrays if isinstance(v, _Grid) else v for k, v in options.items()}
        self.volumes.append({"to_world": np.asarray(to_world, np.float64), **kept})
        given = {k: v.native if isinstance(v, _Grid) else v for k, v in options.items()}
        return self.native.add_volume(to_world, **given)

    def set_camera(self, transform: NDArray[Any], **options: Any) -> None:
        """Record the camera."""
        self.camera = {"transform": np.asarray(transform, np.float64), **options}
        self.native.set_camera(transform, **options)

    def build(self) -> RecordingBuilder:
        """Build the native scene, but return this recording."""
        self.scene = self.native.build()
        self.bounds = np.array(self.scene.bounds, np.float64).reshape(2, 3)
        return self


def record(stage: Path) -> RecordingBuilder:
    """Load a USD stage and return the recorded scene."""
    factory: Any = RecordingBuilder
    recorded: Any = load_stage(stage, builder_factory=factory).scene
    return recorded


def write_volumes(recorded: Recorded, folder: Path) -> None:
    """Write volume densities as .vdb files for Cycles, and store their names in the recording."""
    from wavecomb import vdb

    folder.mkdir(parents=True, exist_ok=True)
    for number, volume in enumerate(recorded.volumes):
        grid = volume.get("density")
        if grid is not None:
            volume["file"] = f"volume{number}.vdb"
            vdb.write(folder / volume["file"], [
                {"name": "density", **{k: v for k, v in grid.items() if k != "background"}}
            ])  # fmt: skip
