# SPDX-License-Identifier: Apache-2.0
"""Tests live plots and the table of runs during real renders."""

from __future__ import annotations

import csv
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLineEdit, QPushButton, QSpinBox

from wavecomb.gui import theme
from wavecomb.gui.scene.material_plots import material_costs, short_names
from wavecomb.gui.scheduling.plots import Curves
from wavecomb.gui.scheduling.plots_panel import PlotsPanel
from wavecomb.gui.scheduling.run_log import Run
from wavecomb.run.stats import PHASES

TIME, COHERENCE, MATERIALS, RUNS = range(4)


@pytest.fixture
def panel(session: Any, qtbot: Any) -> PlotsPanel:
    made = PlotsPanel(session)
    qtbot.addWidget(made)
    made.resize(900, 640)
    made.show()
    qtbot.waitExposed(made)
    return made


def render(panel: PlotsPanel, session: Any, qtbot: Any, **settings: Any) -> None:
    """Renders another image until it is complete."""
    if settings:
        session.change(**settings)
    else:
        session.restart()
    wait_finished(panel, session, qtbot)


def wait_finished(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    def is_finished() -> bool:
        frame, series = session.last_frame, panel.log.current
        return (
            frame.final and frame.version == session.version
            and series is not None and series.run.finished
        )  # fmt: skip

    qtbot.waitUntil(is_finished, timeout=20000)


def show_tab(panel: PlotsPanel, index: int) -> None:
    bar = panel.tabs.tabBar()
    QTest.mouseClick(bar, Qt.MouseButton.LeftButton, pos=bar.tabRect(index).center())
    assert panel.tabs.currentIndex() == index


def click(panel: PlotsPanel, name: str) -> None:
    button = panel.findChild(QPushButton, name)
    assert button.isEnabled(), name
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def select_row(panel: PlotsPanel, row: int) -> None:
    view = panel.runs.view
    place = view.visualRect(panel.runs.model.index(row, 0)).center()
    QTest.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=place)


@pytest.mark.slow
def test_restarts_with_other_settings_are_series(
    panel: PlotsPanel, session: Any, qtbot: Any
) -> None:
    render(panel, session, qtbot)
    render(panel, session, qtbot, policy="none", lanes=1)
    render(panel, session, qtbot, policy="code", lanes=0)
    assert [len(one.runs) for one in panel.log.series] == [2, 1]
    assert panel.log.series[1].changed == "none, 1 lane"
    first, second = (one.best for one in panel.log.series)
    assert second.lane_utilisation() == 1.0 and 0.0 < first.lane_utilisation() <= 1.0
    assert first.last.samples == second.last.samples == 96 * 96 * 4
    legend = panel._legends[0].text().replace("&nbsp;", " ")
    assert "code, widest lanes" in legend and "none, 1 lane" in legend
    assert theme.series(0).name() in legend and theme.series(1).name() in legend
    bars = panel.phases.plot.bars
    for row in (0, 1):
        mine = [bar for bar in bars if bar.y == row]
        assert mine[-1].end == pytest.approx(100.0), "shares of all phases"
        assert all(a.end == b.start for a, b in pairwise(mine))
    assert {bar.tip.splitlines()[1].split(":")[0] for bar in bars} <= set(PHASES)
    assert panel.phases.plot.bar_at(50.0, 1.0).y == 1
    assert "samples/s" in panel._line.text()


@pytest.mark.slow
def test_a_panel_shown_after_the_render(session: Any, qtbot: Any) -> None:
    """The tabs, which are created when the panel is first shown, have the finished run."""
    panel = PlotsPanel(session)
    qtbot.addWidget(panel)
    render(panel, session, qtbot)
    panel.show()
    (curve,) = panel.findChild(Curves, "samples_rate").getPlotItem().listDataItems()
    assert len(curve.getData()[0]) > 0
    assert panel.phases.plot.bars


