# SPDX-License-Identifier: Apache-2.0
"""Reads USD stages into scenes: ``load_stage("shot.usd").scene``.

One module for each concept: ``stage`` is the way in; ``traverse`` finds prims and ``groups`` places
them; ``mesh``, ``shapes``, ``light``, ``camera`` and ``instancing`` read one kind of prim each;
``material``, ``preview`` and ``materialx`` turn networks into programs with parameters.
"""

from wavecomb.errors import WavecombError
from wavecomb.usd.stage.load import LoadedStage, load_stage
from wavecomb.usd.stage.opening import open_editable, open_stage
from wavecomb.usd.stage.peek import peek_products
from wavecomb.usd.stage.report import Finding, LoadReport

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
