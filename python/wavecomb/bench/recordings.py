# SPDX-License-Identifier: Apache-2.0
"""Renders before the sitting that the oracles learn from, and the files that keep them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from wavecomb.bench.jobs import ORDERINGS, RECORDINGS, Job, Jobs
from wavecomb.bench.oracle import (
    COSTS,
    best_orders,
    pooled_costs,
    ranks,
    recorded,
    shuffled,
)
from wavecomb.bench.plan import Config
from wavecomb.bench.process import run_worker
from wavecomb.errors import WavecombError
from wavecomb.picture.files import replacing
from wavecomb.run.costs import save_costs

TRACE_SCHEMA = "wavecomb-trace/1"


def make_profile(jobs: Jobs, config: Config, scratch: Path) -> None:
    """Writes the file that the configuration's oracle starts from.

    Raises:
        WavecombError: A recording failed.
    """
    if config.settings["policy"] == COSTS:
        answers = [_run(jobs.recording(config, k), config, scratch) for k in range(RECORDINGS)]
        save_costs(jobs.profile(config), pooled_costs(answers))
        return
    trace = jobs.trace(config)
    if not trace.exists():
        _write(trace, _orderings(jobs, config, scratch))
    found = json.loads(trace.read_text(encoding="utf-8"))
    save_costs(jobs.profile(config), ranks(found[config.settings["policy"]]))


def _orderings(jobs: Jobs, config: Config, scratch: Path) -> dict[str, Any]:
    """Recordings under random orders of the materials, and the best and worst that follow."""
    first = _run(jobs.recording(config, 0), config, scratch)
    names = [entry["name"] for entry in first["stats"]["materials"]]
    path = scratch / "trace" / ".ranks.json"
    recordings = []
    try:
        for number in range(ORDERINGS):
            order = shuffled(names, number)
            save_costs(path, ranks(order))
            answer = _run(jobs.recording(config, number, path), config, scratch)
            recordings.append(recorded(order, answer))
    finally:
        path.unlink(missing_ok=True)
    return {"schema": TRACE_SCHEMA, **best_orders(recordings), "recordings": recordings}


def _run(job: Job, config: Config, scratch: Path) -> dict[str, Any]:
    answer = run_worker(job, {}, scratch).answer
    if answer["status"] != "ok":
        raise WavecombError(f"recording of {config.name}: {answer['error']}")
    return answer


def _write(path: Path, document: dict[str, Any]) -> None:
    with replacing(path) as part:
        part.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
