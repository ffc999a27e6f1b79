# SPDX-License-Identifier: Apache-2.0
"""Tests MaterialX materials in the panel: inputs, live edits, undo and layout."""

import numpy as np
import pytest
from mtlx_stage import write_referring, write_stage
from PySide6.QtCore import QPoint, QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QDoubleSpinBox, QLineEdit, QToolButton

import wavecomb
from wavecomb.gui import theme
from wavecomb.gui.main_window import MainWindow
from wavecomb.gui.scene.form_model import Range, differs
from wavecomb.gui.scene.scene_panel import ScenePanel
from wavecomb.gui.scene.value_fields import (
    ColourField,
    DrivenField,
    NumberField,
    SwitchField,
)
from wavecomb.gui.setup import Setup

SIZE, SPP = 32, 1
LOOKS = "/World/Looks"
Control = Qt.KeyboardModifier.ControlModifier


@pytest.fixture(scope="module")
def looks(tmp_path_factory):
    return write_stage(tmp_path_factory.mktemp("looks"))


@pytest.fixture
def panel(new_session, qtbot, final, looks):
    session = new_session(width=SIZE, height=SIZE, spp=SPP)
    made = ScenePanel(session)
    qtbot.addWidget(made)
    made.resize(theme.em(22), 700)
    made.show()
    problems = []
    session.failed.connect(problems.append)
    with qtbot.waitSignal(session.opened, timeout=20000):
        session.open(looks)
    final(session)
    made.tabs.setCurrentWidget(made.materials)
    yield made
    assert problems == []


@pytest.fixture
def same_as_saved(tmp_path, final, qtbot):
    """Waits for the final image and compares it with a render of the saved edits."""

    def check(panel):
        qtbot.waitUntil(lambda: not panel.session._jobs, timeout=20000)
        shown = final(panel.session).beauty
        saved = tmp_path / "edits.usda"
        assert panel.edits.save(str(saved))
        assert (shown == wavecomb.render(saved, size=(SIZE, SIZE), spp=SPP).beauty).all()
        return shown

    return check


def type_value(spin, text):
    spin.setFocus()
    spin.selectAll()
    QTest.keyClicks(spin, text)
    QTest.keyClick(spin, Qt.Key.Key_Return)


def unfold(materials):
    for group in materials.form.groups.values():
        group.head.setChecked(True)


@pytest.mark.slow
def test_an_openpbr_material_shows_its_own_inputs(panel):
    materials = panel.materials
    materials.choose(f"{LOOKS}/Car")
    shown = list(materials.form.groups)
    assert shown == [
        "Base", "Specular", "Transmission", "Subsurface", "Fuzz", "Coat", "Thin Film", "Emission",
        "Geometry",
    ]  # fmt: skip
    fields = materials.fields
    assert {"base_weight", "base_metalness", "coat_ior", "thin_film_thickness"} <= fields.keys()
    assert "metallic" not in fields and "clearcoat" not in fields
    assert fields["base_weight"].value() == 0.5
    assert fields["base_color"].value() == pytest.approx((0.8, 0.1, 0.1))
    assert fields["coat_ior"].value() == pytest.approx(1.6)
    assert isinstance(fields["geometry_thin_walled"], SwitchField)
    assert fields["specular_ior"].bounds.soft_low == 1.0
    assert fields["emission_luminance"].bounds.soft_high == 1000.0
    opened = {name for name, group in materials.form.groups.items() if group.rows.isVisible()}
    assert opened == {"Base", "Coat", "Emission"}, "what is not as by default, and the base"
    QTest.mouseClick(materials.form.groups["Specular"].head, Qt.MouseButton.LeftButton)
    assert materials.form.groups["Specular"].rows.isVisible()
    materials.choose("/World/I1/Gold")
    assert materials.form.groups["Specular"].rows.isVisible(), "it stays as somebody left it"
    materials.choose(f"{LOOKS}/Gltf")
    assert "emissive_strength" in materials.fields and "Iridescence" in materials.form.groups


@pytest.mark.slow
def test_what_a_texture_drives_has_no_value(panel, qtbot):
    """Every material can be selected, and driven inputs show their source in place of a value."""
    materials = panel.materials
    for number, row in enumerate(materials.model.rows):
        materials.view.selectRow(number)
        assert materials.chosen == row
    materials.choose(f"{LOOKS}/Wood")
    for name in ("base_color", "emission_color", "fuzz_weight"):
        assert name not in materials.fields
        driven = materials.findChild(DrivenField, f"field-{name.replace('_', '-')}")
        assert "wood.png" in driven.toolTip()
    panel.edits.changed.emit()


