# SPDX-License-Identifier: Apache-2.0
"""Callbacks during a render: progress, checkpoints, previews, stop requests."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from wavecomb._core import Snapshot
    from wavecomb.image.files.image import Transfer

Status = Mapping[str, Any]
"""State of a render; the keys are those of ``Snapshot.status`` in _core.pyi."""


class Sink:
    """Base of outputs that are written at intervals and at the end of a render.

    An error while writing does not stop the render; it is reported, and writing is tried again.
    """

    def __init__(self, path: str | os.PathLike[str], every: float) -> None:
        self.path = os.fspath(path)
        self.every = every
        self.written = 0
        self._next = time.monotonic() + every

    def is_due(self) -> bool:
        """Returns whether the interval has passed."""
        return time.monotonic() >= self._next

    def take(self, snapshot: Snapshot) -> str | None:
        """Writes the file; returns a warning if that fails."""
        self._next = time.monotonic() + self.every
        try:
            self.write(snapshot)
        except OSError as error:
            return f"{error.strerror or error}" if error.filename else str(error)
        self.written += 1
        return None

    def write(self, snapshot: Snapshot) -> None:
        """Writes the file; raises OSError."""
        raise NotImplementedError


class CheckpointSink(Sink):
    """Sink that saves checkpoints; ``seconds`` is the render time of earlier runs."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        every: float,
        header: Mapping[str, Any],
        seconds: float = 0.0,
    ) -> None:
        super().__init__(path, every)
        self._header = header
        self._seconds = seconds

    def write(self, snapshot: Snapshot) -> None:
        """Writes the complete state of the render."""
        from wavecomb.run.checkpoint import save_checkpoint

        seconds = self._seconds + snapshot.status["seconds"]
        save_checkpoint(self.path, {**self._header, "seconds": seconds}, snapshot.state())


class PreviewSink(Sink):
    """Sink that saves the current image for display."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        every: float,
        *,
        exposure: float = 0.0,
        tone_map: Transfer = "clamp",
        working_space: str = "rec709",
    ) -> None:
        super().__init__(path, every)
        self._exposure = exposure
        self._tone_map = tone_map
        self._working = working_space

    def write(self, snapshot: Snapshot) -> None:
        """Writes the beauty: as PNG, or linear and uncompressed as EXR, by the file's name."""
        from wavecomb.image.files.exr import write_exr
        from wavecomb.image.files.image import write_png
        from wavecomb.image.working_space import to_rec709

        if os.fspath(self.path).lower().endswith(".exr"):
            write_exr(self.path, {"beauty": snapshot.beauty()}, compression="none")
            return
        shown = to_rec709(snapshot.beauty(), self._working)
        write_png(self.path, shown, exposure=self._exposure, tone_map=self._tone_map)


class Reporter(Protocol):
    """Interface that shows the progress of a render."""

    def show(self, status: Status) -> None:
        """Shows the progress; called about ten times per second."""

    def wrote(self, path: str) -> None:
        """Reports that a checkpoint or preview was written."""


class Watcher:
    """Callbacks that ``_core.render`` calls during a render.

    Args:
        sinks: Outputs that receive snapshots when they are due, and the last snapshot.
        reporter: Shows progress.
        is_stopped: Returns whether a stop was requested.
        warn: Receives each warning once.
    """

    def __init__(
        self,
        sinks: Sequence[Sink] = (),
        *,
        reporter: Reporter | None = None,
        is_stopped: Callable[[], bool] = lambda: False,
        warn: Callable[[str], None] = lambda line: None,
    ) -> None:
        self._sinks = sinks
        self._reporter = reporter
        self._is_stopped = is_stopped
        self._warn = warn
        self._warned: set[str] = set()

    def progress(self, status: Status) -> str | None:
        """Returns "stop", "snapshot" or None for the render to continue."""
        if self._reporter is not None:
            self._reporter.show(status)
        if self._is_stopped():
            return "stop"
        return "snapshot" if any(sink.is_due() for sink in self._sinks) else None

    def snapshot(self, snapshot: Snapshot) -> None:
        """Passes a snapshot of the paused render to all sinks that are due."""
        for sink in self._sinks:
            if not (snapshot.finished or sink.is_due()):
                continue
            if not snapshot.status["samples_done"]:
                # Do not write an image if the render was stopped before its first sample.
                continue
            warning = sink.take(snapshot)
            if warning is None:
                if self._reporter is not None:
                    self._reporter.wrote(sink.path)
            elif warning not in self._warned:
                self._warned.add(warning)
                self._warn(warning)
