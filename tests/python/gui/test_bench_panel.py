# SPDX-License-Identifier: Apache-2.0
"""Tests that the benchmark panel runs, stops and resumes a suite, and opens its report."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDesktopServices, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench_results import policy_rows, write_folder

from wavecomb.errors import WavecombError
from wavecomb.gui.bench.choice import Choice, suite_info, suite_infos
from wavecomb.gui.bench.panel import BenchPanel

LEFT = Qt.MouseButton.LeftButton
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


@pytest.fixture
def pages(monkeypatch):
    """Pages opened in the browser."""
    found = []
    monkeypatch.setattr(
        QDesktopServices, "openUrl", lambda url: found.append(Path(url.toLocalFile()))
    )
    return found


@pytest.fixture
def panel(qtbot, new_session):
    made = BenchPanel(new_session(width=64, height=64, spp=1 << 16))
    qtbot.addWidget(made)
    made.resize(900, 600)
    made.show()
    yield made
    made.shutdown()


def button(panel, name):
    return panel.findChild(QPushButton, name)


@pytest.mark.slow
def test_the_report_opens_in_the_browser_and_is_made_if_it_is_old(qtbot, panel, pages, tmp_path):
    folder = write_folder(tmp_path / "results", policy_rows(repetitions=2))
    panel.choice.set_choice("quick", folder)
    with qtbot.waitSignal(panel.done, timeout=120000):
        QTest.mouseClick(button(panel, "benchReport"), LEFT)
    page = folder / "report.html"
    assert pages == [page] and "Experiment policies" in page.read_text()
    page.write_text("kept")
    with qtbot.waitSignal(panel.done):
        QTest.mouseClick(button(panel, "benchReport"), LEFT)
    assert page.read_text() == "kept", "a report that is newer than its results is opened as it is"
    os.utime(folder / "runs.csv", (time.time() + 60, time.time() + 60))
    with qtbot.waitSignal(panel.done, timeout=120000):
        QTest.mouseClick(button(panel, "benchReport"), LEFT)
    assert pages == [page] * 3 and page.read_text() != "kept"


def test_a_dropped_folder_opens_its_report(qtbot, panel, pages, tmp_path):
    folder = write_folder(tmp_path / "results", policy_rows(repetitions=1))
    (folder / "report.html").write_text("made before")
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(folder))])
    with qtbot.waitSignal(panel.done):
        panel.dropEvent(
            QDropEvent(
                QPointF(5, 5), Qt.DropAction.CopyAction, data, LEFT,
                Qt.KeyboardModifier.NoModifier,
            )
        )  # fmt: skip
    assert pages == [folder / "report.html"]


def test_a_folder_without_results_is_named(qtbot, panel, pages, tmp_path):
    panel.choice.set_choice("quick", tmp_path)
    with qtbot.waitSignal(panel.failed) as failed:
        QTest.mouseClick(button(panel, "benchReport"), LEFT)
    assert f"{tmp_path}: holds no results (no runs.csv)" in failed.args[0]
    assert panel.state.text() == failed.args[0] and not pages


@pytest.mark.slow
def test_a_damaged_folder_is_a_message(qtbot, panel, pages, tmp_path):
    panel.choice.set_choice("quick", tmp_path)
    (tmp_path / "runs.csv").write_text("run_id,spp\na,many\n")
    with qtbot.waitSignal(panel.failed, timeout=60000) as failed:
        QTest.mouseClick(button(panel, "benchReport"), LEFT)
    assert "runs.csv: cannot be read" in failed.args[0] and not pages


def choose(qtbot, panel, tmp_path):
    """Chooses the tiny suite with only the stage "box"."""
    suite = tmp_path / "tiny.toml"
    suite.write_text(TINY)
    choice = panel.choice
    choice.set_choice(str(suite), tmp_path / "out")
    qtbot.waitUntil(lambda: choice.suite.currentData() == str(suite), timeout=60000)
    choice.stages.item(1).setCheckState(Qt.CheckState.Unchecked)
    return tmp_path / "out"


@pytest.mark.slow
def test_a_suite_is_stopped_resumed_and_its_report_opened(qtbot, panel, pages, tmp_path, cornell):
    """The viewport pauses during the benchmark, and the window never blocks."""
    session = panel._session
    with qtbot.waitSignal(session.opened, timeout=120000):
        session.open(cornell)
    out = choose(qtbot, panel, tmp_path)
    QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert session.state == "paused" and not button(panel, "benchStart").isEnabled()
    session.restart()
    assert session.state == "paused"
    qtbot.waitUntil(lambda: panel.bar.maximum() == 3 and panel.bar.value() >= 1, timeout=120000)
    begun = time.monotonic()
    QTest.mouseClick(button(panel, "benchCancel"), LEFT)
    assert time.monotonic() - begun < 0.1
    qtbot.waitUntil(lambda: not panel.busy, timeout=120000)
    assert "Stopped" in panel.state.text() and session.state == "rendering" and not pages
    assert button(panel, "benchStart").text() == "Resume"
    with qtbot.waitSignal(panel.done, timeout=120000):
        QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert pages == [out / "report.html"]
    runs = (out / "runs.csv").read_text().splitlines()[1:]
    assert len(runs) == 3 and all("order.box" in row for row in runs)
    assert "failed" not in panel.state.text() and "Opened" in panel.state.text()
    assert "order.box" in panel.log.toPlainText()


@pytest.mark.slow
def test_errors_of_a_run_are_messages(qtbot, panel, tmp_path):
    out = choose(qtbot, panel, tmp_path)
    out.mkdir()
    (out / "runs.csv").touch()
    (out / "suite.toml").write_text("another")
    with qtbot.waitSignal(panel.failed, timeout=120000) as failed:
        QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert "was made with another suite" in failed.args[0] and "choose another" in failed.args[0]
    panel.choice.stages.item(0).setCheckState(Qt.CheckState.Unchecked)
    with qtbot.waitSignal(panel.failed) as failed:
        QTest.mouseClick(button(panel, "benchStart"), LEFT)
    assert "check at least one" in failed.args[0] and not panel.busy


def test_suites_and_the_command(tmp_path):
    infos = suite_infos()
    by_name = {info.name: info for info in infos}
    assert infos[0].name == "quick" and by_name["paper"].repetitions == 3
    quick = by_name["quick"]
    assert quick.stages == ("mixed", "dragon") and sum(n for _, n in quick.experiments) == 32
    one = suite_info("quick", ("dragon",))
    assert 0 < one.configurations < 32 and one.seconds < quick.seconds
    with pytest.raises(WavecombError, match="no such stage"):
        suite_info("quick", ("x",))
    choice = Choice("quick", tmp_path, ("dragon",), 3)
    words = choice.arguments()
    assert words[:7] == ["bench", "run", "quick", "-o", str(tmp_path), "--stage", "dragon"]
    assert "--resume" not in words and words[-2:] == ["--progress", "json"]
    (tmp_path / "runs.csv").touch()
    assert "--resume" in choice.arguments(dry=True)
