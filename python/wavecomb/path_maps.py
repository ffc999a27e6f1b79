# SPDX-License-Identifier: Apache-2.0
"""Path maps: folders that lie elsewhere on this machine than a job and its stage name them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable

from wavecomb.errors import WavecombError

Pair = tuple[str, str]
"""A folder as a job and its stage name it, and where it lies here; both absolute."""

VARIABLE = "WAVECOMB_PATH_MAPS"
"""JSON: pairs of folders. Set for the workers of a farm; nothing else sets it."""


def parse_maps(texts: Iterable[str]) -> tuple[Pair, ...]:
    """Pairs of "FROM=TO".

    >>> parse_maps(["/Volumes/share=/share"])
    (('/Volumes/share', '/share'),)

    Raises:
        WavecombError: A text is no such pair.
    """
    found = []
    for text in texts:
        named, equals, lies = text.partition("=")
        if not equals or not os.path.isabs(named) or not os.path.isabs(lies):
            raise WavecombError(f"--map {text}: must be FROM=TO, two absolute folders")
        found.append((os.path.normpath(named), os.path.normpath(lies)))
    return tuple(found)


def use_maps(pairs: Iterable[Pair]) -> None:
    """Has this process, and those that it starts, use maps of this machine."""
    found = list(pairs)
    if found:
        os.environ[VARIABLE] = json.dumps(found)


def own_maps() -> list[Pair]:
    """The maps of this process."""
    text = os.environ.get(VARIABLE)
    return [(str(named), str(lies)) for named, lies in json.loads(text)] if text else []


def here(pairs: Iterable[Pair]) -> list[Pair]:
    """Maps that hold on this machine: its own, and those of a job whose FROM is not there."""
    found = own_maps()
    return found + [p for p in pairs if p not in found and not os.path.exists(p[0])]


def mapped(path: str, pairs: Iterable[Pair]) -> str:
    """Where a file lies; the longest folder that fits decides. Relative names stay as they are.

    >>> mapped("/a/b/c.png", [("/a", "/x"), ("/a/b", "/y")]), mapped("/ab/c", [("/a", "/x")])
    ('/y/c.png', '/ab/c')
    """
    if not os.path.isabs(path):
        return path
    best = max(
        (pair for pair in pairs if _is_in(path, pair[0])),
        key=lambda pair: len(pair[0].rstrip("/")),
        default=None,
    )
    if best is None:
        return path
    named, lies = (folder.rstrip("/") for folder in best)
    rest = path[len(named) :]
    # What was mapped already is not mapped again.
    return path if named == "" and _is_in(path, lies) else (lies + rest) or "/"


def _is_in(path: str, folder: str) -> bool:
    folder = folder.rstrip("/")
    return path == folder or path.startswith(folder + "/")
