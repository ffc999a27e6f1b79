# SPDX-License-Identifier: Apache-2.0
"""Version of the installed package."""

from __future__ import annotations


def version() -> str:
    """Returns the version of the installed package, or "unknown" in a source tree."""
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        return installed("wavecomb")
    except PackageNotFoundError:
        return "unknown"
