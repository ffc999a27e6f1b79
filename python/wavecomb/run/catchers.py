# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers: combines three renders of a stage to one image (docs/visibility.md).

In the main render the camera does not see the catchers. Two further renders show only the catchers:
one with all objects casting shadows and one without any. Let c be a pixel's coverage by catchers,
and L and L0 their reflected luminance in these renders, which use the same random numbers. Then the
shadow adds the alpha c (1 - L / L0).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image.working_space import LUMINANCE

if TYPE_CHECKING:
    from wavecomb._core import Result, Settings
    from wavecomb.image.rendered import Picture

LAYER = "alpha"
"""The AOV to which shadows on catchers are added."""
PASSES: tuple[Mapping[str, str], ...] = (
    {"catch": "lit", "lights": "hidden"},
    {"catch": "bare", "lights": "hidden"},
)
"""Load options that replace the stage's options in the two renders of catchers."""
_LAYERS = ("direct", "indirect", LAYER)


def check(settings: Settings, given: Mapping[str, Any]) -> None:
    """Raises WavecombError for settings that cannot be combined with catchers.

    Args:
        settings: Settings of the render.
        given: Values of further options by name; options that are set are rejected.
    """
    asked = {name: getattr(settings, name) for name in ("time_limit", "adaptive", "noise")}
    asked["allocate"] = settings.allocate != "even"
    refused = {f"--{name.replace('_', '-')}": value for name, value in asked.items()}
    for option, value in {**refused, **given}.items():
        if value:
            raise WavecombError(
                f"shadow catchers cannot be combined with {option}, since the image combines three "
                "renders; leave one of them out"
            )


def with_alpha(settings: Settings) -> Settings:
    """Returns the settings with the layer that receives shadows."""
    from wavecomb import _core

    if LAYER in settings.aovs:
        return settings
    return _core.Settings(**{**settings.to_dict(), "aovs": [*settings.aovs, LAYER]})


def catcher_settings(settings: Settings) -> Settings:
    """Returns the settings for the two renders of catchers."""
    from wavecomb import _core

    own = {"aovs": list(_LAYERS), "light_weights": "power", "error": False, "firefly": "keep"}
    return _core.Settings(**{**settings.to_dict(), **own})


def with_catcher_shadows(
    picture: Picture, render: Callable[[Mapping[str, str]], Result]
) -> Picture:
    """Returns the image with the shadows on its catchers.

    Args:
        picture: Image without catchers; it has the AOV alpha.
        render: Loads the stage with replaced options and renders it with ``catcher_settings``.
    """
    lit, bare = (_light_of(render(how)) for how in PASSES)
    alpha = with_shadows(picture.aovs[LAYER], lit[1], lit[0], bare[0])
    return replace(picture, aovs={**picture.aovs, LAYER: alpha})


def _light_of(result: Result) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the luminance that catchers reflect, and their coverage of each pixel."""
    light = result.aovs["direct"].astype(np.float64) + result.aovs["indirect"]
    return light @ np.array(LUMINANCE), result.aovs[LAYER].astype(np.float64)


def with_shadows(
    alpha: NDArray[Any],
    share: NDArray[np.float64],
    lit: NDArray[np.float64],
    bare: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Adds shadows on catchers to alpha, in proportion to their darkness.

    Args:
        alpha: Alpha of all other objects. Objects behind catchers are not counted twice.
        share: Coverage of each pixel by catchers.
        lit: Luminance that catchers reflect with shadows.
        bare: Luminance that catchers reflect without other objects.

    >>> with_shadows(np.zeros(2), np.ones(2), np.array([0.25, 1]), np.ones(2)).tolist()
    [0.75, 0.0]
    """
    dark = 1.0 - np.clip(np.divide(lit, bare, out=np.ones_like(lit), where=bare > 0), 0.0, 1.0)
    behind = np.maximum(0.0, alpha - (1.0 - share))
    out: NDArray[np.float32] = (alpha + dark * np.maximum(share - behind, 0)).astype(np.float32)
    return out
