# SPDX-License-Identifier: Apache-2.0
"""What a scene generator refuses."""

from __future__ import annotations

from wavecomb.errors import WavecombError


class SceneError(WavecombError, ValueError):
    """A request or an imported file that is no good: one line that says what to do."""
