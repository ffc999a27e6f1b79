# SPDX-License-Identifier: Apache-2.0
"""Light path expressions as AOVs, ``lpe:NAME=EXPRESSION``, and names of common expressions.

The grammar is in docs/light-path-expressions.md.
"""

from __future__ import annotations

import re
from types import MappingProxyType

PREFIX = "lpe:"
"""Prefix of an AOV that is a light path expression."""
LAYER = "lpe_"
"""Prefix of the layer name of a light path expression."""

_ANY_LIGHT = "[LO]"
NAMED = MappingProxyType(
    {
        # Arnold
        "diffuse": "C<RD>.*",
        "diffuse_direct": f"C<RD>{_ANY_LIGHT}",
        "diffuse_indirect": f"C<RD>.+{_ANY_LIGHT}",
        "specular": "C<R[GS]>.*",
        "specular_direct": f"C<R[GS]>{_ANY_LIGHT}",
        "specular_indirect": f"C<R[GS]>.+{_ANY_LIGHT}",
        "transmission": "C<T.>.*",
        "transmission_direct": f"C<T.>{_ANY_LIGHT}",
        "transmission_indirect": f"C<T.>.+{_ANY_LIGHT}",
        "sss": "CW.*",
        "sss_direct": f"CW<RD>{_ANY_LIGHT}",
        "sss_indirect": f"CW<RD>.+{_ANY_LIGHT}",
        "volume": "CV.*",
        "volume_direct": f"CV{_ANY_LIGHT}",
        "volume_indirect": f"CV.+{_ANY_LIGHT}",
        "volume_emission": "CE",
        "volume_beauty": "C(V.*|E)",
        "background": "CB",
        # Karma
        "directdiffuse": f"C<RD>{_ANY_LIGHT}",
        "indirectdiffuse": f"C<RD>.+{_ANY_LIGHT}",
        "directglossyreflection": f"C<R[GS]>{_ANY_LIGHT}",
        "indirectglossyreflection": f"C<R[GS]>.+{_ANY_LIGHT}",
        "glossytransmission": f"C<T[GS]>.*{_ANY_LIGHT}",
        "directvolume": f"CV{_ANY_LIGHT}",
        "indirectvolume": f"CV.+{_ANY_LIGHT}",
        "directemission": "CO",
        "indirectemission": "C.+O",
        "combineddiffuse": f"C<RD>.*{_ANY_LIGHT}",
        "combinedglossyreflection": f"C<R[GS]>.*{_ANY_LIGHT}",
        "combinedvolume": f"CV.*{_ANY_LIGHT}",
    }
)
"""Light path expression of each AOV name that is common in Arnold and Karma."""


def is_expression(aov: str) -> bool:
    """Returns whether an AOV is a light path expression."""
    return aov.startswith(PREFIX)


def spelled(aov: str) -> str:
    """Replaces a name in ``NAMED`` by the expression that the name stands for.

    >>> spelled("lpe:background"), spelled("lpe:a=C.*"), spelled("depth")
    ('lpe:background=CB', 'lpe:a=C.*', 'depth')
    """
    name = aov.removeprefix(PREFIX)
    if is_expression(aov) and "=" not in aov and name in NAMED:
        return f"{PREFIX}{name}={NAMED[name]}"
    return aov


def layer_of(aov: str) -> str:
    """Returns the layer name of an AOV.

    >>> layer_of("lpe:key=C.*<L.'key'>"), layer_of("depth")
    ('lpe_key', 'depth')
    """
    if not is_expression(aov):
        return aov
    return LAYER + aov.removeprefix(PREFIX).partition("=")[0]


def as_aov(text: str, name: str) -> str:
    """Converts a light path expression to an AOV with a valid layer name.

    >>> as_aov("C<RD> L", "direct diffuse")
    'lpe:direct_diffuse=C<RD>L'
    """
    expression = "".join(re.split(r"\s+", text))
    return f"{PREFIX}{re.sub('[^0-9A-Za-z_]', '_', name) or 'lpe'}={expression}"
