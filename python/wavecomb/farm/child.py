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

from wavecomb.run.parents import end_with_parent

_SHOW_S = 0.5


def main(words: list[str]) -> None:
    """``words``: the job's folder, and threads (0: as the job says)."""
    end_with_parent()
    channel = _take_stdout()
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda number, frame: stop.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tasks: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    from wavecomb.errors import WavecombError
    from wavecomb.run.faults import describe

    try:
        worker = _Worker(words[0], int(words[1]), channel, stop)
    except WavecombError as error:
        channel.send("refused", error=describe(error))
        return
    while True:
        worker.do(json.loads(tasks.get()))


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


def _listen(tasks: queue.Queue[str]) -> None:
    for line in sys.stdin:
        tasks.put(line)
    os._exit(3)


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

    def __init__(self, path: str, threads: int, channel: Channel, stop: threading.Event) -> None:
        from wavecomb.farm.assets import differences
        from wavecomb.farm.folder import Folder
        from wavecomb.farm.machine_class import machine_class
        from wavecomb.farm.rendering import Renderer

        folder = Folder(path)
        self._channel, self._stop, self._folder = channel, stop, folder
        with contextlib.suppress(OSError):
            os.chdir(folder.spec.folder)
        shown = _Shown(channel)
        self._renderer = Renderer(
            folder,
            threads=threads,
            reporter=shown,
            loading=shown.loading,
            is_stopped=stop.is_set,
            log=lambda line: channel.send("said", line=line),
        )
        channel.send("class", **machine_class())
        others = differences(folder.assets(), folder.spec.folder) if folder.spec.strict else []
        channel.send("ready", problems=others)

    def do(self, told: Mapping[str, Any]) -> None:
        """A task. Every end is told; of a crash the worker hears by itself."""
        from wavecomb.farm.part import DamagedPart
        from wavecomb.farm.rendering import Absent, Stopped
        from wavecomb.farm.spec import Task
        from wavecomb.run.faults import describe

        started = time.perf_counter()
        try:
            result = self._renderer.do(Task.of(told["task"]))
        except Stopped:
            self._channel.send("stopped")
        except DamagedPart as error:
            self._channel.send("failed", error=describe(error), damaged=True)
        except Exception as error:
            if os.environ.get("WAVECOMB_DEBUG"):
                import traceback

                traceback.print_exc()
            self._channel.send("failed", error=describe(error), final=isinstance(error, Absent))
        else:
            self._channel.send("done", result={**result, "wall_s": time.perf_counter() - started})


if __name__ == "__main__":
    main(sys.argv[1:])
