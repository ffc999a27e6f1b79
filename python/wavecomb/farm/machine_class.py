# SPDX-License-Identifier: Apache-2.0
"""Classes of machines that render the same bits.

Two machines are in one class if they have the same version of Wavecomb, instruction set and native
libraries, and render the same bits in a small probe image. The probe is needed because Embree
selects instructions by CPU, which changes the last bits (docs/decisions/isa.md).
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
from pathlib import Path

import numpy as np

from wavecomb.version import version

PREFIX = "wavecomb-"
_LIBRARIES = re.compile(r"lib(embree|tbb)[^/]*\.so")
_OTHERS = re.compile(r"/(?!wavecomb\.)[^/]+\.libs/[^/]*$")


@functools.cache
def machine_class() -> str:
    """Returns the class of this machine.

    The class is a text with the instruction set and a hash of everything that affects results. The
    text is also the name of a Dask resource.
    """
    from wavecomb import _core

    isa = re.sub(r"[^A-Za-z0-9-]", "-", str(_core.build_info()["isa"]))
    facts = "\n".join((version(), isa, library_hash(), probe_hash()))
    return f"{PREFIX}{isa}-{hashlib.sha256(facts.encode()).hexdigest()[:12]}"


def library_hash() -> str:
    """Returns a hash of the native libraries used for rendering: Wavecomb, Embree and oneTBB."""
    from wavecomb import _core

    files = {os.path.realpath(str(_core.__file__))}
    with contextlib.suppress(OSError):
        lines = Path("/proc/self/maps").read_text(errors="replace").splitlines()
        mapped = {line.split(maxsplit=5)[-1] for line in lines if " /" in line}
        # Ignore copies of these libraries in the wheels of other packages, which Wavecomb does not
        # use.
        mapped = {path for path in mapped if not _OTHERS.search(path)}
        files |= {path for path in mapped if _LIBRARIES.match(os.path.basename(path))}
    told = hashlib.sha256()
    for path in sorted(files, key=os.path.basename):
        told.update(Path(path).read_bytes())
    return told.hexdigest()[:16]


def probe_hash() -> str:
    """Renders a small image of rough metal and glass above a floor, and returns its hash.

    The image depends on all libraries: BVH, SIMD lanes, lights and BSDFs.
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
