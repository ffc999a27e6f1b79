# SPDX-License-Identifier: Apache-2.0
"""UsdRender's vars as AOVs: by names that renderers give them, and by light path expressions."""

from __future__ import annotations

import re

from pxr import UsdRender

from wavecomb.run import aovs as aov_names
from wavecomb.usd.looks.network import word

_NAMES = {
    "beauty": ("Ci", "C", "color", "rgb", "rgba", "RGB", "RGBA"),
    "albedo": ("diffuse_albedo", "Albedo"),
    "normal": ("N", "Nn", "Nworld", "normals"),
    "depth": ("z", "Z", "linearDepth", "cameraDepth"),
    "position": ("P", "Pworld", "__Pworld"),
    "uv": ("st", "UV", "texcoord"),
    "instance_id": ("instanceId", "id"),
    "material_id": ("materialId",),
    "samples": ("sampleCount", "samplecount"),
    "cost": ("cpuTime", "cputime"),
    "crypto_object": ("CryptoObject", "cryptoObject", "cryptomatte_object"),
    "crypto_material": ("CryptoMaterial", "cryptoMaterial", "cryptomatte_material"),
    "crypto_asset": ("CryptoAsset", "cryptoAsset", "cryptomatte_asset"),
    "crypto": ("cryptomatte", "Cryptomatte"),
}
_AOV_OF = {other: name for name, others in _NAMES.items() for other in others}

_EVENTS = {
    "beauty": (".*",),
    "emission": ("",),
    "direct": (".", "<..>", "<.*>"),
    "indirect": ("..+", "...*", ".{2,}", "<..><..>+"),
}
_PARTS = {events: name for name, all_events in _EVENTS.items() for events in all_events}
"""What lies between the camera and the light in an expression."""

_LIGHT = r"(?:\[<L\.>O\]|\[LO\]|\[OL\]|\(L\|O\)|<L\.>|L)"
_EXPRESSION = re.compile(rf"C(?P<events>.*?){_LIGHT}")
_GROUP = re.compile(r"C(?P<events>.*?)<L\.?'(?P<group>[^']+)'>")


def aov_of(prim: UsdRender.Var) -> str | None:
    """The AOV of a var, as ``--aov`` takes it; None where there is none such."""
    name = word(prim.GetSourceNameAttr().Get())
    kind = word(prim.GetSourceTypeAttr().Get(), "raw")
    if kind == "lpe" or name.startswith(("lpe:", "color lpe:")):
        return _of_expression(name.rpartition("lpe:")[2])
    if kind == "primvar" or name.startswith("primvars:"):
        return "uv" if name.removeprefix("primvars:") in ("st", "uv") else None
    if name in aov_names.names() or name == "crypto" or name.startswith(aov_names.LIGHT):
        return name
    return _AOV_OF.get(name)


def _of_expression(text: str) -> str | None:
    """The AOV of a light path expression.

    >>> [_of_expression(text) for text in ("C.*", "C<..>[<L.>O]", "C.*<L.'key'>", "C<RD>L")]
    ['beauty', 'direct', 'light_key', None]
    """
    text = "".join(text.split())
    if text == "C.*":
        return "beauty"
    group = _GROUP.fullmatch(text)
    if group is not None:
        return aov_names.LIGHT + group["group"] if group["events"] == ".*" else None
    whole = _EXPRESSION.fullmatch(text)
    return None if whole is None else _PARTS.get(whole["events"])
