# SPDX-License-Identifier: Apache-2.0
"""MaterialX nodes that read images."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from wavecomb.usd.looks.colour_space import space_of
from wavecomb.usd.looks.graph_code import Linear, Node, Value, fit, linear, numbers
from wavecomb.usd.looks.graph_nodes import placed
from wavecomb.usd.looks.network import source_of
from wavecomb.usd.looks.texture import asset_file

if TYPE_CHECKING:
    from wavecomb.usd.looks.graph_call import NodeCall

_WRAPS = {"periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black"}


def uv_matrix(uv: Value) -> tuple[float, ...] | None:
    """The matrix m: u' = m[0] u + m[1] v + m[2], v' = m[3] u + ...; None where there is none."""
    rows: list[float] = []
    for part in uv:
        found: Linear | None = linear(part, _is_uv)
        if found is None:
            return None
        terms, constant = found
        weights = [0.0, 0.0]
        for (_, component), k in terms.items():
            weights[component] = k
        rows += [*weights, constant]
    return tuple(rows)


def _is_uv(node: Node) -> bool:
    return node.code == "input" and node.number == 0


def _stretch(uv: Value) -> float:
    """Lengths in texture coordinates for one in those of the mesh; 1 where that is not constant."""
    m = uv_matrix(uv)
    if m is None:
        return 1.0
    return math.sqrt(max(m[0] ** 2 + m[1] ** 2, m[3] ** 2 + m[4] ** 2))


def _image(n: NodeCall, uv: Value, wraps: list[str], fallback: str, is_raw: bool = False) -> Value:
    """r, g, b, alpha of the node's file; its default where there is none that can be read."""
    networks = n.networks
    file = source_of(n.shader, "file", networks.time)
    path = asset_file(file.value, file.attribute) if file is not None else ""
    image = networks.textures.image(path, n.shader.GetPath()) if path else None
    if image is None:
        authored = networks.input(n.shader, fallback, n.kind)
        if authored is not None:
            return fit(authored, 4)
        if n.kind == "base" and path:
            return n.make.image(networks.textures.missing(), uv, _stretch(uv))
        return numbers(0.0, 0.0, 0.0, 1.0)
    is_colour = n.kind in ("base", "colour") and not is_raw
    space = space_of(file.attribute if file else None) or ("auto" if is_colour else "raw")
    if n.kind == "normal":
        space = "raw"
    texture = networks.textures.add(path, image, space, *wraps, is_colour=is_colour)
    r, g, b, a = n.make.image(texture, uv, _stretch(uv))
    return (r, r, r, a) if image.channels < 3 else (r, g, b, a)


def _wraps(n: NodeCall) -> list[str]:
    return [_WRAPS.get(n.text(f"{axis}addressmode", "periodic"), "repeat") for axis in "uv"]


def _is_data(n: NodeCall) -> bool:
    return "color" not in n.identifier


def _plain(n: NodeCall) -> Value:
    return _image(n, n.coordinates(), _wraps(n), "default", _is_data(n))


def _tiled(n: NodeCall) -> Value:
    m = n.make
    uv = m.op("multiply", n.coordinates(), n.value("uvtiling", 1.0, 2))
    uv = m.op("subtract", uv, n.value("uvoffset", 0.0, 2))
    uv = m.op("divide", uv, n.value("realworldimagesize", 1.0, 2))
    uv = m.op("multiply", uv, n.value("realworldtilesize", 1.0, 2))
    return _image(n, uv, ["repeat", "repeat"], "default", _is_data(n))


def _gltf(n: NodeCall) -> Value:
    m = n.make
    turn = m.op("subtract", numbers(0.0), n.value("rotate", 0.0, 1))
    scale_first = n.number("operationorder", 1.0) == 0
    uv = placed(n, n.coordinates(), n.value("pivot", (0.0, 1.0), 2), not scale_first, turn)
    texel = _image(n, uv, _wraps(n), "default", _is_data(n))
    if n.category != "gltf_colorimage":
        factor = n.value("factor", 1.0)
        return m.op("multiply", fit(texel, n.width or 4), fit(factor, n.width or 4))
    tinted = m.op("multiply", texel, n.value("color", (1.0, 1.0, 1.0, 1.0), 4))
    tinted = m.op("multiply", tinted, n.value("geomcolor", (1.0, 1.0, 1.0, 1.0), 4))
    n.width = 1 if n.output == "outa" else 3
    return tinted[3:] if n.output == "outa" else tinted[:3]


def _usd(n: NodeCall) -> Value:
    """MaterialX's UsdUVTexture."""
    m = n.make
    uv = n.coordinates("st")
    wraps = [n.text(name, "periodic").replace("periodic", "repeat") for name in ("wrapS", "wrapT")]
    raw = n.text("sourceColorSpace", "auto") == "raw"
    texel = _image(n, uv, wraps, "fallback", raw)
    texel = m.op("multiply", texel, n.value("scale", (1.0, 1.0, 1.0, 1.0), 4))
    texel = m.op("add", texel, n.value("bias", (0.0, 0.0, 0.0, 0.0), 4))
    n.width = {"rgba": 4, "rgb": 3}.get(n.output, 1)
    if n.output in ("r", "g", "b", "a"):
        return (texel["rgba".index(n.output)],)
    return texel[: n.width]


IMAGES: dict[str, Callable[[NodeCall], Value]] = {
    "image": _plain,
    "tiledimage": _tiled,
    "gltf_image": _gltf,
    "gltf_colorimage": _gltf,
    "UsdUVTexture": _usd,
}
