# SPDX-License-Identifier: Apache-2.0
"""UsdRender's vars as AOVs: by names that renderers give them, and by light path expressions."""

from __future__ import annotations

import re

from pxr import UsdRender

from wavecomb import _core
from wavecomb.run import aovs as aov_names
from wavecomb.run import expressions
from wavecomb.usd.looks.network import word

_NAMES = {
    "beauty": ("Ci", "C", "color", "rgb", "rgba", "RGB", "RGBA"),
    "albedo": ("diffuse_albedo", "Albedo"),
    "normal": ("N", "Nn", "Nworld", "normals"),
    "depth": ("z", "Z", "linearDepth", "cameraDepth"),
    "position": ("P", "Pworld", "__Pworld"),
    "uv": ("st", "UV", "texcoord"),
    "alpha": ("a", "A", "Alpha"),
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
        return _of_expression(name.rpartition("lpe:")[2], prim.GetPrim().GetName())
    if kind == "primvar" or name.startswith("primvars:"):
        return "uv" if name.removeprefix("primvars:") in ("st", "uv") else None
    if name in aov_names.names() or name == "crypto" or name.startswith(aov_names.LIGHT):
        return name
    if name not in _AOV_OF and name in expressions.NAMED:
        return expressions.spelled(expressions.PREFIX + name)
    return _AOV_OF.get(name)


def _of_expression(text: str, name: str) -> str | None:
    """The AOV of a light path expression; None where it is none.

    What is no other AOV is called by the name of its var.

    >>> [_of_expression(text, "a") for text in ("C.*", "C<..>[<L.>O]", "C.*<L.'key'>", "C<RD>L")]
    ['beauty', 'direct', 'light_key', 'lpe:a=C<RD>L']
    """
    text = "".join(text.split())
    if text == "C.*":
        return "beauty"
    group = _GROUP.fullmatch(text)
    if group is not None and group["events"] == ".*":
        return aov_names.LIGHT + group["group"]
    whole = _EXPRESSION.fullmatch(text)
    if whole is not None and whole["events"] in _PARTS:
        return _PARTS[whole["events"]]
    aov = expressions.as_aov(text, name)
    try:
        _core.Settings(aovs=[aov]).check()
    except _core.Error:
        return None
    return aov