EDITS = [
    ("Car", "base_weight", "0.9"),
    ("Car", "coat_weight", "0.25"),
    ("Car", "specular_ior", "2.1"),
    ("Car", "transmission_weight", "0.8"),
    ("Car", "emission_luminance", "700"),
    ("Wood", "base_weight", "0.4"),
    ("Wood", "emission_luminance", "2500"),
    ("Wood", "specular_roughness", "0.75"),
    ("Standard", "base", "0.7"),
    ("Standard", "opacity", "0.5"),
    ("Standard", "specular_rotation", "0.3"),
    ("Gltf", "clearcoat", "1"),
]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Car", "Wood", "Standard", "Gltf"])
def test_an_edit_is_what_is_saved(panel, same_as_saved, final, name, qtbot):
    """After each edit, the image equals a render of the saved file; undo restores the image."""
    materials = panel.materials
    materials.choose(f"{LOOKS}/{name}")
    before = final(panel.session).beauty
    mine = [(slot, text) for other, slot, text in EDITS if other == name]
    for slot, text in mine:
        unfold(materials)
        type_value(materials.fields[slot].spin, text)
        qtbot.waitUntil(lambda: not panel.session._jobs, timeout=20000)
        assert materials.fields[slot].value() == pytest.approx(float(text))
    edited = same_as_saved(panel)
    assert (edited != before).any()
    for _ in mine:
        panel.undo_action.trigger()
    assert panel.edits.lines() == []
    qtbot.waitUntil(lambda: not panel.session._jobs, timeout=20000)
    assert (final(panel.session).beauty == before).all()


def test_switches_and_colours(panel, same_as_saved, final):
    materials = panel.materials
    before = final(panel.session).beauty
    materials.choose(f"{LOOKS}/Gltf")
    unfold(materials)
    type_value(materials.fields["sheen_color"].spins[0], "0.9")
    materials.choose(f"{LOOKS}/Car")
    unfold(materials)
    type_value(materials.fields["transmission_weight"].spin, "1")
    QTest.mouseClick(
        materials.fields["geometry_thin_walled"].box, Qt.MouseButton.LeftButton, pos=QPoint(6, 6)
    )
    value = panel.session.usd.GetAttributeAtPath(f"{LOOKS}/Car/S.inputs:geometry_thin_walled")
    assert value.Get() is True
    assert (same_as_saved(panel) != before).any()


@pytest.mark.slow
def test_in_an_instance_edits_are_live_only(panel, final, qtbot):
    materials = panel.materials
    before = final(panel.session).beauty
    materials.choose("/World/I1/Gold")
    unfold(materials)
    assert "cannot be saved" in materials.fields["base_metalness"].toolTip()
    type_value(materials.fields["base_metalness"].spin, "0")
    edited = final(panel.session).beauty
    assert (edited != before).any() and "not saved" in panel.edits.lines()[0]
    for shown in (False, True):
        with qtbot.waitSignal(panel.session.opened, timeout=20000):
            panel.edits.set_visible(["/World/D"], shown)
    assert (final(panel.session).beauty == edited).all()


def make_window(qtbot, tmp_path, stage):
    theme.apply("dark")
    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = MainWindow(Setup(width=SIZE, height=SIZE, spp=1), settings)
    qtbot.addWidget(window)
    window.resize(theme.em(100), theme.em(60))
    window.show()
    with qtbot.waitSignal(window.session.opened, timeout=20000):
        window.open(stage)
    window.scene.tabs.setCurrentWidget(window.scene.materials)
    return window


@pytest.mark.slow
def test_all_is_seen_at_the_usual_width(qtbot, tmp_path, looks):
    window = make_window(qtbot, tmp_path, looks)
    materials = window.scene.materials
    assert theme.em(21) <= window.docks["scene"].width() <= theme.em(22.5)
    for number in range(len(materials.model.rows)):
        materials.view.selectRow(number)
        unfold(materials)
        QTest.qWait(1)
        form = materials.form
        assert form.horizontalScrollBar().maximum() == 0
        wide = form.viewport().width()
        for kind in (QDoubleSpinBox, QLineEdit, QToolButton):
            for widget in form.widget().findChildren(kind):
                left = widget.mapTo(form.widget(), QPoint(0, 0)).x()
                assert left >= 0 and left + widget.width() <= wide, widget.objectName()
        for spin in form.widget().findChildren(QDoubleSpinBox):
            text = spin.fontMetrics().horizontalAdvance("0.000")
            assert spin.lineEdit().width() >= text + 4, spin.accessibleName()
    window.close()


