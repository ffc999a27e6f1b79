# SPDX-License-Identifier: GPL-3.0-or-later
"""Replaces ids of Cryptomatte passes, made of prim paths, by those of Blender's names."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from .context import material_path, object_path

_MASK = 0xFFFFFFFF


def hash_of(name: str) -> int:
    """Returns the id of a name: MurmurHash3 (x86, 32 bits) with a finite exponent."""
    data = name.encode()
    h = 0
    for at in range(0, len(data) - 3, 4):
        h ^= _mixed(int.from_bytes(data[at : at + 4], "little"))
        h = ((h << 13 | h >> 19) * 5 + 0xE6546B64) & _MASK
    rest = data[len(data) & ~3 :]
    if rest:
        h ^= _mixed(int.from_bytes(rest, "little"))
    h ^= len(data)
    h = (h ^ h >> 16) * 0x85EBCA6B & _MASK
    h = (h ^ h >> 13) * 0xC2B2AE35 & _MASK
    h ^= h >> 16
    exponent = min(max(h >> 23 & 255, 1), 254)
    return h & 0x807FFFFF | exponent << 23


def _mixed(k: int) -> int:
    k = k * 0xCC9E2D51 & _MASK
    return (k << 15 | k >> 17) * 0x1B873593 & _MASK


def names_of(depsgraph: Any) -> dict[str, dict[str, str]]:
    """Returns Blender's names by prim path, for each layer of Cryptomatte."""
    objects, assets, materials = {}, {}, {}
    for thing in depsgraph.objects:
        top = thing
        while top.parent is not None:
            top = top.parent
        objects[object_path(thing)] = thing.name
        assets[object_path(thing)] = top.name
        for slot in thing.material_slots:
            if slot.material is not None:
                materials[material_path(slot.material)] = slot.material.name
    return {"CryptoObject": objects, "CryptoAsset": assets, "CryptoMaterial": materials}


def rename(
    channels: dict[str, np.ndarray],
    attributes: Mapping[str, str],
    names: Mapping[str, Mapping[str, str]],
) -> None:
    """Replaces ids in the channels of all layers.

    Args:
        channels: Channels of the image, changed in place.
        attributes: Text attributes of the image, with a manifest for each layer.
        names: Result of ``names_of``.
    """
    for key, layer in attributes.items():
        if not (key.startswith("cryptomatte/") and key.endswith("/name")) or layer not in names:
            continue
        manifest = json.loads(attributes.get(key[: -len("name")] + "manifest", "{}"))
        ids = {
            int(old, 16): hash_of(found)
            for path, old in manifest.items()
            if (found := _nearest(path, names[layer])) is not None
        }
        if not ids:
            continue
        old = np.array(sorted(ids), np.uint32)
        new = np.array([ids[int(one)] for one in old], np.uint32)
        for name in [n for n in channels if n.startswith(layer) and n[-2:] in (".R", ".B")]:
            channels[name] = _replaced(channels[name], old, new)


def _nearest(path: str, names: Mapping[str, str]) -> str | None:
    """Returns the name of the prim at a path, or of its nearest ancestor with a name."""
    while path:
        if path in names:
            return names[path]
        path = path.rpartition("/")[0]
    return None


def _replaced(values: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32)
    at = np.minimum(np.searchsorted(old, bits), len(old) - 1)
    return np.where(old[at] == bits, new[at], bits).astype(np.uint32).view(np.float32)
