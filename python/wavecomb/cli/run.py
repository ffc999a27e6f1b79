# SPDX-License-Identifier: Apache-2.0
"""The middle of ``wavecomb render``: a stage is loaded, rendered and watched."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING, Any

from wavecomb.cli.options import StageOptions, stage_warnings, warn
from wavecomb.cli.purpose import PurposeOptions

if TYPE_CHECKING:
    from wavecomb.api import Picture
    from wavecomb.checkpoint import Checkpoint
    from wavecomb.cli.reporting import Reporter
    from wavecomb.usd import LoadedStage, LoadReport


def run(
    source: StageOptions,
    stage: str,
    settings: Any,
    aovs: tuple[str, ...],
    profile: dict[str, dict[str, float]] | None,
    purpose: PurposeOptions,
    resumed: Checkpoint | None,
    reporter: Reporter,
    exposure: float,
    tone_map: Any,
) -> tuple[Picture, int | None, LoadReport]:
    """The picture, the number of the signal that stopped it, and what there is to say of the stage.

    The scene is freed here: nothing needs it while files are written.
    """
    from wavecomb import _core
    from wavecomb.api import check_memory, picture_of
    from wavecomb.progress import Interrupt
    from wavecomb.stats import make_stats
    from wavecomb.watcher import CheckpointSink, PreviewSink, Sink, Watcher

    with reporter.loading(stage):
        loaded: LoadedStage = source.load(stage, settings.threads)
    warn(stage_warnings(loaded))
    if "light_groups" in aovs:
        check_memory(settings, aovs, len(loaded.scene.light_groups))
    sinks: list[Sink] = []
    state, seconds = None, 0.0
    if purpose.checkpoint_file is not None:
        from wavecomb.checkpoint import build_note, check_fits, make_header

        header = make_header(
            loaded.scene, settings, stage=stage, source=source.as_dict(), aovs=aovs
        )
        if resumed is not None:
            check_fits(resumed, header)
            warn([note] if (note := build_note(resumed, header)) else [])
            state, seconds = resumed.state, resumed.seconds
        sinks.append(CheckpointSink(purpose.checkpoint_file, purpose.every, header, seconds))
    if purpose.preview is not None:
        sinks.append(
            PreviewSink(
                purpose.preview, purpose.preview_every, exposure=exposure, tone_map=tone_map
            )
        )
    with Interrupt() as interrupt, reporter.rendering() as bar:
        watcher = Watcher(
            sinks,
            reporter=bar,
            is_stopped=lambda: interrupt.requested,
            warn=lambda line: warn([line]),
        )
        result = _core.render(
            loaded.scene, settings, None, None, profile, watcher=watcher, state=state
        )
    stats = make_stats(result, stage=stage, loaded=loaded, resumed_s=seconds)
    stopped = (interrupt.signal or signal.SIGINT) if result.cancelled else None
    picture = picture_of(result, stats, scene=loaded.scene, aovs=aovs)
    return picture, stopped, loaded.report


def how_far(picture: Any) -> str:
    """How much is done, as can be said of a render without and with a fixed end."""
    from wavecomb.stats import rendered_pixels

    stats = picture.stats
    settings = stats["settings"]
    samples = stats["counts"]["samples"] + stats["resumed_samples"]
    mean = samples / rendered_pixels(settings)
    if any(settings.get(name) for name in ("adaptive", "noise", "time_limit")):
        return f"with {mean:.3g} samples a pixel"
    return f"at {100.0 * mean / settings['spp']:.0f} %"
