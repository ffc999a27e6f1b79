# SPDX-License-Identifier: Apache-2.0
"""Reads USD stages into scenes: ``load_stage("shot.usd").scene``.

The module ``layers`` opens stages, ``render_settings`` reads their render settings, ``stage`` loads
them into a scene, and ``instances`` builds groups of instanced objects. ``geometry``, ``lights``,
``cameras`` and ``volumes`` each read one kind of prim; ``materials``, ``graphs`` and ``materialx``
convert shader networks to programs with parameters.

The package imports names on first use, since most of them load OpenUSD.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavecomb.errors import WavecombError
    from wavecomb.usd.layers.opening import open_editable, open_stage
    from wavecomb.usd.render_settings.view import peek_products
    from wavecomb.usd.stage.load import load_stage
    from wavecomb.usd.stage.load_result import LoadedStage
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

_HOMES = {
    "Finding": "wavecomb.usd.stage.report",
    "LoadReport": "wavecomb.usd.stage.report",
    "LoadedStage": "wavecomb.usd.stage.load_result",
    "WavecombError": "wavecomb.errors",
    "load_stage": "wavecomb.usd.stage.load",
    "open_editable": "wavecomb.usd.layers.opening",
    "open_stage": "wavecomb.usd.layers.opening",
    "peek_products": "wavecomb.usd.render_settings.view",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'wavecomb.usd' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
