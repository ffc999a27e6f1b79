# SPDX-License-Identifier: Apache-2.0
"""Validates settings, scheduling policy, costs, AOVs and memory of a render."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from wavecomb.run import aovs as aov_names
from wavecomb.run.isolation.memory import machine_limit

if TYPE_CHECKING:
    from wavecomb._core import Settings
    from wavecomb.scheduling import SchedulingPolicy

DEFAULT_SIZE = (600, 600)
MAX_EDGE = 65536
MAX_SPP = 1 << 24
# Memory per pixel of error estimates in adaptive renders: the sums, the error layers and temporary
# buffers.
_ERROR_BYTES_PER_PIXEL = 100
# Memory per pixel of firefly reweighting: the brightness cascades and the layer without
# reweighting.
_CASCADE_BYTES_PER_PIXEL = 96 + 12
# Memory per pixel of light splats, for the beauty layer and for each other layer that receives
# splats.
_SPLAT_BYTES_PER_PIXEL = 48
# Memory per pixel of light path merging: the pixel's visible point and its entries in the hash
# grid.
_VISIBLE_BYTES_PER_PIXEL = 64 + 48
# Upper bound of the memory per pixel of deep images: the sums in the film and the samples in the
# image.
_DEEP_BYTES_PER_PIXEL = 1 + 4
_DEEP_BYTES_PER_SAMPLE = 40 + 24


def prepare(
    size: tuple[int, int],
    spp: int,
    policy: str | SchedulingPolicy | None,
    costs: str | Mapping[str, Mapping[str, float]] | None,
    aovs: Iterable[str] | None,
    settings: dict[str, Any],
) -> tuple[Any, dict[str, dict[str, float]] | None, tuple[str, ...], Settings]:
    """Validates arguments of ``render``.

    Returns custom policy and cost profile (each None if not custom), AOV names and settings.
    """
    own: Any = None
    if isinstance(policy, str):
        settings["policy"] = policy
    elif policy is not None:
        from wavecomb.scheduling import check_policy

        check_policy(policy)
        own = policy
    profile: dict[str, dict[str, float]] | None = None
    if isinstance(costs, str):
        settings["costs"] = costs
    elif costs is not None:
        from wavecomb.run.cost_profile import check_costs

        profile = check_costs(costs)
    names = aov_names.DEFAULT if aovs is None else aov_names.expand(aovs)
    chosen = make_settings(size, spp, aovs=names, **settings)
    return own, profile, tuple(names), chosen


def check_options(size: tuple[int, int] | None, spp: int, settings: Mapping[str, Any]) -> None:
    """Raises an error for settings that are invalid for every stage.

    This function is called before a stage is opened. ``make_settings`` checks regions and memory
    once the image size is known.

    Args:
        size: Width and height; None if the stage defines them.
        spp: Samples per pixel.
        settings: Further settings.
    """
    known = {name: value for name, value in settings.items() if name not in ("region", "crop")}
    make_settings(size or DEFAULT_SIZE, spp, fits=lambda chosen, aovs: None, **known)


def make_settings(
    size: tuple[int, int],
    spp: int,
    *,
    aovs: Sequence[str] = aov_names.DEFAULT,
    fits: Callable[[Settings, Sequence[str]], Any] | None = None,
    **settings: Any,
) -> Settings:
    """Returns validated settings; raises WavecombError or _core.Error with a one-line message.

    ``size`` is the image size without overscan, and ``aovs`` are expanded. The function ``fits``
    (default: ``check_memory``) raises an error if the image needs too much memory.
    """
    from wavecomb import _core
    from wavecomb.errors import WavecombError

    if settings.get("alpha"):
        aovs = aov_names.with_others(tuple(aovs), ["alpha"])
    beyond = 2 * int(settings.get("overscan", 0))
    width, height = (int(edge) + beyond for edge in size)
    if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
        raise WavecombError(
            f"size {width} x {height}: each edge must be from 1 to {MAX_EDGE} pixels"
        )
    if not 1 <= int(spp) <= MAX_SPP:
        raise WavecombError(f"{spp} samples per pixel: must be from 1 to {MAX_SPP}")
    if tuple(aovs) != aov_names.DEFAULT:
        settings["aovs"] = aov_names.for_core(aovs)
        settings["error"] = settings.get("error", False) or bool({"error", "variance"} & {*aovs})
    chosen = _core.Settings(width=width, height=height, spp=int(spp), **settings)
    chosen.check()
    (check_memory if fits is None else fits)(chosen, aovs)
    return chosen


def check_memory(settings: Settings, aovs: Sequence[str], light_groups: int = 1) -> None:
    """Raises WavecombError unless film and image fit into the memory of this machine.

    Args:
        settings: Settings of the render.
        aovs: Expanded AOVs.
        light_groups: Number of light groups of the scene. If the number is unknown, call this
            function again after loading.
    """
    from wavecomb.errors import WavecombError

    needed, there = image_bytes(settings, aovs, light_groups), machine_limit()
    if there is not None and needed > 0.8 * there:
        raise WavecombError(
            f"size {settings.width} x {settings.height}: needs about {needed / 2**30:.0f} GiB of "
            f"memory, this machine has {there / 2**30:.0f}; choose a smaller size or fewer AOVs"
        )


def image_bytes(settings: Settings, aovs: Sequence[str], light_groups: int = 1) -> int:
    """Returns the bytes of film and image; the arguments are the same as for ``check_memory``."""
    others = [name for name in aovs if name not in aov_names.ERRORS]
    each = aov_names.bytes_per_pixel(others, light_groups)
    each += _ERROR_BYTES_PER_PIXEL * has_error_layers(settings)
    each += _CASCADE_BYTES_PER_PIXEL * (settings.firefly != "keep")
    may_have_splats = settings.transport != "auto" or settings.quality != "plain"
    if settings.transport != "path" and may_have_splats:
        sums = 1 + has_error_layers(settings) + aov_names.splat_layers(aovs, light_groups)
        # Each pixel also needs 4 bytes for the number of traced samples of a light path index.
        each += _SPLAT_BYTES_PER_PIXEL * sums + 4
        chosen = settings.transport == "auto" and settings.auto_merge != "off"
        may_merge = settings.merge_radius > 0 or chosen
        each += _VISIBLE_BYTES_PER_PIXEL * may_merge
    if aov_names.DEEP in settings.aovs:
        each += _DEEP_BYTES_PER_PIXEL + _DEEP_BYTES_PER_SAMPLE * settings.deep_samples
    width, height = image_size(settings)
    return width * height * each


def image_size(settings: Settings) -> tuple[int, int]:
    """Returns width and height of the image in pixels, after cropping."""
    if not settings.crop or settings.region is None:
        return settings.width, settings.height
    x0, y0, x1, y1 = settings.region
    return x1 - x0, y1 - y0


def has_error_layers(settings: Settings) -> bool:
    """Returns whether a render with these settings writes layers with its error and variance."""
    return bool(
        settings.adaptive or settings.noise or settings.error or settings.allocate != "even"
    )
