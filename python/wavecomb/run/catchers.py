# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers: three renders of a stage as one picture (docs/visibility.md).

The picture is rendered with catchers that the camera does not see. Two more renders see nothing
but the catchers: one lit as they are, one as if nothing else were there. With c the share of a
pixel that catchers have there, and L, L0 what they reflect in either, both by the same random
numbers, the shadow covers c (1 - L / L0) of the pixel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.picture.working_space import LUMINANCE

if TYPE_CHECKING:
    from wavecomb._core import Result, Settings
    from wavecomb.picture.rendered import Picture

LAYER = "alpha"
"""The AOV that shadows go to."""
PASSES: tuple[Mapping[str, str], ...] = (
    {"catch": "lit", "lights": "hidden"},
    {"catch": "bare", "lights": "hidden"},
)
"""How the stage is loaded for the two renders of catchers, in place of its own options."""
_LAYERS = ("direct", "indirect", LAYER)


def check(settings: Settings, given: Mapping[str, Any]) -> None:
    """Raises WavecombError for what does not go with catchers.

    Args:
        settings: Of the render.
        given: Options by name; those that are given are refused.
    """
    asked = {name: getattr(settings, name) for name in ("time_limit", "adaptive", "noise")}
    asked["allocate"] = settings.allocate != "even"
    refused = {f"--{name.replace('_', '-')}": value for name, value in asked.items()}
    for option, value in {**refused, **given}.items():
        if value:
            raise WavecombError(
                f"shadow catchers do not go with {option}: three renders make the picture; leave "
                "one of them out"
            )


def with_alpha(settings: Settings) -> Settings:
    """Settings with the layer that shadows go to."""
    from wavecomb import _core

    if LAYER in settings.aovs:
        return settings
    return _core.Settings(**{**settings.to_dict(), "aovs": [*settings.aovs, LAYER]})


def of_catchers(settings: Settings) -> Settings:
    """Settings of the two renders of catchers."""
    from wavecomb import _core

    own = {"aovs": list(_LAYERS), "light_weights": "power", "error": False, "firefly": "keep"}
    return _core.Settings(**{**settings.to_dict(), **own})


def caught(picture: Picture, render: Callable[[Mapping[str, str]], Result]) -> Picture:
    """A picture with the shadows on its catchers.

    Args:
        picture: Rendered without them; it has the AOV alpha.
        render: Loads the stage with some options in place of its own, and renders it with
            ``of_catchers``.
    """
    lit, bare = (_light_of(render(how)) for how in PASSES)
    alpha = with_shadows(picture.aovs[LAYER], lit[1], lit[0], bare[0])
    return replace(picture, aovs={**picture.aovs, LAYER: alpha})


def _light_of(result: Result) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What catchers reflect, and their share of each pixel."""
    light = result.aovs["direct"].astype(np.float64) + result.aovs["indirect"]
    return light @ np.array(LUMINANCE), result.aovs[LAYER].astype(np.float64)


def with_shadows(
    alpha: NDArray[Any],
    share: NDArray[np.float64],
    lit: NDArray[np.float64],
    bare: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Alpha with shadows: what catchers show of the pixel is covered as far as it is dark.

    Args:
        alpha: Of all else. What of it lies behind catchers is not covered twice.
        share: Of each pixel that catchers have.
        lit: Luminance that they reflect.
        bare: The same if nothing else were there.

    >>> with_shadows(np.zeros(2), np.ones(2), np.array([0.25, 1]), np.ones(2)).tolist()
    [0.75, 0.0]
    """
    dark = 1.0 - np.clip(np.divide(lit, bare, out=np.ones_like(lit), where=bare > 0), 0.0, 1.0)
    behind = np.maximum(0.0, alpha - (1.0 - share))
    out: NDArray[np.float32] = (alpha + dark * np.maximum(share - behind, 0)).astype(np.float32)
    return out
