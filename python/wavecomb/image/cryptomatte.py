# SPDX-License-Identifier: Apache-2.0
"""Layer names, manifests and metadata of Cryptomatte files (specification 1.2.0).

A rank is a pair of id and coverage. Ranks are sorted by descending coverage and stored as pairs of
channels: channels R and G of the layer "CryptoObject00" hold the first rank, B and A the second,
and so on. Ids are stored as the bits of floats.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVELS = {
    "crypto_object": "CryptoObject",
    "crypto_material": "CryptoMaterial",
    "crypto_asset": "CryptoAsset",
}
"""Layer name in files for each Cryptomatte AOV."""


def is_crypto(layer: str) -> bool:
    """Returns whether a file's layer is part of a Cryptomatte."""
    return re.fullmatch(r"Crypto(Object|Material|Asset)\d\d", layer) is not None


def layers(aov: str, pairs: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Splits Cryptomatte ranks (height, width, 2 * ranks) into layers of four channels."""
    return {
        f"{LEVELS[aov]}{k:02d}": pairs[:, :, 4 * k : 4 * k + 4] for k in range(pairs.shape[2] // 4)
    }


def gather(found: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Joins the Cryptomatte layers of a file. Returns ranks (height, width, 2 * ranks) by AOV."""
    out: dict[str, NDArray[Any]] = {}
    for aov, name in LEVELS.items():
        parts = sorted(layer for layer in found if re.fullmatch(rf"{name}\d\d", layer))
        if parts:
            out[aov] = np.concatenate([found[layer] for layer in parts], axis=2)
    return out


def metadata(manifests: Mapping[str, Mapping[str, int]]) -> dict[str, str]:
    """Returns the file attributes that describe Cryptomattes and their object names.

    Args:
        manifests: For each AOV, the object names and their ids.
    """
    out: dict[str, str] = {}
    if not manifests:
        return out
    from wavecomb._core import crypto_id

    for aov, names in manifests.items():
        name = LEVELS[aov]
        key = f"cryptomatte/{crypto_id(name):08x}"[: len("cryptomatte/") + 7]
        out[f"{key}/name"] = name
        out[f"{key}/hash"] = "MurmurHash3_32"
        out[f"{key}/conversion"] = "uint32_to_float32"
        out[f"{key}/manifest"] = json.dumps(
            {text: f"{number:08x}" for text, number in names.items()}, ensure_ascii=False
        )
    return out


def manifests(attributes: Mapping[str, Any]) -> dict[str, dict[str, int]]:
    """Parses the Cryptomatte manifests in a file's attributes."""
    out: dict[str, dict[str, int]] = {}
    by_name = {name: aov for aov, name in LEVELS.items()}
    for key, value in attributes.items():
        match = re.fullmatch(r"cryptomatte/(\w{7})/name", key)
        if match and value in by_name:
            text = attributes.get(f"cryptomatte/{match[1]}/manifest", "{}")
            out[by_name[value]] = {name: int(i, 16) for name, i in json.loads(str(text)).items()}
    return out


def matte(pairs: NDArray[Any], number: int) -> NDArray[np.float32]:
    """Returns the fraction of each pixel (height, width) that an id covers.

    Args:
        pairs: Cryptomatte ranks with shape (height, width, 2 * ranks).
        number: The id, from ``_core.crypto_id``.
    """
    bits = np.ascontiguousarray(pairs[:, :, 0::2], dtype=np.float32).view(np.uint32)
    return np.where(bits == np.uint32(number), pairs[:, :, 1::2], 0).sum(axis=2, dtype=np.float32)
