# SPDX-License-Identifier: Apache-2.0
"""Progress output on a terminal or as JSON, and Ctrl-C handling that keeps finished samples."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

from wavecomb import terminal

if TYPE_CHECKING:
    from rich.console import Console

_FORCED = ("FORCE_COLOR", "TTY_COMPATIBLE")


def count_text(value: float) -> str:
    """Formats a count with three significant digits and a suffix such as k or M.

    >>> count_text(1234567), count_text(999), count_text(0.5)
    ('1.23 M', '999', '0.5')
    """
    for limit, unit in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= limit * 0.9995:
            return f"{value / limit:.3g}{unit}"
    return f"{value:.3g}"


def time_text(seconds: float) -> str:
    """Formats a duration.

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


def speed(status: Mapping[str, Any]) -> dict[str, Any]:
    """Returns samples and rays per second of a run, and the remaining time at that speed.

    Args:
        status: Values of ``Snapshot.status`` in _core.pyi.

    Returns:
        ``samples_per_s``, ``rays_per_s`` and ``seconds_left`` (None if unknown).
    """
    done, seconds = status["samples_done"], status["seconds"]
    rate = (done - status["resumed_samples"]) / seconds if seconds > 0.0 else 0.0
    return {
        "samples_per_s": rate,
        "rays_per_s": status["rays"] / seconds if seconds > 0.0 else 0.0,
        "seconds_left": (status["samples_total"] - done) / rate if rate > 0.0 else None,
    }


def left_text(seconds: float) -> str:
    """Formats the remaining time in seconds, rounded up.

    >>> left_text(0.2), left_text(59.1), left_text(7322)
    ('1 s left', '1 min 00 s left', '2 h 02 min left')
    """
    whole = math.ceil(seconds)
    return f"{whole} s left" if whole < 60 else f"{time_text(whole)} left"


_earlier: list[int] = []
"""Signals that ``keep_interrupts`` has recorded and no ``Interrupt`` has handled yet."""


def keep_interrupts() -> None:
    """Records Ctrl-C signals, so that the next ``Interrupt`` handles those that Python loses.

    ``KeyboardInterrupt`` is lost if it is raised in a callback of a library that prints exceptions
    and continues. Use this function in commands that end at Ctrl-C, but not in programs with a
    window. This function also replaces the default action, which applies while the command is
    imported.
    """

    def note(number: int, frame: FrameType | None) -> None:
        _earlier.append(number)
        signal.default_int_handler(number, frame)

    is_main = threading.current_thread() is threading.main_thread()
    replaced = (signal.default_int_handler, signal.SIG_DFL)
    if is_main and signal.getsignal(signal.SIGINT) in replaced:
        signal.signal(signal.SIGINT, note)


def was_interrupted() -> bool:
    """Returns whether a recorded Ctrl-C has not been handled yet."""
    return bool(_earlier)


class Interrupt:
    """Context manager that records the first Ctrl-C or SIGTERM and then restores the handlers.

    Contract: handles signals on the main thread only; on other threads it does nothing.
    """

    def __init__(self) -> None:
        self.signal: int | None = None
        """Number of the recorded signal."""
        self._before: dict[int, Any] = {}

    @property
    def requested(self) -> bool:
        """Whether a stop was requested."""
        return self.signal is not None

    def __enter__(self) -> Interrupt:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._note)
            if _earlier:
                self._note(_earlier.pop(), None)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._restore()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.signal = number
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}


def progress_console(*, quiet: bool = False) -> Console | None:
    """Returns a console on standard error for progress, or None if standard error is no terminal.

    Rich decides whether standard error is a terminal. Loading Rich takes time. Rich is therefore
    loaded only if standard error is a terminal, or if one of Rich's environment variables says so.
    """
    is_terminal = sys.stderr is not None and sys.stderr.isatty()
    if quiet or not (is_terminal or any(name in os.environ for name in _FORCED)):
        return None
    console = terminal.console(stderr=True)
    return console if console.is_terminal else None


class Silent:
    """Reporter that shows nothing."""

    def __enter__(self) -> Silent:
        return self

    def __exit__(self, *error: object) -> None:
        """Does nothing."""

    def show(self, status: Mapping[str, Any]) -> None:
        """Does nothing."""

    def wrote(self, path: str) -> None:
        """Does nothing."""


