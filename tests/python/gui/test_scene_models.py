# SPDX-License-Identifier: Apache-2.0
"""Tests the models of the scene panel without views: their contents, and effects of edits."""

import ast
from pathlib import Path

import pytest
from conftest import wait_final
from PySide6.QtCore import QPersistentModelIndex, Qt
from PySide6.QtWidgets import QApplication
from scene_stage import write_stage

import wavecomb.gui
from wavecomb.gui.scene import lights_model, materials_model
from wavecomb.gui.scene.form_model import COLOUR, DRIVEN, NUMBER, SWITCH, Range
from wavecomb.gui.scene.lights_model import LightForm, LightsModel
from wavecomb.gui.scene.materials_model import MaterialForm, MaterialsModel
from wavecomb.gui.scene.notes_model import NotesFilter, NotesModel, rows_of
from wavecomb.gui.scene.scene_edits import SceneEdits
from wavecomb.gui.scene.scene_model import VISIBILITY, SceneModel, StateRole
from wavecomb.gui.scene.variants_model import VariantsModel
from wavecomb.gui.table_model import ColourRole, ToneRole
from wavecomb.gui.viewport.cameras_model import CamerasModel

KEY, BULB, SKY = (f"/World/Lights/{name}" for name in ("Key", "Bulb", "Sky"))
RED, WOOD = "/World/Looks/Red", "/World/Looks/Wood"
Checked, Unchecked = Qt.CheckState.Checked, Qt.CheckState.Unchecked


@pytest.fixture(scope="module")
def stage_path(tmp_path_factory):
    return write_stage(tmp_path_factory.mktemp("models"))


@pytest.fixture
def edits(new_session, qtbot, stage_path):
    session = new_session(width=24, height=16, spp=1)
    widgets = set(map(id, QApplication.allWidgets()))
    made = SceneEdits(session)
    with qtbot.waitSignal(session.opened, timeout=20000):
        session.open(stage_path)
    wait_final(qtbot, session)
    yield made
    assert set(map(id, QApplication.allWidgets())) <= widgets, "no widget was needed"


class Told:
    """Counts the signals of a model."""

    def __init__(self, *signals):
        self.counts = [0] * len(signals)
        for number, signal in enumerate(signals):
            signal.connect(lambda *_, number=number: self._count(number))

    def _count(self, number):
        self.counts[number] += 1


def test_models_know_no_widgets():
    """The modules of models and edits import no widgets."""
    room = Path(wavecomb.gui.__file__).parent
    found = [*room.rglob("*_model.py"), *(room / "scene").glob("*edits.py")]
    found += [room / "scene" / name for name in ("history.py", "render_sync.py")]
    assert len(found) > 8
    for path in found:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [getattr(node, "module", None) or ""]
            names += [one.name for one in getattr(node, "names", ()) if hasattr(one, "name")]
            assert "PySide6.QtWidgets" not in names, path


def test_lights_are_listed_switched_and_alone(edits):
    model = LightsModel(edits)
    assert model.rows == [KEY, BULB, SKY] and model.rowCount() == 3
    on, solo = model.index(0, lights_model.ON), model.index(1, lights_model.SOLO)
    assert model.index(0, 0).data() == "Key" and model.index(2, 1).data() == "Dome"
    assert model.flags(on) & Qt.ItemFlag.ItemIsUserCheckable
    role = Qt.ItemDataRole.CheckStateRole
    assert model.data(on, role) == Checked and model.data(on, ToneRole) is None
    told = Told(model.dataChanged)
    assert model.setData(on, Unchecked.value, role)
    assert edits.is_hidden(KEY) and told.counts[0] >= 1
    assert model.data(on, role) == Unchecked and model.data(on, ToneRole) == "dim"
    assert model.setData(solo, Checked.value, role)
    assert edits.solo == BULB and edits.is_hidden(SKY)
    assert model.setData(solo, Unchecked.value, role)
    assert edits.solo is None and not edits.is_hidden(SKY)
    assert not model.setData(on, 1, Qt.ItemDataRole.EditRole)
    edits.set_light(KEY, "color", (1.0, 0.5, 0.25))
    assert model.data(model.index(0, 0), ColourRole) == (1.0, 0.5, 0.25)


def test_the_fields_of_a_light(edits):
    form = LightForm(edits)
    assert form.rows == [] and form.note == "No light" and form.value("intensity") is None
    told = Told(form.remade, form.changed)
    form.show_light(BULB)
    assert [(row.name, row.label, row.kind) for row in form.rows] == [
        ("intensity", "intensity", NUMBER),
        ("exposure", "exposure", NUMBER),
        ("color", "colour", COLOUR),
        ("radius", "radius", NUMBER),
        ("normalize", "normalize", SWITCH),
        ("diffuse", "diffuse", NUMBER),
        ("specular", "specular", NUMBER),
    ]
    assert [row.group for row in form.rows] == [""] * 5 + ["response"] * 2
    assert form.title == BULB and "on the stage" in form.rows[0].tip
    assert told.counts == [1, 0] and not form.is_edited("exposure")
    form.set_value("exposure", 1.5)
    assert form.value("exposure") == 1.5 and form.is_edited("exposure") and told.counts[1] == 1
    assert edits.can_undo() == f"exposure of {BULB}"
    form.set_value("exposure", None)
    assert not form.is_edited("exposure") and edits.lines() == []
    edits.undo()
    assert form.value("exposure") == 1.5


