# SPDX-License-Identifier: Apache-2.0
"""The renderer's process, as its worker sees it (``child`` is what runs in it)."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Mapping
from typing import IO, Any

from wavecomb import processes
from wavecomb.farm.folder import Folder

_DIE_S = 10.0


class ChildDied(Exception):
    """The child is no more, or was ended since it was silent."""


class Child:
    """The process that renders.

    Attributes:
        facts: Its machine's class.
        problems: Files that are not here, or are others.
    """

    def __init__(
        self, folder: Folder, threads: int, worker: str, log: IO[bytes], isa: str | None
    ) -> None:
        environment = dict(os.environ)
        if isa is not None:
            environment["WAVECOMB_ISA"] = isa
        self._process = processes.start(
            "wavecomb.farm.child",
            str(folder.path),
            str(threads),
            worker,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            env=environment,
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        os.set_blocking(self._out.fileno(), False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._out, selectors.EVENT_READ)
        self._rest = b""
        self._heard = time.monotonic()
        self._number = 0
        self.facts: dict[str, Any] = {}
        self.problems: list[str] = []

    @property
    def silent_s(self) -> float:
        """Since it last said something."""
        return time.monotonic() - self._heard

    def begin(self, task: str, *, copy: bool) -> None:
        """Has it do a task. Raises ChildDied."""
        self._number += 1
        self._heard = time.monotonic()
        self._tell({"task": task, "copy": copy, "number": self._number})

    def drop(self) -> None:
        """Has it end its task, of which nothing is to be kept. Raises ChildDied."""
        self._tell({"drop": self._number})

    def _tell(self, value: Mapping[str, Any]) -> None:
        try:
            self._in.write(json.dumps(dict(value)).encode() + b"\n")
            self._in.flush()
        except OSError:
            raise ChildDied(self.obituary()) from None

    def events(self, wait_s: float) -> list[dict[str, Any]]:
        """What it said meanwhile. Raises ChildDied where it ended."""
        if not self._selector.select(wait_s):
            return []
        found = self._out.read() or b""
        if not found:
            raise ChildDied(self.obituary())
        self._heard = time.monotonic()
        *lines, self._rest = (self._rest + found).split(b"\n")
        return [json.loads(line) for line in lines]

    def stop(self) -> None:
        """Asks it to end its task early."""
        with contextlib.suppress(OSError):
            self._process.send_signal(signal.SIGTERM)

    def obituary(self) -> str:
        """Why it ended; ends it if it did not."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        code = self._process.poll()
        self.end()
        if code is None:
            return "the renderer closed its channel"
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"the renderer was killed by {signal.Signals(-code).name}"
        return f"the renderer ended with code {code}"

    def end(self) -> None:
        """Kills it."""
        if self._process.poll() is None:
            self._process.kill()
            # One that hangs in the kernel, on a share that is gone, dies when that lets it.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_DIE_S)
        self._selector.close()
        with contextlib.suppress(OSError):
            self._in.close()
        self._out.close()
