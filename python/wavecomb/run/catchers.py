# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers: combines three renders of a stage into one image (docs/visibility.md).

In the main render, the camera does not see the catchers. Two further renders show only the
catchers: "lit" with shadows of all other objects, and "bare" without other objects. Let c be the
coverage of a pixel by catchers. Let L and L0 be the luminance that the catchers reflect in "lit"
and in "bare", which use the same random numbers. The shadow adds c (1 - L / L0) to the pixel's
alpha.
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
"""Load options of the two renders that show only the catchers."""
_LAYERS = ("direct", "indirect", LAYER)


def check(settings: Settings, given: Mapping[str, Any]) -> None:
    """Raises WavecombError if settings or options cannot be combined with catchers.

    Args:
        settings: Settings of the render.
        given: Values of further options by name. An option that is set raises an error.
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
    """Returns the settings with the AOV to which the shadows are added."""
    from wavecomb import _core

    if LAYER in settings.aovs:
        return settings
    return _core.Settings(**{**settings.to_dict(), "aovs": [*settings.aovs, LAYER]})


def catcher_settings(settings: Settings) -> Settings:
    """Returns the settings for the two renders that show only the catchers."""
    from wavecomb import _core

    own = {"aovs": list(_LAYERS), "light_weights": "power", "error": False, "firefly": "keep"}
    return _core.Settings(**{**settings.to_dict(), **own})


def with_catcher_shadows(
    picture: Picture, render: Callable[[Mapping[str, str]], Result]
) -> Picture:
    """Returns the image after adding the shadows on catchers to its alpha.

    Args:
        picture: Image of the main render, without catchers but with the AOV ``alpha``.
        render: Function that loads the stage with the given load options and renders the stage with
            ``catcher_settings``.
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
    """Adds the shadows on catchers to alpha, in proportion to the darkness of the shadows.

    Args:
        alpha: Alpha of all objects other than catchers. An object behind a catcher is not counted
            twice.
        share: Fraction of each pixel that catchers cover.
        lit: Luminance that catchers reflect, with shadows of other objects.
        bare: Luminance that catchers reflect in the absence of other objects.

    >>> with_shadows(np.zeros(2), np.ones(2), np.array([0.25, 1]), np.ones(2)).tolist()
    [0.75, 0.0]
    """
    dark = 1.0 - np.clip(np.divide(lit, bare, out=np.ones_like(lit), where=bare > 0), 0.0, 1.0)
    behind = np.maximum(0.0, alpha - (1.0 - share))
    out: NDArray[np.float32] = (alpha + dark * np.maximum(share - behind, 0)).astype(np.float32)
    return out
