# SPDX-License-Identifier: Apache-2.0
"""The process of a worker that renders: it is told tasks, and tells how they go.

Both ways lines of JSON: tasks on stdin, events on what was stdout. Whatever libraries print goes to
stderr, which is the worker's log. It ends with its parent: the kernel sees to that, and the end of
stdin.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

_SHOW_S = 0.5


def main(words: list[str]) -> None:
    """``words``: the job's folder, threads (0: as the job says), and the worker's name."""
    channel = _take_stdout()
    told = _Told()
    signal.signal(signal.SIGTERM, lambda number, frame: told.stop.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=told.listen, daemon=True).start()
    from wavecomb.errors import WavecombError
    from wavecomb.run.faults import describe

    try:
        worker = _Worker(words[0], int(words[1]), channel, told)
    except (OSError, WavecombError) as error:
        lost = not os.path.exists(os.path.join(words[0], "job.json"))
        channel.send("refused", error=describe(error), lost=lost)
        os._exit(2)  # the other thread holds the lock of stdin, which Python would wait for
    while True:
        worker.do(told.next())


class Channel:
    """To the worker."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def send(self, event: str, **values: Any) -> None:
        """A line. Where nobody reads it any more, this process has nothing to live for."""
        line = (json.dumps({"event": event, **values}) + "\n").encode()
        try:
            while line:
                line = line[os.write(self._descriptor, line) :]
        except OSError:
            os._exit(3)


def _take_stdout() -> Channel:
    sys.stdout.flush()
    channel = Channel(os.dup(1))
    os.dup2(2, 1)
    return channel


class _Told:
    """What the worker wants.

    Attributes:
        stop: Set when the task is to end, with a checkpoint.
    """

    def __init__(self) -> None:
        self.stop = threading.Event()
        self._tasks: queue.Queue[dict[str, Any]] = queue.Queue()
        self._number = 0
        self._dropped = -1

    def listen(self) -> None:
        """Reads on; this process ends with the worker, and so with what it says."""
        for line in sys.stdin:
            told = json.loads(line)
            if "drop" in told:
                self._dropped = int(told["drop"])
            else:
                self._tasks.put(told)
        os._exit(3)

    def next(self) -> dict[str, Any]:
        """A task; waits for it."""
        told = self._tasks.get()
        self._number = int(told["number"])
        return told

    def is_dropped(self) -> bool:
        """Whether another did the task."""
        return self._dropped == self._number

    def is_stopped(self) -> bool:
        """Whether the task is to end."""
        return self.stop.is_set() or self.is_dropped()


class _Shown:
    """Tells the worker how far a render is, now and then."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._next = 0.0

    def show(self, status: Mapping[str, Any]) -> None:
        if self._is_due():
            keys = ("samples_done", "samples_total", "seconds")
            self._channel.send("progress", **{key: status[key] for key in keys})

    def wrote(self, path: str) -> None:
        self._channel.send("wrote", file=path)

    def loading(self, done: int, found: int) -> None:
        if self._is_due():
            self._channel.send("loading", prims=done, found=found)

    def _is_due(self) -> bool:
        if time.monotonic() < self._next:
            return False
        self._next = time.monotonic() + _SHOW_S
        return True


class _Worker:
    """Does what it is told."""

    def __init__(self, path: str, threads: int, channel: Channel, told: _Told) -> None:
        from wavecomb.farm.at_hand import files_at_hand
        from wavecomb.farm.folder import Folder
        from wavecomb.farm.machine_class import machine_class
        from wavecomb.farm.rendering import Renderer

        folder = Folder(path)
        self._channel, self._folder = channel, folder
        with contextlib.suppress(OSError):
            os.chdir(folder.spec.place(folder.spec.folder))
        shown = _Shown(channel)
        self._renderer = Renderer(
            folder,
            threads=threads,
            reporter=shown,
            loading=shown.loading,
            is_stopped=told.is_stopped,
            is_dropped=told.is_dropped,
            log=lambda line: channel.send("said", line=line),
        )
        channel.send("class", **machine_class())
        channel.send("ready", problems=files_at_hand(folder))

    def do(self, told: Mapping[str, Any]) -> None:
        """A task. Every end is told; of a crash the worker hears by itself."""
        from wavecomb.farm.files import is_full
        from wavecomb.farm.part import DamagedPart
        from wavecomb.farm.rendering import Absent, Stopped
        from wavecomb.farm.spec import Task
        from wavecomb.run.faults import describe

        started = time.perf_counter()
        try:
            result = self._renderer.do(Task.of(told["task"]), copy=bool(told.get("copy")))
        except Stopped:
            self._channel.send("stopped")
        except DamagedPart as error:
            self._channel.send("failed", error=describe(error), damaged=True)
        except Exception as error:
            if os.environ.get("WAVECOMB_DEBUG"):
                import traceback

                traceback.print_exc()
            self._channel.send(
                "failed", error=describe(error), final=isinstance(error, Absent),
                full=is_full(error, self._places(told["task"])),
            )  # fmt: skip
        else:
            self._channel.send("done", result={**result, "wall_s": time.perf_counter() - started})

    def _places(self, task: str) -> list[str]:
        """Folders that a task writes to."""
        spec = self._folder.spec
        names = spec.names(int(task.partition(".")[0])).values()
        return [str(self._folder.path), *(os.path.dirname(spec.place(name)) for name in names)]


if __name__ == "__main__":
    main(sys.argv[1:])