@pytest.mark.slow
def test_undo_in_a_field_undoes_the_edit(qtbot, tmp_path, looks):
    """A typed value is one undo step, however slowly typed. The text field has no separate undo."""
    window = make_window(qtbot, tmp_path, looks)
    materials, edits = window.scene.materials, window.scene.edits
    materials.choose(f"{LOOKS}/Car")
    clock = [100.0]
    edits.history.now = lambda: clock[0]
    spin = materials.fields["base_weight"].spin
    window.activateWindow()
    spin.setFocus()
    qtbot.waitUntil(spin.hasFocus)
    spin.selectAll()
    for key in "0.75":
        QTest.keyClick(spin, key)
        clock[0] += 3.0
    assert materials.fields["base_weight"].value() == 0.75 and len(edits.lines()) == 1
    QTest.keyClick(spin, Qt.Key.Key_Z, Control)
    assert edits.lines() == [] and spin.value() == 0.5
    QTest.keyClick(spin, Qt.Key.Key_Z, Control)
    assert spin.value() == 0.5, "nothing more to take back"
    QTest.keyClick(spin, Qt.Key.Key_Y, Control)
    assert spin.value() == 0.75 and len(edits.lines()) == 1
    for text in ("0.25", "0.125"):
        type_value(spin, text)
    QTest.keyClick(spin, Qt.Key.Key_Z, Control)
    assert spin.value() == 0.25
    field = window.scene.tree.field
    window.scene.tabs.setCurrentIndex(0)
    field.setFocus()
    QTest.keyClicks(field, "abc")
    QTest.keyClick(field, Qt.Key.Key_Z, Control)
    assert field.text() == "" and len(edits.lines()) == 1
    window.close()


def test_digits_are_typed_where_they_were_begun(qtbot):
    """The cursor does not move when the stage rounds a value to 32 bits."""
    field = NumberField("x", Range(0.0, 10.0, 0.0, 1.0))
    qtbot.addWidget(field)
    field.show()
    from wavecomb.usd.materials.parameters import as_stored

    def back(value):
        if differs(field.value(), as_stored(value)):
            field.set_value(as_stored(value))

    field.changed.connect(back)
    type_value(field.spin, "0.123")
    assert field.value() == 0.123


def test_a_value_out_of_range_is_shown(qtbot):
    field = ColourField("x")
    qtbot.addWidget(field)
    field.set_value((5.0, 0.5, 0.25))
    assert field.value() == (5.0, 0.5, 0.25) and field.spins[0].value() == 5.0


def test_what_usd_says_goes_to_the_notes(new_session, qtbot, final, tmp_path, capfd):
    """Both USD stages of the window resolve .mtlx files, and a missing layer is reported."""
    path = write_referring(tmp_path)
    session = new_session(width=SIZE, height=SIZE, spp=1)
    panel = ScenePanel(session)
    qtbot.addWidget(panel)
    panel.show()
    for again in (False, True):
        with qtbot.waitSignal(session.opened, timeout=20000):
            session.reload() if again else session.open(path)
        final(session)
        lines = [row.line() for row in panel.notes.model.rows]
        assert "warning: cannot open layer: gone.usda" in lines
        assert not any("brick" in line for line in lines)
    assert session.usd.GetPrimAtPath("/World/Looks/Materials/Brick")
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("", "")


def test_what_usd_says_on_this_thread(new_session, qtbot, final, tmp_path, capfd):
    from pxr import Tf

    from wavecomb.usd.stage.report import DiagnosticListener

    session = new_session(width=SIZE, height=SIZE, spp=1)
    panel = ScenePanel(session)
    qtbot.addWidget(panel)
    with qtbot.waitSignal(session.opened, timeout=20000):
        session.open(write_referring(tmp_path))
    listening = DiagnosticListener()
    try:
        assert listening.take() is None
        Tf.Warn("something odd")
        with pytest.raises(Tf.ErrorException):
            Tf.RaiseCodingError("an error is still an exception")
        session.note_words(listening.take())
        assert listening.take() is None
    finally:
        listening.stop()
    assert "warning: USD: something odd" in [row.line() for row in panel.notes.model.rows]
    assert capfd.readouterr().err == ""
    assert np.isfinite(final(session).beauty).all()
