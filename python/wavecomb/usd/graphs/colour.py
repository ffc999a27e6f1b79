# SPDX-License-Identifier: Apache-2.0
"""Colours within value graphs."""

from __future__ import annotations

import numpy as np

from wavecomb.picture.working_space import from_rec709
from wavecomb.usd.graphs.expressions import Expressions
from wavecomb.usd.graphs.node import Value, numbers


def in_working_space(make: Expressions, value: Value, working: str) -> Value:
    """A colour of linear Rec.709 in the working space; what follows r, g and b stays."""
    if working == "rec709":
        return value
    matrix = from_rec709(np.eye(3), working)
    rgb = tuple(
        make.op("dot", value[:3], numbers(*(float(x) for x in matrix[:, i])))[0] for i in range(3)
    )
    return rgb + value[3:]
