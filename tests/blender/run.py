# SPDX-License-Identifier: Apache-2.0
"""Renders Blender scenes with Cycles and Wavecomb: ``python run.py OUTPUT [SCENE ...]``.

Writes a JSON file with the comparison of each scene and an image that shows Cycles to the left and
Wavecomb to the right.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import sys
import traceback
from dataclasses import asdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import bpy  # noqa: E402
import harness  # noqa: E402
import numpy as np  # noqa: E402
import scenes_cameras  # noqa: E402
import scenes_geometry  # noqa: E402
import scenes_lights  # noqa: E402
import scenes_materials  # noqa: E402
import scenes_textures  # noqa: E402
from registry import SCENES, ParityScene  # noqa: E402

MODULES = (scenes_lights, scenes_materials, scenes_textures, scenes_geometry, scenes_cameras)


def run(one: ParityScene, output: Path) -> dict[str, Any]:
    """Renders one scene with both engines and two seeds; returns its row of the table."""
    scene = harness.prepare(max(int(one.spp * float(os.environ.get("PARITY_SPP", "1"))), 1))
    one.make()
    lines = io.StringIO()
    images: dict[str, list[np.ndarray]] = {}
    seconds: dict[str, float] = {}
    for engine in ("CYCLES", "WAVECOMB"):
        pairs = []
        with contextlib.redirect_stdout(lines):
            pairs = [harness.render(scene, engine, seed) for seed in (1, 2)]
        images[engine] = [pair[0] for pair in pairs]
        seconds[engine] = sum(pair[1] for pair in pairs)
    row: dict[str, Any] = harness.compare(images["CYCLES"], images["WAVECOMB"])
    messages = [line for line in lines.getvalue().splitlines() if line.startswith("wavecomb: ")]
    row["messages"] = list(dict.fromkeys(line.removeprefix("wavecomb: ") for line in messages))
    row["seconds"] = seconds
    row["group"], row["about"] = one.group, (one.make.__doc__ or "").strip()
    row["expected"], row["expected_messages"] = asdict(one.expected), one.messages
    row["blender"] = bpy.app.version_string
    both = [np.mean(images[engine], axis=0) for engine in ("CYCLES", "WAVECOMB")]
    scale = 0.7 / max(float(np.percentile(both[0][..., :3], 95)), 1e-3)
    shown = np.concatenate([harness.to_display(image * min(scale, 2.0)) for image in both], axis=1)
    _save(shown, output / f"{one.name}.png")
    return row


def _save(pixels: np.ndarray, file: Path) -> None:
    height, width, _ = pixels.shape
    image = bpy.data.images.new("pair", width, height)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels[::-1] / 255.0
    image.pixels.foreach_set(rgba.ravel())
    image.file_format = "PNG"
    image.save(filepath=str(file))
    bpy.data.images.remove(image)


def refresh(output: Path) -> None:
    """Updates descriptions and bounds in rows of earlier renders."""
    for name, one in SCENES.items():
        file = output / f"{name}.json"
        if file.exists():
            row = json.loads(file.read_text())
            row["group"], row["about"] = one.group, (one.make.__doc__ or "").strip()
            row["expected"] = asdict(one.expected)
            file.write_text(json.dumps(row, indent=1))


def main(words: list[str]) -> int:
    """Renders the named scenes, or all scenes."""
    output = Path(words[0])
    output.mkdir(parents=True, exist_ok=True)
    failed = 0
    if "--refresh" in words:
        refresh(output)
        return 0
    for name in words[1:] or list(SCENES):
        try:
            row = run(SCENES[name], output)
        except Exception:
            traceback.print_exc()
            row, failed = {"error": traceback.format_exc().splitlines()[-1]}, failed + 1
        with open(output / f"{name}.json.part", "w", encoding="utf-8") as stream:
            json.dump(row, stream, indent=1)
        os.replace(output / f"{name}.json.part", output / f"{name}.json")
        shown = {k: round(v, 4) for k, v in row.items() if isinstance(v, float)}
        print(f"== {name} {shown} {row.get('messages', row.get('error'))}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    code = main(sys.argv[1:])
    # Blender 4.2 may crash while its Python module is unloaded.
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    sys.stdout.flush()
    os._exit(code)
