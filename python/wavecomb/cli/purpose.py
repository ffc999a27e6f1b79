# SPDX-License-Identifier: Apache-2.0
"""Options of ``wavecomb render``: when to end, what to keep on the way, how to show it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.setting_options import add_options, option
from wavecomb.errors import WavecombError

if TYPE_CHECKING:
    from wavecomb.run.checkpoint import Checkpoint

DEFAULT_SPP = 64
ADAPTIVE_SPP = 1024
UNLIMITED_SPP = 1 << 20

purpose_options = add_options(
    option(
        "--adaptive X", "positive",
        "Samples go where the error of pixels is above X; 0.02 is fine.",
    ),
    option(
        "--noise X", "positive",
        "Likewise, until the mean relative error of the picture is X: 0.02 is 2 %.",
    ),
    option(
        "--min-spp N", "count",
        "With these: samples before the first look at errors.  [default: 16]",
    ),
    option("--max-spp N", "count", "With these: the most samples a pixel.  [default: 1024]"),
    option(
        "--time-limit S", "positive",
        "Seconds of rendering. Without --spp as many samples as fit.",
    ),
    option(
        "--checkpoint FILE", "path",
        "Saves the state of the render, also on Ctrl-C and SIGTERM.",
    ),
    option("--every S", "positive", "Seconds between checkpoints.  [default: 120]"),
    option(
        "--resume FILE", "path",
        "Goes on from a checkpoint, and saves to it unless --checkpoint is given.",
    ),
    option("--preview FILE.png", "path", "The picture as it grows."),
    option("--preview-every S", "positive", "Seconds between previews.  [default: 10]"),
    option(
        "--denoise", "flag", "Adds the layer denoised, which PNGs then show (extra 'denoise')."
    ),
    option(
        "--progress", click.Choice(["bar", "json", "off"]),
        "json: a line a second on stdout, for programs.  [default: bar]",
    ),
)  # fmt: skip
"""--adaptive, --noise, --time-limit, --checkpoint, --resume, --preview, --denoise ..."""


@dataclass(frozen=True)
class PurposeOptions:
    """What ``purpose_options`` gave."""

    adaptive: float | None
    noise: float | None
    min_spp: int | None
    max_spp: int | None
    time_limit: float | None
    checkpoint: str | None
    every: float
    resume: str | None
    preview: str | None
    preview_every: float
    denoise: bool
    progress: str | None

    @classmethod
    def take(cls, options: dict[str, Any]) -> PurposeOptions:
        """Moves them out of a command's arguments."""
        every, preview_every = options["every"], options["preview_every"]
        if every is not None and options["checkpoint"] is None and options["resume"] is None:
            raise WavecombError("--every is for checkpoints: give --checkpoint or --resume, too")
        if preview_every is not None and options["preview"] is None:
            raise WavecombError("--preview-every is for previews: give --preview, too")
        options["every"] = 120.0 if every is None else every
        options["preview_every"] = 10.0 if preview_every is None else preview_every
        return cls(**{field.name: options.pop(field.name) for field in fields(cls)})

    @property
    def whole(self) -> str:
        """An option that needs all of the picture at once; empty: there is none."""
        for name in ("denoise", "checkpoint", "resume", "preview"):
            if getattr(self, name):
                return f"--{name}"
        return ""

    @property
    def checkpoint_file(self) -> str | None:
        """Where checkpoints go."""
        return self.checkpoint if self.checkpoint is not None else self.resume

    def load(self) -> Checkpoint | None:
        """The checkpoint to resume from. Checks that no other file would be replaced by one."""
        from wavecomb.run.checkpoint import check_replaceable, load_checkpoint

        if self.checkpoint is not None:
            check_replaceable(self.checkpoint)
        return load_checkpoint(self.resume) if self.resume is not None else None

    def settings(self, spp: int | None, resumed: Checkpoint | None) -> dict[str, Any]:
        """Settings that were asked for, and the samples a pixel, as ``spp``."""
        before = resumed.settings if resumed is not None else {}
        chosen = {
            name: value
            for name in ("adaptive", "noise", "min_spp", "time_limit")
            if (value := getattr(self, name)) is not None
        }
        is_adaptive = any({**before, **chosen}.get(name) for name in ("adaptive", "noise"))
        for name in ("min_spp", "max_spp"):
            if getattr(self, name) is not None and not is_adaptive:
                raise WavecombError(
                    f"--{name.replace('_', '-')} is for adaptive renders: "
                    "give --adaptive or --noise, too"
                )
        if None not in (spp, self.max_spp) and spp != self.max_spp:
            raise WavecombError(f"--spp is {spp} and --max-spp {self.max_spp}; give one of them")
        asked = spp if spp is not None else self.max_spp
        was_timed = before.get("spp") == UNLIMITED_SPP and not is_adaptive
        if was_timed and asked is None and self.time_limit is None:
            raise WavecombError(
                f"{self.resume}: is of a render that a time limit was to end: "
                "give --time-limit or --spp"
            )
        if asked is None and "spp" not in before:
            if self.time_limit is not None:
                asked = UNLIMITED_SPP
            else:
                asked = ADAPTIVE_SPP if is_adaptive else DEFAULT_SPP
        if asked is not None:
            chosen["spp"] = asked
        return chosen
