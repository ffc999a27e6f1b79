# SPDX-License-Identifier: Apache-2.0
"""Libraries that only some commands need."""

from __future__ import annotations

import importlib
from typing import Any

from wavecomb.errors import WavecombError


def needed(module: str, what: str, extra: str = "bench") -> Any:
    """Imports a library of an extra.

    Args:
        module: As imported.
        what: Who needs it, as the subject of the message: "SSIM".
        extra: That brings it, of pyproject.toml.

    Raises:
        WavecombError: It is missing; says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0].replace("_", "-")
        raise WavecombError(
            f"{what} needs {package} ({error}): pip install 'wavecomb[{extra}]'"
        ) from error
