# SPDX-License-Identifier: Apache-2.0
"""Tests toolbars, menus, messages, colours, and settings that are kept between windows."""

import threading

import numpy as np
import pytest
from conftest import wait_final
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QAction, QDragEnterEvent, QDropEvent, QPalette
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QPushButton,
    QSlider,
    QWidget,
)

from wavecomb.gui import messages, theme
from wavecomb.gui.shortcuts import listed

Control, No = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.NoModifier


def test_an_empty_window_says_how_to_begin(window):
    assert window.viewport.image() is None and "Ctrl+O" in window.viewport._message
    assert window.windowTitle() == "Wavecomb"
    window.save_to("nothing.exr")
    assert "open a stage first" in window.message.text()
    for name in ("frame_all", "restart", "clear_region", "stage_camera", "next_layer"):
        window.actions_by_name[name].trigger()


GONE = """#usda 1.0
def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] (interpolation = "vertex")
    rel material:binding = </Look>
}
def Material "Look"
{
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Look/T.outputs:rgb>
        token outputs:surface
    }
    def Shader "T"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @gone.png@
        float3 outputs:rgb
    }
}
"""


@pytest.mark.slow
def test_drop_opens_a_stage(window, qtbot, cornell):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(cornell))])
    buttons = Qt.MouseButton.LeftButton
    entered = QDragEnterEvent(
        QPointF(50, 50).toPoint(), Qt.DropAction.CopyAction, data, buttons, No
    )
    QApplication.sendEvent(window, entered)
    assert entered.isAccepted()
    with qtbot.waitSignal(window.session.opened, timeout=10000):
        QApplication.sendEvent(
            window, QDropEvent(QPointF(50, 50), Qt.DropAction.CopyAction, data, buttons, No)
        )
    assert window.recent() == [str(cornell.resolve())]
    assert "cornell.usda" in window.windowTitle()
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile("/a/picture.png")])
    entered = QDragEnterEvent(
        QPointF(50, 50).toPoint(), Qt.DropAction.CopyAction, data, buttons, No
    )
    entered.ignore()
    QApplication.sendEvent(window, entered)
    assert not entered.isAccepted()


@pytest.mark.slow
def test_an_error_is_shown_until_it_is_closed(cornell_window, qtbot, tmp_path):
    window = cornell_window
    window.open(tmp_path / "none.usda")
    qtbot.waitUntil(lambda: "no such file" in window.message.text(), timeout=5000)
    assert "Traceback" not in window.message.text()
    window.message.show_warning("something smaller")
    assert "no such file" in window.message.text()
    close = window.message.findChild(object, "message.close")
    QTest.mouseClick(close, Qt.MouseButton.LeftButton)
    assert window.message.text() == ""


@pytest.mark.slow
def test_controls_of_the_render(cornell_window, qtbot):
    window, bar = cornell_window, cornell_window.render_bar
    controls = window.docks["render"].widget().controls
    for box, field, value in (
        (controls["spp"], "spp", 2), (controls["max_depth"], "max_depth", 3),
        (bar.wide, "width", 64), (bar.high, "height", 48),
    ):  # fmt: skip
        box.setFocus()
        box.selectAll()
        QTest.keyClicks(box, str(value))
        assert getattr(window.session.setup, field) != value, "taken before it was entered"
        QTest.keyClick(box, Qt.Key.Key_Return)
        assert getattr(window.session.setup, field) == value
    frame = wait_final(qtbot, window.session)
    assert frame.beauty.shape == (48, 64, 3) and frame.layers["samples"].max() == 2
    assert bar.camera.currentText() == "Camera" and bar.camera.itemText(0) == "Free camera"
    window.viewport.orbit(0.1, 0.0)
    assert bar.camera.currentIndex() == 0
    bar.camera.setCurrentIndex(1)
    bar.camera.activated.emit(1)
    assert window.session.pose.path == "/World/Camera"


def test_exposure_and_view_change_what_is_shown(cornell_window, qtbot):
    from wavecomb.image.files import image

    window = cornell_window
    window.viewport.set_zoom(1.0)
    window.viewport.setFocus()
    with qtbot.waitSignal(window.viewport.shown, timeout=5000):
        QTest.keyClick(window.viewport, Qt.Key.Key_BracketRight)
    assert window.display.exposure.value() == 0.5 and window.display.slider.value() == 10
    with qtbot.waitSignal(window.viewport.shown, timeout=5000):
        window.display.set_view("Neutral")
    codes = image.display(window.session.last_frame.beauty, exposure=0.5, tone_map="neutral")
    shown = window.viewport.image()
    assert shown.pixelColor(40, 50).getRgb()[:3] == tuple(int(c) for c in codes[50, 40])


