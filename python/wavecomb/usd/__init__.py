# SPDX-License-Identifier: Apache-2.0
"""Reads USD stages into scenes: ``load_stage("shot.usd").scene``.

One module for each concept: ``stage`` is the way in; ``traverse`` finds prims and ``groups`` places
them; ``mesh``, ``shapes``, ``light``, ``camera`` and ``instancing`` read one kind of prim each;
``material``, ``preview`` and ``materialx`` turn networks into programs with parameters.
"""

from wavecomb.errors import WavecombError
from wavecomb.usd.opening import open_editable, open_stage
from wavecomb.usd.peek import peek_products
from wavecomb.usd.report import Finding, LoadReport
from wavecomb.usd.stage import LoadedStage, load_stage

__all__ = [
    "Finding",
    "LoadReport",
    "LoadedStage",
    "WavecombError",
    "load_stage",
    "open_editable",
    "open_stage",
    "peek_products",
]
