# SPDX-License-Identifier: Apache-2.0
"""What comes of one picture of ``wavecomb render``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavecomb.picture.rendered import Picture
    from wavecomb.usd import LoadReport


@dataclass(frozen=True)
class Done:
    """What came of a render.

    Attributes:
        stats: As ``make_stats`` gives them.
        costs: A profile for other renders.
        report: What to say of the stage.
        stopped: Number of the signal that stopped it; None: it went to its end.
        picture: To be written; None: it was written band by band.
        files: Those that were written so.
    """

    stats: dict[str, Any]
    costs: Any
    report: LoadReport
    stopped: int | None
    picture: Picture | None = None
    files: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """All, with those of a checkpoint."""
        return int(self.stats["counts"]["samples"] + self.stats["resumed_samples"])
