# SPDX-License-Identifier: Apache-2.0
"""Handlers for MaterialX image nodes, including hex-tiled images and normal maps.

Hex tiling blends three copies of the image at each point, which are randomly rotated, scaled and
shifted. The implementation follows M. Mikkelsen, "Practical Real-Time Hex-Tiling", JCGT 11(2),
2022, with the weights and the hash function of MaterialX's code.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from wavecomb.usd.graphs.surface_parameters import COLOURS, NORMAL, uv_matrix
from wavecomb.usd.graphs.values import Expressions, Value, fit, is_constant, numbers
from wavecomb.usd.materials.network import asset_file, space_of
from wavecomb.usd.materialx.nodes.arithmetic import fract, weighted_sum
from wavecomb.usd.materialx.nodes.colours import LUMA
from wavecomb.usd.materialx.nodes.node import Handler, NodeCall, adder

NODES: dict[str, Handler] = {}
_node = adder(NODES)

_WRAPS = {
    "periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black",
}  # fmt: skip


def stretch_of(uv: Value) -> float:
    """Returns the scale from the mesh's to the node's texture coordinates; 1 if it varies."""
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
    """Returns r, g, b and alpha of the node's image file, or the fallback if there is no image.

    Args:
        n: The MaterialX node.
        uv: Texture coordinates.
        wraps: Wrap modes in u and v.
        fallback: Name of the input whose value replaces a missing image.
        is_raw: Whether the file holds data rather than colours.
        stretch: Scale from the mesh's texture coordinates to ``uv``; None computes the scale from
            ``uv``.
        name: Name of the input that holds the file.
        space: Colour space in an input of the node, or an empty string.
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
    """Reads a texture by the rules of UsdUVTexture, including ``sourceColorSpace``."""
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


_GRID = 2.0 * math.sqrt(3.0)
"""Scale of the hexagonal grid at which one copy of the image fits into a hexagon."""
_SKEW = (-0.57735027, 1.15470054)
"""Factors of v in the skewed grid coordinates: -tan 30 degrees, and -2 times that."""
_SEED = 0.12345
"""Offset that is added to cell indices before they are hashed."""
_PERIODIC = ["repeat", "repeat"]


@dataclass(frozen=True)
class _Copy:
    """One of the image copies that are blended at a point."""

    uv: Value
    turn: Value
    weight: Value


def _hash(m: Expressions, p: Value) -> Value:
    """Hashes two numbers to two pseudo-random numbers in [0, 1)."""
    a = fract(m, m.mul((p[0], p[1], p[0]), numbers(0.1031, 0.1030, 0.0973)))
    turned = m.add((a[1], a[2], a[0]), 33.33)
    a = m.add(a, m.op("dot", a, turned))
    return fract(m, m.mul(m.add((a[0], a[0]), (a[1], a[2])), (a[2], a[1])))


def _mix(m: Expressions, ends: Value, at: Value) -> Value:
    return m.op("mix", (ends[0],), (ends[1],), at)


def _turned(m: Expressions, v: Value, sin: Value, cos: Value) -> Value:
    x = m.sub(m.mul(v[:1], cos), m.mul(v[1:2], sin))
    y = m.add(m.mul(v[:1], sin), m.mul(v[1:2], cos))
    return x + y


