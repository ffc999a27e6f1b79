# SPDX-License-Identifier: Apache-2.0
"""Where a job stands, for people and programs."""

from __future__ import annotations

import time
from typing import Any

from wavecomb.farm.folder import BUSY, DONE, FAILED, STATES, TODO, Folder
from wavecomb.farm.leases import workers
from wavecomb.farm.spec import Task
from wavecomb.run.progress import time_text


def status(folder: Folder, *, tasks: bool = True) -> dict[str, Any]:
    """The state of a job as JSON.

    Args:
        folder: Its.
        tasks: Whether to list all tasks, too.

    Returns:
        ``state`` is "running", "waiting" (nobody works on it), "cancelled", "failed" (over, and not
        all is done) or "done".
    """
    ids = {state: folder.ids(state) for state in STATES}
    counts = {state: len(found) for state, found in ids.items()}
    now = time.time()
    working = [
        worker
        for worker in workers(folder)
        if not worker.has_ended and now - worker.seen <= folder.spec.lease_s
    ]
    failed = [_failure(folder, Task.of(name)) for name in sorted(ids[FAILED])]
    pictures = _pictures(folder, ids)
    out: dict[str, Any] = {
        "job": str(folder.path), "id": folder.spec.id, "stage": folder.spec.stage,
        "state": _state(folder, counts, bool(working)), "tasks": counts,
        "pictures": {"all": len(pictures), "done": sum(p["state"] == "done" for p in pictures)},
        "seconds_left": _left(folder, counts, len(working)),
        "workers": (told := [_worker(w.name, w.facts, now - w.seen) for w in working]),
        "samples_per_s": sum(worker["samples_per_s"] or 0.0 for worker in told),
        "failed": failed,
    }  # fmt: skip
    if tasks:
        out |= {"tiles": list(folder.spec.tiles), "all_pictures": pictures}
    return out


def _state(folder: Folder, counts: dict[str, int], working: bool) -> str:
    if not counts[TODO] and not counts[BUSY] and not counts[FAILED]:
        return "done"
    if folder.is_cancelled():
        return "cancelled"
    if counts[FAILED] and folder.is_over():
        return "failed"
    return "running" if working else "waiting"


def _failure(folder: Folder, task: Task) -> dict[str, Any]:
    result = folder.result(task)
    return {
        "task": task.id, "title": folder.spec.title(task), "error": result.get("error", "unknown"),
        "tries": result.get("tries"), "worker": result.get("worker"),
    }  # fmt: skip


def _pictures(folder: Folder, ids: dict[str, set[str]]) -> list[dict[str, Any]]:
    """Of each its files, and the state of its tasks."""
    spec = folder.spec
    where = {name: state for state, found in ids.items() for name in found}
    out = []
    for picture in range(len(spec.pictures)):
        tiles = spec.parts_of(picture)
        states = [where.get(task.id, TODO) for task in tiles]
        last = where.get(spec.last_of(picture).id, TODO)
        if last == DONE:
            states = [DONE] * len(states)
        found = (*states, last)
        out.append(
            {
                "picture": picture,
                "frame": spec.pictures[picture][1],
                "output": spec.names(picture)["output"],
                "state": next(s for s in (FAILED, BUSY, TODO, DONE) if s in found),
                "tiles": {task.id: state for task, state in zip(tiles, states, strict=True)},
            }
        )
    return out


def _worker(name: str, facts: dict[str, Any], age: float) -> dict[str, Any]:
    progress = facts.get("progress") or {}
    done, total = progress.get("samples_done"), progress.get("samples_total")
    seconds, mine = progress.get("seconds"), progress.get("task") == facts.get("task")
    return {
        "name": name, "host": facts.get("host"), "task": facts.get("task"),
        "title": facts.get("title"), "seen_s": round(max(0.0, age), 1),
        "share": done / total if mine and done is not None and total else None,
        "samples_per_s": done / seconds if mine and done and seconds else None,
    }  # fmt: skip


def _left(folder: Folder, counts: dict[str, int], working: int) -> float | None:
    """Seconds that are left if tasks go on taking what they took; None: nobody knows."""
    left = counts[TODO] + counts[BUSY]
    if not left or not working or not counts[DONE]:
        return 0.0 if not left else None
    # The last few tell enough.
    names = sorted(folder.ids(DONE))[-64:]
    took = [float(folder.result(Task.of(name)).get("wall_s") or 0.0) for name in names]
    return sum(took) / len(took) * left / working


def lines(state: dict[str, Any]) -> list[str]:
    """The same for people."""
    tasks, pictures = state["tasks"], state["pictures"]
    left = state["seconds_left"]
    out = [
        f"{state['stage']}: {state['state']}",
        f"pictures: {pictures['done']} of {pictures['all']} done",
        "tasks: " + ", ".join(f"{tasks[name]} {name}" for name in STATES),
    ]
    if left:
        out.append(f"about {time_text(left)} left")
    for worker in state["workers"]:
        share = "" if worker["share"] is None else f", {100 * worker['share']:.0f} %"
        out.append(f"worker {worker['name']}: {worker['title'] or 'idle'}{share}")
    for one in state["failed"]:
        out.append(f"failed: {one['title']} (task {one['task']}): {one['error']}")
    return out
