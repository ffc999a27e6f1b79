# SPDX-License-Identifier: Apache-2.0
"""Whether stages are read in a sandbox: asked where nothing of ``reader`` may be needed."""

from __future__ import annotations

import os
import sys

from wavecomb.errors import WavecombError
from wavecomb.run.isolate import trail


def is_wanted(isolate: bool | None = None) -> bool:
    """Whether stages are to be read in such a process; None: unless WAVECOMB_ISOLATE=0.

    Not by default where this process is one already, for who looks for a fault (WAVECOMB_DEBUG),
    and where there is no Linux.

    Raises:
        WavecombError: It is asked for where there is none.
    """
    if isolate is not None:
        if isolate and sys.platform != "linux":
            raise WavecombError("isolate: there is such a process on Linux only")
        return isolate
    if sys.platform != "linux" or trail.is_expendable() or os.environ.get("WAVECOMB_DEBUG"):
        return False
    return os.environ.get("WAVECOMB_ISOLATE", "1") not in ("", "0")
