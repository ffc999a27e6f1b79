# SPDX-License-Identifier: Apache-2.0
"""Source of one side of a comparison: a file, the viewport, or a separate render."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from wavecomb.gui.compare.picture_sides import Side, read_side, side_of_frame
from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.worker import Worker

if TYPE_CHECKING:
    from wavecomb.gui.viewport.live import Live
    from wavecomb.gui.viewport.session import Session

NONE, FILE, KEPT, VIEWPORT, LIVE = "none", "file", "kept", "viewport", "live"
SHORT = {
    **{"policy": "policy", "spp": "spp", "seed": "seed", "max_depth": "depth"},
    **{"roulette": "roulette", "sampler": "sampler", "integrator": "integrator"},
    **{"lanes": "lanes", "wave_size": "waves", "ray_order": "rays", "shadow_order": "shadow rays"},
    **{"adaptive": "adaptive", "denoise": "denoise", "clamp_indirect": "clamp"},
}
"""Short labels of the settings that distinguish two live renders."""


class SideSource(QObject):
    """Source of the image on one side of a comparison.

    All methods must be called on the UI thread, and none of them blocks.

    Signals:
        changed(): Emitted when ``side`` or ``kind`` changes.
        failed(str): Emitted on an error, with one line that says how to fix it.
    """

    changed = Signal()
    failed = Signal(str)

    def __init__(self, name: str, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.name = name
        self.kind = NONE
        self.side: Side | None = None
        self.live: Live | None = None
        self._session = session
        self._reader = Worker(f"read-{name}", self)
        self._reader.done.connect(lambda key, side: self.set_side(side))
        self._reader.failed.connect(lambda key, line: self.failed.emit(line))
        session.frame.connect(self._on_viewport)

    @property
    def loading(self) -> bool:
        """Whether an image file is being read."""
        return self._reader.busy

    def open(self, path: Path) -> None:
        """Reads an image file. The current image stays visible until the new image is read."""
        self._reader.submit(partial(read_side, path), path)

    def set_side(self, side: Side, kind: str = FILE) -> None:
        """Shows the given image on this side of the comparison."""
        self._release()
        self.kind, self.side = kind, side
        self.changed.emit()

    def keep(self) -> None:
        """Shows the viewport's current image. Later changes of the viewport have no effect."""
        frame = self._session.last_frame
        if frame is None:
            self.failed.emit(f"{self.name}: there is no picture to keep yet: open a stage first")
            return
        side = side_of_frame(frame, f"viewport, kept ({setup_text(frame.setup)})", live=False)
        self.set_side(side, KEPT)

    def follow(self) -> None:
        """Shows the viewport's image and follows its changes."""
        self._release()
        self.kind, self.side = VIEWPORT, None
        frame = self._session.last_frame
        if frame is not None:
            self._on_viewport(frame)
        self.changed.emit()

    def render(self, setup: Setup) -> None:
        """Starts a separate render of the open stage with the given settings."""
        if self._session.stage is None:
            self.failed.emit(f"{self.name}: there is no stage to render: open one first")
            return
        self._release()
        self.kind, self.side = LIVE, None
        self.live = self._session.twin(setup)
        self.live.frame.connect(self._on_live)
        self.live.failed.connect(self.failed)
        if self._session.state == "paused":
            self.live.pause()
        self.changed.emit()

    def change(self, **values: Any) -> None:
        """Changes settings of the separate render."""
        if self.live is not None and self.live.change(**values):
            self.changed.emit()

    def exchange(self, other: SideSource) -> None:
        """Exchanges the images of two sources."""
        for mine, theirs in ((self, other), (other, self)):
            if mine.live is not None:
                mine.live.frame.disconnect(mine._on_live)
                mine.live.failed.disconnect(mine.failed)
                mine.live.frame.connect(theirs._on_live)
                mine.live.failed.connect(theirs.failed)
        self.kind, other.kind = other.kind, self.kind
        self.side, other.side = other.side, self.side
        self.live, other.live = other.live, self.live
        self.changed.emit()
        other.changed.emit()

    def close(self) -> None:
        """Stops the reading of files and the separate render."""
        self._reader.close()
        self._release()
        self.side = None

    # ---- inside --------------------------------------------------------------------------------

    def _release(self) -> None:
        self._reader.cancel()
        live, self.live = self.live, None
        if live is not None:
            live.frame.disconnect(self._on_live)
            self._session.drop_twin(live)

    def _on_viewport(self, frame: Frame) -> None:
        if self.kind == VIEWPORT:
            self.side = side_of_frame(frame, f"viewport ({setup_text(frame.setup)})", live=True)
            self.changed.emit()

    def _on_live(self, frame: Frame) -> None:
        name = f"live ({setup_text(frame.setup, self._session.setup)})"
        self.side = side_of_frame(frame, name, live=True)
        self.changed.emit()


def setup_text(setup: Setup, beside: Setup | None = None) -> str:
    """Describes a setup briefly, by its differences from another setup.

    If the two setups are equal, the text names the policy and the sample count.
    """
    names = list(SHORT)
    if beside is not None:
        names = [name for name in names if getattr(setup, name) != getattr(beside, name)]
    if beside is None or not names:
        names = ["policy", "spp"]
    return ", ".join(f"{SHORT[name]} {_value(getattr(setup, name))}" for name in names)


def _value(value: Any) -> str:
    return ("on" if value else "off") if isinstance(value, bool) else f"{value}"
