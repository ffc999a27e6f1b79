# SPDX-License-Identifier: Apache-2.0
"""Callbacks during a render, for progress, checkpoints, previews and stop requests."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from wavecomb._core import Snapshot
    from wavecomb.image.files.image import Transfer

Status = Mapping[str, Any]
"""State of a render. The keys are those of ``Snapshot.status`` in _core.pyi."""


class Sink:
    """Base class of files that are written at intervals during a render and at its end.

    An error while writing a file does not stop the render. The error is reported, and writing is
    tried again later.
    """

    def __init__(self, path: str | os.PathLike[str], every: float) -> None:
        self.path = os.fspath(path)
        self.every = every
        self.written = 0
        self._next = time.monotonic() + every

    def is_due(self) -> bool:
        """Returns whether the interval since the last writing has passed."""
        return time.monotonic() >= self._next

    def take(self, snapshot: Snapshot) -> str | None:
        """Writes the file. Returns a warning if the file cannot be written."""
        self._next = time.monotonic() + self.every
        try:
            self.write(snapshot)
        except OSError as error:
            return f"{error.strerror or error}" if error.filename else str(error)
        self.written += 1
        return None

    def write(self, snapshot: Snapshot) -> None:
        """Writes the file. Raises OSError if the file cannot be written."""
        raise NotImplementedError


class CheckpointSink(Sink):
    """Sink that writes checkpoints. ``seconds`` is the render time before this run."""

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
        """Writes the complete state of the render to the checkpoint."""
        from wavecomb.run.checkpoint import save_checkpoint

        seconds = self._seconds + snapshot.status["seconds"]
        save_checkpoint(self.path, {**self._header, "seconds": seconds}, snapshot.state())


class PreviewSink(Sink):
    """Sink that writes the current image as a preview."""

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
        self._next = 0.0  # The first preview is due with the first samples.
        self._exposure = exposure
        self._tone_map = tone_map
        self._working = working_space

    def write(self, snapshot: Snapshot) -> None:
        """Writes the beauty as PNG, or as linear uncompressed EXR.

        The file's extension decides which.
        """
        from wavecomb.image.files.exr import write_exr
        from wavecomb.image.files.image import write_png
        from wavecomb.image.working_space import to_rec709

        if os.fspath(self.path).lower().endswith(".exr"):
            write_exr(self.path, {"beauty": snapshot.beauty()}, compression="none")
            return
        shown = to_rec709(snapshot.beauty(), self._working)
        write_png(self.path, shown, exposure=self._exposure, tone_map=self._tone_map)


class Reporter(Protocol):
    """Interface of an object that shows the progress of a render."""

    def show(self, status: Status) -> None:
        """Shows the progress. The render calls this method about ten times per second."""

    def wrote(self, path: str) -> None:
        """Reports that a checkpoint or a preview was written."""


class Watcher:
    """Callbacks that ``_core.render`` calls during a render.

    Args:
        sinks: Files that are written during the render when they are due, and at its end.
        reporter: Shows progress.
        is_stopped: Function that returns whether a stop was requested.
        warn: Function that receives each warning once.
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
        """Returns "stop" or "snapshot", or None if the render should continue."""
        if self._reporter is not None:
            self._reporter.show(status)
        if self._is_stopped():
            return "stop"
        if not status["samples_done"]:
            # A pause before the first sample would delay the first preview.
            return None
        return "snapshot" if any(sink.is_due() for sink in self._sinks) else None

    def snapshot(self, snapshot: Snapshot) -> None:
        """Passes a snapshot of the paused render to all sinks whose interval has passed."""
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
