# SPDX-License-Identifier: Apache-2.0
"""Functions that Dask workers run: rendering tiles and joining images.

A worker keeps the stage loaded between tasks. Dask sends these functions by name; their arguments
and results are plain values. A worker has one unit of the resource ``machine_class()``, and each
task needs it, so tasks run one at a time.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker
from distributed.utils import sync

from wavecomb.errors import WavecombError
from wavecomb.path_maps import VARIABLE, Pair, here, mapped, use_maps

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_MIN_FREE = 1 << 16
"""A disk with fewer free bytes counts as full, because libraries do not report why a write
failed."""
_LOOK_S = 1.0
_own_maps = os.environ.get(VARIABLE)
_kept: Any = None
"""Id, ``Renderer`` and folder of the last job of this process, kept for its next task."""
_current: Any = None
"""Dask worker and key of the current task, which any thread of this process may read."""
_read: dict[str, str] = {}
"""SHA-256 of each stage file that this process has read and that USD may have cached."""


class Progress:
    """Time of the last progress in this process, which the watchdog reads."""

    def __init__(self) -> None:
        self.at = time.monotonic()
        self.is_busy = False

    def note(self, *values: object) -> None:
        """Records that the current task made progress."""
        self.at = time.monotonic()

    def show(self, status: object) -> None:
        """Records progress of a render (method of ``Reporter``)."""
        self.note()

    def wrote(self, path: str) -> None:
        """Does nothing, because tiles have no intermediate files (method of ``Reporter``)."""

    def __enter__(self) -> Progress:
        self.note()
        self.is_busy = True
        return self

    def __exit__(self, *error: object) -> None:
        self.is_busy = False


progress = Progress()


class FarmPlugin(WorkerPlugin):
    """Dask plugin that announces a worker's machine class.

    The plugin also restarts the worker if a render hangs.
    """

    name = "wavecomb-farm"

    def __init__(self, isa: str | None, hang_s: float) -> None:
        """Creates the plugin. The arguments are the fields ``isa`` and ``hang_s`` of ``Job``."""
        self._isa = isa
        self._hang_s = hang_s
        self._ended = threading.Event()

    def __getstate__(self) -> dict[str, Any]:
        return {"_isa": self._isa, "_hang_s": self._hang_s}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["_isa"], state["_hang_s"])  # type: ignore[misc]

    async def setup(self, worker: Any) -> None:
        """Renders the probe image and announces the resource."""
        from wavecomb.isa import VARIABLE as ISA

        if self._isa is not None and "wavecomb._core" not in sys.modules:
            os.environ[ISA] = self._isa
        from wavecomb.farm.machine_class import machine_class

        await worker.set_resources(**{machine_class(): 1})
        threading.Thread(target=self._watch, daemon=True).start()

    def teardown(self, worker: Any) -> None:
        """Ends the watchdog."""
        self._ended.set()

    def _watch(self) -> None:
        while not self._ended.wait(_LOOK_S):
            if progress.is_busy and time.monotonic() - progress.at > self._hang_s:
                # Dask's nanny process starts a new worker, and the scheduler assigns the task again
                os._exit(1)


def retry_unrunnable(dask_scheduler: Any) -> None:
    """Makes a scheduler reschedule tasks for which it found no suitable worker.

    Args:
        dask_scheduler: The scheduler. The function runs in the process of the scheduler.
    """
    waiting = {task.key: "waiting" for task in dask_scheduler.unrunnable}
    if waiting:
        dask_scheduler.transitions(waiting, stimulus_id=f"wavecomb-retry-{time.time()}")


def render_tiles(
    folder: str, maps: list[Pair], job: str, machine: str, tiles: list[tuple[int, int, int]]
) -> dict[str, Any]:
    """Renders the given tiles of a job, except tiles that are finished.

    Args:
        folder: Folder of the job, on the client's machine.
        maps: Path maps of the job.
        job: Expected ``Job.id``; a changed job in the folder is an error.
        machine: Machine class of this worker.
        tiles: For each tile, its image index, its tile index and the number of error checks.

    Returns:
        A dictionary with the entries ``done`` (image and tile of each finished tile), ``failed``
            (image, tile and an error line of each tile that cannot be rendered), ``full`` (the
            reason why no file can be written, or ""), ``warnings`` (lines of text), ``seconds``
            (the time taken) and ``worker`` (the address of the worker).
    """
    from wavecomb.farm.job import Task
    from wavecomb.farm.rendering import Stopped
    from wavecomb.farm.tile_file import has_tile

    started = time.monotonic()
    out: dict[str, Any] = {"done": [], "failed": [], "full": "", "warnings": []}
    out["worker"] = _begin()
    with progress:
        renderer, of = _renderer(folder, maps, job)
        for image, number, checks in tiles:
            progress.note()
            if _is_cancelled():
                break
            task = Task(image, number)
            path, key = of.part(task), of.job.tile_key(task, machine)
            tile = of.job.rectangles(image)[number]
            try:
                with _noting_full_disk(out, path, machine):
                    if not has_tile(path, key, tile, checks):
                        renderer.render(task, path, machine, checks, plan=of.plan(image))
                    out["done"].append((image, number))
            except Stopped:
                break
            except WavecombError as error:
                out["failed"].append((image, number, str(error)))
            if out["full"]:
                break
    out["warnings"] = list(renderer.warnings)
    out["seconds"] = time.monotonic() - started
    return out


def plan_image(folder: str, maps: list[Pair], job: str, machine: str, image: int) -> dict[str, Any]:
    """Writes the results of an image's pilot renders; takes the arguments of ``render_tiles``.

    Returns:
        A dictionary with the entries ``full`` (the reason why no file can be written, or ""),
            ``worker`` (the address of the worker) and ``warnings`` (lines of text).
    """
    from wavecomb.farm.rendering import Stopped

    out: dict[str, Any] = {"full": "", "warnings": []}
    out["worker"] = _begin()
    with progress:
        renderer, of = _renderer(folder, maps, job)
        path = of.plan(image)
        with contextlib.suppress(Stopped), _noting_full_disk(out, path, machine):
            renderer.plan(image, path, machine)
    out["warnings"] = list(renderer.warnings)
    return out


def assemble_image(
    folder: str, maps: list[Pair], job: str, machine: str, image: int
) -> dict[str, Any]:
    """Joins the tiles of an image and writes its files; takes the arguments of ``render_tiles``.

    Returns:
        A dictionary with the entries ``again`` (tiles that must be rendered first), ``checks`` (the
            number of error checks that their borders must allow for, or 0), ``full`` (the reason
            why no file can be written, or "") and ``worker`` (the address of the worker).
    """
    from wavecomb.farm.assembly import finish_image

    out: dict[str, Any] = {"again": [], "checks": 0, "full": ""}
    out["worker"] = _begin()
    with progress:
        of = _folder(folder, maps, job)
        path = Path(of.job.place(of.job.names(image)["output"]))
        with _noting_full_disk(out, path, machine):
            out |= finish_image(of, image, machine, get_worker().state.nthreads)
    return out


def has_stale_files(files: Iterable[tuple[str, str]], maps: list[Pair]) -> bool:
    """Returns whether this process read another version of a file, which USD may still cache."""
    return any(_read.get(mapped(path, here(maps)), sha256) != sha256 for path, sha256 in files)


def restart_stale(client: Any, cluster: str, job: Any) -> None:
    """Restarts workers that have read other versions of a job's files.

    Args:
        client: Dask client.
        cluster: Name of the cluster, for messages.
        job: The job.

    Raises:
        WavecombError: A worker that has read other versions cannot be restarted.
    """
    files = [(one.path, one.sha256) for one in job.files]
    maps = [list(pair) for pair in job.maps]
    told = client.run(has_stale_files, files, maps, on_error="return")
    stale = [worker for worker, is_stale in told.items() if is_stale is True]
    if not stale:
        return
    try:
        client.restart_workers(stale)
    except ValueError:
        raise WavecombError(
            f"{cluster}: {stale[0]} holds an older version of the stage and has no nanny that "
            "could restart it: restart that worker"
        ) from None


def is_full(error: OSError, path: Path) -> bool:
    """Returns whether a full disk or an exceeded quota caused an error.

    Args:
        error: The error, with its chain of causes.
        path: File that could not be written.
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.errno in _FULL:
            return True
        cause = cause.__cause__
    try:
        found = os.statvfs(path.parent)
    except OSError:
        return False
    return found.f_bavail * found.f_frsize < _MIN_FREE


