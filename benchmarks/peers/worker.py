# SPDX-License-Identifier: Apache-2.0
"""Run one renderer in a separate process, controlled by lines of JSON.

The process loads a stage, renders one sample per pixel, and writes a JSON object:

    {"load_s", "version", "settings"}

Then the worker answers each request {"spp", "seed", "image": path or null} with a JSON object:

    {"spp", "seconds", "mean", "rays", "peak_mb"}

In this object, spp is the number of samples after rounding by the sampler, seconds is the time of
the render call, and rays may be null. The image is saved at the path as .npy (height, width, 3).
compare.py starts this program; Cycles needs the Python of benchmarks/peers/setup.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from recorded import load

Render = Callable[[int, int], "tuple[Any, int, int | None]"]
"""Function of (spp, seed) that returns the image, samples per pixel and number of rays."""
Opened = tuple[Render, dict[str, Any]]


def open_wavecomb(args: argparse.Namespace, options: dict[str, Any]) -> Opened:
    """Load the USD stage."""
    import wavecomb
    from wavecomb import _core

    # Wavecomb's scene keeps no state between renders, so each render calibrates the light selection
    # probabilities again.
    stage = wavecomb.load(args.stage).scene
    settings = {
        "filter": "box",
        "filter_width": 1.0,
        "max_depth": args.max_depth,
        "threads": args.threads,
        **options,
    }

    def render(spp: int, seed: int) -> tuple[Any, int, int | None]:
        result = wavecomb.render(stage, size=(args.size, args.size), spp=spp, seed=seed, **settings)
        counts = result.stats["counts"]
        return result.beauty, spp, counts["rays"] + counts["shadow_rays"]

    library = hashlib.sha1(Path(_core.__file__).read_bytes()).hexdigest()
    full = _core.Settings(width=args.size, height=args.size, **settings).to_dict()
    return render, {"version": library[:12], "settings": full}


def open_mitsuba(args: argparse.Namespace, options: dict[str, Any]) -> Opened:
    """Load the recorded arrays. Options: variant, and fields of PeerSettings."""
    from mitsuba_bridge import MitsubaScene, PeerSettings, load_mitsuba

    variant = options.pop("variant")
    mi = load_mitsuba(variant, args.threads)
    if variant.startswith("scalar"):
        import drjit as dr

        dr.set_thread_count(args.threads)
    settings = PeerSettings(
        args.size, args.size, args.max_depth, rr_depth=5, instancing=True, **options
    )
    scene = MitsubaScene(mi, load(args.recorded), settings)

    def render(spp: int, seed: int) -> tuple[Any, int, int | None]:
        picture = scene.render(spp, seed)  # `render` returns when the image is complete
        return picture, scene.scene.sensors()[0].sampler().sample_count(), None

    return render, {"version": mi.__version__, "settings": {"variant": variant, **vars(settings)}}


def open_cycles(args: argparse.Namespace, options: dict[str, Any]) -> Opened:
    """Load the recorded arrays in Cycles. Options are `light_tree` and `pattern`."""
    import bpy
    from cycles_bridge import CyclesScene, CyclesSettings

    settings = CyclesSettings(args.size, args.size, args.max_depth, args.threads, **options)
    scene = CyclesScene(load(args.recorded), settings, args.recorded)
    return (
        lambda spp, seed: (scene.render(spp, seed), spp, None),
        {"version": bpy.app.version_string, "settings": vars(settings)},
    )


OPENERS = {"wavecomb": open_wavecomb, "mitsuba": open_mitsuba, "cycles": open_cycles}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=OPENERS)
    parser.add_argument("--options", type=json.loads, default={})
    parser.add_argument("--stage", type=Path, required=True, help="USD file")
    parser.add_argument("--recorded", type=Path, required=True, help="folder of Recorded.save")
    parser.add_argument("--size", type=int, required=True)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--max-depth", type=int, required=True)
    args = parser.parse_args()
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # libraries that print to stdout write to stderr instead
    started = time.perf_counter()
    render, facts = OPENERS[args.kind](args, args.options)
    facts["load_s"] = time.perf_counter() - started
    render(1, 0)
    print(json.dumps(facts), file=out)
    last: tuple[int, Any] | None = None
    for line in sys.stdin:
        job = json.loads(line)
        begin = time.perf_counter()
        picture, spp, rays = render(job["spp"], job["seed"])
        seconds = time.perf_counter() - begin
        # Mitsuba's ptracer returns black for any seed if its light paths miss the stage.
        if last and last[0] != job["seed"] and picture.any() and np.array_equal(last[1], picture):
            raise RuntimeError(f"{args.kind}: a different seed gave the same image")
        last = job["seed"], picture
        if job.get("image"):
            np.save(job["image"], picture)
        answer = {
            "spp": spp,
            "seconds": seconds,
            "mean": [float(v) for v in picture.mean(axis=(0, 1))],
            "rays": rays,
            "peak_mb": peak_mb(),
        }
        print(json.dumps(answer), file=out)


def peak_mb() -> float:
    """Return the peak memory of this process in MB; getrusage may include its parent process."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
