# SPDX-License-Identifier: Apache-2.0
"""Tests the scene panel with real keys and clicks; images equal renders of the edited stage."""

import numpy as np
import pytest
from pxr import Sdf, Usd
from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMenu, QStyle, QStyleOptionViewItem
from scene_stage import write_stage

import wavecomb
from wavecomb.gui.scene.scene_model import NAME, VARIANTS, VISIBILITY
from wavecomb.gui.scene.scene_panel import ScenePanel
from wavecomb.gui.scene.value_fields import DrivenField
from wavecomb.gui.swatch import from_display, to_display

SIZE, SPP = 40, 2
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def stage_path(tmp_path_factory):
    return write_stage(tmp_path_factory.mktemp("scene"))


@pytest.fixture
def open_panel(new_session, qtbot, final):
    def make(path):
        session = new_session(width=SIZE, height=SIZE, spp=SPP)
        panel = ScenePanel(session)
        qtbot.addWidget(panel)
        panel.resize(500, 700)
        panel.show()
        problems = []
        session.failed.connect(problems.append)
        panel.problems = problems
        with qtbot.waitSignal(session.opened, timeout=20000):
            session.open(path)
        final(session)
        return panel

    return make


@pytest.fixture
def panel(open_panel, stage_path):
    made = open_panel(stage_path)
    yield made
    assert made.problems == []


@pytest.fixture
def same_as_saved(tmp_path, final, qtbot):
    """Waits for the image and compares it with a render of the saved edits."""

    def check(panel):
        session = panel.session
        settle(qtbot, session)
        shown = final(session).beauty
        saved = tmp_path / "edits.usda"
        assert panel.edits.save(str(saved))
        assert (shown == picture(saved)).all()
        return shown

    return check


def picture(path):
    return wavecomb.render(path, size=(SIZE, SIZE), spp=SPP).beauty


def settle(qtbot, session):
    """Waits until the session has read its stage."""
    busy = []
    session.busy.connect(busy.append)
    qtbot.waitUntil(lambda: not session._jobs, timeout=20000)


def click(view, index, where=None):
    view.scrollTo(index)
    rect = view.visualRect(index)
    at = where(rect) if where else rect.center()
    QTest.mouseClick(view.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, at)


def row(panel, path, column=NAME):
    index = panel.tree.model.index_of(Sdf.Path(path))
    assert index.isValid(), path
    return index.siblingAtColumn(column)


def type_value(spin, text):
    spin.setFocus()
    spin.selectAll()
    QTest.keyClicks(spin, text)
    QTest.keyClick(spin, Qt.Key.Key_Return)


def test_space_and_eye_toggle(panel, same_as_saved, qtbot, stage_path):
    view, model = panel.tree.view, panel.tree.model
    ball = row(panel, "/World/Things/Ball")
    view.expand(row(panel, "/World/Things"))
    click(view, ball)
    assert panel.session.selection == "/World/Things/Ball"
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        QTest.keyClick(view, Qt.Key.Key_Space)
    hidden = same_as_saved(panel)
    before = picture(stage_path)
    assert (hidden != before).any()
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        click(view, row(panel, "/World/Things/Ball", VISIBILITY))
    assert (same_as_saved(panel) == before).all()
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        panel.undo_action.trigger()
    assert (same_as_saved(panel) == hidden).all()
    assert panel.edits.is_hidden("/World/Things/Ball")
    assert view.isExpanded(row(panel, "/World/Things"))
    assert model.data(row(panel, "/World/Things/Ball", VISIBILITY), Qt.ItemDataRole.ToolTipRole)
    assert panel.state.text() == "1 edited"


