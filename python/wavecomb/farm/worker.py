# SPDX-License-Identifier: Apache-2.0
"""A worker of a job: takes tasks, has a child render them, and gives signs of life.

The child may crash, hang or be killed: then the task is tried again, here or elsewhere, and a new
child is started. The worker itself loads neither USD nor the renderer, so little can befall it.
"""

from __future__ import annotations

import contextlib
import random
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.child_process import Child, ChildDied
from wavecomb.farm.choosing import Chooser
from wavecomb.farm.folder import DONE, Entry, Folder
from wavecomb.farm.leases import Beat, living, look_s, take_back
from wavecomb.farm.machine_class import refusal
from wavecomb.farm.spec import Task

IDLE_S = 0.25
"""Between two looks for work, where there is none."""
GRACE_S = 30.0
"""For a child that is asked to stop."""
START_S = 120.0
"""For a child to load the renderer."""
_MOST_CRASHES = 5
"""One after another, of children that never came to a task."""


class Worker:
    """Works on a job until there is nothing left to do, or it is to stop."""

    def __init__(
        self, folder: Folder, *, threads: int = 0, say: Callable[[str], None] = lambda line: None
    ) -> None:
        """Announces itself.

        Args:
            folder: The job's.
            threads: Of the renderer; 0: as the job says.
            say: Gets a line for each task.
        """
        self._folder = folder
        self._threads = threads
        self._say = say
        self._child: Child | None = None
        self._crashes = 0
        self._shown: tuple[Task, str] | None = None
        self._beat = Beat(folder, {"threads": threads})
        self._chooser = Chooser(folder, self.name)
        self._next_look = 0.0
        self._log = (folder.path / "logs" / f"{self.name}.log").open("ab")
        self.stopped: int | None = None
        """The signal that stopped it."""

    @property
    def name(self) -> str:
        """Its own."""
        return self._beat.name

    def run(self) -> Counter[str]:
        """Works; how many tasks were done, failed and given back.

        Raises:
            WavecombError: It may not work on this job.
        """
        done: Counter[str] = Counter()
        why = "there was nothing left to do"
        try:
            while not self._is_stopped():
                self._keep()
                entry = self._chooser.next()
                if entry is not None:
                    done[self._do(entry)] += 1
                elif self._folder.is_over():
                    break
                else:
                    time.sleep(IDLE_S)
            else:
                why = "it was stopped"
        except BaseException as error:
            why = str(error) or type(error).__name__
            raise
        finally:
            if self._child is not None:
                self._child.end()
            self._beat.end(why)
            self._log.close()
        return done

    def stop(self, number: int) -> None:
        """Has it stop as soon as can be; what was done of its task is kept."""
        self.stopped = number

    def _is_stopped(self) -> bool:
        return self.stopped is not None or self._folder.is_cancelled()

    def _keep(self) -> None:
        """A sign of life; takes tasks of workers that gave none."""
        self._beat.give()
        if time.monotonic() < self._next_look:
            return
        lease = self._folder.spec.lease_s
        self._next_look = time.monotonic() + look_s(lease, 1)
        with contextlib.suppress(OSError):
            now = self._beat.now()
            # By chance, so that workers that were started together do not look together.
            wait = look_s(lease, living(self._folder, now)) * random.uniform(0.75, 1.25)
            self._next_look = time.monotonic() + wait
            for entry in take_back(self._folder, now):
                self._say(f"{self._folder.spec.title(entry.task)}: taken from {entry.worker}")

    def _do(self, entry: Entry) -> str:
        """Has the child do a task that was taken; gives "done", "failed" or "given back"."""
        title = self._folder.spec.title(entry.task)
        try:
            child = self._ready_child()
        except ChildDied as error:
            self._crashes += 1
            self._folder.give_back(entry)
            if self._crashes >= _MOST_CRASHES:
                raise WavecombError(f"{self.name}: {error}, {self._crashes} times") from None
            return "given back"
        except BaseException:
            self._folder.give_back(entry)
            raise
        if child is None:
            self._folder.give_back(entry)
            return "given back"
        self._crashes = 0
        if child.problems:
            # This machine lacks a file: others may have it, so that is no try.
            self._folder.give_back(entry)
            raise WavecombError(f"{self.name}: {child.problems[0]}")
        self._folder.log(entry.task, f"try {entry.attempt} begins on {self.name}")
        self._beat.note(task=entry.task.id, title=title)
        try:
            end = self._wait(child, entry)
        except ChildDied as error:
            self._child = None
            self._folder.fail(entry, str(error))
            self._say(f"{title}: {error}")
            return "failed"
        return self._settle(entry, end, title)

    def _settle(self, entry: Entry, end: Mapping[str, Any], title: str) -> str:
        """Writes down how a task ended."""
        if end["event"] == "done":
            result = {**end["result"], "worker": self.name, "try": entry.attempt}
            if not self._folder.finish(entry, {**result, "ended": time.time()}):
                return "given back"  # another has it, and will come to the same
            self._folder.log(entry.task, f"done in {result['wall_s']:.2f} s")
            self._say(f"{title}: {result['wall_s']:.2f} s")
            return "done"
        if end["event"] == "stopped":
            self._folder.log(entry.task, f"stopped on {self.name}; what was done is kept")
            self._folder.give_back(entry)
            return "given back"
        if end.get("damaged"):
            self._render_again(entry.task)
        self._folder.fail(entry, end["error"], is_final=bool(end.get("final")))
        self._say(f"{title}: {end['error']}")
        return "failed"

    def _render_again(self, task: Task) -> None:
        """Puts tiles back whose files are not there or damaged."""
        from wavecomb.farm.checking import damaged_tiles

        for tile in damaged_tiles(self._folder, task.picture):
            self._folder.put_back(DONE, tile)

    def _ready_child(self) -> Child | None:
        """A child that waits for a task; None: it is to stop."""
        if self._child is not None:
            return self._child
        child = Child(self._folder, self._threads, self._log, self._folder.spec.isa)
        started = time.monotonic()
        ready = False
        try:
            while not ready:
                self._keep()
                for event in child.events(IDLE_S):
                    ready = ready or self._take_greeting(child, event)
                if self._is_stopped():
                    child.end()
                    return None
                if time.monotonic() - started > START_S and child.silent_s > START_S:
                    raise ChildDied("the renderer did not start")
        except BaseException:
            child.end()
            raise
        self._child = child
        return child

    def _take_greeting(self, child: Child, event: Mapping[str, Any]) -> bool:
        """Whether the child is ready. Raises WavecombError where it may not work."""
        if event["event"] == "refused":
            raise WavecombError(f"{self.name}: {event['error']}")
        if event["event"] == "class":
            child.facts = {key: value for key, value in event.items() if key != "event"}
            self._beat.note(**{"class": child.facts})
            why = refusal(self._folder, child.facts, self.name)
            if why is not None:
                raise WavecombError(why)
        if event["event"] == "ready":
            child.problems = list(event["problems"])
            return True
        return False

    def _wait(self, child: Child, entry: Entry) -> dict[str, Any]:
        """The event that ends a task. Raises ChildDied."""
        child.tell({"task": entry.task.id})
        asked: float | None = None
        while True:
            self._keep()
            for event in child.events(IDLE_S):
                if event["event"] == "said":
                    self._folder.log(entry.task, event["line"])
                elif event["event"] in ("progress", "loading"):
                    self._note_progress(entry, event)
                elif event["event"] in ("done", "failed", "stopped"):
                    return event
            if asked is None and self._is_stopped():
                child.stop()
                asked = time.monotonic()
            if asked is not None and time.monotonic() - asked > GRACE_S:
                child.end()
                self._child = None
                return {"event": "stopped"}
            if child.silent_s > self._folder.spec.hang_s:
                child.end()
                raise ChildDied(f"the renderer said nothing for {child.silent_s:.0f} s")

    def _note_progress(self, entry: Entry, event: Mapping[str, Any]) -> None:
        """For whoever looks, with the next sign of life; the first of a task at once."""
        if self._shown != (entry.task, event["event"]):
            self._shown = entry.task, event["event"]
            self._beat.soon()
        self._beat.progress = {"task": entry.task.id, **event}
