# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that read images."""

from __future__ import annotations

import math

from wavecomb.usd.graphs.surface import COLOURS, NORMAL, uv_matrix
from wavecomb.usd.graphs.values import Value, fit, numbers
from wavecomb.usd.looks.network import asset_file, space_of
from wavecomb.usd.materialx.nodes.call import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)

_WRAPS = {
    "periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black",
}  # fmt: skip


def stretch_of(uv: Value) -> float:
    """Lengths in texture coordinates for one in those of the mesh; 1 where that is not constant."""
    m = uv_matrix(uv)
    if m is None:
        return 1.0
    return math.sqrt(max(m[0] ** 2 + m[1] ** 2, m[3] ** 2 + m[4] ** 2))


def read_image(
    n: NodeCall,
    uv: Value,
    wraps: list[str],
    fallback: str,
    is_raw: bool,
    stretch: float | None = None,
    *,
    name: str = "file",
    space: str = "",
) -> Value:
    """r, g, b, alpha of the node's file; its default where there is none that can be read.

    Args:
        n: The node.
        uv: Texture coordinates.
        wraps: Wrap modes in u and v.
        fallback: Input that stands for a missing file.
        is_raw: Whether the file holds no colours.
        stretch: Lengths in ``uv`` for one in the mesh's coordinates, where it is known better.
        name: Input that names the file.
        space: Colour space that the node itself says, "": none.
    """
    networks = n.networks
    stretch = stretch_of(uv) if stretch is None else stretch
    file = n.inputs.source(name)
    path = asset_file(file.value, file.attribute) if file is not None and file.is_value else ""
    image = networks.textures.image(path, n.inputs.path) if path else None
    if image is None:
        authored = n.given(fallback) if n.inputs.has(fallback) else None
        if authored is not None:
            return fit(authored, 4)
        if n.kind == "base" and path:
            return n.make.image(networks.textures.missing(), uv, stretch)
        return numbers(0.0, 0.0, 0.0, 1.0)
    is_colour = n.kind in COLOURS and not is_raw
    space = space or space_of(file.attribute if file else None)
    space = space or ("auto" if is_colour else "raw")
    if n.kind == NORMAL:
        space = "raw"
    texture = networks.textures.add(path, image, space, *wraps, is_colour=is_colour)
    r, g, b, a = n.make.image(texture, uv, stretch)
    return (r, r, r, a) if image.channels < 3 else (r, g, b, a)


@_node("image")
def _image(n: NodeCall) -> Value:
    wraps = [_WRAPS.get(n.text(f"{axis}addressmode", "periodic"), "repeat") for axis in "uv"]
    return read_image(n, n.coordinates(), wraps, "default", "color" not in n.identifier)


@_node("UsdUVTexture")
def _uv_texture(n: NodeCall) -> Value:
    """MaterialX's graph of it has no sourceColorSpace, which 1.38 had and stages say."""
    m = n.make
    uv = n.coordinates("st")
    wraps = [n.text(name, "periodic").replace("periodic", "repeat") for name in ("wrapS", "wrapT")]
    raw = n.text("sourceColorSpace", "auto") == "raw"
    texel = read_image(n, uv, wraps, "fallback", raw)
    texel = m.mul(texel, n.value("scale", (1.0, 1.0, 1.0, 1.0), 4))
    texel = m.add(texel, n.value("bias", (0.0, 0.0, 0.0, 0.0), 4))
    n.width = {"rgba": 4, "rgb": 3}.get(n.output, 1)
    if n.output in ("r", "g", "b", "a"):
        return (texel["rgba".index(n.output)],)
    return texel[: n.width]
