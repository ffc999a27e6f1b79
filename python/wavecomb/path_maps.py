# SPDX-License-Identifier: Apache-2.0
"""Path maps, which replace folder names in a job and its stage by folder names on this machine."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable

from wavecomb.errors import WavecombError

Pair = tuple[str, str]
"""A pair of absolute folders: the name that the job and its stage use, and the name on this
machine."""

VARIABLE = "WAVECOMB_PATH_MAPS"
"""Environment variable with path maps as JSON, which is set only for workers of a render farm."""


def parse_maps(texts: Iterable[str]) -> tuple[Pair, ...]:
    """Parses path maps from texts of the form "FROM=TO".

    >>> parse_maps(["/Volumes/share=/share"])
    (('/Volumes/share', '/share'),)

    Raises:
        WavecombError: A text does not have this form.
    """
    found = []
    for text in texts:
        named, equals, lies = text.partition("=")
        if not equals or not os.path.isabs(named) or not os.path.isabs(lies):
            raise WavecombError(f"--map {text}: must be FROM=TO, two absolute folders")
        found.append((os.path.normpath(named), os.path.normpath(lies)))
    return tuple(found)


def use_maps(pairs: Iterable[Pair]) -> None:
    """Sets the path maps of this process and its child processes."""
    found = list(pairs)
    if found:
        os.environ[VARIABLE] = json.dumps(found)


def own_maps() -> list[Pair]:
    """Returns the path maps of this process."""
    text = os.environ.get(VARIABLE)
    return [(str(named), str(lies)) for named, lies in json.loads(text)] if text else []


def here(pairs: Iterable[Pair]) -> list[Pair]:
    """Returns this process's maps, and the job's maps whose FROM folders do not exist here."""
    found = own_maps()
    return found + [p for p in pairs if p not in found and not os.path.exists(p[0])]


def mapped(path: str, pairs: Iterable[Pair]) -> str:
    """Returns the mapped path of a file. If several folders match, the longest one applies.

    Relative paths are unchanged.

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
    # Do not map a path that has already been mapped.
    return path if named == "" and _is_in(path, lies) else (lies + rest) or "/"


def _is_in(path: str, folder: str) -> bool:
    folder = folder.rstrip("/")
    return path == folder or path.startswith(folder + "/")