@pytest.mark.slow
def test_layers_and_their_legend(cornell_window, qtbot):
    window, display = cornell_window, cornell_window.display

    def shows(layer):
        window_look = window.viewport.look.layer
        frame = window.session.last_frame
        return window_look == layer and frame.final and frame.layer(layer) is not None

    version = window.session.version
    display.choose_layer("depth")
    assert window.session.version == version, "a layer that is kept needs no new render"
    qtbot.waitUntil(lambda: window.viewport.legend() is not None, timeout=5000)
    assert not display.exposure.isVisible()
    display.choose_layer("cost")
    qtbot.waitUntil(lambda: shows("cost"), timeout=20000)
    qtbot.waitUntil(lambda: "ns per pixel" in window.viewport.legend().title, timeout=5000)
    display.automatic.setChecked(False)
    display.high.setValue(1e6)
    qtbot.waitUntil(lambda: window.viewport.legend().high == 1e6, timeout=5000)
    window.viewport.grab()
    display.choose_layer("beauty")
    qtbot.waitUntil(lambda: window.viewport.legend() is None, timeout=5000)


@pytest.mark.slow
def test_png_of_a_heat_map_is_what_is_shown(cornell_window, qtbot, tmp_path):
    from wavecomb.image.files.image import read_image, srgb_from_linear

    window, path = cornell_window, tmp_path / "depth.png"
    window.display.choose_layer("depth")
    qtbot.waitUntil(lambda: window.viewport.legend() is not None, timeout=5000)
    with qtbot.waitSignal(window.session.saved, timeout=5000):
        window.save_to(str(path))
    codes = np.round(srgb_from_linear(read_image(path)) * 255)
    shown = window.viewport.image()
    assert shown.pixelColor(40, 50).getRgb()[:3] == tuple(int(c) for c in codes[50, 40])


def test_a_missing_denoiser_is_told(cornell_window, monkeypatch):
    import importlib

    real = importlib.import_module

    def without(name, *rest):
        if name == "pyoidn":
            raise ImportError("No module named 'pyoidn'")
        return real(name, *rest)

    monkeypatch.setattr(importlib, "import_module", without)
    denoise = cornell_window.docks["render"].widget().denoise
    denoise.click()
    assert "pip install 'pyoidn>=2.5'" in cornell_window.message.text()
    assert not denoise.isChecked()
    assert not cornell_window.session.setup.denoise


def test_shortcuts_are_listed_from_the_actions_and_are_unambiguous(window):
    rows = listed(window)
    texts = [text for text, _ in rows]
    for wanted in ("Open", "Frame selected", "Region", "Keyboard shortcuts", "Exposure 0"):
        assert wanted in texts
    keys = [key.toString() for action in window.findChildren(QAction) for key in action.shortcuts()]
    assert len(keys) == len(set(keys))
    window.show_shortcuts()
    dialog = window._dialog
    dialog.search.setText("orbit")
    hidden = [dialog.table.isRowHidden(row) for row in range(dialog.table.rowCount())]
    assert not all(hidden) and any(hidden)
    window.show_about()
    assert "Apache" in window._dialog.text()


def test_every_control_has_a_name_and_a_tooltip(window):
    kinds = (QAbstractSpinBox, QComboBox, QCheckBox, QPushButton, QSlider)
    for kind in kinds:
        for control in window.findChildren(kind):
            if control.objectName().startswith("qt_") or not control.isEnabled():
                continue
            where = f"{type(control).__name__} {control.objectName()!r}"
            assert control.objectName(), where
            assert control.toolTip(), where
            assert control.accessibleName() or control.property("text"), where


@pytest.mark.parametrize("colours", ["dark", "light"])
def test_text_is_readable_in_both_colours(window, colours):
    window.set_theme(colours)
    palette = QApplication.palette()

    def luminance(colour):
        channels = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
                    for c in colour.getRgbF()[:3]]  # fmt: skip
        return 0.2126 * channels[0] + 0.7152 * channels[1] + 0.0722 * channels[2]

    def contrast(a, b):
        high, low = sorted((luminance(a), luminance(b)), reverse=True)
        return (high + 0.05) / (low + 0.05)

    # WCAG 2 contrast: 4.5 for text, 3 for graphics.
    assert contrast(palette.windowText().color(), palette.window().color()) > 4.5
    assert contrast(palette.text().color(), palette.base().color()) > 4.5
    assert contrast(palette.buttonText().color(), palette.button().color()) > 4.5
    assert contrast(theme.error(), palette.window().color()) > 4.5
    assert contrast(theme.warning(), palette.window().color()) > 4.5
    for n in range(8):
        assert contrast(theme.series(n), theme.surface()) > 3.0, n
    assert window.settings.value("theme") == colours


