# SPDX-License-Identifier: Apache-2.0
"""Finds MaterialX files that a stage refers to but that USD failed to open."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from pxr import Usd

_NAMED = re.compile(r"@([^@]*\.mtlx\]*)@", re.IGNORECASE)
"""Regular expression that finds the MaterialX file in USD's message about an unreadable layer."""


def unopened_materialx(stage: Usd.Stage) -> Iterator[tuple[Any, str]]:
    """Yields composition errors that concern MaterialX files, with the names of the files."""
    for error in stage.GetCompositionErrors():
        found = _NAMED.search(str(error))
        if found is not None:
            yield error, found[1]
