# SPDX-License-Identifier: Apache-2.0
"""Constants of a MaterialX material without reading images, for live edits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

from pxr import Tf, Usd, UsdShade

from wavecomb.usd import mtlx
from wavecomb.usd.materials.material import PREVIEW, surface_source
from wavecomb.usd.materials.surface import DEFAULTS, Surface
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.report import LoadReport


class _NoTextures:
    """Substitute for the scene's textures: every file exists and none is opened."""

    working = "rec709"

    def __init__(self) -> None:
        self._numbers: dict[Any, int] = {}

    def image(self, path: str, prim: object) -> Any:
        """Returns a dummy image with four channels."""
        return SimpleNamespace(channels=4)

    def add(self, *key: Any, **more: Any) -> int:
        """Returns a different id for each different texture use."""
        use = (key[0], *key[2:], *sorted(more.items()))
        return self._numbers.setdefault(use, len(self._numbers))

    def missing(self) -> int:
        """Returns the id of the checker texture."""
        return -1


@dataclass(frozen=True)
class SurfaceValues:
    """The values of a material in the core.

    Attributes:
        constants: Keyword arguments of ``Renderer.edit``, without values from textures and graphs.
        structure: Text that identifies textures and graphs with their constants, which cannot be
            edited in an existing scene.
    """

    constants: Mapping[str, Any]
    structure: str


def surface_values(
    prim: Usd.Prim, time: Usd.TimeCode, values: Mapping[str, Any] | None = None
) -> SurfaceValues | None:
    """Returns the values that the loader passes to the core; None if it is no MaterialX material.

    Args:
        prim: A material.
        time: Time code at which attributes are evaluated.
        values: Constants of the surface shader that replace the authored ones.
    """
    material = UsdShade.Material(prim)
    kind, shader = surface_source(material) if material else ("", UsdShade.Shader())
    if not kind or kind == PREVIEW:
        return None
    textures = cast(TextureTable, _NoTextures())
    try:
        surface = mtlx.surface(prim, time, textures, LoadReport(), shader, kind, values)
    # The loader renders such a material in grey.
    except (Tf.ErrorException, RecursionError):
        return None
    if surface is None:
        return None
    return SurfaceValues(_constants(surface), _structure(surface))


def _constants(surface: Surface) -> dict[str, Any]:
    parameters = dict(surface.parameters)
    layers = parameters.pop("openpbr", {})
    driven = set(surface.textures)
    if surface.graph is not None:
        driven |= {name for name, _ in surface.graph.outputs}
    if "extinction" in driven or "transmission_tint" in driven:
        driven |= {"transmission_color", "transmission_depth"}
    every = {name: value for name, value in DEFAULTS.items() if name != "normal"}
    every |= parameters | layers
    return {name: value for name, value in every.items() if name not in driven}


def _structure(surface: Surface) -> str:
    return repr((sorted(surface.textures.items()), surface.uv_names, surface.graph))
