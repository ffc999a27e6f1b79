# SPDX-License-Identifier: Apache-2.0
"""Tests the viewport: camera movements, zoom, pan, render region and picking."""

import numpy as np
import pytest
from conftest import wait_final
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

Alt, Control, Shift, No = (
    Qt.KeyboardModifier.AltModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.NoModifier,
)
Left, Middle, Right = (
    Qt.MouseButton.LeftButton,
    Qt.MouseButton.MiddleButton,
    Qt.MouseButton.RightButton,
)


def drag(widget, button, start, end, modifiers=No, steps=4):
    """Presses a mouse button, moves in steps and releases it.

    QTest.mouseMove cannot hold a button.
    """
    start, end = QPointF(*start), QPointF(*end)
    QTest.mousePress(widget, button, modifiers, start.toPoint())
    for k in range(1, steps + 1):
        move(widget, start + (end - start) * (k / steps), button, modifiers)
    QTest.mouseRelease(widget, button, modifiers, end.toPoint())


def move(widget, place, button=Qt.MouseButton.NoButton, modifiers=No):
    event = QMouseEvent(
        QEvent.Type.MouseMove, place, widget.mapToGlobal(place), Qt.MouseButton.NoButton, button,
        modifiers,
    )  # fmt: skip
    QApplication.sendEvent(widget, event)


def wheel(widget, place, notches, modifiers=No):
    place = QPointF(*place)
    event = QWheelEvent(
        place, widget.mapToGlobal(place), QPoint(), QPoint(0, 120 * notches),
        Qt.MouseButton.NoButton, modifiers, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(widget, event)


@pytest.fixture
def viewport(cornell_window):
    cornell_window.viewport.setFocus()
    return cornell_window.viewport


def middle(viewport):
    return viewport.width() / 2, viewport.height() / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("button", "modifiers"), [(Middle, No), (Left, Alt)], ids=["blender", "usdview"]
)
def test_orbit(viewport, button, modifiers):
    session, (x, y) = viewport.session, middle(viewport)
    before = session.pose
    drag(viewport, button, (x, y), (x + 60, y), modifiers)
    pivot = viewport.pivot()
    assert np.linalg.norm(session.pose.position - pivot) == pytest.approx(
        np.linalg.norm(before.position - pivot)
    )
    assert (session.pose.position - before.position) @ before.right < 0
    assert session.pose.path is None


@pytest.mark.slow
def test_pictures_follow_while_it_is_dragged(viewport, qtbot):
    session, shown = viewport.session, []
    viewport.shown.connect(lambda frame, look: shown.append(frame.version))
    drag_start = QPointF(*middle(viewport))
    QTest.mousePress(viewport, Middle, No, drag_start.toPoint())
    for k in range(100):
        move(viewport, drag_start + QPointF(k, 0), Middle)
        qtbot.wait(5)
    during = len(shown)
    QTest.mouseRelease(viewport, Middle, No, (drag_start + QPointF(99, 0)).toPoint())
    assert during >= 3 and shown == sorted(shown)
    wait_final(qtbot, session)
    qtbot.waitUntil(lambda: viewport.frame_shown is session.last_frame)


@pytest.mark.slow
def test_pan_takes_what_is_under_the_cursor_along(viewport):
    session, (x, y) = viewport.session, middle(viewport)
    at = viewport.to_picture(QPointF(x, y))
    before = session.pick(at.x(), at.y())["position"]
    drag(viewport, Middle, (x, y), (x + 40, y + 30), Shift)
    wait_settled(viewport)
    at = viewport.to_picture(QPointF(x + 40, y + 30))
    assert session.pick(at.x(), at.y())["position"] == pytest.approx(before, abs=2.0)


def wait_settled(viewport):
    from PySide6.QtTest import QTest as q

    for _ in range(500):
        q.qWait(20)
        frame = viewport.session.last_frame
        if frame.final and frame.version == viewport.session.version:
            return
    raise AssertionError("the render did not end")


@pytest.mark.slow
@pytest.mark.parametrize("way", ["wheel", "Ctrl+Middle", "Alt+Right"])
def test_dolly(viewport, way):
    session, (x, y) = viewport.session, middle(viewport)
    before = session.pose.position.copy()
    if way == "wheel":
        wheel(viewport, (x, y), 2)
    elif way == "Ctrl+Middle":
        drag(viewport, Middle, (x, y), (x, y - 30), Control)
    else:
        drag(viewport, Right, (x, y), (x, y - 30), Alt)
    pivot = viewport.pivot()
    ratio = np.linalg.norm(session.pose.position - pivot) / np.linalg.norm(before - pivot)
    assert 0.5 < ratio < 0.9


def test_keys_move_the_camera(viewport):
    session = viewport.session
    for key, modifiers in (
        (Qt.Key.Key_Left, No), (Qt.Key.Key_Up, No), (Qt.Key.Key_Right, Shift),
        (Qt.Key.Key_PageUp, No), (Qt.Key.Key_1, No), (Qt.Key.Key_3, No), (Qt.Key.Key_7, No),
        (Qt.Key.Key_9, No), (Qt.Key.Key_Home, No),
    ):  # fmt: skip
        before = session.pose
        QTest.keyClick(viewport, key, modifiers)
        assert session.pose is not before, key
    QTest.keyClick(viewport, Qt.Key.Key_0)
    assert session.pose.path == "/World/Camera"


