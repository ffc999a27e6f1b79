# SPDX-License-Identifier: Apache-2.0
"""Parameters of surfaces that primvars of the mesh drive at hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wavecomb.usd.graphs.colour import in_working_space
from wavecomb.usd.graphs.expressions import Expressions
from wavecomb.usd.graphs.node import PARAMETERS, fit, numbers
from wavecomb.usd.graphs.surface import graphs_of
from wavecomb.usd.looks.surface import COLOUR_SLOTS, DEFAULTS, Surface


def with_attributes(surface: Surface, slots: Sequence[str], working: str) -> Surface:
    """A surface whose slots read their primvars at hits.

    Raises:
        GraphTooLarge: Together with what drives the surface already it is too much.
    """
    make = Expressions()
    graph = surface.graph
    outputs = {} if graph is None else dict(graph.outputs)
    names = () if graph is None else graph.primvars
    for slot in slots:
        width = PARAMETERS[slot][1]
        given = surface.parameters.get(slot, DEFAULTS[slot])
        constant = given if isinstance(given, (tuple, list)) else (given,)
        fallback = fit(numbers(*(float(x) for x in constant)), width)
        value = make.attribute(surface.primvars[slot], width, fallback)
        if slot in COLOUR_SLOTS:
            value = in_working_space(make, value, working)
        outputs[slot] = value
    rest = {slot: name for slot, name in surface.primvars.items() if slot not in slots}
    return replace(surface, primvars=rest, graph=graphs_of(outputs, names))
