# SPDX-License-Identifier: Apache-2.0
"""Options of the generated stages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wavecomb.errors import SceneError
from wavecomb.scenes.models.dragon import dragon
from wavecomb.scenes.models.mesh import Mesh


@dataclass(frozen=True)
class SceneOptions:
    """Options of ``write_scene``. Scenes ignore options that do not concern them.

    Attributes:
        dragon: OBJ, PLY or USD file that replaces the built-in dragon, or None.
        triangles: Triangles of the built-in dragon, or of all stones of the scenes ``spread`` and
            ``heavy`` together.
        teapot_level: Cells along each edge of the teapot's 32 patches. In the scene ``room``,
            bodies of revolution have four times as many cells around their axis.
        seed: Random seed of the layout and of texture patterns.
        texture_size: Edge of the largest textures, in texels; smaller textures are scaled in
            proportion.
        aspect: Width / height of the image that the camera frames; None uses the scene's value.
        material: Material of the dragon in the scene ``cornell-dragon``: gold, copper, glass or
            jade.
        materials: Number of materials in the scenes ``spread`` and ``heavy``.
        programs: Number of kinds of material in the scene ``spread``, from 1 to 5.
        texture_mb: Memory of all textures of the scenes ``spread`` and ``heavy``, in 1e6 bytes; 0
            means no textures.
        shader_cost: Octaves of noise on the most expensive material of the scene ``spread``. The
            number of octaves grows geometrically over the materials, from 1, which means no noise.
        lights: Number of lights in the scene ``lights``.
        lamps: Whether a key light, a fill light and a dim dome illuminate the scenes ``mixed`` and
            ``dragon``.
        strands: Number of strands in the scenes ``fur`` and ``head``.
        splats: Number of Gaussian splats in the scene ``splats``.
        capture: PLY file of 3D Gaussian splats that replaces the contents of the scene ``splats``,
            or None.
        capture_linear: Whether the colours in the PLY file of ``capture`` are linear. By default,
            the colours are sRGB, which most training programs use.
        voxels: Voxels along the longest edge of the grids in the scenes ``smoke`` and ``clouds``,
            at least 16.
        plain: Whether materials are written as by third-party exporters: UsdPreviewSurface in the
            metallic workflow, without a program. Not available for the scene ``heavy``, for hair,
            and for the scene ``spread`` if ``shader_cost`` is above 1.
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
        """Raises SceneError for values that are invalid for every scene."""
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
        """Returns the built-in dragon, or the mesh of a file scaled to the dragon's size."""
        if self.dragon is None:
            return dragon(self.triangles)
        from wavecomb.scenes.models.mesh_file import load_dragon

        return load_dragon(Path(self.dragon))