def figures(status: Mapping[str, Any], columns: int = 200) -> list[str]:
    """Returns the texts beside a progress bar, such as the time left and samples per second.

    Args:
        status: Values of ``Snapshot.status`` in _core.pyi.
        columns: Width available for the texts, in columns; texts at the end that do not fit are
            left out.
    """
    rates = speed(status)
    said = []
    if rates["seconds_left"] is not None:
        said.append(left_text(rates["seconds_left"]))
    if status["error"] is not None:
        said.append(f"error {100 * status['error']:.2g} %")
    said += [
        f"{count_text(rates['samples_per_s'])} samples/s",
        f"{count_text(rates['rays_per_s'])} rays/s",
        f"pass {status['passes']}",
    ]
    while len(said) > 1 and len(", ".join(said)) > columns:
        said.pop()
    return said


MOST_BAR, LEAST_BAR = 40, 10
"""Largest and smallest width of a progress bar, in columns."""


def bar_width(columns: int) -> int:
    """Returns the width of a progress bar in columns on a terminal with ``columns`` columns.

    >>> bar_width(60), bar_width(100), bar_width(160)
    (15, 25, 40)
    """
    return max(LEAST_BAR, min(MOST_BAR, columns // 4))


class ProgressBar(Silent):
    """Progress bar with passes, samples and rays per second, error and time left.

    Use the progress bar in a ``with`` statement.
    """

    def __init__(self, console: Console, title: str = "rendering") -> None:
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        width = bar_width(console.width)
        # The title, the bar and the percentage have a fixed width, and a space follows each of
        # them. The rest of the line is for the text after the percentage.
        self._space = console.width - (len(title) + 1) - (width + 1) - 5
        self._bar = Progress(
            TextColumn(title, markup=False),
            BarColumn(width),
            TaskProgressColumn(),
            TextColumn("{task.fields[figures]}"),
            console=console,
            auto_refresh=False,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._above = terminal.lines_above(console)
        self._task = self._bar.add_task("", total=None, figures="")

    def __enter__(self) -> ProgressBar:
        self._bar.start()
        self._above.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._above.__exit__(None, None, None)
        self._bar.stop()

    def show(self, status: Mapping[str, Any]) -> None:
        """Draws the bar."""
        self._bar.update(
            self._task,
            completed=status["samples_done"],
            total=status["samples_total"],
            figures=", ".join(figures(status, self._space)),
        )
        self._bar.refresh()


LoadProgress = Callable[[int, int], None]
"""Callback with the number of prims read and the number of prims found so far."""


@contextlib.contextmanager
def loading_bar(console: Console, title: str) -> Iterator[LoadProgress]:
    """Shows a progress bar while a stage is loaded; yields the callback that updates the bar."""
    from rich.progress import BarColumn, Progress, TextColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width(console.width)),
        TextColumn("{task.fields[figures]}"),
        console=console,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    with bar, terminal.lines_above(console):
        task = bar.add_task(terminal.one_line(title), total=None, figures="")

        def show(done: int, found: int) -> None:
            text = f"{done:,} of {found:,} prims"
            bar.update(task, completed=done, total=found, figures=text)

        yield show


class ProgressLines(Silent):
    """Reporter that writes progress and the names of written files as JSON lines."""

    def __init__(self, write: Callable[[str], None], *, every: float = 1.0) -> None:
        self._write = write
        self._every = every
        self._next = 0.0

    def show(self, status: Mapping[str, Any]) -> None:
        """Writes {"event": "progress", ...} if the interval has passed."""
        is_done = status["samples_done"] >= status["samples_total"]
        if time.monotonic() < self._next and not is_done:
            return
        self._next = time.monotonic() + self._every
        self.event("progress", **status, **speed(status))

    def wrote(self, path: str) -> None:
        """Writes {"event": "wrote", "file": path}."""
        self.event("wrote", file=path)

    def event(self, name: str, **values: Any) -> None:
        """Writes an event as a line of JSON."""
        self._write(json.dumps({"event": name, **values}))
