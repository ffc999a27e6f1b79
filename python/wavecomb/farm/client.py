# SPDX-License-Identifier: Apache-2.0
"""Submits the unfinished tasks of a job to Dask and follows them to the end."""

from __future__ import annotations

import contextlib
import queue
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.assembly import Outcome, is_finished, machine_of
from wavecomb.farm.batches import Batch, batch_size
from wavecomb.farm.clusters import Cluster, ClusterSpec, Workers, connected
from wavecomb.farm.folder import Folder
from wavecomb.farm.job import Task, hashed
from wavecomb.farm.tile_file import has_tile
from wavecomb.farm.tiling import has_pilots

_TURN_S = 0.2
_RETRY_S = 5.0
"""Interval, in seconds, at which tasks that wait for a worker are rescheduled."""
_NOBODY_S = 60.0
"""Time to wait for new workers when all workers have ended, in seconds."""
_ASSEMBLY_PRIORITY = 1


class Run:
    """One run of a farm job: submits tasks to Dask and receives their results."""

    def __init__(
        self,
        folder: Folder,
        cluster: Cluster,
        outcome: Outcome,
        *,
        show: Callable[[Outcome], None],
        warn: Callable[[str], None],
        is_stopped: Callable[[], bool],
    ) -> None:
        """Creates a run; the arguments are those of ``run``."""
        self._folder, self._job, self._cluster = folder, folder.job, cluster
        self._out = outcome
        self._show, self._warn, self._is_stopped = show, warn, is_stopped
        self._machine = ""
        self._ready: deque[Batch] = deque()
        self._tiles: deque[Task] = deque()
        self._missing: dict[int, set[int]] = {}
        self._unplanned: dict[int, list[Task]] = {}
        self._checks: dict[int, int] = {}
        self._flying: dict[Any, Batch] = {}
        self._ended: queue.SimpleQueue[tuple[Any, dict[str, Any] | None]] = queue.SimpleQueue()
        self._attempts = 0
        self._seconds = 0.0
        self._warned: set[str] = set()
        self._workers = Workers(cluster)
        self._progressed = False
        self._alone_since: float | None = None
        self._next_retry = 0.0
        self._full = ""
        self._common = (str(folder.path), [list(pair) for pair in self._job.maps], self._job.id)

    # ---- begin -----------------------------------------------------------------------------------

    def work(self, images: list[int]) -> None:
        """Renders the missing tiles of the given images and writes the images."""
        from wavecomb.farm.rendering import error_checks_for
        from wavecomb.farm.tasks import FarmPlugin, restart_stale

        self._cluster.client.register_plugin(FarmPlugin(self._job.isa, self._job.hang_s))
        if not self._wait_for_workers():
            return
        self._machine = self._choose_machine(images)
        restart_stale(self._cluster.client, self._cluster.what, self._job)
        for image in images:
            shot, tiles = self._job.shot(image), self._job.rectangles(image)
            self._checks[image] = error_checks_for(shot) if len(tiles) > 1 else 0
            missing = {
                task.tile
                for task, tile in zip(self._job.tasks_of(image), tiles, strict=True)
                if not has_tile(
                    self._folder.part(task), self._job.tile_key(task, self._machine), tile,
                    self._checks[image],
                )
            }  # fmt: skip
            self._missing[image] = missing
            self._out.tasks_done += len(tiles) - len(missing)
            wanted = [Task(image, tile) for tile in sorted(missing)]
            if len(wanted) > 1 and self._job.learned is None and has_pilots(shot.settings):
                self._unplanned[image] = wanted
                self._ready.append(Batch([], image, is_plan=True))
            else:
                self._tiles.extend(wanted)
            if not missing:
                self._ready.append(Batch([], image))
        self._loop()

    def _wait_for_workers(self) -> bool:
        """Waits until a worker has announced its machine class.

        Returns False if the user stops the run.
        """
        limit = self._cluster.wait_s
        until = None if limit is None else time.monotonic() + limit
        while not self._capacity():
            if self._is_stopped():
                return False
            if until is not None and time.monotonic() > until:
                raise WavecombError(f"{self._cluster.what}: no workers came in {limit:.0f} s")
            self._cluster.check(False)
            self._workers.query(0.0)
            time.sleep(_TURN_S)
        return True

    def _capacity(self) -> int:
        """Returns the number of workers that may work on the job."""
        return self._workers.count(self._machine)

    def _choose_machine(self, images: list[int]) -> str:
        """Chooses the machine class with the most finished tiles, or else the most workers."""
        # Wait until all workers that were started at the same time have registered with the
        # scheduler.
        time.sleep(_TURN_S if self._cluster.wait_s else 0.0)
        self._workers.query(0.0)
        found = self._workers.classes()
        parts = dict.fromkeys(found, 0)
        if len(found) > 1:
            for image in images:
                for task in self._job.tasks_of(image):
                    machine = machine_of(self._folder, task)
                    if machine in parts:
                        parts[machine] += 1
        best = max(found, key=lambda name: (parts[name], found[name], name))
        self._out.others = sum(found.values()) - found[best]
        if self._out.others:
            self._warn(
                f"{self._out.others} workers are of another class of machines than {best}, so "
                "their pixels would differ in the last bits; they are not used"
            )
        return best

    # ---- loop ------------------------------------------------------------------------------------

    def _loop(self) -> None:
        client = self._cluster.client
        while self._flying or self._tiles or self._ready:
            if self._is_stopped():
                self._out.stopped = True
                client.cancel(list(self._flying), reason="wavecomb farm was stopped")
                return
            self._workers.query()
            while len(self._flying) < self._capacity() and self._submit():
                pass
            try:
                self._take(*self._ended.get(timeout=_TURN_S))
            except queue.Empty:
                self._check()
            self._show(self._out)

    def _check(self) -> None:
        self._cluster.check(self._progressed)
        self._progressed = False
        if self._capacity():
            self._alone_since = None
            self._retry_waiting()
            return
        if self._full:
            raise WavecombError(self._full)
        now = time.monotonic()
        self._alone_since = self._alone_since or now
        if self._cluster.wait_s is not None and now - self._alone_since > _NOBODY_S:
            raise WavecombError(f"{self._cluster.what}: all workers are gone")

    def _retry_waiting(self) -> None:
        """Makes the scheduler reschedule tasks for which it found no suitable worker.

        Dask itself reschedules such tasks only when a worker joins. When a worker joins, it still
        lacks the required resource, because it announces its machine class a little later.
        """
        from wavecomb.farm.tasks import retry_unrunnable

        if self._flying and time.monotonic() > self._next_retry:
            self._next_retry = time.monotonic() + _RETRY_S
            self._cluster.client.run_on_scheduler(retry_unrunnable)

    def _submit(self) -> bool:
        """Submits the next batch; returns False if no batch is left."""
        if self._ready:
            batch = self._ready.popleft()
        elif self._tiles:
            waiting = len(self._tiles)
            count = min(batch_size(self._seconds, waiting, self._capacity()), waiting)
            batch = Batch([self._tiles.popleft() for _ in range(count)])
        else:
            return False
        work, kind, what = batch.work(self._checks)
        # Two clients of a Dask scheduler must use the same key for the same work.
        name = hashed([self._common[0], self._job.id, self._machine, what if batch.tiles else [],
                       batch.image, batch.attempt, self._checks.get(batch.image)])  # fmt: skip
        future = self._cluster.client.submit(
            work, *self._common, self._machine, what, key=f"wavecomb-{kind}-{name[:32]}",
            resources={self._machine: 1}, retries=self._job.tries - 1, pure=False,
            priority=0 if batch.tiles else _ASSEMBLY_PRIORITY,
        )  # fmt: skip
        self._flying[future] = batch
        future.add_done_callback(self._fetch)
        return True

    def _again(self, tiles: list[Task]) -> None:
        """Queues tiles to be rendered again, one per batch, before all others."""
        self._attempts += 1
        self._ready.extendleft(Batch([task], attempt=self._attempts) for task in reversed(tiles))

    def _take(self, future: Any, result: dict[str, Any] | None) -> None:
        """Handles the result or the failure of a batch."""
        batch = self._flying.pop(future, None)
        if batch is None:
            return
        if result is not None:
            if result["full"]:
                self._leave_out(result["worker"], result["full"])
            if batch.tiles:
                self._take_tiles(batch, result)
            elif batch.is_plan:
                self._take_plan(batch, result)
            else:
                self._take_image(batch.image, result)
        elif future.status == "error":
            self._take_error(batch, future.exception())
        # The task was lost or cancelled by another client, or its worker ended before sending the
        # result.
        else:
            self._cluster.client.cancel([future])
            self._cluster.check(False)
            self._put_back(batch)

    def _fetch(self, future: Any) -> None:
        """Fetches the result of a finished task, on a thread of Dask.

        Workers hold results until the client requests them. If a worker ends before that, Dask
        computes the task again, perhaps on a worker that a later ``Cluster.check`` will start. For
        this reason only this thread may wait for results.
        """
        result = None
        if future.status == "finished":
            with contextlib.suppress(Exception):  # `_take` reports the error of a failed task
                result = future.result()
        self._ended.put((future, result))

    def _warn_once(self, lines: list[str]) -> None:
        for line in lines:
            if line not in self._warned:
                self._warned.add(line)
                self._warn(line)

    def _take_plan(self, batch: Batch, result: dict[str, Any]) -> None:
        self._warn_once(result["warnings"])
        if result["full"]:
            self._put_back(batch)
        else:
            self._tiles.extend(self._unplanned.pop(batch.image))

    def _take_tiles(self, batch: Batch, result: dict[str, Any]) -> None:
        self._warn_once(result["warnings"])
        done = [Task(image, tile) for image, tile in result["done"]]
        for task in done:
            self._note_done(task)
        bad = {(image, tile): line for image, tile, line in result["failed"]}
        for (image, tile), line in bad.items():
            self._out.failed.append((self._job.title(image, tile), line))
        self._again([t for t in batch.tiles if t not in done and (t.image, t.tile) not in bad])
        if done:
            # Estimate the time of a tile from the last batch, because the times of the first
            # batches include opening the stage.
            self._seconds = result["seconds"] / len(done)

    def _note_done(self, task: Task) -> None:
        missing = self._missing[task.image]
        if task.tile not in missing:
            return
        missing.discard(task.tile)
        self._progressed = True
        self._out.tasks_done += 1
        if not missing:
            self._ready.append(Batch([], task.image, self._attempts))

    def _take_image(self, image: int, result: dict[str, Any]) -> None:
        if result["full"]:
            self._put_back(Batch([], image))
            return
        if not result["again"]:
            self._out.images_done += 1
            self._progressed = True
            return
        self._checks[image] = max(result["checks"], self._checks[image])
        self._missing[image] |= set(result["again"])
        self._out.tasks_done -= len(result["again"])
        self._again([Task(image, tile) for tile in result["again"]])

    def _take_error(self, batch: Batch, error: BaseException | None) -> None:
        from distributed import KilledWorker

        if isinstance(error, KilledWorker):
            line = f"its worker ended {self._job.tries} times: a crash, or too little memory"
        else:
            line = " ".join(str(error).split()) or type(error).__name__
        if batch.is_plan:  # render the tiles without a plan; failing tiles report the error
            self._tiles.extend(self._unplanned.pop(batch.image))
        elif len(batch.tiles) > 1:  # retry each tile of the batch alone, since most may succeed
            self._again(batch.tiles)
        elif batch.tiles:
            one = batch.tiles[0]
            self._out.failed.append((self._job.title(one.image, one.tile), line))
        else:
            self._out.failed.append((self._job.title(batch.image), line))

    def _put_back(self, batch: Batch) -> None:
        if batch.tiles:
            self._again(batch.tiles)
        else:
            self._attempts += 1
            again = Batch([], batch.image, self._attempts, batch.is_plan)
            self._ready.appendleft(again)

    def _leave_out(self, worker: str, why: str) -> None:
        """Withdraws queued tasks from a worker whose disk is full."""
        self._full = why
        self._workers.expire()
        client = self._cluster.client
        held = set(client.processing(workers=[worker]).get(worker, ()))
        for future in [one for one in self._flying if one.key in held]:
            batch = self._flying.pop(future)
            client.cancel([future])
            self._put_back(batch)


