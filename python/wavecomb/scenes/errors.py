# SPDX-License-Identifier: Apache-2.0
"""Errors of the scene generators."""

from __future__ import annotations

from wavecomb.errors import WavecombError


class SceneError(WavecombError, ValueError):
    """Error about an invalid option or imported file, with one line that says what to do."""
