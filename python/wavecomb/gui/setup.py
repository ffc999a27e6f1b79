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
    "adaptive", "noise", "time_limit", "guiding", "transport", "merge_radius", "firefly",
    "integrator", "allocate",
)  # fmt: skip
"""Settings that keep their defaults in reduced images."""
PREVIEW_DEPTH = 3

_LIVE = {"guiding": "off", "transport": "path"}
"""Defaults that differ in live renders, whose first image should not wait for pilot renders."""


if TYPE_CHECKING:

    class _Rows:
        """Type stub with a field for each row of the table of settings."""

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
        aovs: Layers to render beside the beauty, by the names of docs/aovs.md.
        denoise: Whether frames are also denoised.
        region: Rectangle x0, y0, x1, y1 of pixels to render, without x1 and y1; None renders all.
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
        self, scale: int = 1, *, preview: bool = False, depth: int = PREVIEW_DEPTH
    ) -> Settings:
        """Returns the checked settings of the core.

        Args:
            scale: Divisor of width and height.
            preview: Whether to render only one sample per pixel, with few bounces and guides for
                denoising.
            depth: Largest number of bounces of a preview.

        Raises:
            WavecombError, wavecomb._core.Error: A value is invalid. The message is one line.
        """
        from wavecomb.run.settings import make_settings

        own = {"width", "height", "spp", "aovs", "denoise", "region", "own_policy", "profile"}
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in own}
        if self.region is not None:
            values["region"] = scaled_region(self.region, scale, self.width, self.height)
        layers = self.layers()
        if preview:
            layers = aov_names.with_others(layers, aov_names.GUIDES)
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
    """Returns the size of an image at 1 / scale, at least one pixel."""
    if scale == 1:
        return width, height
    return max(1, width // scale), max(1, height // scale)


def scaled_region(region: Region, scale: int, width: int, height: int) -> Region:
    """Returns a region at 1 / scale that covers the full region, within the scaled image."""
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
