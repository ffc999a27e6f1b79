# SPDX-License-Identifier: Apache-2.0
"""Names of AOVs: what may be asked for, and what the core is asked for then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

from wavecomb.core_table import rows_by_name
from wavecomb.errors import WavecombError
from wavecomb.run import expressions

DEFAULT = ("beauty", "albedo", "normal", "depth", "samples")
"""What a picture holds where nothing is asked for."""

GUIDES = ("guide_albedo", "guide_normal")
"""For denoisers: of what is seen, also in mirrors and through clear glass."""
ERRORS = ("error", "variance")
DEEP = "deep"
"""No layer, but a picture of its own: what ``--deep`` writes."""
LIGHT = "light_"
TECHNIQUES = ("by_bounces", "by_light_samples", "by_light_paths")
"""What each way to find light brought; their sum is the beauty."""


@dataclass(frozen=True)
class Aov:
    """An AOV that the core keeps: a row of its table (core/aov.h).

    Attributes:
        name: Of ``--aov`` and of the layer.
        channels: Of its layer; 0 where that is none of numbers, or there are several.
        kind: How samples become a pixel: "mean", "mean_of_hits", "nearest", "coverage", "groups",
            "sum" or "median".
        title: In the window; "" where it does not offer the layer.
    """

    name: str
    channels: int
    kind: str
    title: str


@cache
def core_aovs() -> Mapping[str, Aov]:
    """Every AOV of the core by name, in the table's order.

    >>> core_aovs()["depth"].kind
    'mean_of_hits'
    """
    from wavecomb import _core

    return rows_by_name(Aov, _core.aov_table())


@cache
def of_kind(kind: str) -> tuple[str, ...]:
    """Names of those whose samples become a pixel so.

    >>> of_kind("coverage")
    ('crypto_object', 'crypto_material', 'crypto_asset')
    """
    return tuple(name for name, row in core_aovs().items() if row.kind == kind)


@cache
def names() -> tuple[str, ...]:
    """All AOVs; "light_NAME" is a single light group beside them.

    >>> names()[:3]
    ('beauty', 'albedo', 'normal')
    """
    return ("beauty", *core_aovs(), "samples", *ERRORS)


def groups() -> dict[str, tuple[str, ...]]:
    """Names that stand for several."""
    return {"all": names(), "crypto": of_kind("coverage"), "techniques": TECHNIQUES}


def expand(asked: Iterable[str]) -> tuple[str, ...]:
    """AOVs in the order of ``names``, each once, and what has a name of its own; beauty is in.

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
    """``aovs`` with what else the core is to keep, such as what a denoiser needs."""
    missing = [name for name in others if name not in aovs]
    return expand([*aovs, *missing]) if missing else aovs


def for_core(aovs: Iterable[str]) -> list[str]:
    """Those that the core has to make room for."""
    return [
        name
        for name in aovs
        if name in core_aovs() or name == DEEP or _is_light(name) or expressions.is_expression(name)
    ]


_SUM_BYTES = {
    **{"mean": 8, "mean_of_hits": 8, "nearest": 4, "coverage": 0, "groups": 0, "sum": 8},
    "median": 88,
}
"""A channel in the film; what has none is counted apart."""


def bytes_per_pixel(aovs: Iterable[str], light_groups: int) -> int:
    """Memory of a pixel: sums in the film, and the layers that are handed out (docs/aovs.md)."""
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
    """Layers beside the beauty that keep what paths from the lights bring by itself."""
    chosen = set(aovs)
    return len({"direct", "indirect"} & chosen) + _many_layers(chosen, light_groups)


def _many_layers(chosen: set[str], light_groups: int) -> int:
    """Light groups and light path expressions."""
    groups = light_groups if "light_groups" in chosen else sum(map(_is_light, chosen))
    return groups + sum(map(expressions.is_expression, chosen))


def _is_light(name: str) -> bool:
    return name.startswith(LIGHT) and name != "light_groups"