@contextlib.contextmanager
def _noting_full_disk(out: dict[str, Any], path: Path, machine: str) -> Iterator[None]:
    """Withdraws the worker if the disk of ``path`` is full, and stores why in ``out["full"]``."""
    try:
        yield
    except OSError as error:
        if not is_full(error, path):
            raise
        out["full"] = str(error)
        _withdraw(machine)


def _begin() -> str:
    """Records the current task and returns the address of this worker."""
    global _current
    worker = get_worker()
    _current = worker, worker.get_current_task()
    return str(worker.address)


def _folder(folder: str, maps: list[Pair], job: str) -> Any:
    from wavecomb.farm.folder import Folder

    os.environ.pop(VARIABLE, None)
    if _own_maps is not None:
        os.environ[VARIABLE] = _own_maps
    use_maps(here(maps))
    found = Folder(mapped(folder, here(maps)))
    if found.job.id != job:
        raise WavecombError(f"{found.path}: the job was changed: `wavecomb farm resume` continues")
    return found


def _renderer(folder: str, maps: list[Pair], job: str) -> Any:
    """Returns the renderer and folder of a job. The last renderer is reused for the same job."""
    global _kept
    if _kept is not None and _kept[0] == job:
        return _kept[1:]
    if _kept is not None:
        _kept[1].close()
        _kept = None
    from wavecomb.api import import_usd
    from wavecomb.farm.rendering import Renderer, check_files

    import_usd()
    of = _folder(folder, maps, job)
    check_files(of.job)
    _read.update({of.job.place(one.path): one.sha256 for one in of.job.files})
    wanted = int(of.job.shots[0].settings.get("threads") or 0)
    renderer = Renderer(
        of.job, threads=wanted or get_worker().state.nthreads, learned=of.learned(),
        reporter=progress, loading=progress.note, is_stopped=_is_cancelled,
    )  # fmt: skip
    _kept = job, renderer, of
    return renderer, of


def _is_cancelled() -> bool:
    """Returns whether the current task was cancelled.

    Dask does not stop threads of cancelled tasks.
    """
    worker, key = _current
    task = worker.state.tasks.get(key)
    return task is None or task.state == "cancelled" or worker.status.name != "running"


def _withdraw(machine: str) -> None:
    """Makes Dask assign no further farm tasks to this worker."""
    worker = get_worker()
    sync(worker.loop, worker.set_resources, **{machine: 0})
