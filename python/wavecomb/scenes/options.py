# SPDX-License-Identifier: Apache-2.0
"""Options of the generated stages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wavecomb.scenes.dragon import dragon
from wavecomb.scenes.errors import SceneError
from wavecomb.scenes.mesh import Mesh


@dataclass(frozen=True)
class SceneOptions:
    """What ``write_scene`` takes; a scene ignores what it has no use for.

    Attributes:
        dragon: OBJ, PLY or USD file to stand in for our dragon, or None.
        triangles: Triangles of our dragon; of all stones of ``spread`` and ``heavy`` together.
        teapot_level: Cells along each edge of the teapot's 32 patches; whatever is turned in
            ``room`` has four times as many around.
        seed: Of the layout and of the texture patterns.
        texture_size: Edge of the largest textures, texels; the others shrink in proportion.
        aspect: Width / height of the picture that the camera frames.
        material: Of the dragon in ``cornell-dragon``: gold, copper, glass or jade.
        materials: How many ``spread`` and ``heavy`` have.
        programs: How many kinds of material ``spread`` uses, 1 to 5.
        texture_mb: Memory of all textures of ``spread`` and ``heavy``, 1e6 bytes; 0 is none.
        shader_cost: Octaves of noise on the dearest material of ``spread``; on the others from 1,
            which is none, geometrically.
        lights: How many ``lights`` has.
        lamps: Whether ``mixed`` and ``dragon`` are lit by a key, a fill and a dim dome.
        strands: How many ``fur`` and ``head`` have.
        splats: How many ``splats`` has.
        capture: PLY file of 3D Gaussian splats that ``splats`` holds in place of all else, or None.
        capture_linear: Whether its colours are linear light; else they are in sRGB, as captures are
            mostly trained.
        voxels: Along the longest edge of the grids of ``smoke`` and ``clouds``, at least 16.
        plain: Whether materials are as other people's exporters write them: UsdPreviewSurface in
            the metallic workflow, no program named. ``heavy`` has no such form, nor has hair,
            ``spread`` none of
            a ``shader_cost`` above 1.
    """

    dragon: Path | str | None = None
    triangles: int = 250_000
    teapot_level: int = 24
    seed: int = 1
    texture_size: int = 2048
    aspect: float | None = None
    material: str = "gold"
    materials: int = 16
    programs: int = 5
    texture_mb: float = 16.0
    shader_cost: float = 1.0
    lights: int = 1000
    lamps: bool = False
    strands: int = 100_000
    splats: int = 60_000
    capture: Path | str | None = None
    capture_linear: bool = False
    voxels: int = 160
    plain: bool = False

    def __post_init__(self) -> None:
        """Refuses what no scene can use."""
        if self.aspect is not None and not 0.01 <= self.aspect <= 100.0:
            raise SceneError(f"aspect must be from 0.01 to 100, not {self.aspect}")
        if not 16 <= self.voxels <= 4096:
            raise SceneError(f"voxels must be from 16 to 4096, not {self.voxels}")
        if not 1 <= self.strands <= 20_000_000:
            raise SceneError(f"strands must be from 1 to 20000000, not {self.strands}")
        if not 1 <= self.splats <= 20_000_000:
            raise SceneError(f"splats must be from 1 to 20000000, not {self.splats}")
        if self.seed < 0:
            raise SceneError(f"seed must not be negative: {self.seed}")

    def dragon_mesh(self) -> Mesh:
        """The dragon to use: ours, or the file's, normalised to our size."""
        if self.dragon is None:
            return dragon(self.triangles)
        from wavecomb.scenes.meshfile import load_dragon

        return load_dragon(Path(self.dragon))
