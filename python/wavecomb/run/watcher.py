# SPDX-License-Identifier: Apache-2.0
"""What happens while a render goes on: progress, checkpoints, previews, the wish to stop."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from wavecomb._core import Snapshot
    from wavecomb.picture.image import Transfer

Status = Mapping[str, Any]
"""Where a render stands; the keys of ``Snapshot.status`` in _core.pyi."""


class Sink:
    """Something that is made of a render every so many seconds, and at its end.

    A failure to write is no reason to lose the render: it is reported, and tried again.
    """

    def __init__(self, path: str | os.PathLike[str], every: float) -> None:
        self.path = os.fspath(path)
        self.every = every
        self.written = 0
        self._next = time.monotonic() + every

    def is_due(self) -> bool:
        """Whether its time has come."""
        return time.monotonic() >= self._next

    def take(self, snapshot: Snapshot) -> str | None:
        """Writes the file. Returns a warning where that fails."""
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
    """Saves a checkpoint; ``seconds`` were rendered before this run."""

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
        """All that the render holds."""
        from wavecomb.run.checkpoint import save_checkpoint

        seconds = self._seconds + snapshot.status["seconds"]
        save_checkpoint(self.path, {**self._header, "seconds": seconds}, snapshot.state())


class PreviewSink(Sink):
    """Saves the picture as it is, for display."""

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
        """The beauty as a PNG."""
        from wavecomb.picture.image import write_png
        from wavecomb.picture.working_space import to_rec709

        shown = to_rec709(snapshot.beauty(), self._working)
        write_png(self.path, shown, exposure=self._exposure, tone_map=self._tone_map)


class Reporter(Protocol):
    """Shows how far a render is."""

    def show(self, status: Status) -> None:
        """Called some ten times a second."""

    def wrote(self, path: str) -> None:
        """A checkpoint or a preview was written."""


class Watcher:
    """What ``_core.render`` asks while it works, and gives its snapshots to.

    Args:
        sinks: Asked when they are due; each gets the last snapshot, too.
        reporter: Shows progress.
        is_stopped: Whether somebody wants the render to end.
        warn: Gets each warning once.
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
        """Asks for a stop or a snapshot, or for nothing."""
        if self._reporter is not None:
            self._reporter.show(status)
        if self._is_stopped():
            return "stop"
        return "snapshot" if any(sink.is_due() for sink in self._sinks) else None

    def snapshot(self, snapshot: Snapshot) -> None:
        """Gives a render that stands still to whoever waits for it."""
        for sink in self._sinks:
            if not (snapshot.finished or sink.is_due()):
                continue
            if not snapshot.status["samples_done"]:
                continue  # stopped before there was anything
            warning = sink.take(snapshot)
            if warning is None:
                if self._reporter is not None:
                    self._reporter.wrote(sink.path)
            elif warning not in self._warned:
                self._warned.add(warning)
                self._warn(warning)
