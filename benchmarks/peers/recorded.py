# SPDX-License-Identifier: Apache-2.0
"""Scene contents as plain arrays, for exchange between the processes of renderers.

Needs only NumPy, so that it loads in Blender's environment.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

INHERIT = 0xFFFFFFFF
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """Arguments of ``SceneBuilder.add_curves``, except those that are fields of ``Mesh``."""

    kind: str
    segments: NDArray[np.uint32]
    radii: NDArray[np.float32]

    def strands(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the indices of the points on all curves, and the number of points per curve."""
        ahead = 3 if self.kind.startswith("cubic") else 1
        first = (self.segments & 0x3FFFFFFF).astype(np.int64)
        ends = (self.segments & (1 << 30)) == 0
        count = np.diff(np.flatnonzero(np.concatenate([[True], ends])))
        rows = np.stack([first, np.where(ends, first + ahead, -1)], axis=1).ravel()
        return rows[rows >= 0], count + 1


@dataclass(frozen=True)
class Mesh:
    """Arguments of ``SceneBuilder.add_mesh``; curves set ``curves`` and have no triangles."""

    positions: NDArray[np.float32]
    indices: NDArray[np.uint32]
    normals: NDArray[np.float32] | None
    uvs: NDArray[np.float32] | None
    face_materials: NDArray[np.uint32] | None
    material: int
    name: str
    curves: Curves | None = None


@dataclass(frozen=True)
class Placed:
    """Instance of a mesh. The transform is for row vectors; `material` includes inheritance."""

    mesh: int
    transform: Matrix
    material: int


@dataclass
class Group:
    """A group of meshes and of instances of other groups, which is instanced as a whole."""

    meshes: list[int] = field(default_factory=list)
    children: list[tuple[int, Matrix, NDArray[np.uint32] | None]] = field(default_factory=list)


@dataclass
class Recorded:
    """Arguments of all calls to a ``SceneBuilder``. ``bounds`` (2, 3) are in world space."""

    textures: list[dict[str, Any]] = field(default_factory=list)
    materials: list[dict[str, Any]] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    groups: list[Group] = field(default_factory=lambda: [Group()])
    lights: list[dict[str, Any]] = field(default_factory=list)
    volumes: list[dict[str, Any]] = field(default_factory=list)
    camera: dict[str, Any] = field(default_factory=dict)
    bounds: Matrix = field(default_factory=lambda: np.zeros((2, 3)))

    def placed(self) -> list[Placed]:
        """Return an instance for each visible copy of a mesh; nested groups are expanded."""

        def expand(group: int, matrix: Matrix, inherited: int) -> Iterator[Placed]:
            for number in self.groups[group].meshes:
                own = self.meshes[number].material
                yield Placed(number, matrix, inherited if own == INHERIT else own)
            for child, transforms, materials in self.groups[group].children:
                for k, transform in enumerate(transforms):
                    chosen = INHERIT if materials is None else int(materials[k])
                    passed = inherited if chosen == INHERIT else chosen
                    yield from expand(child, np.asarray(transform, np.float64) @ matrix, passed)

        return list(expand(0, np.eye(4), INHERIT))

    def save(self, folder: Path) -> None:
        """Write scene.json and one .npy per array; an existing folder is reused."""
        folder.mkdir(parents=True, exist_ok=True)
        count = 0

        def plain(value: Any) -> Any:
            nonlocal count
            if isinstance(value, np.ndarray):
                name = f"{count:05d}.npy"
                np.save(folder / name, value)
                count += 1
                return {"array": name}
            if isinstance(value, np.generic):
                return value.item()
            if isinstance(value, dict):
                return {k: plain(v) for k, v in value.items()}
            if isinstance(value, (list, tuple)):
                return [plain(v) for v in value]
            return value

        names = ("textures", "materials", "lights", "volumes", "camera", "bounds")
        scene = {name: plain(getattr(self, name)) for name in names}
        scene["meshes"] = [
            plain({**vars(mesh), "curves": vars(mesh.curves) if mesh.curves else None})
            for mesh in self.meshes
        ]
        scene["groups"] = [plain(asdict(group)) for group in self.groups]
        # Write scene.json last, so that a folder with scene.json is complete.
        (folder / "scene.json").write_text(json.dumps(scene))


def dense(grid: dict[str, Any]) -> tuple[NDArray[np.float32], Matrix]:
    """Return all voxels of a recorded grid, with a border of background voxels.

    The array is indexed by x, y and z. Also returns the transform (for row vectors) from the unit
    cube, which the voxels divide into equal cells, to object space.
    """
    origins, values = grid["origins"], grid["values"]
    edge = values.shape[1]
    first = origins.min(axis=0) - 1
    counts = origins.max(axis=0) + edge + 1 - first
    made = np.full((*counts, *values.shape[4:]), grid["background"], np.float32)
    for (x, y, z), brick in zip(origins - first, values, strict=True):
        made[x : x + edge, y : y + edge, z : z + edge] = brick
    cells = np.diag([*counts.astype(float), 1.0])
    cells[3, :3] = first - 0.5
    return made, cells @ grid["index_to_object"]


def load(folder: Path) -> Recorded:
    """Read a folder that ``Recorded.save`` wrote."""

    def rich(value: Any) -> Any:
        if isinstance(value, dict):
            if set(value) == {"array"}:
                return np.load(folder / value["array"])
            return {k: rich(v) for k, v in value.items()}
        return [rich(v) for v in value] if isinstance(value, list) else value

    scene = rich(json.loads((folder / "scene.json").read_text()))
    meshes = [Mesh(**mesh) for mesh in scene.pop("meshes")]
    for k, mesh in enumerate(meshes):
        if mesh.curves is not None:
            meshes[k] = replace(mesh, curves=Curves(**mesh.curves))  # type: ignore[arg-type]
    groups = [
        Group(g["meshes"], [(c, t, m) for c, t, m in g["children"]]) for g in scene.pop("groups")
    ]
    return Recorded(meshes=meshes, groups=groups, **scene)
