# SPDX-License-Identifier: Apache-2.0
"""MaterialX files that a stage names and USD did not open."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from pxr import Usd

_NAMED = re.compile(r"@([^@]*\.mtlx\]*)@", re.IGNORECASE)
"""A MaterialX file in what USD says of a layer that it cannot open."""


def unread_mtlx(stage: Usd.Stage) -> Iterator[tuple[Any, str]]:
    """Errors of composition that are about MaterialX files, and these files' names."""
    for error in stage.GetCompositionErrors():
        found = _NAMED.search(str(error))
        if found is not None:
            yield error, found[1]
