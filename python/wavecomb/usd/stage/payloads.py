# SPDX-License-Identifier: Apache-2.0
"""Which payloads of a stage are loaded."""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Sdf, Usd

from wavecomb.errors import WavecombError
from wavecomb.usd.stage.patterns import PathPattern
from wavecomb.usd.stage.report import LoadReport

NONE = "none"
"""In place of patterns: no payload."""


def load_payloads(stage: Usd.Stage, wanted: Sequence[str]) -> None:
    """Loads payloads of a stage that was opened without any.

    Those of prims that a pattern is the path of, or that are below such prims, and those above that
    the names of a pattern lead through.

    Args:
        stage: Opened with ``Usd.Stage.LoadNone``.
        wanted: Patterns, or ``NONE``.

    Raises:
        WavecombError: A pattern is none, or the stage has no such payload.
    """
    if NONE in wanted:
        if len(wanted) > 1:
            raise WavecombError(f"payloads: {NONE} goes with no pattern")
        return
    patterns = [PathPattern(text, "payloads") for text in wanted]
    met: set[str] = set()
    seen: set[Sdf.Path] = set()
    while True:
        new = [path for path in stage.FindLoadable() if path not in seen]
        seen.update(new)
        chosen = set()
        for path in new:
            mine = [one.text for one in patterns if one.is_at_or_above(path)]
            met.update(mine)
            if mine or any(one.may_be_below(path) for one in patterns):
                chosen.add(path)
        if not chosen:
            break
        stage.LoadAndUnload(chosen, set(), Usd.LoadWithoutDescendants)
    for text in wanted:
        if text not in met:
            raise WavecombError(f"payloads {text}: the stage has no such payload")


def tell_unloaded(stage: Usd.Stage, report: LoadReport) -> None:
    """Notes payloads that the stage was opened without."""
    if stage.GetLoadRules() == Usd.StageLoadRules.LoadAll():
        return
    loaded = set(stage.GetLoadSet())
    for path in stage.FindLoadable():
        if path not in loaded:
            report.note("payloads that are not loaded", path)
