# SPDX-License-Identifier: Apache-2.0
"""Edits that the scene panels make to the stage and to the live render."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pxr import Gf, Sdf, Usd
from PySide6.QtCore import QObject, Signal

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.scene.history import History
from wavecomb.gui.scene.light_inputs import light_inputs
from wavecomb.gui.scene.render_sync import RenderSync
from wavecomb.gui.scene.stage_edits import Key, Opinion, Solo, StageEdits, Step
from wavecomb.gui.scene.transforms import Placement, Placements, placement
from wavecomb.gui.scene.visibility import HIDDEN, HIDDEN_ABOVE, show, state, uneditable
from wavecomb.usd.materials.parameters import as_stored
from wavecomb.usd.stage.time_codes import code_of

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session
    from wavecomb.usd import LoadedStage


class SceneEdits(QObject, RenderSync):
    """Editor of the session's open stage. Each edit is an undo step in ``history``.

    Edits of visibility and variants load the stage again. Edits of materials and lights change the
    existing scene without loading the stage again.

    Signals:
        reset(): Another stage was opened, or the stage was closed. Prims of the earlier stage are
            invalid.
        structure_changed(): Prims may have been added or removed.
        scene_changed(): The stage was loaded or loaded again, which changes indices of materials
            and lights.
        changed(): A value was edited, or an edit was undone or redone.

    Attributes:
        history: Undo history of the edits.
        edits: Edits of the open stage; None without a stage.
        solo: Path of the light that is shown alone, or None.
    """

    reset = Signal()
    structure_changed = Signal()
    scene_changed = Signal()
    changed = Signal()

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.session = session
        self.history = History(self)
        self.stage_edits = _no_edits()
        self.placements = Placements(self.stage_edits.stage, self.stage_edits.time)
        self._is_open = False
        self._solo = Solo()
        self._touched: set[Sdf.Path] = set()
        self.history.step.connect(self._perform)
        session.opened.connect(self._on_opened)
        session.closing.connect(self._forget)
        session.refused.connect(self.load_refused)
        if session.stage is not None and session.usd is not None:
            self._on_opened(session.stage)

    # ---- what there is -------------------------------------------------------------------------

    @property
    def edits(self) -> StageEdits | None:
        """Edits of the open stage; None without a stage."""
        return self.stage_edits if self._is_open else None

    @property
    def usd(self) -> Usd.Stage | None:
        """The USD stage that is open, or None."""
        return self.stage_edits.stage if self._is_open else None

    @property
    def stage(self) -> LoadedStage | None:
        """The loaded stage with its scene; None without a stage."""
        return self.session.stage

    @property
    def solo(self) -> str | None:
        """Path of the light that is shown alone, or None."""
        return self._solo.path

    def is_hidden(self, path: str) -> bool:
        """Returns whether a prim or one of its ancestors is hidden."""
        return state(self.prim(path), self.time)[0] in (HIDDEN, HIDDEN_ABOVE)

    def can_undo(self) -> str:
        """Returns the description of the step that undo would revert, or "" if there is none."""
        return self.history.stack.undoText()

    def lines(self) -> list[str]:
        """Returns descriptions of all edits, one line each."""
        return self.stage_edits.lines()

    # ---- visibility and variants ---------------------------------------------------------------

    def set_visible(self, paths: Iterable[str], visible: bool) -> None:
        """Shows or hides prims."""
        wanted = [Sdf.Path(path) for path in paths]
        self._do(lambda edits: edits.visible(wanted, visible))

    def toggle_visible(self, paths: Iterable[str]) -> None:
        """Hides prims if any of them is visible, else shows them."""
        can = [path for path in paths if not uneditable(self.prim(path))]
        if can:
            self.set_visible(can, all(self.is_hidden(path) for path in can))

    def select_variant(self, path: str, name: str, choice: str | None) -> None:
        """Selects a variant; None restores the selection that the stage's files contain."""
        self._do(lambda edits: edits.variant(Sdf.Path(path), name, choice))

    def solo_light(self, path: str | None, lights: Iterable[str]) -> None:
        """Shows one light and hides all others, as one undo step.

        Args:
            path: Path of the light; None restores the visibility of all lights.
            lights: Paths of all lights of the stage.
        """
        if self.edits is None:
            return
        label, opinions = "end solo", dict(self._solo.before)
        if path is not None:
            label = f"solo {path}"
            for other in lights:
                if other != path and not uneditable(self.prim(other)):
                    opinions[(Sdf.Path(other), ".visibility")] = _word("invisible")
            # If another light was shown alone before, this light is hidden in the session layer.
            # Replace that opinion, so that the light is visible.
            opinions.pop((Sdf.Path(path), ".visibility"), None)
            for at, word in show(self.prim(path), self.time).items():
                opinions[(at, ".visibility")] = _word(word)
        step = self.edits.plan(label, opinions)
        changed = step.before if step is not None else {}
        after = Solo(path, {**changed, **self._solo.before}) if path is not None else Solo()
        if step is not None:
            self.history.push(replace(step, solo=(self._solo, after)))
        else:
            self._solo = after
            self.changed.emit()

    def set_typing(self, typing: bool) -> None:
        """Marks the start and end of typing a value.

        All changes in between become one undo step.
        """
        self.history.set_typing(typing)

    # ---- materials -----------------------------------------------------------------------------

    def set_parameter(self, path: str, name: str, value: Any) -> None:
        """Edits a parameter of a material; None restores the value in the stage's files."""
        parameter = self.parameters(path).get(name)
        label = f"{name} of {path}"
        if parameter is None or parameter.driven_by:
            return
        opinion: Opinion | None = None
        if parameter.attribute is None:
            if value is not None and not self.can_show(path, name, value):
                self.session.warned.emit(f"{label}: not changed: {parameter.reason}")
                self.changed.emit()
                return
            key = (Sdf.Path(path), f"!{name}")
            opinion = None if value is None else Opinion(as_stored(value))
        else:
            attribute = parameter.attribute
            key = (attribute.GetPrimPath(), f".{attribute.name}")
            if value is not None:
                opinion = Opinion(parameter.authored(value), parameter.type_name)
        self._change(label, key, opinion)

    # ---- lights --------------------------------------------------------------------------------

    def set_light(self, path: str, name: str, value: Any) -> None:
        """Edits an input of a light; None restores the value in the stage's files."""
        opinion: Opinion | None = None
        if value is not None and self.light_reason(path):
            opinion = Opinion(as_stored(value))
        elif value is not None:
            known = light_inputs()[name]
            opinion = Opinion(known.stored(value), known.type_name)
        label = f"{name} of {path or 'soft dome'}"
        self._change(label, self.light_key(path, name), opinion)

    # ---- transforms ----------------------------------------------------------------------------

    def placement(self, path: str) -> Placement | None:
        """Returns the transform of a prim, or None if it cannot be edited."""
        return placement(self.prim(path), self.time) if self._is_open else None

    def move(self, before: Placement, change: Gf.Matrix4d) -> None:
        """Changes a prim's transform by a matrix in world space, in the row vector convention."""
        self._do(lambda edits: edits.plan(f"transform of {before.path}", before.moved(change)))

    # ---- history -------------------------------------------------------------------------------

    def undo(self) -> None:
        """Undoes the last edit."""
        self.history.undo()

    def redo(self) -> None:
        """Redoes the last undone edit."""
        self.history.redo()

    def save(self, path: str) -> bool:
        """Saves the edits as a layer over the stage; returns whether the file was written."""
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
                f"{path}: {count} edit(s) are not in it: no attribute can hold them"
            )
        self.history.stack.setClean()
        self.session.saved.emit(path)
        return True

    def _change(self, label: str, key: Key, opinion: Opinion | None) -> None:
        self._do(lambda edits: edits.plan(label, {key: opinion}))

    def _do(self, plan: Callable[[StageEdits], Step | None]) -> None:
        """Applies a new undo step and adds it to the history."""
        if self.edits is None:
            return
        try:
            step = plan(self.edits)
        except WavecombError as error:
            self.session.failed.emit(str(error))
            return
        if step is not None:
            self.history.push(step)

    def _perform(self, step: Step) -> None:
        """Applies an undo step of the history and updates the render."""
        if not self._is_open:
            return
        self._touched |= set(step.prims)
        self.make_step(step)
        if step.solo is not None:
            self._solo = step.solo[1]
        if step.structural:
            self.structure_changed.emit()
        self.changed.emit()

    # ---- signals of the session
    # ----------------------------------------------------------------------

    def _on_opened(self, loaded: LoadedStage) -> None:
        usd = self.session.usd
        if usd is None or loaded is None:
            return
        if self.usd != usd:
            self._forget(StageEdits(usd, code_of(loaded.frame)))
            self.changed.emit()
            return
        self.stage_edits.time = code_of(loaded.frame)
        self.placements = Placements(usd, self.stage_edits.time, self.placements.refused)
        self.scene_changed.emit()
        # Apply edits that were made or undone while the stage was loading, since the loaded scene
        # does not contain them.
        for prim in {path for path, _ in self.stage_edits.edited()} | self._touched:
            self.show_step(Step("", {}, {(prim, ""): None}))
        self._touched = set()
        self.changed.emit()

    def _forget(self, edits: StageEdits | None = None) -> None:
        """Removes all undo steps, because another stage was opened or the stage was closed."""
        self.stage_edits, self._is_open = edits or _no_edits(), edits is not None
        self.placements = Placements(self.stage_edits.stage, self.stage_edits.time)
        self._solo, self._touched = Solo(), set()
        self.history.clear()
        self.reset.emit()
        self.scene_changed.emit()


def _no_edits() -> StageEdits:
    """Returns an editor of an empty stage, for use while no stage is open."""
    return StageEdits(Usd.Stage.CreateInMemory(), Usd.TimeCode.Default())


def _word(word: str) -> Opinion:
    """Returns an opinion for the attribute ``visibility``."""
    return Opinion(word, Sdf.ValueTypeNames.Token)
