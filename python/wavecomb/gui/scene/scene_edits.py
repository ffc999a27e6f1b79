# SPDX-License-Identifier: Apache-2.0
"""What the scene panels do: edits go to the stage, and from there into the live render."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from pxr import Gf, Sdf, Usd, UsdGeom
from PySide6.QtCore import QObject, Signal

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.scene.stage_edits import Key, Opinion, StageEdits, Step
from wavecomb.gui.scene.visibility import HIDDEN, HIDDEN_ABOVE, show, state, uneditable
from wavecomb.usd.looks.parameters import (
    IN_INSTANCE,
    Parameter,
    as_stored,
    light_radiance,
    material_parameters,
)
from wavecomb.usd.looks.surface_values import surface_values

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session
    from wavecomb.usd import LoadedStage

LIGHT_INPUTS: dict[str, Any] = {"intensity": 1.0, "exposure": 0.0, "color": (1.0, 1.0, 1.0)}
"""What of a light is edited, and its value where nothing is authored."""


class SceneEdits(QObject):
    """Edits of the stage that a session has open.

    What is visible and which variants are chosen decides what is in the scene: the stage is read
    again. Materials and lights change in the scene that there is, at once.

    Signals:
        reset(): Another stage is open, or none: prims known before are no more.
        structure_changed(): Prims may have come and gone.
        scene_changed(): The stage was read (again): materials and lights have other numbers.
        changed(): Something was edited, undone or done again.

    Attributes:
        edits: Of the stage that is open; None while there is none to edit.
        solo: The light that is shown alone, or None.
    """

    reset = Signal()
    structure_changed = Signal()
    scene_changed = Signal()
    changed = Signal()

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.session = session
        self.edits: StageEdits | None = None
        self.solo: str | None = None
        self._before_solo: dict[Key, Opinion | None] = {}
        self._touched: set[Sdf.Path] = set()
        session.opened.connect(self._on_opened)
        session.closing.connect(self._on_closing)
        if session.stage is not None and session.usd is not None:
            self._on_opened(session.stage)

    # ---- what there is -------------------------------------------------------------------------

    @property
    def usd(self) -> Usd.Stage | None:
        """The stage; None while there is none to edit."""
        return self.edits.stage if self.edits is not None else None

    @property
    def stage(self) -> LoadedStage | None:
        """What was read."""
        return self.session.stage

    @property
    def time(self) -> Usd.TimeCode:
        """At which attributes are read."""
        return self.edits.time if self.edits is not None else Usd.TimeCode.Default()

    def prim(self, path: str) -> Usd.Prim:
        """A prim by path, an invalid one where there is none."""
        if self.edits is None or not path or not Sdf.Path.IsValidPathString(path):
            return Usd.Prim()
        return self.edits.stage.GetPrimAtPath(path)

    def is_hidden(self, path: str) -> bool:
        """Whether a prim is hidden, by itself or from above."""
        return state(self.prim(path), self.time)[0] in (HIDDEN, HIDDEN_ABOVE)

    def can_undo(self) -> str:
        """What could be undone; "": nothing."""
        return self.edits.undo_label if self.edits is not None else ""

    def can_redo(self) -> str:
        """What could be done again; "": nothing."""
        return self.edits.redo_label if self.edits is not None else ""

    def lines(self) -> list[str]:
        """All edits, one line each."""
        return self.edits.lines() if self.edits is not None else []

    # ---- visibility and variants ---------------------------------------------------------------

    def set_visible(self, paths: Iterable[str], visible: bool) -> None:
        """Shows or hides prims."""
        wanted = [Sdf.Path(path) for path in paths]
        self._do(lambda edits: edits.set_visible(wanted, visible))

    def toggle_visible(self, paths: Iterable[str]) -> None:
        """Hides what is shown; where all of it is hidden, shows it."""
        can = [path for path in paths if not uneditable(self.prim(path))]
        if can:
            self.set_visible(can, all(self.is_hidden(path) for path in can))

    def select_variant(self, path: str, name: str, choice: str | None) -> None:
        """Selects a variant; None: what the stage itself selects."""
        self._do(lambda edits: edits.select_variant(Sdf.Path(path), name, choice))

    def solo_light(self, path: str | None, lights: Iterable[str]) -> None:
        """Shows one light and hides all others, as one step; None: as it was before.

        Args:
            path: The light.
            lights: All lights.
        """
        label, opinions = "end solo", dict(self._before_solo)
        if path is not None:
            label = f"solo {path}"
            for other in lights:
                if other != path and not uneditable(self.prim(other)):
                    opinions[(Sdf.Path(other), ".visibility")] = _word("invisible")
            # The one that had the solo before is hidden by now, in the session layer alone.
            opinions.pop((Sdf.Path(path), ".visibility"), None)
            for at, word in show(self.prim(path), self.time).items():
                opinions[(at, ".visibility")] = _word(word)
        before: dict[Key, Opinion | None] = {}

        def change(edits: StageEdits) -> Step | None:
            step = edits.change(label, opinions)
            before.update(step.before if step is not None else {})
            return step

        self._do(change)
        self._before_solo = {**before, **self._before_solo} if path is not None else {}
        self.solo = path
        self.changed.emit()

    def set_typing(self, typing: bool) -> None:
        """Whether a value is being typed: however slowly, it is one step of undo."""
        if self.edits is not None:
            self.edits.set_typing(typing)

    # ---- materials -----------------------------------------------------------------------------

    def parameters(self, path: str) -> dict[str, Parameter]:
        """Parameters of a material by slot; empty of one that no prim is there for."""
        prim = self.prim(path)
        return material_parameters(prim, self.time) if prim else {}

    def material_ids(self, path: str) -> list[int]:
        """The materials that a prim gave: several where meshes bring values of their own."""
        paths = self.stage.material_paths if self.stage is not None else ()
        return [i for i, one in enumerate(paths) if one == path]

    def set_parameter(self, path: str, slot: str, value: Any) -> None:
        """Changes a parameter of a material; None: as the stage has it."""
        parameter = self.parameters(path).get(slot)
        label = f"{slot} of {path}"
        if parameter is None or parameter.driven_by:
            return
        opinion: Opinion | None = None
        if parameter.attribute is None:
            if value is not None and not self._can_show(path, slot, value):
                self.session.warned.emit(f"{label}: not changed: {parameter.reason}")
                self.changed.emit()
                return
            key = (Sdf.Path(path), f"!{slot}")
            opinion = None if value is None else Opinion(as_stored(value))
        else:
            attribute = parameter.attribute
            key = (attribute.GetPrimPath(), f".{attribute.name}")
            if value is not None:
                opinion = Opinion(parameter.authored(value), parameter.type_name)
        self._do(lambda edits: edits.change(label, {key: opinion}), (key[0],))

    def parameter_value(self, path: str, parameter: Parameter) -> Any:
        """What a parameter is now."""
        values = self.edits.values if self.edits is not None else {}
        return values.get((Sdf.Path(path), f"!{parameter.slot}"), parameter.value)

    def is_edited(self, path: str, parameter: Parameter) -> bool:
        """Whether a parameter was changed here."""
        if self.edits is None:
            return False
        attribute = parameter.attribute
        if attribute is None:
            return (Sdf.Path(path), f"!{parameter.slot}") in self.edits.values
        return self.edits.opinion((attribute.GetPrimPath(), f".{attribute.name}")) is not None

    # ---- lights --------------------------------------------------------------------------------

    def light_reason(self, path: str) -> str:
        """Why edits of a light cannot be saved; "" where they can."""
        prim = self.prim(path)
        if not prim:
            return "it is not on the stage"
        return IN_INSTANCE if prim.IsInstanceProxy() else ""

    def light_value(self, path: str, name: str) -> Any:
        """One of ``LIGHT_INPUTS`` as it is now.

        Of a light whose edits cannot be saved: what its colour on the stage is multiplied by.
        """
        default = LIGHT_INPUTS[name]
        if self.edits is None:
            return default
        if self.light_reason(path):
            return self.edits.values.get((_light_path(path), f"!{name}"), default)
        attribute = self.prim(path).GetAttribute(f"inputs:{name}")
        value = attribute.Get(self.time) if attribute else None
        if value is None:
            return default
        return tuple(value) if isinstance(value, Gf.Vec3f) else float(value)

    def light_is_edited(self, path: str, name: str) -> bool:
        """Whether an input of a light was changed here."""
        return (
            self.edits is not None and self.edits.opinion(self._light_key(path, name)) is not None
        )

    def set_light(self, path: str, name: str, value: Any) -> None:
        """Changes an input of a light; None: as the stage has it."""
        types = Sdf.ValueTypeNames
        opinion: Opinion | None = None
        if value is not None and self.light_reason(path):
            opinion = Opinion(as_stored(value))
        elif value is not None and name == "color":
            opinion = Opinion(Gf.Vec3f(*value), types.Color3f)
        elif value is not None:
            opinion = Opinion(as_stored(value), types.Float)
        key = self._light_key(path, name)
        self._do(lambda edits: edits.change(f"{name} of {path or 'soft dome'}", {key: opinion}))

    def _light_key(self, path: str, name: str) -> tuple[Sdf.Path, str]:
        if self.light_reason(path):
            return _light_path(path), f"!{name}"
        return Sdf.Path(path), f".inputs:{name}"

    # ---- history -------------------------------------------------------------------------------

    def undo(self) -> None:
        """Takes the last edit back."""
        self._end_solo()
        if self.edits is not None:
            self._do(lambda edits: edits.undo(), self.edits.next_prims(undo=True))

    def redo(self) -> None:
        """Makes the edit again that was taken back last."""
        self._end_solo()
        if self.edits is not None:
            self._do(lambda edits: edits.redo(), self.edits.next_prims(undo=False))

    def _end_solo(self) -> None:
        self.solo, self._before_solo = None, {}

    def save(self, path: str) -> bool:
        """Writes the edits as a layer over the stage; whether that went well."""
        if self.edits is None:
            self.session.failed.emit("there is no stage: open one first")
            return False
        try:
            save_edits(self.edits.stage, path)
        except WavecombError as error:
            self.session.failed.emit(str(error))
            return False
        if self.edits.values:
            count = len(self.edits.values)
            self.session.warned.emit(
                f"{path}: {count} edit(s) are not in it: the stage has no place for them"
            )
        self.session.saved.emit(path)
        return True

    # ---- into the render -----------------------------------------------------------------------

    def _do(
        self, action: Callable[[StageEdits], Step | None], prims: Iterable[Sdf.Path] = ()
    ) -> None:
        """Makes a step and brings it into the picture.

        ``prims``: whose attributes it will change, where materials may be among them.
        """
        if self.edits is None:
            return
        before = self._structures(prims)
        try:
            step = action(self.edits)
        except WavecombError as error:
            self.session.failed.emit(str(error))
            return
        if step is None:
            return
        self._touched |= set(step.prims)
        if step.structural:
            self.session.rebuild(step.label)
            self.structure_changed.emit()
        elif self._structures(prims) != before:
            # A constant that is part of a graph, or of how a texture is read.
            self.session.rebuild(step.label)
        else:
            self._show(step)
        self.changed.emit()

    def _materials_of(self, prim: Sdf.Path) -> set[str]:
        """Materials in use that a prim is, or is in."""
        path, stage = str(prim), self.stage
        known = {one for one in stage.material_paths if one} if stage is not None else set()
        return {one for one in known if path == one or path.startswith(one + "/")}

    def _live_values(self, path: str) -> dict[str, Any]:
        """What was changed of a material and no attribute holds."""
        values = self.edits.values if self.edits is not None else {}
        own = Sdf.Path(path)
        return {what[1:]: value for (prim, what), value in values.items() if prim == own}

    def _can_show(self, path: str, slot: str, value: Any) -> bool:
        """Whether a value that no attribute can hold can be brought into the picture."""
        known = self._live_values(path)
        before = surface_values(self.prim(path), self.time, known)
        after = surface_values(self.prim(path), self.time, {**known, slot: value})
        return before is None or after is None or before.structure == after.structure

    def _structures(self, prims: Iterable[Sdf.Path]) -> dict[str, str]:
        """What of materials cannot be edited in the scene that there is."""
        out = {}
        for path in {one for prim in prims for one in self._materials_of(prim)}:
            found = surface_values(self.prim(path), self.time)
            if found is not None:
                out[path] = found.structure
        return out

    def _show(self, step: Step) -> None:
        """Brings a step into the scene that is rendered."""
        stage = self.stage
        if stage is None:
            return
        emission = any("emissi" in what for _, what in step.after)
        if emission and not stage.lights:
            # Whether a stage without lights gets the soft dome goes by what its materials emit.
            self.session.rebuild(step.label)
        for prim in step.prims:
            for light in {one for one in stage.light_paths if _light_path(one) == prim}:
                self._sync_light(light)
            for material in self._materials_of(prim):
                self._sync_material(material)

    def _sync_material(self, path: str) -> None:
        """Gives the materials of a prim the values that the stage has now."""
        scene = self.session.scene
        if scene is None:
            return
        surface = surface_values(self.prim(path), self.time, self._live_values(path))
        if surface is not None:
            wanted = {name: as_stored(value) for name, value in surface.constants.items()}
        else:
            wanted = {
                slot: as_stored(self.parameter_value(path, parameter))
                for slot, parameter in self.parameters(path).items()
                if not parameter.driven_by
            }
        for number in self.material_ids(path):
            if number >= len(scene.materials):
                continue
            have = scene.material(number)
            have |= have.get("openpbr", {})
            # A mesh may bring a value for a slot, which a graph reads then.
            values = {
                slot: value
                for slot, value in wanted.items()
                if slot not in have.get("driven", ()) and as_stored(have[slot]) != value
            }
            if values:
                self.session.edit_material(number, **values)
            # The stage holds the edit: it comes with the next reading.
            self.session.material_edits.pop(have["name"], None)

    def _sync_light(self, path: str) -> None:
        scene, stage = self.session.scene, self.stage
        if scene is None or stage is None or self.edits is None:
            return
        reason = self.light_reason(path)
        radiance = None
        if not reason:
            up = str(UsdGeom.GetStageUpAxis(self.edits.stage))
            radiance = light_radiance(self.prim(path), self.time, up)
        for number, one in enumerate(stage.light_paths):
            if one != path or number >= scene.light_count:
                continue
            if radiance is None:
                tint = self.light_value(path, "color")
                power = self.light_value(path, "intensity") * 2.0 ** self.light_value(
                    path, "exposure"
                )
                base = stage.scene.light(number)["color"]
                colour = tuple(b * t * power for b, t in zip(base, tint, strict=True))
            else:
                colour = radiance
            if as_stored(tuple(scene.light(number)["color"])) != as_stored(colour):
                self.session.edit_light(number, color=colour)
        self.session.light_edits.clear()

    # ---- what the session says -----------------------------------------------------------------

    def _on_opened(self, loaded: LoadedStage) -> None:
        usd = self.session.usd
        if usd is None or loaded is None:
            return
        if self.edits is None or self.edits.stage != usd:
            time = Usd.TimeCode.Default() if loaded.frame is None else Usd.TimeCode(loaded.frame)
            self.edits = StageEdits(usd, time)
            self._touched = set()
            self._end_solo()
            self.reset.emit()
            self.scene_changed.emit()
            self.changed.emit()
            return
        self.scene_changed.emit()
        # What was edited, or taken back, while the stage was read is not in the scene yet.
        for prim in {path for path, _ in self.edits.edited()} | self._touched:
            self._show(Step("", {}, {(prim, ""): None}))
        self._touched = set()
        self.changed.emit()

    def _on_closing(self) -> None:
        self.edits = None
        self.reset.emit()
        self.scene_changed.emit()


def _word(word: str) -> Opinion:
    """Of an attribute ``visibility``."""
    return Opinion(word, Sdf.ValueTypeNames.Token)


def _light_path(path: str) -> Sdf.Path:
    """The key of a light; of the soft dome, which is no prim, one that no prim has."""
    return Sdf.Path(path) if path else Sdf.Path("/soft_dome_of_wavecomb")
