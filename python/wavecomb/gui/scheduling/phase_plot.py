# SPDX-License-Identifier: Apache-2.0
"""Where the time of the threads goes: a stacked bar for each series."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.scheduling.plots import Bar, Bars, Legend
from wavecomb.gui.scheduling.run_log import Look, Run, Series, ratio
from wavecomb.gui.scheduling.run_rates import stretches
from wavecomb.run.stats import PHASES

SHARE, EACH, TIME = "share of time", "ns per sample", "over time"
MODES = {
    SHARE: "What part of the threads' time each phase took, for each series.",
    EACH: "Thread nanoseconds that a camera path takes in each phase: shorter is faster, where "
    "the work is the same.",
    TIME: "The share of each phase in the run that goes on, from its start at the top to now.",
}
_TITLES = {
    SHARE: "Phases: % of thread time",
    EACH: "Phases: thread nanoseconds per sample",
    TIME: "Phases of this run, from its start (top) to now: % of thread time",
}
_MOST_STRETCHES = 12
# Of a colour: phases that belong together; the number lightens or darkens it.
_COLOURS = {
    "generate": (2, 100),
    "order_rays": (3, 100),
    "trace": (0, 100),
    "keys": (4, 125),
    "sort": (4, 100),
    "materialize": (4, 75),
    "shade": (1, 100),
    "shadow": (0, 70),
    "resolve": (7, 100),
    "metrics": (7, 65),
}


def phase_colour(name: str) -> QColor:
    """The colour of a phase: shades of one for keys, sort and materialize, and for traversal."""
    number, lighter = _COLOURS[name]
    return theme.series(number).lighter(lighter)


def phases_between(a: Look, b: Look) -> dict[str, float]:
    """Thread seconds of each phase between two looks."""
    return {name: b.phases.get(name, 0.0) - a.phases.get(name, 0.0) for name in PHASES}


def stacked(row: int, label: str, seconds: dict[str, float], scale: float, mode: str) -> list[Bar]:
    """The bars of one row, end to end; ``scale``: from seconds to what is shown."""
    bars = []
    start = 0.0
    total = sum(seconds.values())
    for name in PHASES:
        length = seconds[name] * scale
        if length <= 0.0:
            continue
        unit = f"{length:.1f} ns per sample" if mode == EACH else f"{seconds[name]:.2f} thread s"
        tip = f"{label}\n{name}: {100 * ratio(seconds[name], total):.1f} %, {unit}"
        bars.append(Bar(row, 0.72, start, start + length, phase_colour(name), tip))
        start += length
    return bars


def rows_over_time(run: Run) -> list[tuple[Look, Look]]:
    """At most a dozen stretches of a run, of about the same length."""
    least = run.last.seconds / _MOST_STRETCHES
    return stretches(run, least_s=0.999 * least) or stretches(run)


class PhasePlot(QWidget):
    """The plot, what it shows, and its legend."""

    def __init__(self) -> None:
        super().__init__()
        self.mode = QComboBox()
        self.mode.setObjectName("phase_mode")
        self.mode.setAccessibleName("What the bars of phases show")
        for i, (name, tip) in enumerate(MODES.items()):
            self.mode.addItem(name)
            self.mode.setItemData(i, tip, Qt.ItemDataRole.ToolTipRole)
        self.mode.setToolTip("\n".join(f"{name}: {tip}" for name, tip in MODES.items()))
        self.plot = Bars("phases", _TITLES[SHARE])
        self.legend = Legend("phases_legend")
        self.legend.show_entries(
            lambda: [(name.replace("_", " "), phase_colour(name)) for name in PHASES]
        )
        top = QHBoxLayout()
        top.addWidget(QLabel("Show"))
        top.addWidget(self.mode)
        top.addStretch(1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(top)
        layout.addWidget(self.plot, 1)
        layout.addWidget(self.legend)

    def show_series(
        self, series: Sequence[Series], labels: Sequence[str], current: Series | None
    ) -> None:
        """Draws."""
        mode = self.mode.currentText()
        self.plot.name_it(_TITLES[mode])
        bars: list[Bar] = []
        rows: list[str] = []
        if mode == TIME:
            for i, (a, b) in enumerate(rows_over_time(current.run) if current else ()):
                rows.append(f"{b.seconds:.1f} s")
                seconds = phases_between(a, b)
                scale = ratio(100.0, sum(seconds.values()))
                bars += stacked(i, f"{a.seconds:.1f} to {b.seconds:.1f} s", seconds, scale, mode)
        else:
            for i, (one, label) in enumerate(zip(series, labels, strict=True)):
                last = one.best.last
                seconds = phases_between(Look(0.0), last)
                total = sum(seconds.values())
                scale = ratio(100.0, total) if mode == SHARE else ratio(1e9, last.samples)
                rows.append(label)
                bars += stacked(i, label, seconds, scale, mode)
        self.plot.show_bars(rows, bars, 0.0 if mode == EACH else 102.0)
