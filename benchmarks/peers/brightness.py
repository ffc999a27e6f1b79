# SPDX-License-Identifier: Apache-2.0
"""Compare the brightness of each material of a stage between Wavecomb, Mitsuba 3 and Cycles.

    benchmarks/peers/setup                      # once: Cycles, in a separate environment
    .venv/bin/python benchmarks/peers/brightness.py
    .venv/bin/python benchmarks/peers/brightness.py --stages shot.usd --max-depth 1

Renders each stage with several seeds, and prints the mean brightness over the pixels of a material,
relative to Wavecomb, with its standard error:

- same: Mitsuba with Wavecomb's formulas (mitsuba_preview.py), which must agree within noise;
- Mitsuba, Cycles: with the models of these renderers.

The stages `dome` and `sun` are balls of all materials of `mixed` under a white dome and under a sun
of 15 degrees at the side of the camera, with one scattering; `mixed-lamps` is the stage of the
comparison of speed.

Causes of the differences on opaque materials:

- Mitsuba's principled adds the reflection of the interface to an undimmed base, so a white floor
  reflects more than it receives, and adds retro-reflection. It has no multiple scattering between
  microfacets (0.2, 1.1 and 3.6 % of the light at roughness 0.16, 0.24 and 0.34), and does not dim
  layers below a coat.
- Cycles dims the base by 1 - E(view), without a factor for the direction of the light. Under a
  uniform dome this has the same albedo as Wavecomb's formula. Its area lights do not block the
  dome, and its bounces do not count straight transmissions.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shlex
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from renderers import ROOT, Job, Process
from report import commit, machine

Array = NDArray[np.float64]
OWN = ("dome", "sun")
OTHERS = {
    "same": "mitsuba-llvm-same",
    "mitsuba": "mitsuba-llvm-multijitter",
    "cycles": "cycles-no-tree",
}


def ball(steps: int = 96) -> Any:
    """Make a unit sphere with normals and texture coordinates."""
    from wavecomb.scenes.models.mesh import Mesh

    u, v = np.meshgrid(np.linspace(0.0, 1.0, 2 * steps + 1), np.linspace(0.0, 1.0, steps + 1))
    polar, around = np.pi * v, 2.0 * np.pi * u
    points = np.stack(
        [np.sin(polar) * np.sin(around), -np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1
    )
    row, column = np.meshgrid(np.arange(steps), np.arange(2 * steps), indexing="ij")
    a = (row * (2 * steps + 1) + column).ravel()
    b = a + 2 * steps + 1
    faces = np.concatenate([np.stack([a, a + 1, b + 1], -1), np.stack([a, b + 1, b], -1)])
    flat = points.reshape(-1, 3).astype(np.float32)
    uv = np.stack([2.0 * u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return Mesh(flat, faces.astype(np.int32), flat.copy(), uv)


def write_balls(path: Path, light: str) -> None:
    """Write a stage of balls of all materials of the generated stages, as exporters write them."""
    from wavecomb.scenes.authoring import materials
    from wavecomb.scenes.authoring.stage import StageWriter

    looks = {k: v for k, v in vars(materials).items() if isinstance(v, materials.MaterialInfo)}
    writer = StageWriter(path, 1.0, texture_size=512, is_plain=True)
    shape = writer.prototype("Ball", ball())
    for k, (name, info) in enumerate(looks.items()):
        label = "".join(word.capitalize() for word in name.split("_"))
        place = (3.0 * (k % 5 - 2), 3.0 * (2 - k // 5), 0.0)
        writer.instance(f"/World/Objects/{label}", shape, writer.material(label, info), place)
    if light == "dome":
        writer.even_dome("Dome", 1.0)
    else:
        writer.sun("Sun", (7.0, -10.0, -10.0), 15.0, (3.0, 3.0, 3.0))
    writer.camera((0.0, 0.0, 60.0), (0.0, 0.0, 0.0), 14.5, 1.0)
    writer.save("Balls of the materials of the generated stages")


def without_opacity(stage: Path) -> Path:
    """Write a copy of a stage whose materials are opaque."""
    from pxr import Usd, UsdShade

    opened = Usd.Stage.Open(str(stage))
    for prim in opened.Traverse():
        given = UsdShade.Shader(prim).GetInput("opacity") if prim.IsA(UsdShade.Shader) else None
        if given:
            given.Set(1.0)
    path = stage.with_name(f"{stage.stem}-opaque.usdc")
    opened.GetRootLayer().Export(str(path))
    return path


def prepare(name: str, args: argparse.Namespace) -> Job:
    """Write a stage and its arrays."""
    from recording import record

    from wavecomb.scenes import write_scene

    stage = args.cache / f"{name}.usdc" if not Path(name).is_file() else Path(name)
    if name in OWN:
        write_balls(stage, name)
    elif name == "mixed-lamps" and not stage.exists():
        write_scene("mixed", stage, plain=True, lamps=True)
    if args.opaque:
        stage = without_opacity(stage)
    scene = record(stage)
    recorded = args.cache / f"{stage.stem}-recorded"
    scene.save(recorded)
    digest = hashlib.sha1((recorded / "scene.json").read_bytes()).hexdigest()
    depth = 1 if name in OWN else args.max_depth
    return Job(stage, recorded, digest, args.size, args.threads, depth)


def mattes(job: Job) -> dict[str, Array]:
    """Return the coverage of each material, by the last part of its name."""
    import wavecomb
    from wavecomb import cryptomatte

    picture = wavecomb.render(
        job.stage, size=(job.size, job.size), spp=64, max_depth=1, filter="box", filter_width=1.0,
        threads=job.threads, aovs=["crypto_material"], progress=False,
    )  # fmt: skip
    ranks = picture.aovs["crypto_material"]
    found = picture.manifests["crypto_material"]
    return {
        k.split("/")[-1]: np.asarray(cryptomatte.matte(ranks, v), np.float64)
        for k, v in found.items()
    }


def images(name: str, job: Job, args: argparse.Namespace) -> list[Array]:
    """Render a stage with each seed."""
    file = args.cache / "brightness.npy"
    process = Process(name, job, args.cache / f"{name}.log", {})
    spp = args.spp if name != "wavecomb" else args.spp * args.more
    out = []
    for seed in range(args.seeds):
        answer = process.render(spp, 100 + seed, file)
        print(f"{job.stage.stem}, {name}: {answer['seconds']:.1f} s", file=sys.stderr)
        out.append(np.load(file).astype(np.float64))
    process.close()
    return out


def means(pictures: list[Array], matte: Array) -> tuple[float, float]:
    """Return the mean over the pixels of a material, and its standard error, over seeds."""
    each = [float((p.mean(axis=2) * matte).sum()) for p in pictures]
    return float(np.mean(each)), float(np.std(each, ddof=1) / np.sqrt(len(each)))


def measure(name: str, args: argparse.Namespace) -> dict[str, Any]:
    """Return the ratios to Wavecomb and their standard errors, by material and renderer."""
    job = prepare(name, args)
    covers = {k: m for k, m in mattes(job).items() if m.sum() > 0.0}
    covers["all"] = np.ones((job.size, job.size))
    ours = images("wavecomb", job, args)
    base = {k: means(ours, m) for k, m in covers.items()}
    out: dict[str, Any] = {k: {"cover": float(m.mean())} for k, m in covers.items()}
    for label in args.renderers:
        theirs = images(OTHERS[label], job, args)
        for material, matte in covers.items():
            (a, da), (b, db) = base[material], means(theirs, matte)
            if a > 0.0:
                error = b / a * float(np.hypot(da / a, db / max(b, 1e-30)))
                out[material][label] = [b / a, error]
    return out


def table(found: dict[str, Any], labels: list[str]) -> str:
    """Return the ratios of a stage as a Markdown table."""
    lines = [f"| material | {' | '.join(labels)} |", "| --- " * (len(labels) + 1) + "|"]
    for name, row in found.items():
        cells = [f"{row[k][0]:.3f} +- {row[k][1]:.3f}" if k in row else "" for k in labels]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add(
        "--stages",
        nargs="+",
        default=["mixed-lamps", *OWN],
        help="mixed-lamps, dome, sun or a file",
    )
    add("--renderers", nargs="+", default=list(OTHERS), choices=list(OTHERS))
    add("--size", type=int, default=96)
    add("--spp", type=int, default=36, help="samples per pixel and seed; a square")
    add("--more", type=int, default=2, help="factor of Wavecomb's samples")
    add("--seeds", type=int, default=5)
    add("--max-depth", type=int, default=7, help="scattering vertices")
    add("--opaque", action="store_true", help="render all materials opaque")
    add("--threads", type=int, default=2)
    add("--cache", type=Path, default=ROOT / "out" / "brightness", help="folder of stages and logs")
    add("--output", type=Path, default=ROOT / "benchmarks" / "results" / "brightness.json")
    args = parser.parse_args()
    args.cache.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {
        "schema": "wavecomb-brightness/1",
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        **commit(),
        "command": shlex.join(["benchmarks/peers/brightness.py", *sys.argv[1:]]),
        "rounds": args.seeds,
        "machine": machine(),
        "settings": {k: v for k, v in vars(args).items() if k not in ("cache", "output")},
        "stages": {},
    }
    for name in args.stages:
        result["stages"][Path(name).stem] = found = measure(name, args)
        args.output.write_text(json.dumps(result, indent=1) + "\n")
        print(f"\n{name}\n\n{table(found, args.renderers)}")


if __name__ == "__main__":
    main()
