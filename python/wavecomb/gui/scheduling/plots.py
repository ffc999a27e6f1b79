# SPDX-License-Identifier: Apache-2.0
"""Plots in the colours of the window: curves, bars, and legends beside them."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QFontMetricsF
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QToolTip,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scheduling.run_log import Look, Run, Series, ratio
from wavecomb.gui.scheduling.run_rates import stretches
from wavecomb.run.progress import count_text
from wavecomb.run.stats import PHASES

pg.setConfigOptions(antialias=True)


@dataclass(frozen=True)
class Bar:
    """Bar of a horizontal bar chart, from ``start`` to ``end`` in row ``y``."""

    y: float
    height: float
    start: float
    end: float
    colour: QColor
    tip: str


class AmountAxis(pg.AxisItem):
    """Plot axis with short tick labels such as "20 k" and "1.5 M"."""

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Returns the labels of the axis ticks."""
        return [count_text(value * scale) for value in values]


class Plot(pg.PlotWidget):
    """Plot that follows the theme, always shows all of its data and ignores the mouse."""

    def __init__(self, name: str, title: str, parent: QWidget | None = None) -> None:
        axes = {side: AmountAxis(side) for side in ("left", "bottom")}
        super().__init__(parent, axisItems=axes, enableMenu=False)
        self.setObjectName(name)
        self.setAccessibleName(title)
        item = self.getPlotItem()
        item.hideButtons()
        item.setMouseEnabled(False, False)
        self._title = title
        self.setMinimumSize(theme.em(12), theme.em(6))
        theme.on_change(self.retheme)
        self.retheme()

    def retheme(self) -> None:
        """Applies the colours of the theme to the plot."""
        self.setBackground(theme.surface())
        for name in ("left", "bottom"):
            axis = self.getAxis(name)
            axis.setPen(theme.dim())
            axis.setTextPen(theme.text())
            axis.setTickPen(theme.grid())
            axis.setZValue(-1000)  # draws grid lines behind bars and curves
        colour = theme.text().name()
        self.getPlotItem().setTitle(html.escape(self._title), color=colour, size=_points())

    def name_it(self, title: str) -> None:
        """Changes the title of the plot."""
        if title != self._title:
            self._title = title
            self.setAccessibleName(title)
            self.retheme()

    def wheelEvent(self, event: object) -> None:
        """Leaves mouse wheel events to the surrounding scroll area."""
        event.ignore()  # type: ignore[attr-defined]


class Curves(Plot):
    """Plot of curves over the seconds of rendering, one for each series. The y axis starts at 0."""

    def __init__(self, name: str, title: str) -> None:
        super().__init__(name, title)
        self.getAxis("left").setWidth(theme.em(3.4))
        self.setMinimumHeight(theme.em(8))
        self.showGrid(x=False, y=True, alpha=0.25)

    def show_curves(
        self, curves: Sequence[tuple[Sequence[float], Sequence[float], QColor, bool]]
    ) -> None:
        """Draws curves, given as (times, values, colour, strong).

        ``strong`` marks the current run.
        """
        self.clear()
        for times, values, colour, strong in curves:
            width = max(1.0, 0.2 * theme.em() if strong else 0.12 * theme.em())
            few = len(times) < 3
            self.plot(
                list(times), list(values), pen=pg.mkPen(colour, width=width),
                symbol="o" if few else None, symbolBrush=colour, symbolPen=None,
                symbolSize=0.4 * theme.em(),
            )  # fmt: skip
        if not any(len(times) for times, *_ in curves):
            return
        latest = max((max(times) for times, *_ in curves if len(times)), default=1.0)
        most = max((max(values) for _, values, *_ in curves if len(values)), default=1.0)
        self.setXRange(0.0, latest * 1.02, padding=0.0)
        self.setYRange(0.0, 1.08 * most if most > 0.0 else 1.0, padding=0.0)


