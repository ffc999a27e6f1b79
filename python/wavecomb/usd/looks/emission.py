# SPDX-License-Identifier: Apache-2.0
"""Mean emission of surfaces, with the means of their textures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.graphs.surface import sampled
from wavecomb.usd.looks.surface import Surface
from wavecomb.usd.looks.texture import TextureTable


def mean_emission(surface: Surface, textures: TextureTable) -> NDArray[np.float64]:
    """(3,) What a surface emits, as a mean over texture coordinates; estimated for graphs."""
    graph = surface.graph
    if graph is not None and graph.emission is not None:
        value = dict(graph.outputs)["emission"]
        white = np.broadcast_to(sampled(value).mean(axis=0, dtype=np.float64), 3)
        means = [textures.mean(texture)[:3] for texture, _ in graph.emission.images]
        return np.asarray(white * np.mean(means, axis=0) if means else white)
    use = surface.textures.get("emission")
    if use is None:
        emission = surface.parameters.get("emission", (0.0, 0.0, 0.0))
        return np.asarray(emission, np.float64)
    texel = textures.mean(use["texture"])
    value = texel * np.array(use["scale"]) + np.array(use["bias"])
    if use["channel"] == "rgb":
        return np.asarray(value[:3])
    return np.full(3, value["rgba".index(use["channel"])])
