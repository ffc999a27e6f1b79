# SPDX-License-Identifier: Apache-2.0
"""Classes of machines: those that give the same bits.

Two machines are of one class where they have the same version, the same native libraries, and the
same bits in a small probe picture: Embree chooses its instructions by itself, and its last bits
differ between them (docs/decisions/isa.md).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wavecomb.farm.files import read_json, write_json
from wavecomb.farm.folder import Folder
from wavecomb.version import version

_WORDS = {
    "version": "Wavecomb",
    "isa": "instruction set",
    "library": "native library",
    "probe": "probe picture",
}
"""What makes a class, and what people call it."""
_LIBRARIES = re.compile(r"lib(embree|tbb)[^/]*\.so")


def machine_class() -> dict[str, str]:
    """The class of this machine."""
    from wavecomb import _core

    return {
        "version": version(),
        "isa": str(_core.build_info()["isa"]),
        "library": library_hash(),
        "probe": probe_hash(),
    }


def library_hash() -> str:
    """A hash of the native libraries that rendering is done by: ours, Embree, oneTBB."""
    from wavecomb import _core

    files = {os.path.realpath(str(_core.__file__))}
    with contextlib.suppress(OSError):
        lines = Path("/proc/self/maps").read_text(errors="replace").splitlines()
        mapped = {line.split(maxsplit=5)[-1] for line in lines if " /" in line}
        files |= {path for path in mapped if _LIBRARIES.match(os.path.basename(path))}
    told = hashlib.sha256()
    for path in sorted(files, key=os.path.basename):
        told.update(Path(path).read_bytes())
    return told.hexdigest()[:16]


def probe_hash() -> str:
    """A hash of a small picture: rough metal and glass over a floor, an area light, a sky.

    Every library takes part in it: hierarchies, lanes, lights and BSDFs.
    """
    from wavecomb import _core

    builder = _core.SceneBuilder()
    floor = builder.add_material("diffuse", name="floor", base_color=(0.6, 0.5, 0.4))
    metal = builder.add_material("principled", name="metal", metallic=1.0, roughness=0.3)
    glass = builder.add_material("dielectric", name="glass", roughness=0.1)
    steps = np.arange(12, dtype=np.float32)
    for number, material in enumerate((floor, metal, glass)):
        grid = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2) / 11 * 4 - 2
        bump = 0.0 if number == 0 else 0.3
        height = bump * np.sin(3 * grid[:, :1]) * np.cos(2 * grid[:, 1:]) - 1 + 0.45 * number
        points = np.concatenate([grid[:, :1], height, grid[:, 1:]], 1).astype(np.float32)
        corner = (np.arange(11)[:, None] * 12 + np.arange(11)).reshape(-1, 1)
        quads = corner + np.array([[0, 12, 13, 1]])
        faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
        mesh = builder.add_mesh(points, faces[number::2] if number else faces, material=material)
        builder.add_to_group(0, mesh)
    lamp = np.eye(4)
    lamp[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    lamp[3, 1] = 2.0
    builder.add_light("rect", lamp, color=(4.0, 3.5, 3.0), width=1.0, height=1.0)
    builder.add_light("dome", np.eye(4), color=(0.2, 0.3, 0.5))
    camera = np.eye(4)
    camera[3, 1:3] = 0.2, 5.0
    builder.set_camera(camera, window=(-0.5, 0.5, -0.5, 0.5))
    settings = _core.Settings(width=32, height=32, spp=4, threads=1, costs="model", max_depth=5)
    result = _core.render(builder.build(), settings)
    told = hashlib.sha256(result.beauty.tobytes())
    if result.depth is not None:
        told.update(result.depth.tobytes())
    return told.hexdigest()[:16]


def refusal(folder: Folder, mine: Mapping[str, Any], worker: str) -> str | None:
    """Why this machine may not work on a job; None: it may.

    The first worker of a job decides over its class.
    """
    file = folder.path / "class.json"
    if not file.exists():
        write_json(file, dict(mine), only_new=True)
    wanted = read_json(file)
    for key, word in _WORDS.items():
        if mine.get(key) != wanted.get(key):
            more = "; --isa of `farm submit` widens a class" if key != "version" else ""
            return (
                f"{worker} is of another class: its {word} is {mine.get(key)}, that of the job is "
                f"{wanted.get(key)}, so its pictures would differ in their last bits{more}"
            )
    return None