@pytest.mark.slow
def test_phases_per_sample_and_over_time(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    render(panel, session, qtbot, spp=64)
    look = panel.log.current.run.last
    QTest.keyClick(panel.phases.mode, Qt.Key.Key_Down)
    assert panel.phases.mode.currentText() == "ns per sample"
    end = panel.phases.plot.bars[-1].end
    assert end == pytest.approx(1e9 * sum(look.phases.values()) / look.samples)
    QTest.keyClick(panel.phases.mode, Qt.Key.Key_Down)
    rows = {bar.y for bar in panel.phases.plot.bars}
    assert 1 <= len(rows) <= 13
    assert max(bar.end for bar in panel.phases.plot.bars) == pytest.approx(100.0)


@pytest.mark.slow
def test_figures_come_while_it_renders(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    session.change(width=256, height=256, spp=4096)
    qtbot.waitUntil(
        lambda: panel.log.current is not None and len(panel.log.current.run.looks) >= 3,
        timeout=20000,
    )
    looks = panel.log.current.run.looks
    assert not panel.log.current.run.finished
    assert looks[1].samples < looks[2].samples < 256 * 256 * 4096
    assert sum(looks[2].phases.values()) > sum(looks[1].phases.values())
    (curve,) = panel.findChild(Curves, "samples_rate").getPlotItem().listDataItems()
    assert len(curve.getData()[0]) == len(looks) - 1
    run, begun = panel.log.current.run, time.perf_counter()
    session.pause()
    qtbot.waitUntil(lambda: session.last_frame.status.get("paused"), timeout=20000)
    qtbot.wait(1500)
    seconds, count = run.last.seconds, len(run.looks)
    session.resume()
    qtbot.waitUntil(lambda: len(run.looks) > count + 1, timeout=20000)
    assert panel.log.current.run is run
    assert run.looks[count + 1].seconds - seconds < time.perf_counter() - begun - 1.0
    session.stop()


@pytest.mark.slow
def test_coherence(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    render(panel, session, qtbot, policy="material")
    show_tab(panel, COHERENCE)
    stats = panel.log.current.run.stats
    for name, value in (
        ("lane_utilisation", 100 * stats["lane_utilisation"]),
        ("run_length", stats["coherence"]["run_length"]),
        ("material_homogeneity", 100 * stats["coherence"]["material_homogeneity"]),
    ):
        items = panel.findChild(Curves, name).getPlotItem().listDataItems()
        assert items[-1].getData()[1][-1] == pytest.approx(value), name


@pytest.mark.slow
def test_materials(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    render(panel, session, qtbot, policy="material")
    show_tab(panel, MATERIALS)
    tab = panel.materials
    stats = panel.log.current.run.stats
    used = {one["name"]: one for one in stats["materials"] if one["records"]}
    assert tab.model.rowCount() == len(used) >= 3
    assert len(tab.costs.bars) == 2 * len(used) and len(tab.records.bars) == len(used)
    top = material_costs(stats)[0]
    assert tab.costs.bars[0].end == top.predicted_ns == used[top.name]["predicted_ns"]
    assert tab.costs.bars[1].end == top.measured_ns == used[top.name]["ns_per_record"]
    count = tab.findChild(QSpinBox, "materials_top")
    count.setFocus()
    count.selectAll()
    QTest.keyClicks(count, "1")
    assert len(tab.records.bars) == 1
    order = tab.findChild(QComboBox, "materials_order")
    QTest.keyClick(order, Qt.Key.Key_End)
    assert tab.records.bars[0].end == max(one["records"] for one in used.values())
    search = tab.findChild(QLineEdit, "materials_search")
    QTest.keyClicks(search, "rEd")
    found = [
        tab.proxy.index(i, 0).data(Qt.ItemDataRole.ToolTipRole) for i in range(tab.proxy.rowCount())
    ]
    assert found == [name for name in used if "red" in name.lower()] and found


def test_short_names_and_orders() -> None:
    assert short_names(["/A/x/Gold", "/B/x/Gold", "/B/Wood"]) == ["A/x/Gold", "B/x/Gold", "Wood"]
    stats = {
        "materials": [
            {"name": "/a", "program": "p", "records": 10, "ns_per_record": 5.0, "predicted_ns": 4},
            {"name": "/b", "program": "p", "records": 4, "ns_per_record": 0.0, "predicted_ns": 20},
            {"name": "/c", "program": "p", "records": 0, "ns_per_record": 9.0, "predicted_ns": 9},
        ]
    }
    assert [one.short for one in material_costs(stats)] == ["b", "a"], "by predicted, where untimed"
    assert [one.short for one in material_costs(stats, "records")] == ["a", "b"]
    assert material_costs(stats)[0].share == pytest.approx(80 / 130)
    assert material_costs({}) == []


@pytest.mark.slow
def test_runs_are_pinned_copied_saved_and_cleared(
    panel: PlotsPanel, session: Any, qtbot: Any, tmp_path: Path
) -> None:
    render(panel, session, qtbot)
    render(panel, session, qtbot, policy="material")
    show_tab(panel, RUNS)
    assert panel.runs.model.rowCount() == 2
    assert panel.log.base is panel.log.series[0]
    select_row(panel, 1)
    click(panel, "runs_pin")
    assert panel.log.base is panel.log.pinned is panel.log.series[1]
    assert panel.findChild(QPushButton, "runs_pin").text() == "Unpin"
    click(panel, "runs_copy")
    text = QGuiApplication.clipboard().text()
    assert "material" in text and len(text.splitlines()) == 3
    file = tmp_path / "runs.csv"
    panel.runs.save(str(file))
    qtbot.waitUntil(file.exists, timeout=10000)
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert [row["policy"] for row in rows] == ["code", "material"]
    assert all(int(row["samples"]) == 96 * 96 * 4 for row in rows)
    with qtbot.waitSignal(session.failed, timeout=10000) as failed:
        panel.runs.save(str(tmp_path / "missing" / "runs.csv"))
    assert "missing" in failed.args[0] and "internal" not in failed.args[0]
    click(panel, "runs_clear")
    assert len(panel.log.series) == 1 and panel.log.pinned is None


@pytest.mark.slow
def test_both_are_repeated_in_turn(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    render(panel, session, qtbot)
    render(panel, session, qtbot, policy="none", ray_order="slot")
    show_tab(panel, RUNS)
    order: list[str] = []
    session.setup_changed.connect(lambda setup: order.append(setup.policy))
    with qtbot.waitSignal(panel.runs.rounds.ended, timeout=60000) as ended:
        click(panel, "runs_repeat")
    assert ended.args == [True]
    assert order[:6] == ["code", "none"] * 3, "in turn, so that drift meets both"
    assert (session.setup.policy, session.setup.ray_order) == ("none", "slot"), "put back"
    assert [len(one.runs) for one in panel.log.series] == [4, 4]
    verdict = panel.runs._rows[1].ratio
    assert verdict is not None and verdict.repeats == 4


@pytest.mark.slow
def test_a_moved_camera_is_another_picture(panel: PlotsPanel, session: Any, qtbot: Any) -> None:
    from dataclasses import replace

    render(panel, session, qtbot)
    there = session.pose
    moved = there.to_world.copy()
    moved[3, 0] += 0.1
    session.set_camera(replace(there, to_world=moved, path=None))
    wait_finished(panel, session, qtbot)
    assert [one.changed for one in panel.log.series] == ["", "other picture"]
    assert panel.shown() == [panel.log.series[1]], "no other picture's curves beside it"
    session.set_camera(there)
    wait_finished(panel, session, qtbot)
    assert [len(one.runs) for one in panel.log.series] == [2, 1], "back at the first"


@pytest.mark.slow
def test_draws_only_what_is_seen_and_follows_the_theme(
    panel: PlotsPanel, session: Any, qtbot: Any
) -> None:
    render(panel, session, qtbot)
    panel.hide()
    render(panel, session, qtbot, policy="none")
    rows = {bar.y for bar in panel.phases.plot.bars}
    assert rows == {0} and len(panel.log.series) == 2
    panel.show()
    assert {bar.y for bar in panel.phases.plot.bars} == {0, 1}
    try:
        colours = {}
        for name in ("dark", "light"):
            theme.apply(name)
            colours[name] = panel.phases.plot.bars[0].colour.name()
            background = panel.phases.plot.backgroundBrush().color()
            assert background == theme.surface()
        assert colours["dark"] != colours["light"]
    finally:
        theme.apply("system")


def test_runs_without_looks_have_no_figures() -> None:
    run = Run()
    assert run.shading_ns() == run.lane_utilisation() == run.run_length() == 0.0