@pytest.mark.slow
def test_front_right_and_top_are_along_the_axes(viewport):
    for key, axis in ((Qt.Key.Key_1, 2), (Qt.Key.Key_3, 0), (Qt.Key.Key_7, 1)):
        QTest.keyClick(viewport, key)
        assert viewport.session.pose.back[axis] == pytest.approx(1.0)


def test_click_selects_and_f_frames_it(viewport):
    session = viewport.session
    place = viewport.from_picture(QPointF(62, 75)).toPoint()
    QTest.mouseClick(viewport, Left, No, place)
    assert session.selection.endswith("Block")
    assert ("prim", session.selection) in [
        row for row in wait_rows(viewport.window()) if row[0] == "prim"
    ]
    QTest.keyClick(viewport, Qt.Key.Key_F)
    bounds = session.selected_bounds()
    assert np.allclose(viewport.pivot(), bounds.mean(axis=0))
    distance = np.linalg.norm(session.pose.position - viewport.pivot())
    assert distance < 5 * np.linalg.norm(bounds[1] - bounds[0])


def wait_rows(window):
    for _ in range(50):
        QTest.qWait(20)
        rows = window.inspector.rows()
        if rows:
            return rows
    return []


def test_zoom_about_the_cursor_and_back(viewport):
    assert viewport.is_fitted()
    place = QPointF(300, 200)
    before = viewport.to_picture(place)
    pose = viewport.session.pose
    wheel(viewport, (300, 200), 3, Control)
    after = viewport.to_picture(place)
    assert not viewport.is_fitted() and viewport.session.pose is pose
    assert (before - after).manhattanLength() < 0.5
    zoom, corner = viewport.zoom(), viewport.picture_rect().topLeft()
    drag(viewport, Right, (300, 200), (340, 225))
    moved = viewport.picture_rect().topLeft() - corner
    assert (moved.x(), moved.y()) == pytest.approx((40, 25), abs=1.0)
    assert viewport.zoom() == zoom
    QTest.keyClick(viewport, Qt.Key.Key_1, Control)
    assert viewport.zoom() == 1.0 and viewport.picture_rect().width() == 96
    QTest.keyClick(viewport, Qt.Key.Key_0, Control)
    assert viewport.is_fitted()


@pytest.mark.slow
def test_at_100_percent_the_screen_has_the_pixels_of_the_picture(viewport, qtbot):
    from wavecomb.image.files import image

    viewport.set_zoom(1.0)
    viewport.repaint()
    grabbed = viewport.grab().toImage()
    corner = viewport.picture_rect().topLeft() * viewport.devicePixelRatioF()
    codes = image.display(viewport.session.last_frame.beauty)
    for x, y in ((3, 5), (50, 40), (90, 95), (20, 70)):
        shown = grabbed.pixelColor(round(corner.x()) + x, round(corner.y()) + y)
        assert shown.getRgb()[:3] == tuple(int(c) for c in codes[y, x])


@pytest.mark.slow
def test_region_by_dragging(viewport, qtbot):
    session, window = viewport.session, viewport.window()
    QTest.keyClick(window, Qt.Key.Key_B, Control)
    a, b = (viewport.from_picture(QPointF(*p)) for p in ((10.4, 20.4), (59.6, 49.6)))
    drag(viewport, Left, (a.x(), a.y()), (b.x(), b.y()))
    x0, y0, x1, y1 = session.setup.region
    assert (x0, y0, x1, y1) == pytest.approx((10, 20, 60, 50), abs=1)
    samples = wait_final(qtbot, session).layers["samples"]
    assert samples[:, :9].sum() == 0 and samples[30, 30] == 4
    assert not window.actions_by_name["region"].isChecked()
    QTest.keyClick(window, Qt.Key.Key_B, Control | Alt)
    assert session.setup.region is None


@pytest.mark.slow
def test_escape_leaves_the_region_mode(viewport):
    QTest.keyClick(viewport.window(), Qt.Key.Key_B, Control)
    assert viewport.cursor().shape() == Qt.CursorShape.CrossCursor
    QTest.keyClick(viewport, Qt.Key.Key_Escape)
    assert viewport.cursor().shape() == Qt.CursorShape.ArrowCursor
    assert viewport.session.setup.region is None


@pytest.mark.slow
def test_inspector_shows_the_pixel_under_the_cursor(viewport, qtbot):
    window, frame = viewport.window(), viewport.session.last_frame
    move(viewport, viewport.from_picture(QPointF(30.5, 80.5)))
    qtbot.waitUntil(lambda: len(window.inspector.rows()) > 6, timeout=5000)
    rows = dict(window.inspector.rows())
    assert rows["samples"] == "4"
    values = [float(text) for text in rows["beauty"].split()]
    assert values == pytest.approx(frame.beauty[80, 30], rel=1e-3)
    assert rows["prim"].startswith("/World/") and "material" in rows
    assert float(rows["depth"]) == pytest.approx(float(frame.layers["depth"][80, 30]), rel=1e-3)


@pytest.mark.slow
def test_grid_of_large_pixels(viewport):
    viewport.set_zoom(32.0)
    plain = viewport.grab().toImage()
    a = viewport.from_picture(QPointF(50, 50)).toPoint()
    inside = plain.pixelColor(a.x() + 16, a.y() + 16)
    line = plain.pixelColor(a.x(), a.y() + 16)
    assert inside != line
