# SPDX-License-Identifier: Apache-2.0
"""One render in a process of its own, which ``bench.process`` starts.

Reads a job as JSON from its standard input and writes one JSON line with what came of it. The job:

    stage, camera   file, and camera prim or null
    settings        of the render, as ``wavecomb.render`` takes them, with "size" and "spp"
    cpus            cores to stay on, or null
    warm            renders with 1 sample per pixel before the timed one, which are thrown away
    profile         costs to start from, a file, or null
    golden          {"file", "spp"} of the converged picture, or null
    image           where to keep the picture (.npy), or null
    perf            of ``counters.Session``, or null
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
    """Does the job; an error of the render is an answer, too."""
    job = json.load(sys.stdin)
    # What libraries print goes to stderr: the answer is the only line of stdout.
    answer = os.dup(1)
    os.dup2(2, 1)
    if job.get("cpus"):
        with contextlib.suppress(OSError, AttributeError):
            os.sched_setaffinity(0, job["cpus"])
    try:
        result = {"status": "ok", "error": "", **run(job)}
    except Exception as error:
        from wavecomb.run.faults import describe

        result = {"status": "failed", "error": " ".join(describe(error).split())}
    with os.fdopen(answer, "w", encoding="utf-8") as out:
        out.write(json.dumps(result, allow_nan=False) + "\n")


def run(job: Job) -> dict[str, Any]:
    """Loads, warms up, renders, compares."""
    from wavecomb import api
    from wavecomb.bench.counters import Switch
    from wavecomb.run.costs import load_costs
    from wavecomb.run.stats import plain

    settings = dict(job["settings"])
    size, spp = tuple(settings.pop("size")), int(settings.pop("spp"))
    profile = load_costs(job["profile"]) if job.get("profile") else None
    stage = api.load(job["stage"], camera=job.get("camera"), size=size)
    if profile is not None:
        settings["costs"] = profile
    for _ in range(int(job.get("warm", 0))):
        api.render(stage.scene, size=size, spp=1, **settings)  # keeps nothing for the next
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
    """Samples of a pixel in the mean: not what was asked for, where time is limited."""
    from wavecomb.run.stats import rendered_pixels

    return float(stats["counts"]["samples"]) / rendered_pixels(stats["settings"])


def judge_picture(beauty: Any, spp: float, golden: dict[str, Any] | None) -> dict[str, Any]:
    """Digest of the picture, and its error against the converged one.

    The golden picture has noise of its own, 1 / golden spp of what one sample has; so a measured
    squared error is too large by the factor 1 + spp / golden spp, and is divided by it. Of samples
    that are better than the golden picture's, which nothing was learned for, this takes off too
    little.
    """
    import hashlib

    import numpy as np

    from wavecomb.picture.compare import compare

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

    from wavecomb.picture.files import replacing

    with replacing(path) as part:
        np.save(part, np.ascontiguousarray(beauty, dtype=np.float32))


if __name__ == "__main__":
    main()
