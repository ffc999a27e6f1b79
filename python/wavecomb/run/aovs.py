# SPDX-License-Identifier: Apache-2.0
"""Validates the names of AOVs, and selects the AOVs that the core renders."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

from wavecomb.core_table import rows_by_name
from wavecomb.errors import WavecombError
from wavecomb.run import expressions

DEFAULT = ("beauty", "albedo", "normal", "depth", "samples")
"""Default layers of an image."""

GUIDES = ("guide_albedo", "guide_normal")
"""AOVs that guide the denoiser: features of surfaces seen directly, in mirrors or through clear
glass."""
ERRORS = ("error", "variance")
DEEP = "deep"
"""AOV of the deep image, which the option ``--deep`` writes to a separate file, not to a layer."""
LIGHT = "light_"


@dataclass(frozen=True)
class Aov:
    """An AOV of the core, as described by a row of its table (core/aov.h).

    Attributes:
        name: Name of the AOV in the option ``--aov``, and of its layer.
        channels: Number of channels of the AOV's layer; 0 if it has no numeric layer or several
            layers.
        letters: Letters of the channel names in files, such as "XYZ". "" means that channels are
            numbered or that there is one channel.
        content: Meaning of the AOV's values: "light", "colour", "direction", "id", "exact" (values
            that lossy compression would make useless), "magnitude" (best displayed on a logarithmic
            scale) or "value".
        kind: How the samples of a pixel are combined: "mean", "mean_of_hits", "nearest",
            "coverage", "groups", "sum" or "median".
        source: What changes the value: "hit", "vertex", "guide", "light", "technique" (light found
            by certain sampling techniques), "time" or "bounce".
        title: Title of the layer in the window; "" if the window does not offer the layer.
    """

    name: str
    channels: int
    letters: str
    content: str
    kind: str
    source: str
    title: str


@cache
def core_aovs() -> Mapping[str, Aov]:
    """Returns all AOVs of the core by name, in the order of the core's table.

    >>> core_aovs()["depth"].kind
    'mean_of_hits'
    """
    from wavecomb import _core

    return rows_by_name(Aov, _core.aov_table())


_OTHERS = {
    row.name: row
    for row in (
        Aov("beauty", 3, "RGB", "light", "mean", "light", "Beauty"),
        Aov("denoised", 3, "RGB", "light", "mean", "light", "Denoised"),
        Aov("unbiased", 3, "RGB", "light", "mean", "light", "Unbiased"),
        Aov("samples", 1, "", "value", "sum", "time", "Samples per pixel"),
        Aov("error", 1, "", "magnitude", "mean", "light", "Error of the pixel"),
        Aov("variance", 3, "RGB", "magnitude", "mean", "light", "Variance, luminance"),
    )
}
"""Layers that are not AOVs of the core."""


def row_of(layer: str) -> Aov | None:
    """Returns the row that describes a layer, or None for layers of lights and expressions."""
    return _OTHERS.get(layer) or core_aovs().get(layer)


def letters(layer: str) -> str:
    """Returns the letters of a layer's channel names in files.

    "" means that channels are numbered or that there is one channel.

    >>> letters("normal")
    'XYZ'
    """
    row = row_of(layer)
    return row.letters if row else ""


def content(layer: str) -> str:
    """Returns the meaning of a layer's values (``Aov.content``); "value" for unknown layers.

    >>> content("by_bounces"), content("position")
    ('light', 'exact')
    """
    row = row_of(layer)
    if row:
        return row.content
    return "light" if layer.startswith((LIGHT, "lpe_")) else "value"


@cache
def layer_order() -> tuple[str, ...]:
    """Returns the names of the layers with named channels, in the order of an EXR file."""
    named = tuple(name for name, row in core_aovs().items() if row.letters)
    return ("beauty", *named, "variance")


@cache
def of_kind(kind: str) -> tuple[str, ...]:
    """Returns the names of the AOVs with a given ``Aov.kind``.

    >>> of_kind("coverage")
    ('crypto_object', 'crypto_material', 'crypto_asset')
    """
    return tuple(name for name, row in core_aovs().items() if row.kind == kind)


@cache
def techniques() -> tuple[str, ...]:
    """Returns the names of the AOVs with the light that certain sampling techniques find.

    >>> techniques()
    ('by_bounces', 'by_light_samples', 'by_light_paths')
    """
    return tuple(name for name, row in core_aovs().items() if row.source == "technique")


@cache
def names() -> tuple[str, ...]:
    """Returns the names of all AOVs.

    Another valid name is "light_NAME", which selects one light group.

    >>> names()[:3]
    ('beauty', 'albedo', 'normal')
    """
    return ("beauty", *core_aovs(), "samples", *ERRORS)


def groups() -> dict[str, tuple[str, ...]]:
    """Returns the names that stand for several AOVs, with these AOVs."""
    return {"all": names(), "crypto": of_kind("coverage"), "techniques": techniques()}


def expand(asked: Iterable[str]) -> tuple[str, ...]:
    """Returns AOVs in canonical order, including beauty.

    Removes duplicates and replaces names that stand for several AOVs.

    >>> expand(["depth", "crypto", "light_key"])
    ('beauty', 'depth', 'crypto_object', 'crypto_material', 'crypto_asset', 'light_key')

    Raises:
        WavecombError: There is no AOV of that name.
    """
    all_names, several = names(), groups()
    wanted: dict[str, None] = {"beauty": None}
    for name in map(expressions.spelled, asked):
        is_single = _is_light(name) or expressions.is_expression(name) or name == DEEP
        if name not in all_names and name not in several and not is_single:
            raise WavecombError(
                f"AOV {name!r} is not known; there are {', '.join(all_names)}, "
                f"{LIGHT}NAME for the light group NAME, lpe:NAME=EXPRESSION, crypto, "
                "techniques and all"
            )
        wanted.update(dict.fromkeys(several.get(name, (name,))))
    known = tuple(name for name in all_names if name in wanted)
    kept = [name for name in wanted if name not in all_names]
    if "light_groups" in wanted:
        kept = [name for name in kept if not _is_light(name)]
    return known + tuple(kept)


def with_others(aovs: tuple[str, ...], others: Iterable[str]) -> tuple[str, ...]:
    """Returns ``aovs`` and further AOVs that the core must render, such as denoiser guides."""
    missing = [name for name in others if name not in aovs]
    return expand([*aovs, *missing]) if missing else aovs


def for_core(aovs: Iterable[str]) -> list[str]:
    """Returns the AOVs for which the core allocates memory."""
    return [
        name
        for name in aovs
        if name in core_aovs() or name == DEEP or _is_light(name) or expressions.is_expression(name)
    ]


_SUM_BYTES = {
    **{"mean": 8, "mean_of_hits": 8, "nearest": 4, "coverage": 0, "groups": 0, "sum": 8},
    "median": 88,
}
"""Bytes per pixel of a film channel, by ``Aov.kind``. Kinds that are not listed are counted
separately."""


def bytes_per_pixel(aovs: Iterable[str], light_groups: int) -> int:
    """Returns the bytes per pixel of the film and of output layers (docs/aovs.md)."""
    chosen = set(aovs)
    kept = [row for row in core_aovs().values() if row.name in chosen]
    total = 32 + 12 + 4
    for row in kept:
        total += (_SUM_BYTES[row.kind] + 4) * row.channels
    for kind in ("mean_of_hits", "nearest"):
        total += 4 * any(row.kind == kind for row in kept)
    total += (64 + 48) * sum(row.kind == "coverage" for row in kept)
    total += (24 + 12) * _many_layers(chosen, light_groups)
    if chosen & set(ERRORS):
        total += 48 + 4 + 12
    return total


def splat_layers(aovs: Iterable[str], light_groups: int) -> int:
    """Returns the number of AOVs other than beauty that store light path contributions."""
    chosen = set(aovs)
    return len({"direct", "indirect"} & chosen) + _many_layers(chosen, light_groups)


def _many_layers(chosen: set[str], light_groups: int) -> int:
    """Returns the number of light groups and of light path expressions."""
    groups = light_groups if "light_groups" in chosen else sum(map(_is_light, chosen))
    return groups + sum(map(expressions.is_expression, chosen))


def _is_light(name: str) -> bool:
    return name.startswith(LIGHT) and name != "light_groups"