def test_keys_of_the_window(qtbot, stage_path, tmp_path):
    """Key F in the prim tree frames the selection; Ctrl+Z undoes edits wherever the focus is."""
    from PySide6.QtCore import QSettings

    from wavecomb.gui.main_window import MainWindow
    from wavecomb.gui.setup import Setup

    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = MainWindow(Setup(width=SIZE, height=SIZE, spp=1), settings)
    qtbot.addWidget(window)
    window.show()
    with qtbot.waitSignal(window.session.opened, timeout=20000):
        window.open(stage_path)
    view = window.scene.tree.view
    window.session.select("/World/Sign")
    view.setFocus()
    before = window.session.pose
    QTest.keyClick(view, Qt.Key.Key_F)
    assert (window.session.pose.to_world != before.to_world).any()
    window.scene.edits.set_light("/World/Lights/Key", "exposure", 2.0)
    QTest.keyClick(view, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.scene.edits.lines() == []
    with qtbot.waitSignal(window.session.opened, timeout=20000):
        QTest.keyClick(view, Qt.Key.Key_Space)
    assert window.scene.edits.is_hidden("/World/Sign") and window.session.state != "paused"
    window.close()


def test_instances_are_shown_and_say_why_not(panel):
    model = panel.tree.model
    assert model.data(row(panel, "/World/I1", 1)) == "Xform (instance)"
    knob = row(panel, "/World/I1/Knob", VISIBILITY)
    assert "inside an instance" in model.data(knob, Qt.ItemDataRole.ToolTipRole)
    view = panel.tree.view
    view.expand(row(panel, "/World/I1"))
    click(view, knob)
    assert panel.edits.lines() == []


def test_variants_by_combo_and_menu(panel, same_as_saved, qtbot, stage_path):
    panel.tree.choose("/World/Sign")
    panel.session.select("/World/Sign")
    combo = panel.variants.combos["look"]
    assert combo.isVisible() and combo.currentText() == "ball"
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        combo.setFocus()
        QTest.keyClick(combo, Qt.Key.Key_Down)
    boxed = same_as_saved(panel)
    assert (boxed != picture(stage_path)).any()
    assert panel.tree.model.data(row(panel, "/World/Sign", VARIANTS)) == "look: box"
    assert panel.tree.model.data(row(panel, "/World/Sign/Shape", 1)) == "Cube"
    click(panel.tree.view, row(panel, "/World/Sign", VARIANTS))
    menu = panel.findChild(QMenu, "variant-menu")
    (ball,) = [action for action in menu.actions() if action.text() == "ball"]
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        QTest.mouseClick(menu, LEFT, pos=menu.actionGeometry(ball).center())
    assert (same_as_saved(panel) == picture(stage_path)).all()


def test_material_parameters(panel, same_as_saved, stage_path, final):
    before = final(panel.session).beauty
    panel.tabs.setCurrentWidget(panel.materials)
    materials = panel.materials
    # Materials with equal parameters are separate.
    names = [one.name for one in materials.model.rows]
    assert {"Red", "Wood", "Twin", "Gold"} <= set(names)
    materials.choose("/World/Looks/Red")
    field = materials.fields["base_color"]
    assert field.value() == pytest.approx((0.8, 0.1, 0.1)) and not field.back.isEnabled()
    type_value(field.spins[2], "0.9")
    edited = same_as_saved(panel)
    assert (edited != before).any()
    stage = panel.session.usd
    value = stage.GetAttributeAtPath("/World/Looks/Red/S.inputs:diffuseColor").Get()
    assert tuple(value) == pytest.approx((0.8, 0.1, 0.9))
    twin = panel.edits.material_ids("/World/Looks/Twin")[0]
    assert panel.session.scene.material(twin)["base_color"][2] == pytest.approx(0.1)
    QTest.mouseClick(field.back, LEFT)
    assert (final(panel.session).beauty == before).all()
    assert panel.edits.lines() == [] and not field.back.isEnabled()
    panel.undo_action.trigger()
    assert (same_as_saved(panel) == edited).all()
    assert field.value()[2] == pytest.approx(0.9)


def test_one_attribute_of_two_parameters_and_textures(panel, same_as_saved):
    materials = panel.materials
    panel.tabs.setCurrentWidget(materials)
    materials.choose("/World/Looks/Wood")
    assert "base_color" not in materials.fields
    driven = materials.findChild(DrivenField, "field-base-color")
    assert "wood.png" in driven.toolTip() and "base color" in driven.accessibleName()
    slider = materials.fields["roughness"].slider
    slider.setFocus()
    QTest.keyClick(slider, Qt.Key.Key_PageUp)
    assert materials.fields["clearcoat"].value() == materials.fields["roughness"].value() > 0.3
    same_as_saved(panel)
    assert panel.edits.lines()[0].startswith("/World/Looks/Wood.inputs:polish = 0.35")


def test_edits_inside_instances_are_live_only(panel, final, qtbot, tmp_path):
    materials = panel.materials
    before = final(panel.session).beauty
    materials.choose("/World/I1/Gold")
    field = materials.fields["base_color"]
    assert "cannot be saved" in field.toolTip()
    field.spins[0].setValue(0.1)
    edited = final(panel.session).beauty
    assert (edited != before).any()
    assert "not saved" in panel.edits.lines()[0]
    warned = []
    panel.session.warned.connect(warned.append)
    assert panel.edits.save(str(tmp_path / "e.usda")) and "1 edit(s) are not in it" in warned[0]
    # The edit survives reloads of the stage.
    for shown in (False, True):
        with qtbot.waitSignal(panel.session.opened, timeout=20000):
            panel.edits.set_visible(["/World/Things"], shown)
    assert (final(panel.session).beauty == edited).all()


def test_lights(panel, same_as_saved, qtbot, stage_path, final):
    lights = panel.lights
    panel.tabs.setCurrentWidget(lights)
    assert lights.model.rows == [f"/World/Lights/{name}" for name in ("Key", "Bulb", "Sky")]
    before = final(panel.session).beauty
    assert lights.choose("/World/Lights/Bulb")
    type_value(lights.fields["exposure"].spin, "1.5")
    brighter = same_as_saved(panel)
    assert brighter.mean() > before.mean()
    lights.choose("/World/Lights/Key")
    type_value(lights.fields["intensity"].spin, "2.5")
    type_value(lights.fields["color"].spins[1], "0.2")
    same_as_saved(panel)
    for name in ("intensity", "color"):
        QTest.mouseClick(lights.fields[name].back, LEFT)
    assert (final(panel.session).beauty == brighter).all()


def test_fields_of_lights_are_what_their_kind_has(panel, same_as_saved, final):
    lights = panel.lights
    panel.tabs.setCurrentWidget(lights)
    before = final(panel.session).beauty
    lights.choose("/World/Lights/Sky")
    assert not {"width", "radius", "normalize"} & lights.fields.keys()
    lights.choose("/World/Lights/Bulb")
    assert {"radius", "normalize", "diffuse", "specular"} <= lights.fields.keys()
    assert "width" not in lights.fields
    type_value(lights.fields["radius"].spin, "0.9")
    wider = same_as_saved(panel)
    assert (wider != before).any()
    lights.fields["normalize"].box.click()
    assert (same_as_saved(panel) != wider).any()
    for name in ("radius", "normalize"):
        QTest.mouseClick(lights.fields[name].back, LEFT)
    assert (final(panel.session).beauty == before).all()


def box(view):
    def where(rect):
        option = QStyleOptionViewItem()
        option.rect = QRect(rect)
        option.features = QStyleOptionViewItem.ViewItemFeature.HasCheckIndicator
        element = QStyle.SubElement.SE_ItemViewItemCheckIndicator
        return view.style().subElementRect(element, option, view).center()

    return where


@pytest.mark.slow
def test_lights_off_and_alone(panel, same_as_saved, qtbot, stage_path):
    lights = panel.lights
    panel.tabs.setCurrentWidget(lights)
    view, model = lights.view, lights.model
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        click(view, model.index(0, 2), box(view))
    assert panel.edits.is_hidden("/World/Lights/Key")
    off = same_as_saved(panel)
    assert len(model.rows) == 3
    for number in (1, 2):
        with qtbot.waitSignal(panel.session.opened, timeout=20000):
            click(view, model.index(number, 3), box(view))
        alone = [not panel.edits.is_hidden(path) for path in model.rows]
        assert alone == [i == number for i in range(3)]
    same_as_saved(panel)
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        click(view, model.index(2, 3), box(view))
    assert (same_as_saved(panel) == off).all()


def test_emission_in_a_stage_without_lights(open_panel, stage_path, tmp_path, same_as_saved, qtbot):
    stage = Usd.Stage.Open(str(stage_path))
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath("/World/Lights").SetActive(False)
    dark = stage_path.with_name("dark.usda")
    stage.Flatten().Export(str(dark))
    panel = open_panel(dark)
    assert panel.lights.model.rows == [""]
    panel.lights.view.selectRow(0)
    type_value(panel.lights.fields["exposure"].spin, "-1")
    assert "soft_dome" in panel.edits.lines()[0]
    panel.edits.undo()
    panel.materials.choose("/World/Looks/Red")
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        panel.materials.fields["emission"].spins[0].setValue(5.0)
    same_as_saved(panel)
    assert panel.lights.model.rows == []


def test_notes(panel, qtbot):
    notes = panel.notes
    panel.tabs.setCurrentWidget(notes)
    rows = [(one.kind, one.what, one.place) for one in notes.model.rows]
    assert ("not supported", "GeometryLight", "/World/Things/Dust") in rows
    assert panel.tabs.tabText(3) == "Notes (1)"
    QTest.keyClicks(notes.field, "geometryl")
    assert notes.view.model().rowCount() == 1 and notes.count.text().startswith("1 of")
    index = notes.view.model().index(0, 1)
    click(notes.view, index)
    QTest.mouseDClick(notes.view.viewport(), LEFT, pos=notes.view.visualRect(index).center())
    assert panel.session.selection == "/World/Things/Dust"
    assert panel.tree.view.chosen() == ["/World/Things/Dust"]
    notes.copy()
    assert QGuiApplication.clipboard().text() == "not supported: GeometryLight: /World/Things/Dust"
    QTest.keyClicks(notes.field, "zzz")
    assert notes.view.model().rowCount() == 0


def test_a_pick_selects_everywhere(panel):
    session = panel.session
    hit = session.pick(9, 20)
    assert hit["object"] == "/World/Things/Ball"
    session.select(hit["object"])
    assert panel.tree.view.chosen() == ["/World/Things/Ball"]
    assert panel.materials.chosen.path == "/World/Looks/Red"
    session.select("/World/Lights/Sky")
    assert panel.lights.chosen == "/World/Lights/Sky"
    session.select("/World/I2/Knob[3]/x")
    session.select(None)
    assert panel.tree.view.chosen() == []


def test_a_camera_is_looked_through(panel, qtbot):
    view = panel.tree.view
    side = row(panel, "/World/Side")
    click(view, side)
    QTest.mouseDClick(view.viewport(), LEFT, pos=view.visualRect(side).center())
    assert panel.session.pose.path == "/World/Side"


def test_edits_while_the_stage_is_read(panel, same_as_saved):
    """Edits made while the stage is being read are in the final image."""
    panel.edits.set_visible(["/World/Things/Box"], False)
    panel.materials.choose("/World/Looks/Red")
    panel.materials.fields["base_color"].spins[1].setValue(0.7)
    panel.edits.set_visible(["/World/Sign"], False)
    panel.edits.set_light("/World/Lights/Key", "exposure", -1.0)
    same_as_saved(panel)
    assert len(panel.edits.lines()) == 4


def test_reload_drops_edits(panel, qtbot, stage_path, final):
    panel.edits.set_light("/World/Lights/Key", "exposure", 3.0)
    with qtbot.waitSignal(panel.session.opened, timeout=20000):
        panel.session.reload()
    assert panel.edits.lines() == [] and not panel.undo_action.isEnabled()
    assert (final(panel.session).beauty == picture(stage_path)).all()
    assert panel.tree.model.rowCount() == 2 - 1


@pytest.mark.slow
def test_many_prims(open_panel, tmp_path, qtbot):
    layer = Sdf.Layer.CreateNew(str(tmp_path / "many.usdc"))
    with Sdf.ChangeBlock():
        for parent in range(20):
            group = Sdf.CreatePrimInLayer(layer, f"/World/G{parent}")
            group.specifier, group.typeName = Sdf.SpecifierDef, "Scope"
            for child in range(5000 if parent == 7 else 1000):
                Sdf.PrimSpec(group, f"P{child}", Sdf.SpecifierDef, "Scope")
        layer.GetPrimAtPath("/World").specifier = Sdf.SpecifierDef
    layer.Save()
    panel = open_panel(tmp_path / "many.usdc")
    tree = panel.tree
    made = []

    def count(node):
        made.append(node)
        for child in node.made.values():
            count(child)

    group = tree.model.index_of(Sdf.Path("/World/G7"))
    tree.view.expand(group)
    tree.view.grab()
    count(tree.model._root)
    assert tree.view.isExpanded(group) and len(made) < 3000 > tree.model.rowCount(group)
    tree.choose("/World/G7/P4500")
    tree.view.grab()
    assert tree.view.chosen() == ["/World/G7/P4500"]
    assert tree.model.rowCount(group) >= 4501
    while tree.model.canFetchMore(group):
        tree.model.fetchMore(group)
    assert tree.model.rowCount(group) == 5000
    QTest.keyClicks(tree.field, "p777")
    qtbot.waitUntil(lambda: tree.found.text() == "20 found", timeout=20000)
    first = tree.model.index_of(Sdf.Path("/World/G0"))
    assert tree.model.rowCount(first) == 1
    tree.field.clear()
    qtbot.waitUntil(lambda: tree.model.rowCount(row(panel, "/World/G0")) > 1)


def test_colours_of_the_screen():
    for value in ((0.0, 0.5, 1.0), (0.18, 0.002, 0.9)):
        assert from_display(to_display(value)) == pytest.approx(value, abs=1e-4)
    assert np.allclose(to_display((2.0, 0.0, 0.0)).getRgbF()[:3], (1, 0, 0))