def run(
    folder: Folder,
    where: ClusterSpec,
    *,
    threads: int = 0,
    dashboard: int | None = None,
    show: Callable[[Outcome], None] = lambda outcome: None,
    warn: Callable[[str], None] = lambda line: None,
    say: Callable[[str], None] = lambda line: None,
    is_stopped: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Runs a job until all tasks are done or have failed, or the user stops it.

    Renders only tiles whose file is missing, damaged or made with other inputs.

    Args:
        folder: Folder of the job.
        where: The cluster.
        threads: Threads of each local worker; 0 uses the job's value, else an equal share of the
            cores.
        dashboard: Port of Dask's dashboard; None starts no dashboard.
        show: Called with the progress of the job.
        warn: Called once with each distinct warning about the stage.
        say: Function that is called with the address of the dashboard.
        is_stopped: Returns whether to stop the run. Finished tiles are kept.

    Raises:
        WavecombError: The settings are invalid, no workers connected, or all workers have ended.
    """
    from wavecomb import _core

    job = folder.job
    for shot in job.shots:
        _core.Settings(**shot.settings).check()
    outcome = Outcome(job.task_count(), len(job.images))
    left = []
    for image in range(len(job.images)):
        if is_finished(folder, image):
            outcome.images_done += 1
            outcome.tasks_done += job.tile_count(image)
        else:
            left.append(image)
    if not left:
        return outcome
    wanted = threads or int(job.shots[0].settings.get("threads") or 0)
    with connected(
        where, folder.path, threads=wanted, tries=job.tries, hang_s=job.hang_s,
        dashboard=dashboard,
    ) as cluster:  # fmt: skip
        if dashboard is not None:
            say(f"dashboard {cluster.client.dashboard_link}")
        at_work = Run(folder, cluster, outcome, show=show, warn=warn, is_stopped=is_stopped)
        try:
            at_work.work(left)
        except (OSError, RuntimeError, TimeoutError) as error:
            cluster.check(False)  # `check` raises an error that states if the scheduler has ended
            raise WavecombError(f"{cluster.what}: {' '.join(str(error).split())}") from error
        outcome.stopped = outcome.stopped or is_stopped()
    return outcome
