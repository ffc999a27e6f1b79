# SPDX-License-Identifier: Apache-2.0
"""Live plots: time by render phase, coherence of queues, costs of materials, and run comparison."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from PySide6.QtWidgets import QGridLayout, QLabel, QTabWidget, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.compare.same_picture import PictureRevision
from wavecomb.gui.scene.material_plots import MaterialsTab
from wavecomb.gui.scheduling.choices import recipe_of, scheduling_of
from wavecomb.gui.scheduling.plots import Curves, Legend, PhasePlot
from wavecomb.gui.scheduling.run_log import Run, RunLog, Series, labels, last_of
from wavecomb.gui.scheduling.run_rates import moments, rate
from wavecomb.gui.scheduling.runs_tab import RunsTab
from wavecomb.gui.viewport.session import Frame, Session
from wavecomb.run.progress import count_text

MAX_CURVES = 6
EMPTY = "Open a stage: figures appear while it renders."
Curve = Callable[[Run], tuple[list[float], list[float]]]


class PlotsPanel(QWidget):
    """Panel that groups the session's statistics into runs and plots them in the visible tab.

    The tabs are created when the panel is shown for the first time, since creating their plots
    takes half of the time of creating a window.
    """

    phases: PhasePlot
    materials: MaterialsTab
    runs: RunsTab
    tabs: QTabWidget

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._revision = PictureRevision(session, self)
        self.log = RunLog()
        self._curves: dict[Curves, Curve] = {}
        self._legends: list[Legend] = []
        self._is_created = False
        self._line = QLabel(EMPTY)
        self._line.setObjectName("plots_line")
        self._line.setWordWrap(True)
        QVBoxLayout(self).addWidget(self._line)
        self.setObjectName("plots_panel")
        self.setAccessibleName("Plots")
        session.statistics.connect(self._take)
        session.frame.connect(self._finish)
        theme.on_change(self.refresh)

    # ---- construction
    # --------------------------------------------------------------------------------

    def _create_tabs(self) -> None:
        self._is_created = True
        self.phases = PhasePlot()
        self.materials = MaterialsTab()
        self.runs = RunsTab(self._session, self.log)
        self.tabs = QTabWidget()
        self.tabs.setObjectName("plots_tabs")
        self.tabs.setDocumentMode(True)
        for i, (tab, title, tip) in enumerate(
            (
                (self._time_tab(), "Time",
                 "Phases of the threads, and samples and rays per second."),
                (self._coherence_tab(), "Coherence",
                 "Lane utilisation, run length and homogeneity of queues."),
                (self.materials, "Materials",
                 "Cost per record and number of records of each material."),
                (self.runs, "Runs", "Comparison of recent runs."),
            )
        ):  # fmt: skip
            self.tabs.addTab(tab, title)
            self.tabs.setTabToolTip(i, tip)
        layout = self.layout()
        assert isinstance(layout, QVBoxLayout)
        layout.insertWidget(0, self.tabs, 1)
        self.tabs.show()  # Otherwise refresh(), which draws visible plots only, would draw none.
        self.tabs.currentChanged.connect(lambda index: self.refresh())
        self.phases.mode.currentIndexChanged.connect(lambda index: self.refresh())
        self.materials.of.activated.connect(lambda index: self.refresh())
        self.materials.order.activated.connect(lambda index: self.refresh())
        self.runs.changed.connect(self.refresh)

    def _time_tab(self) -> QWidget:
        samples = self._add_curves("samples_rate", "Samples per second", _rates("samples"))
        rays = self._add_curves("rays_rate", "Rays per second", _rates("rays"))
        return self._grid(
            (self.phases, 0, 0, 2), (samples, 1, 0, 1), (rays, 1, 1, 1), stretch=(3, 2)
        )

    def _coherence_tab(self) -> QWidget:
        def so_far(value: Callable[[Any], float]) -> Curve:
            return lambda run: (
                [look.seconds for look in run.looks[1:]],
                [value(look) for look in run.looks[1:]],
            )

        def lanes(run: Run) -> tuple[list[float], list[float]]:
            looks = [look for look in run.looks[1:] if look.packet_lanes]
            return (
                [look.seconds for look in looks],
                [100 * look.records / look.packet_lanes for look in looks],
            )

        def coherence(name: str, scale: float = 1.0) -> Curve:
            return so_far(lambda look: scale * look.coherence.get(name, 0.0))

        return self._grid(
            (self._add_curves("lane_utilisation", "Lane utilisation, %", lanes), 0, 0, 1),
            (self._add_curves("run_length", "Run length, records",
                              coherence("run_length")), 0, 1, 1),
            (self._add_curves("material_homogeneity", "Neighbours: same material, %",
                              coherence("material_homogeneity", 100.0)), 1, 0, 1),
            (self._add_curves("texture_homogeneity", "Neighbours: same texture position, %",
                              coherence("texture_homogeneity", 100.0)), 1, 1, 1),
            stretch=(1, 1),
        )  # fmt: skip

    def _add_curves(self, name: str, title: str, curve: Curve) -> Curves:
        plot = Curves(name, title)
        self._curves[plot] = curve
        return plot

    def _grid(self, *places: tuple[QWidget, int, int, int], stretch: tuple[int, int]) -> QWidget:
        tab = QWidget()
        grid = QGridLayout(tab)
        for widget, row, column, span in places:
            grid.addWidget(widget, row, column, 1, span)
        legend = Legend("series_legend")
        self._legends.append(legend)
        grid.addWidget(legend, 2, 0, 1, 2)
        for row, weight in enumerate(stretch):
            grid.setRowStretch(row, weight)
        return tab

    # ---- incoming statistics
    # -------------------------------------------------------------------------

    def _take(self, statistics: dict[str, Any]) -> None:
        if not statistics.get("seconds", {}).get("render"):
            return
        setup = self._session.setup
        settings = scheduling_of(setup)
        work = (setup.width, setup.height, setup.spp, setup.max_depth, setup.seed, setup.sampler,
                setup.filter, setup.filter_width, setup.clamp_indirect, setup.fresnel,
                setup.cosine_sampling, setup.region, setup.layers())  # fmt: skip
        self.log.add(statistics, settings, (self._revision.value(), *work), recipe=recipe_of(setup))
        self.refresh()

    def _finish(self, frame: Frame) -> None:
        whole = frame.final and frame.scale == 1 and not frame.status.get("cancelled")
        if whole and self.log.finish():
            self.refresh()

    # ---- display
    # -------------------------------------------------------------------------------------

    def shown(self) -> list[Series]:
        """Returns the newest series of the current image and the series it is compared with."""
        current = self.log.current
        if current is None:
            return []
        same = [one for one in self.log.series if one.picture == current.picture]
        return last_of(same, MAX_CURVES, self.log.base)

    def refresh(self) -> None:
        """Draws the visible tab."""
        if not self.isVisible():
            return
        series = self.shown()
        names = labels(series)
        current = self.log.current
        tab = self.tabs.currentIndex()
        if tab == 0:
            self.phases.show_series(series, names, current)
        if tab == 2:
            self.materials.show_series(series, names, current)
        if tab == 3:
            self.runs.refresh()
        for plot, curve in self._curves.items():
            if plot.isVisible():
                plot.show_curves(
                    [
                        (*curve(one.run if one is current else one.best),
                         theme.series(one.number - 1), one is current)
                        for one in series
                    ]
                )  # fmt: skip
        for legend in self._legends:
            legend.show_entries(lambda: _entries(series, names))
        self._line.setText(summary(current))

    def showEvent(self, event: object) -> None:
        """Draws the data that arrived while the panel was hidden."""
        if not self._is_created:
            self._create_tabs()
        super().showEvent(event)  # type: ignore[arg-type]
        self.refresh()


def _rates(counter: str) -> Curve:
    return lambda run: moments(run, counter)


def _entries(series: Sequence[Series], names: Sequence[str]) -> list[tuple[str, Any]]:
    return [(name, theme.series(one.number - 1)) for one, name in zip(series, names, strict=True)]


def summary(series: Series | None) -> str:
    """Returns a summary of the current run in one line."""
    if series is None:
        return EMPTY
    run = series.run
    samples = rate(run, "samples")
    text = f"{count_text(samples.value)} samples/s and {count_text(rate(run, 'rays').value)} rays/s"
    if samples.is_short:
        return f"{text} over {samples.seconds:.1f} s: too short to have meaning."
    spread = f"± {100 * samples.spread:.0f} % between intervals"
    return f"{text} over {samples.seconds:.1f} s ({spread})."
