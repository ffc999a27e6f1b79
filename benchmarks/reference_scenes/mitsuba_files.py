# SPDX-License-Identifier: Apache-2.0
"""Lay out Mitsuba's scenes as in its repository, with replacements for common meshes."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np

SEGMENTS = 96
"""Segments around the axis of the replacement sphere."""


def load_mitsuba() -> Any:
    """Import Mitsuba 3 in its scalar variant, which needs no compilation.

    Raises:
        ImportError: Mitsuba is missing.
    """
    sys.path.append(str(Path(__file__).resolve().parents[1] / "peers"))
    from mitsuba_bridge import load_mitsuba as load

    return load("scalar_rgb")


def lay_out(assets: Path, folder: Path) -> Path:
    """Link the scenes below ``folder``; return the folder of the scenes.

    common/meshes gets a generated rectangle and sphere, because the assets do not include these
    files. The reference images show that the sphere is smooth and of radius 1.
    """
    assets, scenes = assets.resolve(), folder / "mitsuba"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(assets / "reference" / "mitsuba", scenes, copy_function=os.symlink)
    plates = scenes / "veach_mis" / "meshes" / "veach"
    plates.mkdir(parents=True)
    for file in (scenes / "veach_mis").glob("*.obj"):
        (plates / file.name).symlink_to(file.resolve())
    common = folder / "common"
    (common / "meshes").mkdir(parents=True)
    (common / "textures").mkdir()
    (common / "textures" / "museum.exr").symlink_to((assets / "hdri" / "museum.exr").resolve())
    (common / "meshes" / "rectangle.obj").write_text(RECTANGLE, encoding="utf-8")
    (common / "meshes" / "sphere.obj").write_text(sphere(), encoding="utf-8")
    return scenes


RECTANGLE = """v -1 -1 0
v 1 -1 0
v 1 1 0
v -1 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1 4/4/1
"""


def sphere(segments: int = SEGMENTS) -> str:
    """OBJ file of a unit sphere around y with exact normals."""
    rings = segments // 2
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments + 1), indexing="ij"
    )
    points = np.stack(
        [np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1
    ).reshape(-1, 3)
    uv = np.stack([around / (2 * np.pi), 1 - polar / np.pi], axis=-1).reshape(-1, 2)
    lines = [f"v {x:.8g} {y:.8g} {z:.8g}\nvn {x:.8g} {y:.8g} {z:.8g}" for x, y, z in points]
    lines += [f"vt {u:.8g} {v:.8g}" for u, v in uv]
    for i in range(rings):
        for j in range(segments):
            a = i * (segments + 1) + j + 1
            quad = (a, a + segments + 1, a + segments + 2, a + 1)
            lines.append("f " + " ".join(f"{k}/{k}/{k}" for k in quad))
    return "\n".join(lines) + "\n"
