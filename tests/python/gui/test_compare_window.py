# SPDX-License-Identifier: Apache-2.0
"""Tests the comparison window: keys, mouse, dropped files and live renders."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, QSettings, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QTableWidget, QToolButton

from wavecomb.gui.compare.window import CompareWindow
from wavecomb.image.compare.comparison import compare
from wavecomb.image.files.image import write_exr

KEYS = Qt.Key
LEFT = Qt.MouseButton.LeftButton
SHIFTED = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier


@pytest.fixture
def window(qtbot, new_session):
    """A comparison window without a stage."""
    made = CompareWindow(new_session(width=48, height=48, spp=2))
    qtbot.addWidget(made)
    made.resize(900, 600)
    made.show()
    yield made
    made.shutdown()


@pytest.fixture
def files(tmp_path):
    """Two images that differ in one pixel, and a third image of another size."""
    a = np.random.default_rng(1).random((20, 30, 3), np.float32)
    b = a.copy()
    b[4, 7] += np.float32(0.5)
    for name, pixels in (("a", a), ("b", b), ("small", a[:10])):
        write_exr(tmp_path / f"{name}.exr", {"beauty": pixels, "albedo": pixels})
    return {name: str(tmp_path / f"{name}.exr") for name in ("a", "b", "small")}


def settled(qtbot, window):
    qtbot.waitUntil(lambda: not window.busy, timeout=120000)


def numbers(window):
    table = window.findChild(QTableWidget, "numbers")
    return {table.item(r, 0).text(): table.item(r, 1).text() for r in range(table.rowCount())}


def verdict(window):
    return window.findChild(QLabel, "verdict").text()


def drop(widget, at, *paths):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(path) for path in paths])
    none, copy = Qt.KeyboardModifier.NoModifier, Qt.DropAction.CopyAction
    enter = QDragEnterEvent(QPoint(at), copy, data, LEFT, none)
    QApplication.sendEvent(widget, enter)
    assert enter.isAccepted()
    QApplication.sendEvent(widget, QDropEvent(QPointF(at), copy, data, LEFT, none))


@pytest.fixture
def pair(qtbot, window, files):
    """A comparison window with images A and B, which were dropped together."""
    drop(window.view, QPoint(10, 10), files["a"], files["b"])
    qtbot.waitUntil(lambda: window.a.side is not None and window.b.side is not None)
    settled(qtbot, window)
    return window


@pytest.mark.slow
def test_numbers_of_dropped_files(qtbot, pair, files):
    found = compare(files["a"], files["b"])
    assert verdict(pair) == "beauty: different"
    text = numbers(pair)
    assert text["Pixels that differ"].startswith("1 of 600")
    assert text["RMSE"] == f"{found.rmse:.4g}" and text["relMSE"] == f"{found.rel_mse:.4g}"
    assert text["Largest difference"] == "0.5 near 7, 4"
    assert float(text["FLIP, mean"]) > 0.0
    assert text["Other layers"] == "albedo"
    drop(pair.view, QPoint(pair.view.width() - 5, 10), files["a"])
    qtbot.waitUntil(lambda: pair.b.side.name == "a.exr")
    settled(qtbot, pair)
    assert verdict(pair) == "beauty: bit for bit the same"


def test_other_sizes_are_explained_and_shown(qtbot, pair, files):
    pair.open("B", [files["small"]])
    qtbot.waitUntil(lambda: "only pictures of one size" in verdict(pair))
    settled(qtbot, pair)
    assert "A is 30 x 20, B is 30 x 10" in verdict(pair) and numbers(pair) == {}
    assert pair.view.image("B").height() == 10 and pair.view.image("D") is None


def test_a_file_that_is_none_changes_nothing(qtbot, pair, tmp_path):
    (tmp_path / "bad.exr").write_bytes(b"no")
    with qtbot.waitSignal(pair.failed) as failed:
        drop(
            pair.findChild(QLabel, "titleA").parentWidget(), QPoint(5, 5), str(tmp_path / "bad.exr")
        )
    assert "bad.exr" in failed.args[0]
    assert pair.findChild(QLabel, "compareError").text() == failed.args[0]
    assert pair.a.side.name == "a.exr"


def test_keys_switch_flip_and_move_the_line(qtbot, pair):
    view = pair.view
    QTest.mouseClick(pair.findChild(QToolButton, "mode-flip"), LEFT)
    assert view.mode == "flip" and view.shown == "A" and view.hasFocus()
    QTest.keyClick(view, KEYS.Key_F)
    assert view.shown == "B"
    QTest.keyClick(view, KEYS.Key_Space)
    assert view.shown == "A"
    QTest.mouseClick(pair.findChild(QToolButton, "mode-wipe"), LEFT)
    QTest.keyClick(view, KEYS.Key_Right)
    QTest.keyClick(view, KEYS.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    assert view.wipe == pytest.approx(0.41)
    QTest.mousePress(view, LEFT, pos=QPoint(round(view.width() * 0.41), 50))
    QTest.mouseMove(view, QPoint(round(view.width() * 0.75), 50))
    QTest.mouseRelease(view, LEFT, pos=QPoint(round(view.width() * 0.75), 50))
    assert view.wipe == pytest.approx(0.75, abs=0.01)
    assert view.zoom is None


def test_what_a_wipe_shows(qtbot, pair):
    """Image A is left of the line and image B is right of it, as the differing pixel shows."""
    pair.set_mode("wipe")
    view = pair.view
    at = view.target(0).topLeft()
    scale = view.points_per_pixel()
    spot = QPoint(round(at.x() + 7.5 * scale), round(at.y() + 4.5 * scale))

    def shown():
        shot = view.grab().toImage()
        ratio = shot.devicePixelRatio()
        return shot.pixelColor(round(spot.x() * ratio), round(spot.y() * ratio))

    view.set_wipe(1.0)
    assert shown() == view.image("A").pixelColor(7, 4)
    view.set_wipe(0.0)
    assert shown() == view.image("B").pixelColor(7, 4) != view.image("A").pixelColor(7, 4)


def test_zoom_and_pan_are_linked_and_the_pixel_stays(qtbot, pair):
    view = pair.view
    at = QPointF(view.width() * 0.75, view.height() * 0.4)
    before = view.pixel_at(at)
    for _ in range(4):
        event = QWheelEvent(
            at,
            view.mapToGlobal(at),
            QPoint(0, 0),
            QPoint(0, 120),
            Qt.MouseButton.NoButton,
            Qt.KeyboardModifier.NoModifier,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(view, event)
    assert view.zoom is not None and view.pixel_at(at) == before
    twin = at - view.target(1).topLeft() + view.target(0).topLeft()
    assert view.pixel_at(twin) == before
    QTest.mousePress(view, LEFT, pos=at.toPoint())
    QTest.mouseMove(view, (at + QPointF(40, 0)).toPoint())
    QTest.mouseRelease(view, LEFT, pos=(at + QPointF(40, 0)).toPoint())
    assert view.pixel_at(at) != before
    QTest.keyClick(view, KEYS.Key_0)
    assert view.zoom is None and view.pixel_at(at) == before


def test_values_under_the_mouse(qtbot, pair):
    view = pair.view
    at = view.target(0).topLeft()
    scale = view.points_per_pixel()
    QTest.mouseMove(view, QPoint(round(at.x() + 7.5 * scale), round(at.y() + 4.5 * scale)))
    table = pair.findChild(QTableWidget, "pixel")
    qtbot.waitUntil(lambda: table.rowCount() == 4)
    assert table.item(0, 1).text() == "7, 4"
    assert [float(v) for v in table.item(3, 1).text().split()] == pytest.approx(
        [-0.5] * 3, abs=1e-4
    )


@pytest.mark.slow
def test_maps(qtbot, pair):
    combo = pair.findChild(QComboBox, "compare-map")
    QTest.mouseClick(pair.findChild(QToolButton, "mode-difference"), LEFT)
    for kind in ("absolute", "signed", "flip-ldr", "flip-hdr"):
        combo.setCurrentIndex(combo.findData(kind))
        settled(qtbot, pair)
        image = pair.view.image("D")
        assert (image.width(), image.height()) == (30, 20)
        assert image.pixelColor(7, 4).lightness() > 0
        if not kind.startswith("flip"):
            assert image.pixelColor(20, 15).lightness() == 0
    combo.setCurrentIndex(combo.findData("z"))
    assert "needs a variance" in pair.view.message


@pytest.mark.slow
def test_exposure_is_that_of_both_and_of_flip(qtbot, pair):
    before = numbers(pair)
    colour = pair.view.image("A").pixelColor(0, 0)
    pair._exposure.setFocus()
    pair._exposure.stepBy(-4)
    settled(qtbot, pair)
    assert pair.look().exposure == -2.0
    for which in "AB":
        assert pair.view.image(which).pixelColor(0, 0).lightness() < colour.lightness()
    after = numbers(pair)
    assert after["RMSE"] == before["RMSE"] and after["PSNR"] != before["PSNR"]


@pytest.mark.slow
def test_exchange(qtbot, pair):
    QTest.mouseClick(pair.findChild(QToolButton, "swap"), LEFT)
    settled(qtbot, pair)
    assert pair.a.side.name == "b.exr" and numbers(pair)["Mean difference"].startswith("+")


def test_without_a_stage_keeping_says_so(qtbot, window):
    for call in (lambda: window.keep("A"), lambda: window.b.render(window.session.setup)):
        with qtbot.waitSignal(window.failed) as failed:
            call()
        assert "open" in failed.args[0] and "first" in failed.args[0]


@pytest.mark.slow
def test_kept_picture_against_live_settings(qtbot, session):
    """A new policy changes no bits, a new seed changes the noise, and the viewport continues."""
    window = CompareWindow(session)
    qtbot.addWidget(window)
    window.show()
    try:
        window.keep("A")
        window._pickers["B"].render_other()
        live = window.b.live
        policy = window.findChild(QComboBox, "policyB")
        policy.setCurrentIndex(policy.findText("material"))
        policy.activated.emit(policy.currentIndex())
        assert live.setup.policy == "material" and session.setup.policy == "code"

        def done():
            frame = live.last_frame
            return frame is not None and frame.final and frame.version == live.version

        qtbot.waitUntil(done, timeout=120000)
        settled(qtbot, window)
        assert verdict(window) == "beauty: bit for bit the same"
        assert "share all threads" in window._pickers["B"].findChild(QLabel, "sharing").text()
        window.b.change(seed=5)
        qtbot.waitUntil(done, timeout=120000)
        settled(qtbot, window)
        assert verdict(window).startswith("beauty: different")
        assert "seed 5" in window.findChild(QLabel, "titleB").text()
        window.a.follow()
        assert window.a.side.name.startswith("viewport") and live in session.twins
        window.b.keep()
        assert live not in session.twins  # it was released
    finally:
        window.shutdown()


@pytest.mark.slow
def test_keys_of_the_main_window_keep_the_picture(qtbot, cornell, tmp_path):
    from wavecomb.gui.main_window import MainWindow
    from wavecomb.gui.setup import Setup

    settings = QSettings(str(tmp_path / "view.ini"), QSettings.Format.IniFormat)
    window = MainWindow(Setup(width=48, height=48, spp=2), settings)
    qtbot.addWidget(window)
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    compared = window.docks["compare"].widget()
    with qtbot.waitSignal(window.session.failed) as failed:
        QTest.keyClick(window, KEYS.Key_A, SHIFTED)
    assert "open a stage first" in failed.args[0]
    window.open(str(cornell))
    qtbot.waitUntil(lambda: window.session.state == "finished", timeout=120000)
    for key in (KEYS.Key_A, KEYS.Key_B):
        QTest.keyClick(window, key, SHIFTED)
    settled(qtbot, compared)
    assert verdict(compared) == "beauty: bit for bit the same"
    window.close()
