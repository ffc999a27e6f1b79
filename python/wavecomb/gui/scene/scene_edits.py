# SPDX-License-Identifier: Apache-2.0
"""What the scene panels do: edits go to the stage, and from there into the live render."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd
from PySide6.QtCore import QObject, Signal

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.scene.history import History
from wavecomb.gui.scene.light_inputs import light_inputs
from wavecomb.gui.scene.render_sync import RenderSync
from wavecomb.gui.scene.stage_edits import Key, Opinion, Solo, StageEdits, Step
from wavecomb.gui.scene.visibility import HIDDEN, HIDDEN_ABOVE, show, state, uneditable
from wavecomb.usd.looks.parameters import as_stored
from wavecomb.usd.stage.times import code_of

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session
    from wavecomb.usd import LoadedStage


class SceneEdits(QObject, RenderSync):
    """Edits of the stage that a session has open. Every one is a step of ``history``.

    What is visible and which variants are chosen decides what is in the scene: the stage is read
    again. Materials and lights change in the scene that there is, at once.

    Signals:
        reset(): Another stage is open, or none: prims known before are no more.
        structure_changed(): Prims may have come and gone.
        scene_changed(): The stage was read (again): materials and lights have other numbers.
        changed(): Something was edited, undone or done again.

    Attributes:
        history: Steps that can be taken back.
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
        self.history = History(self)
        self.stage_edits = _no_edits()
        self._is_open = False
        self._solo = Solo()
        self._touched: set[Sdf.Path] = set()
        self.history.step.connect(self._perform)
        session.opened.connect(self._on_opened)
        session.closing.connect(self._forget)
        if session.stage is not None and session.usd is not None:
            self._on_opened(session.stage)

    # ---- what there is -------------------------------------------------------------------------

    @property
    def edits(self) -> StageEdits | None:
        """Edits of the stage that is open, or None."""
        return self.stage_edits if self._is_open else None

    @property
    def usd(self) -> Usd.Stage | None:
        """The USD stage that is open, or None."""
        return self.stage_edits.stage if self._is_open else None

    @property
    def stage(self) -> LoadedStage | None:
        """What was read."""
        return self.session.stage

    @property
    def solo(self) -> str | None:
        """The light that is shown alone."""
        return self._solo.path

    def is_hidden(self, path: str) -> bool:
        """Whether a prim is hidden, by itself or from above."""
        return state(self.prim(path), self.time)[0] in (HIDDEN, HIDDEN_ABOVE)

    def can_undo(self) -> str:
        """What could be undone; "": nothing."""
        return self.history.stack.undoText()

    def lines(self) -> list[str]:
        """All edits, one line each."""
        return self.stage_edits.lines()

    # ---- visibility and variants ---------------------------------------------------------------

    def set_visible(self, paths: Iterable[str], visible: bool) -> None:
        """Shows or hides prims."""
        wanted = [Sdf.Path(path) for path in paths]
        self._do(lambda edits: edits.visible(wanted, visible))

    def toggle_visible(self, paths: Iterable[str]) -> None:
        """Hides what is shown; where all of it is hidden, shows it."""
        can = [path for path in paths if not uneditable(self.prim(path))]
        if can:
            self.set_visible(can, all(self.is_hidden(path) for path in can))

    def select_variant(self, path: str, name: str, choice: str | None) -> None:
        """Selects a variant; None: what the stage itself selects."""
        self._do(lambda edits: edits.variant(Sdf.Path(path), name, choice))

    def solo_light(self, path: str | None, lights: Iterable[str]) -> None:
        """Shows one light and hides all others, as one step; None: as it was before.

        Args:
            path: The light.
            lights: All lights.
        """
        if self.edits is None:
            return
        label, opinions = "end solo", dict(self._solo.before)
        if path is not None:
            label = f"solo {path}"
            for other in lights:
                if other != path and not uneditable(self.prim(other)):
                    opinions[(Sdf.Path(other), ".visibility")] = _word("invisible")
            # The one that had the solo before is hidden by now, in the session layer alone.
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
        """Whether a value is being typed: however slowly, it is one step of undo."""
        self.history.set_typing(typing)

    # ---- materials -----------------------------------------------------------------------------

    def set_parameter(self, path: str, name: str, value: Any) -> None:
        """Changes a parameter of a material; None: as the stage has it."""
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
        """Changes an input of a light; None: as the stage has it."""
        opinion: Opinion | None = None
        if value is not None and self.light_reason(path):
            opinion = Opinion(as_stored(value))
        elif value is not None:
            known = light_inputs()[name]
            opinion = Opinion(known.stored(value), known.type_name)
        label = f"{name} of {path or 'soft dome'}"
        self._change(label, self.light_key(path, name), opinion)

    # ---- history -------------------------------------------------------------------------------

    def undo(self) -> None:
        """Takes the last edit back."""
        self.history.undo()

    def redo(self) -> None:
        """Makes the edit again that was taken back last."""
        self.history.redo()

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
        self.history.stack.setClean()
        self.session.saved.emit(path)
        return True

    def _change(self, label: str, key: Key, opinion: Opinion | None) -> None:
        self._do(lambda edits: edits.plan(label, {key: opinion}))

    def _do(self, plan: Callable[[StageEdits], Step | None]) -> None:
        """Makes what is planned, as a step of undo."""
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
        """Makes a step, new, again or back, and brings it into the picture."""
        if not self._is_open:
            return
        self._touched |= set(step.prims)
        self.make_step(step)
        if step.solo is not None:
            self._solo = step.solo[1]
        if step.structural:
            self.structure_changed.emit()
        self.changed.emit()

    # ---- what the session says -----------------------------------------------------------------

    def _on_opened(self, loaded: LoadedStage) -> None:
        usd = self.session.usd
        if usd is None or loaded is None:
            return
        if self.usd != usd:
            self._forget(StageEdits(usd, code_of(loaded.frame)))
            self.changed.emit()
            return
        self.scene_changed.emit()
        # What was edited, or taken back, while the stage was read is not in the scene yet.
        for prim in {path for path, _ in self.stage_edits.edited()} | self._touched:
            self.show_step(Step("", {}, {(prim, ""): None}))
        self._touched = set()
        self.changed.emit()

    def _forget(self, edits: StageEdits | None = None) -> None:
        """Drops all steps: another stage is open, or none."""
        self.stage_edits, self._is_open = edits or _no_edits(), edits is not None
        self._solo, self._touched = Solo(), set()
        self.history.clear()
        self.reset.emit()
        self.scene_changed.emit()


def _no_edits() -> StageEdits:
    """Edits of an empty stage, for when none is open."""
    return StageEdits(Usd.Stage.CreateInMemory(), Usd.TimeCode.Default())


def _word(word: str) -> Opinion:
    """A value for an attribute ``visibility``."""
    return Opinion(word, Sdf.ValueTypeNames.Token)
