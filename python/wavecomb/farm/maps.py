# SPDX-License-Identifier: Apache-2.0
"""Path maps: folders that lie elsewhere on a worker's machine than on that of the job."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable

from wavecomb.errors import WavecombError

Pair = tuple[str, str]
"""What is named in a job and its stage, and where it lies here; both absolute."""

VARIABLE = "WAVECOMB_FARM_MAPS"
"""Those of this worker, for its renderer: JSON."""


def parse_maps(texts: Iterable[str]) -> tuple[Pair, ...]:
    """Pairs of "FROM=TO".

    >>> parse_maps(["/Volumes/share=/share"])
    (('/Volumes/share', '/share'),)

    Raises:
        WavecombError: One is none.
    """
    found = []
    for text in texts:
        named, equals, lies = text.partition("=")
        if not equals or not os.path.isabs(named) or not os.path.isabs(lies):
            raise WavecombError(f"--map {text}: must be FROM=TO, two absolute folders")
        found.append((os.path.normpath(named), os.path.normpath(lies)))
    return tuple(found)


def set_own(pairs: Iterable[Pair]) -> None:
    """Has this process, and those that it starts, use maps of this machine."""
    os.environ[VARIABLE] = json.dumps(list(pairs))


def here(pairs: Iterable[Pair]) -> list[Pair]:
    """Maps that hold on this machine: its own, and of a job's those whose FROM is not there."""
    text = os.environ.get(VARIABLE)
    own = [(str(named), str(lies)) for named, lies in json.loads(text)] if text else []
    return own + [pair for pair in pairs if not os.path.exists(pair[0])]


def place(path: str, pairs: Iterable[Pair]) -> str:
    """Where a file lies; the longest folder that fits decides.

    >>> place("/a/b/c.png", [("/a", "/x"), ("/a/b", "/y")])
    '/y/c.png'
    """
    best = max(
        (pair for pair in pairs if path == pair[0] or path.startswith(pair[0].rstrip("/") + "/")),
        key=lambda pair: len(pair[0]),
        default=None,
    )
    if best is None:
        return path
    return best[1].rstrip("/") + "/" + path[len(best[0].rstrip("/")) + 1 :]
