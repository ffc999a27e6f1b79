# SPDX-License-Identifier: Apache-2.0
"""Process for one render, started by ``bench.process``.

Reads a job as JSON from its standard input and writes the result as one JSON line. The job:

    stage, camera   file, and camera prim or null
    settings        of the render, as ``wavecomb.render`` takes them, with "size" and "spp"
    cpus            cores to run on, or null
    warm            number of discarded renders with 1 sample per pixel before the timed one
    profile         file of initial costs, or null
    golden          {"file", "spp"} of the converged image, or null
    image           file that keeps the image (.npy), or null
    perf            ``counters.Session.job``, or null
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

Job = dict[str, Any]


def main() -> None:
    """Performs the job and prints the answer, which states the error if the render fails."""
    job = json.load(sys.stdin)
    # Libraries may print to stdout. Redirect stdout to stderr, so that the answer is the only line
    # on the original stdout.
    answer = os.dup(1)
    os.dup2(2, 1)
    if job.get("cpus"):
        with contextlib.suppress(OSError, AttributeError):
            os.sched_setaffinity(0, job["cpus"])
    try:
        result = {"status": "ok", "error": "", **run(job)}
    except Exception as error:
        from wavecomb.run.error_messages import describe

        result = {"status": "failed", "error": " ".join(describe(error).split())}
    with os.fdopen(answer, "w", encoding="utf-8") as out:
        out.write(json.dumps(result, allow_nan=False) + "\n")


def run(job: Job) -> dict[str, Any]:
    """Loads the stage, renders it once without measurement, then renders and compares the image."""
    from wavecomb import api
    from wavecomb.bench.process import Switch
    from wavecomb.run.cost_profile import load_costs
    from wavecomb.run.stats import plain

    settings = dict(job["settings"])
    size, spp = tuple(settings.pop("size")), int(settings.pop("spp"))
    profile = load_costs(job["profile"]) if job.get("profile") else None
    stage = api.load(job["stage"], camera=job.get("camera"), size=size)
    if profile is not None:
        settings["costs"] = profile
    for _ in range(int(job.get("warm", 0))):
        # The timed render reuses no training data of this warm-up render.
        api.render(stage.scene, size=size, spp=1, **settings)
    switch = Switch(job.get("perf"))
    switch.start()
    picture = api.render(stage, size=size, spp=spp, **settings)
    switch.stop()
    found: dict[str, Any] = {
        "stats": plain(picture.stats),
        "costs": picture.costs,
        **plain(judge_picture(picture.beauty, _mean_spp(picture.stats), job.get("golden"))),
    }
    if job.get("image"):
        _save(Path(job["image"]), picture.beauty)
    return found


def _mean_spp(stats: Mapping[str, Any]) -> float:
    """Returns the mean samples per pixel, which differs from spp in renders with a time limit."""
    from wavecomb.run.stats import rendered_pixels

    return float(stats["counts"]["samples"]) / rendered_pixels(stats["settings"])


def judge_picture(beauty: Any, spp: float, golden: dict[str, Any] | None) -> dict[str, Any]:
    """Returns a hash of the image, and its error against the golden (converged) image.

    The variance of the golden image is the variance of one sample divided by its number of samples
    per pixel (golden spp). The variance of the golden image increases the measured squared error by
    the factor 1 + spp / golden spp, so the error is divided by this factor. The correction is too
    small if guiding made the samples less noisy than those of the golden image, which is rendered
    without guiding.
    """
    import hashlib

    import numpy as np

    from wavecomb.image.compare.comparison import compare

    digest = hashlib.sha256(np.ascontiguousarray(beauty).tobytes()).hexdigest()
    result: dict[str, Any] = {"picture_sha256": digest}
    if golden is None:
        return result
    difference = compare(beauty, np.load(golden["file"]))
    noise = 1.0 + spp / float(golden["spp"])
    return {
        **result,
        "rel_mse": difference.rel_mse / noise,
        "mse": difference.rmse**2 / noise,
        "comparison": difference.to_dict(),
    }


def _save(path: Path, beauty: Any) -> None:
    import numpy as np

    from wavecomb.image.files.output_file import replacing

    with replacing(path) as part:
        np.save(part, np.ascontiguousarray(beauty, dtype=np.float32))


if __name__ == "__main__":
    main()