class Bars(Plot):
    """Horizontal bar chart with named rows, of which the first is at the top."""

    def __init__(self, name: str, title: str, *, names: bool = True) -> None:
        super().__init__(name, title)
        self._bars: list[Bar] = []
        self._names = names
        self.showGrid(x=True, y=False, alpha=0.25)
        self.getViewBox().invertY(True)
        self.getAxis("left").setStyle(tickLength=0)
        self.scene().sigMouseMoved.connect(self._tell)

    @property
    def bars(self) -> list[Bar]:
        """The bars that the plot draws."""
        return self._bars

    def show_bars(self, rows: Sequence[str], bars: Sequence[Bar], most: float = 0.0) -> None:
        """Draws bars into the plot.

        The axis ends at ``most``, or at the end of the longest bar if ``most`` is 0.
        """
        self._bars = list(bars)
        self.clear()
        by_colour: dict[str, list[Bar]] = {}
        for bar in bars:
            by_colour.setdefault(bar.colour.name(), []).append(bar)
        for colour, group in by_colour.items():
            self.addItem(
                pg.BarGraphItem(
                    x0=[bar.start for bar in group], x1=[bar.end for bar in group],
                    y=[bar.y for bar in group], height=[bar.height for bar in group],
                    brush=QColor(colour), pen=pg.mkPen(theme.surface(), width=0.5),
                )
            )  # fmt: skip
        end = most or 1.04 * max((bar.end for bar in bars), default=1.0)
        self.setXRange(0.0, end or 1.0, padding=0.0)
        self.setYRange(-0.6, max(len(rows) - 0.4, 0.4), padding=0.0)
        left = self.getAxis("left")
        if not self._names:
            left.setTicks([[]])
            left.setWidth(theme.em(0.5))
            return
        metrics = QFontMetricsF(QApplication.font())
        room = min(0.42 * self.width(), theme.em(17.0))
        shown = [
            metrics.elidedText(name, Qt.TextElideMode.ElideMiddle, room - theme.em())
            for name in rows
        ]
        left.setTicks([list(enumerate(shown))])
        widest = max((metrics.horizontalAdvance(name) for name in shown), default=0.0)
        left.setWidth(round(widest + theme.em(0.9)))

    def bar_at(self, x: float, y: float) -> Bar | None:
        """Returns the bar at a position in data coordinates, or None."""
        for bar in self._bars:
            if bar.start <= x <= bar.end and abs(y - bar.y) <= bar.height / 2:
                return bar
        return None

    def _tell(self, position: QPointF) -> None:
        place = self.getViewBox().mapSceneToView(position)
        bar = self.bar_at(place.x(), place.y())
        if bar is not None:
            point = self.mapToGlobal(self.mapFromScene(position))
            QToolTip.showText(point, bar.tip, self)
        else:
            QToolTip.hideText()


class Legend(QLabel):
    """Legend of a plot: names and colours in a wrapped text below the plot."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setObjectName(name)
        self.setTextFormat(Qt.TextFormat.RichText)
        self.setWordWrap(True)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Minimum)
        self._entries: Callable[[], Sequence[tuple[str, QColor]]] = lambda: ()
        theme.on_change(self.retheme)

    def show_entries(self, entries: Callable[[], Sequence[tuple[str, QColor]]]) -> None:
        """Shows (name, colour) pairs in the legend.

        Calls ``entries`` again when the theme changes.
        """
        self._entries = entries
        self.retheme()

    def retheme(self) -> None:
        """Applies the colours of the theme."""
        text = " &nbsp; ".join(
            f'<span style="color:{colour.name()}">&#9632;</span>&nbsp;'
            + html.escape(name).replace(" ", "&nbsp;")
            for name, colour in self._entries()
        )
        if text != self.text():
            self.setText(text)


def _points() -> str:
    return f"{QApplication.font().pointSizeF():.1f}pt"


# ---- Thread time by phase: a stacked bar for each series
# ------------------------------------------


SHARE, EACH, TIME = "share of time", "ns per sample", "over time"
MODES = {
    SHARE: "Fraction of thread time in each phase, for each series.",
    EACH: "Thread nanoseconds per camera path in each phase. At equal work, shorter is faster.",
    TIME: "Fraction of each phase in the current run, from its start (top) to now.",
}
_TITLES = {
    SHARE: "Phases: % of thread time",
    EACH: "Phases: thread nanoseconds per sample",
    TIME: "Phases of this run, from its start (top) to now: % of thread time",
}
_MOST_STRETCHES = 12
# Base colour and brightness of each render phase. Related phases share a base colour.
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
    """Returns the plot colour of a render phase."""
    number, lighter = _COLOURS[name]
    return theme.series(number).lighter(lighter)


def phases_between(a: Look, b: Look) -> dict[str, float]:
    """Returns the thread seconds of each render phase between two readings of the counters."""
    return {name: b.phases.get(name, 0.0) - a.phases.get(name, 0.0) for name in PHASES}


def stacked(row: int, label: str, seconds: dict[str, float], scale: float, mode: str) -> list[Bar]:
    """Returns the bars of one row of a phase plot. Each bar begins at the end of the previous bar.

    ``scale`` converts seconds to the shown unit.
    """
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
    """Splits the counter readings of a run into at most a dozen intervals of similar length."""
    least = run.last.seconds / _MOST_STRETCHES
    return stretches(run, least_s=0.999 * least) or stretches(run)


class PhasePlot(QWidget):
    """Plot of the time in each render phase, with its legend and a choice of units."""

    def __init__(self) -> None:
        super().__init__()
        self.mode = QComboBox()
        self.mode.setObjectName("phase_mode")
        self.mode.setAccessibleName("Unit of the bars of phases")
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
        """Draws the time in each render phase for the given series."""
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
