# SPDX-License-Identifier: Apache-2.0
"""A live render and its twins: what is done to the scene is done to all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.engine import Edit
from wavecomb.gui.viewport.live import Live

if TYPE_CHECKING:
    from wavecomb._core import Renderer
    from wavecomb.usd import LoadedStage


class Lives:
    """The first one, and those with settings of their own.

    Attributes:
        first: The viewport's.
        twins: The others.
    """

    def __init__(self, setup: Setup | None, parent: QObject) -> None:
        self.first = Live(setup, parent)
        self.twins: list[Live] = []

    def __iter__(self) -> Iterator[Live]:
        return iter((self.first, *self.twins))

    def begin(self, make: Callable[[], Renderer], loaded: LoadedStage, edit: Edit) -> None:
        """A new scene for all; ``make`` is called on each one's render thread."""
        for live in self:
            live.begin(make, loaded, copied(edit))

    def edit(self, edit: Edit, *, moving: bool) -> None:
        """Changes the scene of all."""
        for live in self:
            live.edit(copied(edit), moving=moving)

    def settle(self) -> None:
        """A movement has ended."""
        for live in self:
            live.settle()

    def pause(self) -> None:
        """All stand still."""
        for live in self:
            live.pause()

    def resume(self) -> None:
        """All go on."""
        for live in self:
            live.resume()

    def add_twin(self, setup: Setup, loaded: LoadedStage | None, edit: Edit) -> Live:
        """One more, of the same scene; ``edit`` is made first."""
        live = Live(setup, self.first.parent())
        self.twins.append(live)
        if self.first.renderer is not None:
            live.begin(self.first.renderer.twin, loaded, edit)
        return live

    def drop_twin(self, live: Live) -> None:
        """Ends a twin."""
        if live in self.twins:
            self.twins.remove(live)
            live.shutdown()
            live.deleteLater()

    def shutdown(self) -> None:
        """Ends all."""
        for live in (*self.twins, self.first):
            live.shutdown()
        self.twins.clear()


def copied(edit: Edit) -> Edit:
    """Later edits are added to one that waits, and so each render has its own."""
    return Edit(edit.camera, dict(edit.materials), dict(edit.lights))
