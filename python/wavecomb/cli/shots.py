# SPDX-License-Identifier: Apache-2.0
"""Sources of scenes for ``wavecomb render``: a stage at one frame, or a stage that stays open."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from wavecomb.cli.options import StageOptions

if TYPE_CHECKING:
    from wavecomb.run.sequence import Frames
    from wavecomb.usd import LoadedStage


class Shot(Protocol):
    """Source of a scene, with the methods that render it."""

    def load(
        self, progress: Callable[[int, int], None] | None = None, **changes: Any
    ) -> LoadedStage:
        """Loads the stage. ``changes`` are fields of ``LoadOptions`` that override the options."""

    def render(self, *arguments: Any, **named: Any) -> Any:
        """Renders the scene. Takes the arguments of ``_core.render`` after the scene."""

    def render_part(self, *arguments: Any, **named: Any) -> Any:
        """Renders one of several bands of an image, with the arguments of ``render``."""

    def stats(self, result: Any, resumed_s: float) -> dict[str, Any]:
        """Returns ``make_stats`` for a result, after ``resumed_s`` seconds of an earlier render."""


class Still:
    """A stage at one frame."""

    def __init__(self, source: StageOptions, stage: str, settings: Any, kept: Any = None) -> None:
        """Creates the source. Holds ``kept`` until the stage is loaded."""
        self._renderer: Any = None
        self._kept = kept
        self._source = source
        self._stage = stage
        self._settings = settings
        self._loaded: LoadedStage | None = None

    def load(
        self, progress: Callable[[int, int], None] | None = None, **changes: Any
    ) -> LoadedStage:
        """Loads the stage."""
        chosen = self._settings
        size = chosen.width, chosen.height
        self._loaded = self._source.load(self._stage, chosen.threads, size, progress, **changes)
        self._kept = None
        self._renderer = None
        return self._loaded

    def render(self, *arguments: Any, **named: Any) -> Any:
        """Renders the scene, and frees the renderer's data afterwards."""
        from wavecomb import _core

        assert self._loaded is not None
        return _core.render(self._loaded.scene, *arguments, **named)

    def render_part(self, settings: Any, *arguments: Any, **named: Any) -> Any:
        """Renders a band of the image, and keeps the renderer for the next one."""
        from wavecomb import _core

        assert self._loaded is not None
        if self._renderer is None:
            self._renderer = _core.Renderer(self._loaded.scene, settings.threads)
        return self._renderer.render(settings, *arguments, **named)

    def stats(self, result: Any, resumed_s: float) -> dict[str, Any]:
        """Returns the statistics of the image."""
        from wavecomb.run.stats import make_stats

        return make_stats(result, stage=self._stage, loaded=self._loaded, resumed_s=resumed_s)


class FrameShot:
    """A frame of a stage that stays open between frames."""

    def __init__(self, frames: Frames, frame: float | None, **options: Any) -> None:
        """Creates the source. ``options`` are arguments of ``Frames.load``."""
        self._frames = frames
        self._frame = frame
        self._options = options

    def load(
        self, progress: Callable[[int, int], None] | None = None, **changes: Any
    ) -> LoadedStage:
        """Loads what changed since the previous frame."""
        return self._frames.load(self._frame, progress=progress, **self._options, **changes)

    def render(self, *arguments: Any, **named: Any) -> Any:
        """Renders the scene."""
        return self._frames.render(*arguments, **named)

    render_part = render

    def stats(self, result: Any, resumed_s: float) -> dict[str, Any]:
        """Returns the statistics of the image."""
        return self._frames.stats(result, resumed_s=resumed_s)