def test_a_value_that_is_typed_is_one_step_of_the_form(edits):
    form = LightForm(edits)
    form.show_light(KEY)
    edits.history.now = iter(range(0, 1000, 10)).__next__
    form.set_typing(True)
    for value in (2.0, 2.5, 2.75):
        form.set_value("intensity", value)
    form.set_typing(False)
    form.set_value("intensity", 3.0)
    assert edits.history.stack.count() == 2


def test_materials_are_listed_with_costs(edits):
    model = MaterialsModel(edits)
    names = [row.name for row in model.rows]
    assert {"Red", "Wood", "Twin", "Gold"} <= set(names)
    red = names.index("Red")
    index = model.index(red, materials_model.NAME)
    assert index.data() == "Red"
    assert model.data(index, ColourRole) == pytest.approx((0.8, 0.1, 0.1))
    figures = [
        {"records": 1200, "timed_records": 100, "ns_per_record": 41.0}
        for _ in range(len(edits.stage.material_paths))
    ]
    told = Told(model.dataChanged)
    model.count({"materials": figures})
    assert told.counts == [1]
    ids = len(model.rows[red].ids)
    assert model.index(red, materials_model.RECORDS).data() == f"{1200 * ids:,}"
    assert model.index(red, materials_model.COST).data() == "41"
    edits.session.reload()
    assert model.rows == []


def test_the_fields_of_a_material(edits):
    model, form = MaterialsModel(edits), MaterialForm(edits)
    assert form.note == "No stage is open" and form.groups() == []
    rows = {row.path: row for row in model.rows}
    form.show_material(rows[WOOD])
    fields = {row.name: row for row in form.rows}
    assert fields["base_color"].kind == DRIVEN and "wood.png" in fields["base_color"].driver
    assert form.value("base_color") is None
    form.show_material(rows[RED])
    fields = {row.name: row for row in form.rows}
    assert fields["base_color"].kind == COLOUR and fields["roughness"].kind == NUMBER
    assert form.value("roughness") == pytest.approx(0.4)
    told = Told(form.changed)
    form.set_value("roughness", 0.75)
    assert told.counts == [1] and form.is_edited("roughness")
    assert edits.lines() == [f"{RED}/S.inputs:roughness = 0.75"]
    form.set_value("nonsense", 1.0)
    assert len(edits.lines()) == 1


def test_a_heading_stays_as_somebody_left_it(edits):
    form = MaterialForm(edits)
    form.show_material(MaterialsModel(edits).rows[0])
    assert form.is_open("Base") and not form.is_open("Coat")
    form.fold("Base", False)
    form.fold("Coat", True)
    assert not form.is_open("Base") and form.is_open("Coat")


def test_variants_as_data(edits, qtbot):
    model = VariantsModel(edits)
    told = Told(model.changed)
    model.show_prim("/World/Sign")
    (look,) = model.sets
    assert (look.name, look.choice, model.editable) == ("look", "ball", True)
    model.choose("look", "box")
    assert model.sets[0].choice == "box" and told.counts[0] >= 2
    assert edits.can_undo() == "look of /World/Sign"
    edits.undo()
    assert model.sets[0].choice == "ball"
    model.show_prim("/World/Things")
    assert model.sets == []


def test_prims_as_data(edits):
    from pxr import Sdf

    model = SceneModel(edits)
    kept = QPersistentModelIndex(model.index_of(Sdf.Path(KEY)))
    eye = model.index_of(Sdf.Path(KEY)).siblingAtColumn(VISIBILITY)
    assert model.data(eye, StateRole) == "visible"
    edits.set_visible([KEY], False)
    assert model.data(eye, StateRole) == "hidden" and kept.isValid()
    assert model.data(model.index_of(Sdf.Path(KEY)), ToneRole) == "dim"


def test_cameras_as_data(edits):
    session = edits.session
    model = CamerasModel(session)
    paths = [model.index(row).data(Qt.ItemDataRole.UserRole) for row in range(model.rowCount())]
    assert paths == [None, "/World/Cam", "/World/Side"] and model.row == 1
    assert [model.index(row).data() for row in range(3)] == ["Free camera", "Cam", "Side"]
    told = Told(model.moved)
    model.choose(2)
    assert session.pose.path == "/World/Side" and model.row == 2 and told.counts == [1]
    model.choose(0)
    assert session.pose.path is None and model.row == 0
    model.paths = [None, "/A/Cam", "/B/Cam", "/B/Other"]
    assert [model.index(row).data() for row in (1, 2, 3)] == ["/A/Cam", "/B/Cam", "Other"]


def test_notes_are_filtered(edits):
    model = NotesModel()
    model.fill(rows_of(edits.stage))
    lines = [row.line() for row in model.rows]
    assert "not supported: GeometryLight: /World/Things/Dust" in lines
    shown = NotesFilter()
    shown.setSourceModel(model)
    shown.set("", "geometryl")
    assert shown.rowCount() == 1
    assert shown.index(0, 0).data(ToneRole) == "error"
    shown.set("note", "nurbs")
    assert shown.rowCount() == 0


@pytest.mark.parametrize("bounds", [Range(0, 10, 2, 4), Range(0, 1e9, 1e-3, 1e5, logarithmic=True)])
def test_places_on_a_slider(bounds):
    for share in (0.1, 0.5, 1.0):
        assert bounds.share(bounds.value_at(share)) == pytest.approx(share)
    assert bounds.share(bounds.low) == 0.0 and bounds.share(bounds.high) == 1.0
    assert bounds.value_at(0.0) == (bounds.low if bounds.logarithmic else bounds.soft_low)
