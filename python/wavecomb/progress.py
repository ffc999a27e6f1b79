# SPDX-License-Identifier: Apache-2.0
"""Progress on a terminal, and Ctrl-C that keeps what is done."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress


_FORCED = ("FORCE_COLOR", "TTY_COMPATIBLE")


def count_text(value: float) -> str:
    """A count in three digits with a unit.

    >>> count_text(1234567), count_text(999), count_text(0.5)
    ('1.23 M', '999', '0.5')
    """
    for limit, unit in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= limit * 0.9995:
            return f"{value / limit:.3g}{unit}"
    return f"{value:.3g}"


def time_text(seconds: float) -> str:
    """A duration.

    >>> time_text(0.0123), time_text(59.94), time_text(61), time_text(7322)
    ('0.012 s', '59.9 s', '1 min 01 s', '2 h 02 min')
    """
    if seconds < 1.0:
        return f"{seconds:.3f} s"
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


class Interrupt:
    """While it is entered, the first Ctrl-C is only noted; a second one acts as always.

    Contract: takes the signal on the main thread only; elsewhere it does nothing.
    """

    def __init__(self) -> None:
        self.requested = False
        self._before: Any = None

    def __enter__(self) -> Interrupt:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._restore()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.requested = True
        self._restore()

    def _restore(self) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            self._before = None


def progress_console(*, quiet: bool = False) -> Console | None:
    """The terminal to show progress on: standard error, or None where nobody would see it.

    Rich decides what a terminal is. It is not loaded where it could only say no: standard error is
    none, and no variable that Rich goes by claims that it is.
    """
    if quiet or not (sys.stderr.isatty() or any(name in os.environ for name in _FORCED)):
        return None
    from rich.console import Console

    console = Console(stderr=True, emoji=False)
    return console if console.is_terminal else None


class RenderProgress:
    """A bar with percent, samples per second and time left, on a console; silent without one.

    Use as a context manager, and call it as the core does: progress(samples_done, samples_total).
    Returns False, which stops the render, once ``interrupt.requested``.
    """

    def __init__(self, console: Console | None, interrupt: Interrupt) -> None:
        self.done = 0
        self.total = 0
        self._interrupt = interrupt
        self._start = time.perf_counter()
        self._bar: Progress | None = None
        if console is None:
            return
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        self._bar = Progress(
            TextColumn("rendering"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[rate]}"),
            TextColumn("{task.fields[left]}"),
            console=console,
            auto_refresh=False,
            transient=True,
        )
        self._task = self._bar.add_task("", total=None, rate="", left="")

    def __enter__(self) -> RenderProgress:
        if self._bar is not None:
            self._bar.start()
        self._start = time.perf_counter()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, done: int, total: int) -> bool:
        """Shows how far it is; False asks the core to stop."""
        self.done, self.total = done, total
        if self._bar is not None:
            seconds = time.perf_counter() - self._start
            rate = done / seconds if seconds > 0.0 else 0.0
            left = f"{time_text((total - done) / rate)} left" if rate > 0.0 else ""
            speed = f"{count_text(rate)}samples/s" if rate >= 1e3 else f"{rate:.0f} samples/s"
            self._bar.update(self._task, completed=done, total=total, rate=speed, left=left)
            self._bar.refresh()
        return not self._interrupt.requested
