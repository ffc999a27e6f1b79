# SPDX-License-Identifier: Apache-2.0
"""Benchmarks in the window: folders browsed, a suite run, stopped and gone on with."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QListWidget, QPushButton

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench_results import policy_rows, write_folder

from wavecomb.bench.columns import Column
from wavecomb.bench.report_parts import Figure, Markup, Report, Section
from wavecomb.gui.bench import tables as bench_tables
from wavecomb.gui.bench.panel import BenchPanel
from wavecomb.gui.bench.recent_folders import recent_folders
from wavecomb.picture.image import write_png

LEFT = Qt.MouseButton.LeftButton
FIGURES = {"first": 0.25, "second": 1.0}
TINY = """
name = "tiny"
title = "a box"
repetitions = 3
warm_up = 0
[stage.box]
scene = "cornell"
[stage.other]
scene = "cornell"
[[experiment]]
name = "order"
settings = { size = [16, 12], spp = 4 }
"""


@pytest.fixture(autouse=True)
def own_settings(tmp_path):
    QSettings.setPath(
        QSettings.Format.NativeFormat, QSettings.Scope.UserScope, str(tmp_path / "config")
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = write_folder(
        tmp_path_factory.mktemp("made") / "results", policy_rows(repetitions=3), pictures=True
    )
    (made / "figures").mkdir()
    for name, value in FIGURES.items():
        write_png(made / "figures" / f"{name}.png", np.full((20, 40, 3), value, np.float32))
    figures = [Figure(name, f"The {name}", f"Caption of the {name}") for name in FIGURES]
    sections = [
        Section("findings", "Findings", [Markup("<p>none is faster</p>")]),
        Section("figures", "Experiment a", [*figures]),
    ]
    Report("Made up", "<p>One machine</p>", [], sections).write(made)
    (made / "notes.md").write_text("# Notes\n\nof the sitting")
    return made


@pytest.fixture
def panel(qtbot, new_session):
    made = BenchPanel(new_session(width=64, height=64, spp=1 << 16))
    qtbot.addWidget(made)
    made.resize(900, 600)
    made.show()
    yield made
    made.shutdown()


@pytest.fixture
def opened(qtbot, panel, folder):
    with qtbot.waitSignal(panel.browser.opened, timeout=60000):
        panel.open(folder)
    return panel


def test_a_folder_is_shown(qtbot, opened, folder):
    browser = opened.browser
    assert "made-up - Times that were made up" in browser.findChild(QLabel, "benchTitle").text()
    assert "vary by 12%" in browser.findChild(QLabel, "benchWarnings").text()
    figures = browser.findChild(QListWidget, "figureList")
    titles = [figures.item(k).text() for k in range(figures.count())]
    assert titles == ["Experiment a", "The first", "The second"]
    assert figures.currentRow() == 1, "a heading cannot be chosen"
    qtbot.waitUntil(lambda: browser.figures.view.image is not None)
    figures.setFocus()
    QTest.keyClick(figures, Qt.Key.Key_Down)
    qtbot.waitUntil(lambda: browser.figures.view.image.pixelColor(5, 5).lightness() == 255)
    target = browser.figures.view.target()
    assert target.width() / target.height() == pytest.approx(2.0)
    assert browser.figures.caption.text() == "Caption of the second"
    report = browser.report_view
    browser.tabs.setCurrentWidget(report)
    assert "none is faster" in report.text.toPlainText() and "One machine" in report.lead.text()
    report.list.setFocus()
    QTest.keyClick(report.list, Qt.Key.Key_Down)
    assert "Caption of the first" in report.text.toPlainText()
    browser.tabs.setCurrentWidget(browser.pages)
    qtbot.waitUntil(lambda: "of the sitting" in browser.pages.text.toPlainText())
    assert "Made-up CPU <4 GHz> & friends" in browser.machine.toPlainText()
    assert recent_folders() == [folder.resolve()]


def test_runs_are_sorted_by_number_and_filtered(qtbot, opened):
    runs = opened.browser.runs
    opened.browser.tabs.setCurrentWidget(runs)
    names = [
        runs.model.headerData(k, Qt.Orientation.Horizontal) for k in range(runs.model.columnCount())
    ]
    column = names.index("render_s")
    for order, reverse in (
        (Qt.SortOrder.AscendingOrder, False),
        (Qt.SortOrder.DescendingOrder, True),
    ):
        runs.view.sortByColumn(column, order)
        rows = [
            runs.proxy.mapToSource(runs.proxy.index(r, 0)).row()
            for r in range(runs.proxy.rowCount())
        ]
        values = [runs.model.value(row, column) for row in rows]
        assert values == sorted(values, reverse=reverse) and len(values) == 108
    QTest.keyClicks(runs.filter, "Dragon -policy-none")
    shown = [runs.proxy.index(r, 0).data() for r in range(runs.proxy.rowCount())]
    assert len(shown) == 2 * 8 * 3 and all("dragon" in s and "policy-none" not in s for s in shown)
    assert runs.count.text() == "48 of 108 rows"


def test_pictures_go_to_compare(qtbot, opened):
    shots = opened.browser.shots
    opened.browser.tabs.setCurrentWidget(shots)
    with qtbot.waitSignal(opened.compare) as sent:
        rect = shots.visualItemRect(shots.item(0))
        QTest.mouseClick(shots.viewport(), LEFT, pos=rect.center())
        QTest.mouseDClick(shots.viewport(), LEFT, pos=rect.center())
    assert sent.args[0].parent.name == "images" and sent.args[1].parent.name == "golden"


def test_what_is_no_folder_is_said(qtbot, opened, tmp_path):
    with qtbot.waitSignal(opened.failed) as failed:
        opened.open(tmp_path)
    assert "no runs.csv" in failed.args[0]
    assert opened.browser.findChild(QLabel, "benchError").text() == failed.args[0]
    assert opened.browser.folder is not None  # what was there stays


@pytest.mark.slow
def test_two_folders(qtbot, opened, folder, tmp_path):
    two = opened.browser.two
    two.set_before(write_folder(tmp_path / "before", policy_rows(repetitions=3, seed=4)))
    qtbot.waitUntil(lambda: two.found is not None, timeout=120000)
    assert two.table.model.rowCount() == 36 and "after over before" in two.words.text()


def button(panel, name):
    return panel.findChild(QPushButton, name)


def choose(qtbot, panel, tmp_path):
    """The tiny suite, stage "box" only, twice."""
    suite = tmp_path / "tiny.toml"
    suite.write_text(TINY)
    panel.tabs.setCurrentWidget(panel.runner)
    choice = panel.runner.choice
    panel.runner.open_choice(str(suite), tmp_path / "out")
    qtbot.waitUntil(lambda: choice.suite.currentData() == str(suite), timeout=60000)
    choice.stages.item(1).setCheckState(Qt.CheckState.Unchecked)
    panel.runner.report.setChecked(False)
    return tmp_path / "out"


@pytest.mark.slow
def test_a_suite_is_stopped_gone_on_with_and_shown(qtbot, panel, tmp_path, cornell):
    """The viewport renders before and after, and stands still between; the window never waits."""
    session, runner = panel.runner._session, panel.runner
    with qtbot.waitSignal(session.opened, timeout=120000):
        session.open(cornell)
    out = choose(qtbot, panel, tmp_path)
    QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert session.state == "paused" and not button(panel, "benchStart").isEnabled()
    session.restart()  # as an edit would
    assert session.state == "paused"
    qtbot.waitUntil(lambda: runner.bar.maximum() == 3 and runner.bar.value() >= 1, timeout=120000)
    begun = time.monotonic()
    QTest.mouseClick(button(panel, "benchCancel"), LEFT)
    assert time.monotonic() - begun < 0.1
    qtbot.waitUntil(lambda: not runner.running, timeout=120000)
    assert "Stopped" in runner.state.text() and session.state == "rendering"
    assert button(panel, "benchStart").text() == "Go on"
    with qtbot.waitSignal(panel.browser.opened, timeout=120000):
        QTest.mouseClick(button(panel, "benchStart"), LEFT)
    runs = panel.browser.folder.runs
    assert len(runs) == 3 and {row["stage"] for row in runs} == {"box"}
    assert panel.tabs.currentWidget() is panel.browser and panel.browser.folder.path == out
    assert "tried" not in runner.state.text() and "Done" in runner.state.text()
    assert "order.box" in runner.log.toPlainText()


@pytest.mark.slow
def test_errors_of_a_run_are_messages(qtbot, panel, tmp_path):
    out = choose(qtbot, panel, tmp_path)
    out.mkdir()
    (out / "runs.csv").touch()
    (out / "suite.toml").write_text("another")
    with qtbot.waitSignal(panel.failed, timeout=120000) as failed:
        QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert "was made with another suite" in failed.args[0] and "choose another" in failed.args[0]
    panel.runner.choice.stages.item(0).setCheckState(Qt.CheckState.Unchecked)
    with qtbot.waitSignal(panel.failed) as failed:
        QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert "tick one" in failed.args[0] and not panel.runner.running


def test_a_table_asks_for_no_cell_that_is_not_seen(qtbot, monkeypatch):
    """Qt's way to size columns asked for each cell several times: seconds for a large sitting."""
    asked = []
    data = bench_tables.RunsModel.data

    def counted(self, index, role=Qt.ItemDataRole.DisplayRole):
        asked.append(role)
        return data(self, index, role)

    monkeypatch.setattr(bench_tables.RunsModel, "data", counted)
    columns = [Column(f"c{k}", "integer", "", "") for k in range(40)]
    table = bench_tables.RunsTable("rows")
    qtbot.addWidget(table)
    table.set_rows(columns, [{c.name: k for c in columns} for k in range(500)])
    assert len(asked) < 500 * 40
    assert table.view.columnWidth(0) > 0
