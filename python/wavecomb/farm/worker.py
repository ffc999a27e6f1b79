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
from wavecomb.farm.copies import Copies
from wavecomb.farm.folder import BUSY, DONE, Entry, Folder, ShareLost
from wavecomb.farm.leases import Beat, living, look_s, take_back
from wavecomb.farm.machine_class import refusal
from wavecomb.farm.patience import Patience
from wavecomb.farm.spec import Task
from wavecomb.farm.sweeping import sweep

IDLE_S = 0.25
"""Between two looks for work, where there is none."""
GRACE_S = 30.0
"""For a child that is asked to stop."""
START_S = 120.0
"""For a child to load the renderer."""
_LOOK_S = 1.0
"""Between two looks whether another did the task at hand."""
_LEAST_PATIENCE_S = 30.0
"""For tasks that are nowhere."""
_MOST_FULL = 6
"""Times one after another that there was no room: 63 seconds in all."""
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
        self._copies = Copies(folder, self.name, self._beat.now)
        self._next_look = 0.0
        self._idle_since: float | None = None
        self._full = 0
        self._patience = Patience(folder, self.name, self._is_stopped, say)
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
            WavecombError: It may not work on this job, or cannot.
        """
        done: Counter[str] = Counter()
        why = "there was nothing left to do"
        try:
            while not self._is_stopped():
                self._keep()
                try:
                    if not self._step(done):
                        break
                    self._patience.calm()
                except OSError as error:
                    self._patience.bear(error)
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

    def _step(self, done: Counter[str]) -> bool:
        """Does a task, if there is one; False: nothing is left to do."""
        entry, copy = self._chooser.next(), False
        if entry is None:
            if self._folder.is_over():
                with contextlib.suppress(OSError):
                    sweep(self._folder)
                return False
            self._check_idle()
            entry, copy = self._copies.next(), True
        if entry is None:
            time.sleep(IDLE_S)
            return True
        self._idle_since = None
        if not copy:
            done[self._do(entry)] += 1
            return True
        self._say(f"{self._folder.spec.title(entry.task)}: begun here, too")
        try:
            done[self._do(entry, copy=True)] += 1
        finally:
            self._copies.end(entry)
        return True

    def _check_idle(self) -> None:
        """Gives back what this worker is said to have; raises WavecombError where all wait in vain.

        A disk that was gone for a while may have kept what was said of a task.
        """
        held = self._folder.entries(BUSY)
        for entry in held:
            if entry.worker == self.name:
                self._folder.give_back(entry)
        if held:
            self._idle_since = None
            return
        now = time.monotonic()
        self._idle_since = now if self._idle_since is None else self._idle_since
        if now - self._idle_since > max(_LEAST_PATIENCE_S, self._folder.spec.lease_s):
            raise WavecombError(
                f"{self.name}: tasks are neither to be done, nor done, nor failed; "
                f"`wavecomb farm resume {self._folder.path}` mends that"
            )

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

    def _do(self, entry: Entry, *, copy: bool = False) -> str:
        """Has the child do a task that was taken; gives "done", "failed" or "given back"."""
        title = self._folder.spec.title(entry.task)
        try:
            child = self._ready_child()
        except ChildDied as error:
            self._crashes += 1
            self._give_back(entry, copy)
            if self._crashes >= _MOST_CRASHES:
                raise WavecombError(f"{self.name}: {error}, {self._crashes} times") from None
            return "given back"
        except BaseException:
            self._give_back(entry, copy)
            raise
        if child is None:
            self._give_back(entry, copy)
            return "given back"
        self._crashes = 0
        if child.problems:
            # This machine lacks a file: others may have it, so that is no try.
            self._give_back(entry, copy)
            raise WavecombError(f"{self.name}: {child.problems[0]}")
        begins = "a copy" if copy else f"try {entry.attempt}"
        self._folder.log(entry.task, f"{begins} begins on {self.name}")
        self._beat.note(task=entry.task.id, title=title)
        try:
            end = self._wait(child, entry, copy)
        except ChildDied as error:
            self._child, why = None, str(error)
            if not copy:
                self._patience.insist(lambda: self._folder.fail(entry, why))
            self._say(f"{title}: {why}")
            return "failed"
        finally:
            self._beat.note(task=None, title=None)
        return self._settle(entry, end, title, copy)

    def _give_back(self, entry: Entry, copy: bool) -> None:
        if not copy:
            self._patience.insist(lambda: self._folder.give_back(entry))

    def _settle(self, entry: Entry, end: Mapping[str, Any], title: str, copy: bool) -> str:
        """Writes down how a task ended."""
        if end["event"] == "done":
            self._full = 0
            result = {**end["result"], "worker": self.name, "try": entry.attempt}
            result["ended"] = time.time()
            finish = self._folder.finish_copy if copy else self._folder.finish
            told = entry.task if copy else entry
            if not self._patience.insist(lambda: finish(told, result)):  # type: ignore[arg-type]
                return "given back"  # another has it, and will come to the same
            self._folder.log(entry.task, f"done in {result['wall_s']:.2f} s")
            self._say(f"{title}: {result['wall_s']:.2f} s")
            return "done"
        if end["event"] == "stopped":
            if not self._is_lost(entry, copy):
                self._folder.log(entry.task, f"stopped on {self.name}; what was done is kept")
            self._give_back(entry, copy)
            return "given back"
        if copy or self._is_lost(entry, copy):
            self._folder.log(entry.task, f"a copy failed on {self.name}: {end['error']}")
            return "given back"
        if end.get("full") or not self._folder.is_there():
            return self._give_back_later(entry, end)
        if end.get("damaged"):
            self._render_again(entry.task)
        final = bool(end.get("final"))
        self._patience.insist(lambda: self._folder.fail(entry, end["error"], is_final=final))
        self._say(f"{title}: {end['error']}")
        return "failed"

    def _is_lost(self, entry: Entry, copy: bool) -> bool:
        """Whether another has a task, or did it."""
        return self._folder.is_done(entry.task) if copy else not self._folder.has(entry)

    def _give_back_later(self, entry: Entry, end: Mapping[str, Any]) -> str:
        """A full disk, or one that is gone, is no fault of a task: it is done when there is room.

        Raises:
            WavecombError: It is full for too long.
        """
        self._folder.log(entry.task, f"given back by {self.name}: {end['error']}")
        self._give_back(entry, copy=False)
        if not end.get("full"):
            return "given back"
        self._full += 1
        if self._full > _MOST_FULL:
            raise WavecombError(f"{self.name}: {end['error']}")
        self._say(f"{end['error']}; waiting for room")
        until = time.monotonic() + 2.0 ** (self._full - 1)
        while time.monotonic() < until and not self._is_stopped():
            self._keep()
            time.sleep(IDLE_S)
        return "given back"

    def _render_again(self, task: Task) -> None:
        """Puts tiles back whose files are not there or damaged."""
        from wavecomb.farm.checking import damaged_tiles

        for tile in damaged_tiles(self._folder, task.picture):
            self._folder.put_back(DONE, tile)

    def _ready_child(self) -> Child | None:
        """A child that waits for a task; None: it is to stop."""
        if self._child is not None:
            return self._child
        child = Child(self._folder, self._threads, self.name, self._log, self._folder.spec.isa)
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
        """Whether the child is ready.

        Raises:
            ShareLost: It did not see the job.
            WavecombError: It may not work.
        """
        if event["event"] == "refused" and event["lost"]:
            raise ShareLost(event["error"])
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

    def _wait(self, child: Child, entry: Entry, copy: bool) -> dict[str, Any]:
        """The event that ends a task. Raises ChildDied."""
        child.begin(entry.task.id, copy=copy)
        asked: float | None = None
        look = time.monotonic() + _LOOK_S
        while True:
            self._keep()
            if asked is None and time.monotonic() > look:
                look = time.monotonic() + _LOOK_S
                if self._is_lost(entry, copy):
                    child.drop()
                    asked = time.monotonic()
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