@pytest.mark.slow
def test_the_state_is_kept(window, qtbot):
    from wavecomb.gui.main_window import MainWindow

    window.display.set_view("Neutral")
    window.docks["inspector"].hide()
    window.resize(780, 577)
    size = window.size()
    window.close()
    other = MainWindow(settings=window.settings)
    other.show()
    assert other.viewport.look.view == "Neutral"
    assert not other.docks["inspector"].isVisible()
    assert other.size() == size
    other.reset_layout()
    assert other.docks["inspector"].isVisible()
    other.close()


def test_faults_become_a_line_and_a_file(window, qtbot, tmp_path, monkeypatch):
    monkeypatch.setattr(messages, "log_folder", lambda: tmp_path / "logs")
    remove = messages.install_hooks(window.message.show_error)
    try:
        thread = threading.Thread(target=lambda: 1 / 0)
        thread.start()
        thread.join()
        qtbot.waitUntil(lambda: "ZeroDivisionError" in window.message.text(), timeout=5000)
    finally:
        remove()
    (report,) = (tmp_path / "logs").iterdir()
    assert str(report) in window.message.text() and "\n" not in window.message.text()
    assert "Traceback" in report.read_text()


def test_closing_ends_all_threads(window, qtbot, cornell):
    with qtbot.waitSignal(window.session.opened, timeout=10000):
        window.open(cornell)
    window.session.change(spp=100_000)
    qtbot.wait(100)
    window.close()
    names = [thread.name for thread in threading.enumerate()]
    assert not [name for name in names if name.startswith("wavecomb-")]


@pytest.mark.slow
def test_colours_reach_every_widget(window, qapp):
    for dock in window.docks.values():
        dock.show()
    for colours, is_dark in (("light", False), ("dark", True)):
        theme.apply(colours)
        qapp.processEvents()
        for widget in window.findChildren(QWidget):
            background = widget.palette().color(QPalette.ColorRole.Base)
            text = widget.palette().color(QPalette.ColorRole.Text)
            where = f"{type(widget).__name__} {widget.objectName()} in {colours}"
            assert (background.lightness() < 128) == is_dark, where
            assert (text.lightness() > 128) == is_dark, where


def test_panels_leave_room_for_the_picture(window, qtbot):
    for name, dock in window.docks.items():
        assert dock.minimumSizeHint().width() <= 600, name
    assert window.docks["scheduling"].isHidden(), "for researchers"
    for size in ((1300, 700), (900, 600)):
        window.resize(*size)
        qtbot.waitUntil(lambda: window.viewport.width() >= window.width() // 2)


def test_findings_are_told_over_the_picture(window, qtbot, tmp_path):
    stage = tmp_path / "gone.usda"
    stage.write_text(GONE)
    with qtbot.waitSignal(window.session.opened, timeout=10000):
        window.open(stage)
    qtbot.waitUntil(lambda: "gone.png" in window.findings.text())
    assert window.findings.parent() is window.viewport and window.message.text() == ""
    window.scene.tabs.setCurrentIndex(0)
    window.findings.findChild(object, "findings.details").click()
    assert window.scene.tabs.currentWidget() is window.scene.notes
    window.findings.findChild(object, "findings.close").click()
    assert window.findings.text() == ""


def test_the_render_panel_changes_settings(window):
    panel, session = window.docks["render"].widget(), window.session
    panel.controls["noise"].setValue(0.02)
    assert session.setup.noise == 0.02 and session.setup.min_spp == session.setup.spp == 4
    panel.controls["spp"].setValue(2)
    assert session.setup.min_spp == 2
    caustics = panel.controls["transport"]
    caustics.setCurrentIndex(caustics.findText("light paths"))
    caustics.activated.emit(caustics.currentIndex())
    assert session.setup.transport == "light"
    session.change(noise=0.0, transport="path")
    assert panel.controls["noise"].text() == "off" and caustics.currentText() == "camera paths"


def test_ctrl_s_saves_edits_and_asks_only_once(cornell_window, qtbot, tmp_path, monkeypatch):
    window, asked = cornell_window, []
    layer = tmp_path / "edits.usda"

    def ask(*arguments, **options):
        asked.append(options["start"])
        arguments[3](str(layer))

    monkeypatch.setattr("wavecomb.gui.scene.scene_panel.ask_file", ask)
    window.activateWindow()
    for count in range(2):
        window.scene.edits.set_light(window.scene.lights.model.rows[0], "exposure", 1.0 + count)
        QTest.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
        assert f"exposure = {1 + count}" in layer.read_text()
    assert len(asked) == 1
