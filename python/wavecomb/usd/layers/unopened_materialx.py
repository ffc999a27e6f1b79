# SPDX-License-Identifier: Apache-2.0
"""MaterialX files that a stage names but USD did not open."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from pxr import Usd

_NAMED = re.compile(r"@([^@]*\.mtlx\]*)@", re.IGNORECASE)
"""Name of a MaterialX file in USD's message about a layer that cannot be opened."""


def unopened_materialx(stage: Usd.Stage) -> Iterator[tuple[Any, str]]:
    """Yields composition errors about MaterialX files, with the files' names."""
    for error in stage.GetCompositionErrors():
        found = _NAMED.search(str(error))
        if found is not None:
            yield error, found[1]
