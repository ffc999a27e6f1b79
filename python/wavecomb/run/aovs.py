# SPDX-License-Identifier: Apache-2.0
"""Names of AOVs: what may be asked for, and what the core is asked for then."""

from __future__ import annotations

from collections.abc import Iterable

from wavecomb.errors import WavecombError

DEFAULT = ("beauty", "albedo", "normal", "depth", "samples")
"""What a picture holds where nothing is asked for."""

GUIDES = ("guide_albedo", "guide_normal")
"""For denoisers: of what is seen, also in mirrors and through clear glass."""
_CORE: dict[str, tuple[int, str]] = {
    "albedo": (3, "Albedo"),
    "normal": (3, "Normal"),
    "depth": (1, "Depth"),
    "position": (3, "Position"),
    "uv": (2, "Texture coordinates"),
    "material_id": (1, "Materials"),
    "instance_id": (1, "Instances"),
    "crypto_object": (0, "Objects (Cryptomatte)"),
    "crypto_material": (0, "Materials (Cryptomatte)"),
    "crypto_asset": (0, "Assets (Cryptomatte)"),
    "emission": (3, "Emission"),
    "direct": (3, "Direct light"),
    "indirect": (3, "Indirect light"),
    "light_groups": (0, ""),
    "cost": (1, "Cost per pixel"),
    "guide_albedo": (3, ""),
    "guide_normal": (3, ""),
}
"""AOVs that the core keeps: channels, where they are a layer of their own; title in the window, ""
where it does not offer them."""
CRYPTO = ("crypto_object", "crypto_material", "crypto_asset")
ERRORS = ("error", "variance")
NAMES = ("beauty", *_CORE, "samples", *ERRORS)
"""All AOVs; "light_NAME" is a single light group."""
TITLES = {name: title for name, (_, title) in _CORE.items() if title}
GROUPS = {"all": NAMES, "crypto": CRYPTO}
"""Names that stand for several."""
LIGHT = "light_"


def expand(names: Iterable[str]) -> tuple[str, ...]:
    """AOVs in the order of ``NAMES``, each once, single light groups at the end; beauty is in.

    >>> expand(["depth", "crypto", "light_key"])
    ('beauty', 'depth', 'crypto_object', 'crypto_material', 'crypto_asset', 'light_key')

    Raises:
        WavecombError: There is no AOV of that name.
    """
    wanted: dict[str, None] = {"beauty": None}
    for name in names:
        if name not in NAMES and name not in GROUPS and not _is_light(name):
            raise WavecombError(
                f"AOV {name!r} is not known; there are {', '.join(NAMES)}, "
                f"{LIGHT}NAME for the light group NAME, crypto and all"
            )
        wanted.update(dict.fromkeys(GROUPS.get(name, (name,))))
    known = tuple(name for name in NAMES if name in wanted)
    if "light_groups" in wanted:
        return known
    return known + tuple(name for name in wanted if name not in NAMES)


def with_guides(aovs: tuple[str, ...], guides: Iterable[str]) -> tuple[str, ...]:
    """``aovs`` with those that a denoiser needs."""
    missing = [name for name in guides if name not in aovs]
    return expand([*aovs, *missing]) if missing else aovs


def for_core(aovs: Iterable[str]) -> list[str]:
    """Those that the core has to make room for."""
    return [name for name in aovs if name in _CORE or _is_light(name)]


def bytes_per_pixel(aovs: Iterable[str], light_groups: int) -> int:
    """Memory of a pixel: sums in the film, and the layers that are handed out (docs/aovs.md)."""
    names = set(aovs)
    total = 32 + 12 + 4
    if names & {"albedo", "normal", "depth"}:
        total += 64
    if names & {"position", "uv", "material_id", "instance_id"}:
        total += 32
    if names & {"emission", "direct", "indirect"}:
        total += 72
    if names & set(GUIDES):
        total += 48
    groups = light_groups if "light_groups" in names else sum(map(_is_light, names))
    total += groups * (24 + 12)
    total += len(names & set(CRYPTO)) * (64 + 48)
    total += 4 * sum(_CORE[name][0] for name in names & _CORE.keys())
    if names & set(ERRORS):
        total += 48 + 4 + 12
    return total + (8 if "cost" in names else 0)


def _is_light(name: str) -> bool:
    return name.startswith(LIGHT) and name != "light_groups"
