# SPDX-License-Identifier: Apache-2.0
"""Settings of a live render: the core's settings, and settings that only a window has."""

from __future__ import annotations

from dataclasses import dataclass, fields, make_dataclass, replace
from typing import TYPE_CHECKING, Any

from wavecomb.errors import WavecombError
from wavecomb.options import settings
from wavecomb.run import aovs as aov_names

if TYPE_CHECKING:
    from wavecomb._core import Settings
    from wavecomb.run.cost_profile import Profile
    from wavecomb.scheduling import SchedulingPolicy

Region = tuple[int, int, int, int]
NOT_LIVE = ("progressive", "crop")
"""Settings that do not apply to live renders, which always use progressive passes and the whole
image."""
NOT_IN_PREVIEWS = (
    "adaptive", "noise", "time_limit", "guiding", "transport", "merge_radius", "auto_merge",
    "firefly", "integrator", "allocate",
)  # fmt: skip
"""Settings that keep their default values while reduced images are rendered."""
PREVIEW_DEPTH = 3

_LIVE = {"guiding": "off", "transport": "path"}
"""Defaults of live renders that differ from those of other renders. The first image should not wait
for pilot renders."""


if TYPE_CHECKING:

    class _Rows:
        """Declares a field for each row of the core's table of settings, for type checkers."""

        def __init__(self, **values: Any) -> None: ...
        def __getattr__(self, name: str) -> Any: ...

else:
    _Rows = make_dataclass(
        "_Rows",
        [
            (row.name, Any, _LIVE.get(row.name, row.default))
            for row in settings().values()
            if row.name not in NOT_LIVE
        ],
        frozen=True,
    )


@dataclass(frozen=True)
class Setup(_Rows):
    """Settings of a live render: the fields of the core's table, and fields that only a window has.

    Attributes:
        aovs: Layers to render in addition to the beauty, by their names in docs/aovs.md.
        denoise: Whether frames are also denoised.
        region: Pixels to render, as a rectangle x0, y0, x1, y1 that excludes x1 and y1. None
            renders all pixels.
        own_policy: A policy object that replaces ``policy``, or None.
        profile: Initial costs from ``wavecomb.run.cost_profile.load_costs``, or None.
    """

    aovs: tuple[str, ...] = aov_names.DEFAULT
    denoise: bool = False
    region: Region | None = None
    own_policy: SchedulingPolicy | None = None
    profile: Profile | None = None

    def changed(self, **values: Any) -> Setup:
        """Returns a checked copy with some values replaced.

        Raises:
            WavecombError: A field does not exist.
            wavecomb._core.Error: A value is invalid.
        """
        known = {field.name for field in fields(self)}
        unknown = sorted(set(values) - known)
        if unknown:
            raise WavecombError(f"no setting {unknown[0]!r}; there are {', '.join(sorted(known))}")
        if "aovs" in values:
            values["aovs"] = aov_names.expand(values["aovs"])
        if values.keys() & {"width", "height"} and "region" not in values:
            values["region"] = None
        new = replace(self, **values)
        policies = settings()["policy"].choices
        if new.policy not in policies:
            raise WavecombError(f"no policy {new.policy!r}; there are {', '.join(policies)}")
        new.settings()
        return new

    def layers(self) -> tuple[str, ...]:
        """Returns the AOVs to render, including those that the denoiser needs."""
        guides = aov_names.GUIDES if self.denoise else ()
        return aov_names.with_others(aov_names.expand(self.aovs), guides)

    def settings(
        self,
        scale: int = 1,
        *,
        preview: bool = False,
        depth: int = PREVIEW_DEPTH,
        layers: tuple[str, ...] | None = None,
    ) -> Settings:
        """Returns the core's render settings for this setup, with all values checked.

        Args:
            scale: Number by which width and height are divided.
            preview: Whether to render one sample per pixel with few bounces and with guide layers
                for the denoiser.
            depth: Largest number of bounces of a preview.
            layers: AOVs to render; None means those of ``layers()``, and guides in a preview.

        Raises:
            WavecombError, wavecomb._core.Error: A value is invalid. The message is one line.
        """
        from wavecomb.run.settings import make_settings

        own = {"width", "height", "spp", "aovs", "denoise", "region", "own_policy", "profile"}
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in own}
        if self.region is not None:
            values["region"] = scaled_region(self.region, scale, self.width, self.height)
        if layers is None:
            layers = aov_names.with_others(self.layers(), aov_names.GUIDES if preview else ())
        if preview:
            values |= {name: settings()[name].default for name in NOT_IN_PREVIEWS}
            # Previews use modelled material costs and light weights by power, since measuring costs
            # and calibrating weights would take longer than the preview.
            values |= {"costs": "model", "light_weights": "power"}
            values["max_depth"] = min(self.max_depth, depth)
        else:
            values["progressive"] = True
        size = scaled_size(self.width, self.height, scale)
        return make_settings(size, 1 if preview else self.spp, aovs=layers, **values)


def scaled_size(width: int, height: int, scale: int) -> tuple[int, int]:
    """Returns the width and height of an image divided by ``scale``, at least one pixel each."""
    if scale == 1:
        return width, height
    return max(1, width // scale), max(1, height // scale)


def scaled_region(region: Region, scale: int, width: int, height: int) -> Region:
    """Returns the region of an image reduced by ``scale``, rounded outwards."""
    x0, y0, x1, y1 = region
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise WavecombError(
            f"region {x0} {y0} {x1} {y1} is empty or outside the picture of {width} x {height}"
        )
    if scale == 1:
        return region
    wide, high = scaled_size(width, height, scale)
    left, top = min(x0 // scale, wide - 1), min(y0 // scale, high - 1)
    right, bottom = min(-(-x1 // scale), wide), min(-(-y1 // scale), high)
    return left, top, max(right, left + 1), max(bottom, top + 1)