class _Grid:
    """The hexagonal grid of a node, which computes the three image copies at a point."""

    def __init__(self, n: NodeCall) -> None:
        m = self.make = n.make
        self.coord = m.mul(n.coordinates(), n.value("tiling", 1.0, 2))
        self._rotation = n.value("rotation", 1.0, 1)
        degrees = n.value("rotationrange", (0.0, 360.0), 2)
        self._turns = m.mul(degrees, numbers(math.pi / 180))
        self._scale = n.value("scale", 1.0, 1)
        self._scales = n.value("scalerange", (0.5, 2.0), 2)
        self._offset = n.value("offset", 1.0, 1)
        self._offsets = n.value("offsetrange", (0.0, 1.0), 2)
        self._falloff = n.value("falloff", 0.5, 1)

    def copies(self) -> list[_Copy]:
        m = self.make
        st = m.mul(self.coord, numbers(_GRID))
        skewed = m.add(st[:1], m.mul(st[1:], numbers(_SKEW[0])))
        skewed += m.mul(st[1:], numbers(_SKEW[1]))
        base = m.op("floor", skewed)
        x, y = ((part,) for part in m.sub(skewed, base))
        z = m.sub(m.sub(1.0, x), y)
        # `upper` is 1 in the upper triangle of a grid cell, where z is 0 or less, and 0 in the
        # lower triangle.
        upper = m.op("select", m.op("less", 0.0, z), 0.0, 1.0)
        lower = m.sub(1.0, upper)
        sign = m.sub(m.mul(upper, 2.0), 1.0)
        weights = (
            m.sub(0.0, m.mul(z, sign)),
            m.sub(upper, m.mul(y, sign)),
            m.sub(upper, m.mul(x, sign)),
        )
        steps = (upper + upper, upper + lower, lower + upper)
        cells = (m.add(base, step) for step in steps)
        return [self._copy(cell, w) for cell, w in zip(cells, weights, strict=True)]

    def _copy(self, cell: Value, weight: Value) -> _Copy:
        m = self.make
        centre = m.add(cell[:1], m.mul(cell[1:], 0.5))
        centre += m.mul(cell[1:], numbers(1 / _SKEW[1]))
        centre = m.mul(centre, numbers(1 / _GRID))
        chance = _hash(m, m.add(cell, numbers(_SEED)))
        turn = _mix(m, self._turns, m.mul(chance[:1], self._rotation))
        drawn = _mix(m, self._scales, chance[1:])
        scale = m.op("mix", 1.0, drawn, self._scale)
        shift = _mix(m, self._offsets, m.mul(chance[:1], self._offset))
        shift += _mix(m, self._offsets, m.mul(chance[1:], self._offset))
        away = m.sub(self.coord, centre)
        away = _turned(m, away, m.op("sin", turn), m.op("cos", turn))
        uv = m.add(m.add(m.div(away, scale), centre), shift)
        return _Copy(uv, turn, weight)

    def shares(self, copies: list[_Copy], bright: list[Value] | None = None) -> Value:
        """Returns the blend weights of three image copies; ``bright`` are weights by luminance."""
        m = self.make
        grid = tuple(copy.weight[0] for copy in copies)
        w = m.op("power", m.op("max", grid, 0.0), 7.0)
        if bright is not None:
            w = m.mul(w, tuple(one[0] for one in bright))
        w = self._normalised(w)
        r = m.op("clamp", self._falloff, 0.001, 0.999)
        return self._normalised(self._gain(w, r)) if r != numbers(0.5) else w

    def _normalised(self, w: Value) -> Value:
        return self.make.div(w, self.make.op("dot", w, numbers(1.0, 1.0, 1.0)))

    def _gain(self, x: Value, r: Value) -> Value:
        """Applies Schlick's gain curve.

        Source: "Fast Alternatives to Perlin's Bias and Gain Functions", Graphics Gems IV, 1994.
        """
        m = self.make
        steep = m.sub(m.div(1.0, r), 2.0)
        twice = m.mul(x, 2.0)
        a = m.mul(steep, m.sub(1.0, twice))
        low = m.div(x, m.add(a, 1.0))
        high = m.div(m.sub(a, x), m.sub(a, 1.0))
        return m.op("select", m.op("less", x, 0.5), low, high)


def _texels(n: NodeCall, grid: _Grid, copies: list[_Copy], is_raw: bool) -> list[Value]:
    stretch = stretch_of(grid.coord)
    return [read_image(n, c.uv, _PERIODIC, "default", is_raw, stretch) for c in copies]


@_node("hextiledimage")
def _hextiled_image(n: NodeCall) -> Value:
    m, grid = n.make, _Grid(n)
    copies = grid.copies()
    texels = _texels(n, grid, copies, is_raw=False)
    # If the file is missing, the texel is a constant, which is the default value of the node.
    if is_constant(texels[0]):
        return texels[0]
    luma, contrast = n.value("lumacoeffs", LUMA, 3), n.value("falloffcontrast", 0.5, 1)
    bright = [m.op("mix", 1.0, m.op("dot", t[:3], luma), contrast) for t in texels]
    colour = weighted_sum(m, [t[:3] for t in texels], grid.shares(copies, bright))
    if n.width != 4:
        return colour
    return colour + weighted_sum(m, [t[3:4] for t in texels], grid.shares(copies))


@_node("hextilednormalmap")
def _hextiled_normal_map(n: NodeCall) -> Value:
    """Blends tangent-space normals by their gradients (M. Mikkelsen, JCGT 9(3), 2020)."""
    m, grid, n.width = n.make, _Grid(n), 3
    kind, n.kind = n.kind, NORMAL
    copies = grid.copies()
    texels = _texels(n, grid, copies, is_raw=True)
    strength, flips = n.value("strength", 1.0, 1), n.number("flip_g", 0.0) != 0
    n.kind = kind
    if is_constant(texels[0]):
        return numbers(0.0, 0.0, 1.0)
    slopes = []
    for copy, texel in zip(copies, texels, strict=True):
        v = m.sub(m.mul(fit(texel, 3), 2.0), 1.0)
        if flips:
            v = v[:1] + m.sub(0.0, v[1:2]) + v[2:]
        # Rotate the tangent-space normals by -copy.turn, because this copy of the tile is rotated
        # by copy.turn.
        back = m.sub(0.0, copy.turn)
        across = _turned(m, m.mul(v[:2], strength), m.op("sin", back), m.op("cos", back))
        steep = m.op("max", m.op("abs", v[2:]), 1e-3)
        slopes.append(m.div(across, steep))
    return weighted_sum(m, slopes, grid.shares(copies)) + numbers(1.0)
