# SPDX-License-Identifier: Apache-2.0
"""Options of ``wavecomb render`` for stopping criteria, checkpoints, previews and progress."""

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
        "Sample each pixel until its relative error is below X (0.02 is a good value).",
    ),
    option(
        "--noise X", "positive",
        "Sample adaptively until the mean relative error of the image is X (0.02 is 2 %).",
    ),
    option(
        "--min-spp N", "count",
        "Samples per pixel before the first error estimate of adaptive renders.  [default: 16]",
    ),
    option(
        "--max-spp N", "count",
        "Maximum number of samples per pixel in adaptive renders.  [default: 1024]",
    ),
    option(
        "--time-limit S", "positive",
        "Stop after S seconds of rendering, or earlier at --spp if given.",
    ),
    option(
        "--checkpoint FILE", "path",
        "Save the state of the render regularly, and on Ctrl-C and SIGTERM.",
    ),
    option("--every S", "positive", "Interval between checkpoints in seconds.  [default: 120]"),
    option(
        "--resume FILE", "path",
        "Continue from a checkpoint, and save to it unless --checkpoint is given.",
    ),
    option("--preview FILE.png", "path", "Regularly write an image of the render in progress."),
    option("--preview-every S", "positive", "Interval between previews in seconds.  [default: 10]"),
    option(
        "--denoise", "flag", "Add a denoised layer, which PNGs then show (extra 'denoise')."
    ),
    option(
        "--progress", click.Choice(["bar", "json", "off"]),
        "How progress is shown; json prints one line per second on standard output.  [default: "
        "bar]",
    ),
)  # fmt: skip
"""--adaptive, --noise, --time-limit, --checkpoint, --resume, --preview, --denoise ..."""


@dataclass(frozen=True)
class PurposeOptions:
    """Values of the options that ``purpose_options`` added to a command."""

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
        """Removes these options from a command's arguments."""
        every, preview_every = options["every"], options["preview_every"]
        if every is not None and options["checkpoint"] is None and options["resume"] is None:
            raise WavecombError(
                "--every applies to checkpoints: also give --checkpoint or --resume"
            )
        if preview_every is not None and options["preview"] is None:
            raise WavecombError("--preview-every applies to previews: also give --preview")
        options["every"] = 120.0 if every is None else every
        options["preview_every"] = 10.0 if preview_every is None else preview_every
        return cls(**{field.name: options.pop(field.name) for field in fields(cls)})

    @property
    def whole(self) -> str:
        """An option that needs the whole image in memory, or "" if there is none."""
        for name in ("denoise", "checkpoint", "resume", "preview"):
            if getattr(self, name):
                return f"--{name}"
        return ""

    @property
    def checkpoint_file(self) -> str | None:
        """File that checkpoints are saved to, or None."""
        return self.checkpoint if self.checkpoint is not None else self.resume

    def load(self) -> Checkpoint | None:
        """Loads the checkpoint to resume, or None.

        Raises WavecombError if --checkpoint would overwrite another kind of file.
        """
        from wavecomb.run.checkpoint import check_replaceable, load_checkpoint

        if self.checkpoint is not None:
            check_replaceable(self.checkpoint)
        return load_checkpoint(self.resume) if self.resume is not None else None

    def settings(self, spp: int | None, resumed: Checkpoint | None) -> dict[str, Any]:
        """Returns the render settings of these options, with ``spp``, in samples per pixel."""
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
                    f"--{name.replace('_', '-')} applies to adaptive renders: "
                    "also give --adaptive or --noise"
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
