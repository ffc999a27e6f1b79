# SPDX-License-Identifier: Apache-2.0
"""Progress on a terminal or for programs, and Ctrl-C that keeps what is done."""

from __future__ import annotations

import contextlib
import json
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


def speed(status: Mapping[str, Any]) -> dict[str, Any]:
    """Samples and rays per second of a run, and the seconds left at that speed.

    Args:
        status: The keys of ``Snapshot.status`` in _core.pyi.

    Returns:
        ``samples_per_s``, ``rays_per_s``, ``seconds_left`` (None: not known yet).
    """
    done, seconds = status["samples_done"], status["seconds"]
    rate = (done - status["resumed_samples"]) / seconds if seconds > 0.0 else 0.0
    return {
        "samples_per_s": rate,
        "rays_per_s": status["rays"] / seconds if seconds > 0.0 else 0.0,
        "seconds_left": (status["samples_total"] - done) / rate if rate > 0.0 else None,
    }


_earlier: list[int] = []
"""The Ctrl-C that ``keep_interrupts`` saw, if any."""


def keep_interrupts() -> None:
    """From now on a Ctrl-C that nobody heeds is heeded by the next ``Interrupt``.

    ``KeyboardInterrupt`` is lost where it is raised in a callback of a library that prints
    exceptions and goes on. For programs that such an exception ends: commands, not a window.
    """

    def note(number: int, frame: FrameType | None) -> None:
        _earlier.append(number)
        signal.default_int_handler(number, frame)

    is_main = threading.current_thread() is threading.main_thread()
    if is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, note)


def was_interrupted() -> bool:
    """Whether ``keep_interrupts`` saw a Ctrl-C that no ``Interrupt`` took."""
    return bool(_earlier)


class Interrupt:
    """While it is entered, the first Ctrl-C or SIGTERM is only noted; the next acts as always.

    Contract: takes the signals on the main thread only; elsewhere it does nothing.
    """

    def __init__(self) -> None:
        self.signal: int | None = None
        """The number of the one that came."""
        self._before: dict[int, Any] = {}

    @property
    def requested(self) -> bool:
        """Whether somebody wants this to end."""
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
    """The terminal to show progress on: standard error, or None where nobody would see it.

    Rich decides what a terminal is. It is not loaded where it could only say no: standard error is
    none, and no variable that Rich goes by claims that it is.
    """
    is_terminal = sys.stderr is not None and sys.stderr.isatty()
    if quiet or not (is_terminal or any(name in os.environ for name in _FORCED)):
        return None
    console = terminal.console(stderr=True)
    return console if console.is_terminal else None


class Silent:
    """No progress at all."""

    def __enter__(self) -> Silent:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing to tidy."""

    def show(self, status: Mapping[str, Any]) -> None:
        """Shows nothing."""

    def wrote(self, path: str) -> None:
        """Says nothing."""


def figures(status: Mapping[str, Any]) -> list[str]:
    """What is said beside a bar: passes, rates, error, time left.

    Args:
        status: The keys of ``Snapshot.status`` in _core.pyi.
    """
    rates = speed(status)
    said = [
        f"pass {status['passes']}",
        f"{count_text(rates['samples_per_s'])} samples/s",
        f"{count_text(rates['rays_per_s'])} rays/s",
    ]
    if status["error"] is not None:
        said.append(f"error {100 * status['error']:.2g} %")
    if rates["seconds_left"] is not None:
        said.append(f"{time_text(rates['seconds_left'])} left")
    return said


class ProgressBar(Silent):
    """A bar with passes, samples and rays per second, error and time left.

    Use as a context manager.
    """

    def __init__(self, console: Console, title: str = "rendering") -> None:
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        self._bar = Progress(
            TextColumn(title, markup=False),
            BarColumn(),
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
            figures=", ".join(figures(status)),
        )
        self._bar.refresh()


LoadProgress = Callable[[int, int], None]
"""Called as progress(prims read, prims found so far)."""


@contextlib.contextmanager
def loading_bar(console: Console, title: str) -> Iterator[LoadProgress]:
    """A bar while a stage is read; it pulses until the first call, so small stages show no more."""
    from rich.progress import BarColumn, Progress, TextColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[figures]}"),
        console=console,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    with bar, terminal.lines_above(console):
        task = bar.add_task(terminal.clean(title), total=None, figures="")

        def show(done: int, found: int) -> None:
            text = f"{done:,} of {found:,} prims"
            bar.update(task, completed=done, total=found, figures=text)

        yield show


class ProgressLines(Silent):
    """A line of JSON about once a second, and for each file: for programs that wrap this one."""

    def __init__(self, write: Callable[[str], None], *, every: float = 1.0) -> None:
        self._write = write
        self._every = every
        self._next = 0.0

    def show(self, status: Mapping[str, Any]) -> None:
        """A line {"event": "progress", ...}, if it is time for one."""
        is_done = status["samples_done"] >= status["samples_total"]
        if time.monotonic() < self._next and not is_done:
            return
        self._next = time.monotonic() + self._every
        self.event("progress", **status, **speed(status))

    def wrote(self, path: str) -> None:
        """A line {"event": "wrote", "file": path}."""
        self.event("wrote", file=path)

    def event(self, name: str, **values: Any) -> None:
        """A line of any kind."""
        self._write(json.dumps({"event": name, **values}))
