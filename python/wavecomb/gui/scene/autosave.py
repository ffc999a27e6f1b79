# SPDX-License-Identifier: Apache-2.0
"""Saves a copy of unsaved edits, so that they survive a crash of the window."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pxr import Sdf
from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import QMessageBox, QPushButton, QWidget

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.edit_layer import save_edits

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits

DELAY_MS = 2000
"""Delay between an edit and the autosave, in milliseconds."""


class Autosave(QObject):
    """Automatic writer of unsaved edits to a file.

    The file is removed when the edits are saved or undone.

    Each stage has one autosave file. A window holds a lock beside the autosave file while its stage
    is open. A second window with the same stage writes no autosave file.

    Signals:
        found(): Emitted if an earlier window ended without saving its edits.
    """

    found = Signal()

    def __init__(self, edits: SceneEdits, folder: Path, parent: QObject | None = None) -> None:
        """Starts saving the edits of a stage automatically.

        Args:
            edits: Edits of the stage, which are saved shortly after each change.
            folder: Folder of the autosave files, created when needed.
            parent: Qt parent of the writer.
        """
        super().__init__(parent)
        self._edits, self._folder = edits, folder
        self._file: Path | None = None
        self._lock: int | None = None
        self._waits = False
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.write)
        edits.session.opened.connect(self._on_opened)
        edits.session.closing.connect(self._timer.stop)
        edits.changed.connect(self._on_changed)
        edits.history.stack.cleanChanged.connect(self._on_clean)

    @property
    def file(self) -> Path | None:
        """Autosave file of the open stage.

        None if no stage is open or another window holds the lock.
        """
        return self._file

    def close(self) -> None:
        """Writes pending edits and releases the lock of the autosave file.

        Unsaved edits stay in the autosave file.
        """
        if self._timer.isActive():
            self.write()
        self._release()

    def _release(self) -> None:
        self._timer.stop()
        if self._lock is not None:
            os.close(self._lock)
        self._file = self._lock = None

    def write(self) -> None:
        """Writes the edits to the autosave file now, or removes the file if there are no edits."""
        if self._file is None or self._edits.edits is None:
            return
        if self._edits.history.stack.isClean():
            if not self._waits:
                self.discard()
            return
        # New edits overwrite edits in the autosave file that the user did not restore.
        self._waits = False
        with contextlib.suppress(WavecombError, OSError):
            save_edits(self._edits.edits.stage, self._file)

    def restore(self) -> None:
        """Loads the edits of the autosave file into the stage."""
        self._waits = False
        usd, layer = self._edits.usd, None
        if self._file is not None and usd is not None:
            with contextlib.suppress(Exception):
                layer = Sdf.Layer.OpenAsAnonymous(str(self._file))
        if layer is None or usd is None:
            self._edits.session.failed.emit(f"{self._file}: the edits cannot be read")
            return
        layer.subLayerPaths = []
        usd.GetSessionLayer().TransferContent(layer)
        self._edits.history.stack.resetClean()
        self._edits.structure_changed.emit()
        self._edits.session.rebuild("restored edits")

    def discard(self) -> None:
        """Removes the autosave file."""
        self._waits = False
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.unlink()

    def _on_opened(self, loaded: Any) -> None:
        path = self._edits.session.path
        if path is None:
            return
        name = hashlib.sha256(os.fsencode(path.resolve())).hexdigest()[:24]
        file = self._folder / f"{name}.usda"
        if file == self._file:
            self._timer.start(0)
            return
        self._release()
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            lock = os.open(file.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError:
            return
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            return
        self._file, self._lock = file, lock
        self._waits = file.exists()
        if self._waits:
            self.found.emit()

    def _on_changed(self) -> None:
        if self._edits.edits is not None:
            self._timer.start(DELAY_MS)

    def _on_clean(self, clean: bool) -> None:
        if clean and not self._waits:
            # The timer calls `write`, which removes the file. Closing a stage also makes the undo
            # stack clean, but stops the timer, so that the file keeps the unsaved edits.
            self._timer.start(0)


def make_question(autosave: Autosave, parent: QWidget) -> QMessageBox:
    """Creates the dialog that asks whether to restore edits."""
    box = QMessageBox(parent)
    box.setObjectName("autosave")
    box.setIcon(QMessageBox.Icon.Question)
    box.setWindowTitle("Unsaved edits")
    box.setText("Wavecomb ended before the edits of this stage were saved.")
    box.setInformativeText("Restore the edits?")
    for text, role, act in (
        ("Restore", QMessageBox.ButtonRole.AcceptRole, autosave.restore),
        ("Discard", QMessageBox.ButtonRole.DestructiveRole, autosave.discard),
    ):
        button = QPushButton(text, box)
        box.addButton(button, role)
        button.setObjectName(f"autosave.{text.lower()}")
        button.clicked.connect(act)
    box.setModal(False)
    return box
