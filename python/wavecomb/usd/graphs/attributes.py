# SPDX-License-Identifier: Apache-2.0
"""Parameters of surfaces that primvars of the mesh drive at hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wavecomb.usd.graphs.colour import in_working_space
from wavecomb.usd.graphs.expressions import Expressions
from wavecomb.usd.graphs.node import PARAMETERS, fit, numbers
from wavecomb.usd.graphs.surface import graphs_of
from wavecomb.usd.looks.surface import COLOUR_PARAMETERS, DEFAULTS, Surface


def with_attributes(surface: Surface, varying: Sequence[str], working: str) -> Surface:
    """A surface some of whose parameters read their primvars at hits.

    Raises:
        GraphTooLarge: Together with what drives the surface already it is too much.
    """
    make = Expressions()
    graph = surface.graph
    outputs = {} if graph is None else dict(graph.outputs)
    names = () if graph is None else graph.primvars
    for parameter in varying:
        width = PARAMETERS[parameter][1]
        given = surface.parameters.get(parameter, DEFAULTS[parameter])
        constant = given if isinstance(given, (tuple, list)) else (given,)
        fallback = fit(numbers(*(float(x) for x in constant)), width)
        value = make.attribute(surface.primvars[parameter], width, fallback)
        if parameter in COLOUR_PARAMETERS:
            value = in_working_space(make, value, working)
        outputs[parameter] = value
    rest = {key: name for key, name in surface.primvars.items() if key not in varying}
    return replace(surface, primvars=rest, graph=graphs_of(outputs, names))
