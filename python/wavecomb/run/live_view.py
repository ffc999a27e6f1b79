# SPDX-License-Identifier: Apache-2.0
"""Live view of a render in a notebook: progress bar, speed and remaining time, current image.

Uses ipywidgets if it is installed, otherwise IPython's updatable output.
"""

from __future__ import annotations

import contextlib
import html
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from wavecomb.run.callbacks import Sink
from wavecomb.run.progress import ProgressBar, Silent, figures, progress_console

if TYPE_CHECKING:
    from wavecomb._core import Snapshot

PICTURE_EDGE = 480
"""Longer edge of the live image in pixels."""
FIRST_S, EVERY_S = 1.0, 2.0
"""Seconds until the first image, and seconds between images."""
BAR_EVERY_S = 0.25


@dataclass(frozen=True)
class ProgressDisplays:
    """Reporter and image sinks that show the progress of a render."""

    reporter: Silent
    sinks: Sequence[Sink] = ()


@contextlib.contextmanager
def watching(asked: bool | None, space: str = "rec709") -> Iterator[ProgressDisplays | None]:
    """Shows the progress of a render in the ``with`` block; yields None if nothing is shown.

    Args:
        asked: True shows progress in a notebook or terminal, None only in a notebook, False
            nowhere.
        space: Working colour space of the image.
    """
    shown = None
    if asked is not False:
        if in_notebook():
            view = make_view()
            shown = ProgressDisplays(LiveProgress(view), [LivePicture(view, space)])
        elif asked and (console := progress_console()) is not None:
            shown = ProgressDisplays(ProgressBar(console))
    if shown is None:
        yield None
        return
    with shown.reporter:
        yield shown


def in_notebook() -> bool:
    """Returns whether this process is a Jupyter kernel."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return getattr(shell, "kernel", None) is not None


class View(Protocol):
    """Interface of the live views for notebooks."""

    def bar(self, share: float, text: str) -> None:
        """Shows the completed fraction of the render, from 0 to 1, and a text such as its speed."""

    def picture(self, png: bytes) -> None:
        """Shows the current image."""

    def close(self) -> None:
        """Removes the view, which the final image replaces."""


class WidgetView:
    """Live view that uses ipywidgets."""

    def __init__(self) -> None:
        import ipywidgets
        from IPython.display import display

        self._bar = ipywidgets.FloatProgress(min=0.0, max=1.0)
        self._text = ipywidgets.Label()
        self._image = ipywidgets.Image(format="png", layout={"display": "none"})
        row = ipywidgets.HBox([self._bar, self._text])
        self._all = ipywidgets.VBox([row, self._image])
        display(self._all)

    def bar(self, share: float, text: str) -> None:
        """Shows the completed fraction of the render and a text."""
        self._bar.value, self._text.value = share, text

    def picture(self, png: bytes) -> None:
        """Shows the current image."""
        self._image.value = png
        self._image.layout.display = ""

    def close(self) -> None:
        """Removes the view."""
        self._all.close()


class IPythonView:
    """Live view that uses IPython's updatable output."""

    def __init__(self) -> None:
        from IPython.display import HTML, display

        self._html = HTML
        self._handle: Any = display(HTML(""), display_id=True)
        self._bar = self._picture = ""

    def bar(self, share: float, text: str) -> None:
        """Shows the completed fraction of the render and a text."""
        self._bar = (
            f"<progress max='1' value='{share:.4f}' style='width:20em'></progress> "
            f"{html.escape(text)}"
        )
        self._show(self._bar + self._picture)

    def picture(self, png: bytes) -> None:
        """Shows the current image."""
        from wavecomb.image.thumbnails import base64_text

        source = f"data:image/png;base64,{base64_text(png)}"
        self._picture = f"<br><img src='{source}' alt='the picture so far'>"
        self._show(self._bar + self._picture)

    def close(self) -> None:
        """Removes the view."""
        self._show("")

    def _show(self, markup: str) -> None:
        if self._handle is not None:
            self._handle.update(self._html(markup))


def make_view() -> View:
    """Returns an ipywidgets view if ipywidgets is installed, otherwise an IPython view."""
    with contextlib.suppress(ImportError):
        return WidgetView()
    return IPythonView()


class LiveProgress(Silent):
    """Reporter that shows a progress bar in a live view."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._next = 0.0

    def __exit__(self, *error: object) -> None:
        self._view.close()

    def show(self, status: Mapping[str, Any]) -> None:
        """Updates the bar a few times per second."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + BAR_EVERY_S
        done, total = status["samples_done"], status["samples_total"]
        share = min(max(done / total, 0.0), 1.0) if total else 0.0
        self._view.bar(share, f"{100 * share:.0f} %, " + ", ".join(figures(status)))


class LivePicture(Sink):
    """Sink that shows the current image in a live view."""

    def __init__(self, view: View, working_space: str = "rec709") -> None:
        super().__init__("the picture so far", FIRST_S)
        self.every = EVERY_S
        self._view = view
        self._working = working_space

    def write(self, snapshot: Snapshot) -> None:
        """Shows the image unless the render has finished, since the final image follows."""
        if snapshot.finished:
            return
        from wavecomb.image.files.image import display
        from wavecomb.image.thumbnails import encode_image, shrink
        from wavecomb.image.working_space import to_rec709

        small = to_rec709(shrink(snapshot.beauty(), PICTURE_EDGE), self._working)
        self._view.picture(encode_image(display(small, tone_map="neutral")))
