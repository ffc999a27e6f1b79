# SPDX-License-Identifier: Apache-2.0
"""MaterialX's nodes that make the absorption of hair, as its shader code has them."""

from __future__ import annotations

from wavecomb.usd.graphs.values import Value, fit, numbers
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)

_EUMELANIN = (0.657704, 0.498077, 0.254106)
_PHEOMELANIN = (0.829443, 0.670320, 0.349937)


def color_divisor(azimuthal: float) -> float:
    """What a colour's logarithm is divided by for the root of the absorption.

    Chiang et al. 2016, eq. 9; ``fibre_color_divisor`` of the core.
    """
    p = azimuthal
    return 5.969 + p * (-0.215 + p * (2.532 + p * (-10.73 + p * (5.574 + p * 0.245))))


@_node("chiang_hair_absorption_from_color")
def _from_color(n: NodeCall) -> Value:
    m = n.make
    color = m.op("clamp", n.value("color", (1.0,) * 3, 3), numbers(0.001), numbers(1.0))
    divisor = color_divisor(n.number("azimuthal_roughness", 0.2))
    root = m.op("multiply", m.op("log", color), numbers(1.0 / divisor))
    return m.op("multiply", root, root)


@_node("deon_hair_absorption_from_melanin")
def _from_melanin(n: NodeCall) -> Value:
    """E. d'Eon et al., "An Energy-Conserving Hair Reflectance Model", 2011."""
    m = n.make
    left = m.op("subtract", numbers(1.0), n.value("melanin_concentration", 0.25, 1))
    amount = m.op("multiply", m.op("log", m.op("max", left, numbers(1e-4))), numbers(-1.0))
    red = n.value("melanin_redness", 0.5, 1)
    brown = m.op("subtract", numbers(1.0), red)

    def of(share: Value, name: str, default: tuple[float, ...]) -> Value:
        log = m.op("log", m.op("max", n.value(name, default, 3), numbers(1e-6)))
        return m.op("multiply", fit(m.op("multiply", amount, share), 3),
                    m.op("multiply", log, numbers(-1.0)))  # fmt: skip

    total = m.op(
        "add",
        of(brown, "eumelanin_color", _EUMELANIN),
        of(red, "pheomelanin_color", _PHEOMELANIN),
    )
    return m.op("max", total, numbers(0.0))
