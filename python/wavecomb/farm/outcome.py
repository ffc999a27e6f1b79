# SPDX-License-Identifier: Apache-2.0
"""How far a job is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from wavecomb.farm.assemble import is_finished, machine_of
from wavecomb.farm.folder import Folder


@dataclass
class Outcome:
    """How far a job is.

    Attributes:
        tasks: How many tiles there are.
        tasks_done: How many are rendered.
        images: How many images there are.
        images_done: How many are written.
        failed: A title and a line for each tile or image that failed.
        stopped: Whether ``is_stopped`` ended it.
        others: Workers that were not used, since they are of another class.
    """

    tasks: int
    images: int
    tasks_done: int = 0
    images_done: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    stopped: bool = False
    others: int = 0

    @property
    def state(self) -> str:
        """One of "done", "failed" and "unfinished"."""
        if self.images_done == self.images:
            return "done"
        return "failed" if self.failed else "unfinished"

    def as_dict(self) -> dict[str, Any]:
        """For programs."""
        return {
            "state": self.state, "tasks": {"all": self.tasks, "done": self.tasks_done},
            "images": {"all": self.images, "done": self.images_done},
            "failed": [{"title": title, "error": line} for title, line in self.failed],
        }  # fmt: skip


def status(folder: Folder) -> Outcome:
    """How far a job is, by the files that are there; each is read and compared."""
    job = folder.job
    out = Outcome(job.task_count(), len(job.images))
    for image in range(len(job.images)):
        if is_finished(folder, image):
            out.images_done += 1
            out.tasks_done += job.tile_count(image)
            continue
        keys: dict[str, int] = {}
        for task in job.tasks_of(image):
            machine = machine_of(folder, task)
            keys[machine] = keys.get(machine, 0) + 1
        keys.pop("", None)
        out.tasks_done += max(keys.values(), default=0)
    return out
