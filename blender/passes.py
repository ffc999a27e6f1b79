# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's passes and the AOVs of Wavecomb that fill them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

BACKGROUND_DEPTH = 1e10
"""Depth of the background in passes of Cycles."""


@dataclass(frozen=True)
class Pass:
    """A pass.

    Attributes:
        name: Name in Blender.
        setting: Property of the view layer that enables it.
        channels: Channel ids, such as "RGB".
        aov: Option of Wavecomb; empty for the beauty.
        sources: Channels of the image, one for each channel id.
        kind: COLOR, VALUE or VECTOR.
    """

    name: str
    setting: str
    channels: str
    aov: str
    sources: tuple[str, ...]
    kind: str


def _rgb(name: str, setting: str, aov: str, layer: str) -> Pass:
    return Pass(name, setting, "RGB", aov, tuple(f"{layer}.{c}" for c in "RGB"), "COLOR")


def _lobe(name: str, setting: str, light: str) -> Pass:
    return _rgb(name, setting, f"lpe:{light}", f"lpe_{light}")


PASSES = (
    Pass("Depth", "use_pass_z", "Z", "depth_nearest", ("depth_nearest.Z",), "VALUE"),
    Pass("Normal", "use_pass_normal", "XYZ", "normal", tuple(f"normal.{c}" for c in "XYZ"),
         "VECTOR"),
    Pass("Position", "use_pass_position", "XYZ", "position",
         tuple(f"position.{c}" for c in "XYZ"), "VECTOR"),
    Pass("UV", "use_pass_uv", "UVA", "uv", ("uv.U", "uv.V", "1"), "VECTOR"),
    Pass("Vector", "use_pass_vector", "XYZW", "motion", ("0", "0", "motion.U", "motion.V"),
         "VECTOR"),
    _rgb("Emit", "use_pass_emit", "emission", "emission"),
    _rgb("Env", "use_pass_environment", "lpe:background", "lpe_background"),
    _lobe("DiffDir", "use_pass_diffuse_direct", "diffuse_direct"),
    _lobe("DiffInd", "use_pass_diffuse_indirect", "diffuse_indirect"),
    _lobe("GlossDir", "use_pass_glossy_direct", "specular_direct"),
    _lobe("GlossInd", "use_pass_glossy_indirect", "specular_indirect"),
    _lobe("TransDir", "use_pass_transmission_direct", "transmission_direct"),
    _lobe("TransInd", "use_pass_transmission_indirect", "transmission_indirect"),
    Pass("DiffCol", "use_pass_diffuse_color", "RGB", "", ("1", "1", "1"), "COLOR"),
    Pass("GlossCol", "use_pass_glossy_color", "RGB", "", ("1", "1", "1"), "COLOR"),
    Pass("TransCol", "use_pass_transmission_color", "RGB", "", ("1", "1", "1"), "COLOR"),
    _rgb("Denoising Albedo", "wavecomb_albedo", "albedo", "albedo"),
)  # fmt: skip
"""Supported passes. Light passes include the colour of the surface, so colour passes are white:
the sum of the products of light and colour passes still gives the image."""

CRYPTOMATTE = (
    ("use_pass_cryptomatte_object", "crypto_object", "CryptoObject"),
    ("use_pass_cryptomatte_material", "crypto_material", "CryptoMaterial"),
    ("use_pass_cryptomatte_asset", "crypto_asset", "CryptoAsset"),
)


def wanted(view_layer: Any, denoise: bool) -> Iterator[Pass]:
    """Yields the passes that a view layer enables, without the pass Combined."""
    for one in PASSES:
        if one.name == "Denoising Albedo":
            cycles = getattr(view_layer, "cycles", None)
            if cycles is not None and cycles.denoising_store_passes:
                yield one
        elif getattr(view_layer, one.setting, False):
            yield one
    if denoise:
        yield Pass("Noisy Image", "", "RGB", "", ("R", "G", "B"), "COLOR")
    for setting, aov, name in CRYPTOMATTE:
        if getattr(view_layer, setting, False):
            for level in range((view_layer.pass_cryptomatte_depth + 1) // 2):
                sources = tuple(f"{name}{level:02d}.{c}" for c in "RGBA")
                yield Pass(f"{name}{level:02d}", setting, "RGBA", aov, sources, "COLOR")


def pixels(one: Pass, channels: dict[str, np.ndarray]) -> np.ndarray:
    """Returns (pixels, channels) values of a pass, bottom row first."""
    first = next(iter(channels.values()))
    planes = []
    for source in one.sources:
        if source in ("0", "1"):
            planes.append(np.full_like(first, float(source)))
        else:
            planes.append(channels[source] if source in channels else np.zeros_like(first))
    found = np.stack([plane[::-1] for plane in planes], axis=-1)
    if one.name == "Depth":
        found = np.where(np.isfinite(found), found, BACKGROUND_DEPTH)
    return np.ascontiguousarray(found.reshape(-1, len(planes)), np.float32)


def combined(channels: dict[str, np.ndarray], denoised: bool) -> np.ndarray:
    """Returns (pixels, 4) values of the Combined pass, bottom row first."""
    prefix = "denoised." if denoised and "denoised.R" in channels else ""
    planes = [channels[prefix + c] for c in "RGB"]
    alpha = channels.get("A")
    planes.append(np.ones_like(planes[0]) if alpha is None else alpha)
    found = np.stack([plane[::-1] for plane in planes], axis=-1)
    return np.ascontiguousarray(found.reshape(-1, 4), np.float32)
