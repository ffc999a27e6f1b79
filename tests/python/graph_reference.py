# SPDX-License-Identifier: Apache-2.0
"""Value graphs in NumPy with double precision, implemented from the definitions alone."""

from __future__ import annotations

import numpy as np

from wavecomb.usd.graphs.values import INPUTS, nodes_of

COLUMNS = {"uv": 0, "position": 3, "local_position": 6, "normal": 9, "local_normal": 12,
           "tangent": 15, "view": 18,
           "normal_x": 21, "normal_y": 24, "normal_z": 27}  # fmt: skip
U32 = np.uint32


def rotl(x, k):
    return ((x << U32(k)) | (x >> U32(32 - k))).astype(np.uint32)


def jenkins(*words):
    """Returns Jenkins' lookup3 hash of 1 to 4 words."""
    with np.errstate(over="ignore"):
        a = np.full(words[0].shape, 0xDEADBEEF + 4 * len(words) + 13, np.uint64).astype(np.uint32)
        b, c = a.copy(), a.copy()
        a = a + words[0]
        if len(words) > 1:
            b = b + words[1]
        if len(words) > 2:
            c = c + words[2]
        if len(words) > 3:
            for k in (4, 6, 8, 16, 19, 4):
                a = (a - c) ^ rotl(c, k)
                c = c + b
                a, b, c = b, c, a
            # After six rotations, the three names are in their original order.
            a = a + words[3]
        c = (c ^ b) - rotl(b, 14)
        a = (a ^ c) - rotl(c, 11)
        b = (b ^ a) - rotl(a, 25)
        c = (c ^ b) - rotl(b, 16)
        a = (a ^ c) - rotl(c, 4)
        b = (b ^ a) - rotl(a, 14)
        return (c ^ b) - rotl(b, 24)


def lattice(p):
    base = np.floor(p)
    return base.astype(np.int64), p - base


def words_of(cells):
    return [(c & 0xFFFFFFFF).astype(np.uint32) for c in cells]


def gradient(h, d):
    """Returns the dot product of d and the gradient that hash h selects."""
    if len(d) == 2:
        h = h & U32(7)
        u, v = np.where(h < 4, d[0], d[1]), 2 * np.where(h < 4, d[1], d[0])
    else:
        h = h & U32(15)
        u = np.where(h < 8, d[0], d[1])
        v = np.where(h < 4, d[1], np.where((h == 12) | (h == 14), d[0], d[2]))
    return np.where(h & 1, -u, u) + np.where(h & 2, -v, v)


def perlin(p, width):
    """Returns gradient noise at points p (one array per axis), with 1 or 3 channels."""
    n = len(p)
    cells, parts = zip(*(lattice(axis) for axis in p), strict=True)
    fade = [t * t * t * (t * (t * 6 - 15) + 10) for t in parts]
    out = [np.zeros_like(p[0]) for _ in range(width)]
    for corner in range(2**n):
        bits = [corner >> i & 1 for i in range(n)]
        h = jenkins(*words_of([c + b for c, b in zip(cells, bits, strict=True)]))
        weight = np.prod([f if b else 1 - f for f, b in zip(fade, bits, strict=True)], axis=0)
        away = [t - b for t, b in zip(parts, bits, strict=True)]
        for k in range(width):
            mine = h if width == 1 else (h >> U32(8 * k)) & U32(255)
            out[k] = out[k] + weight * gradient(mine, away)
    return [(0.6616 if n == 2 else 0.982) * x for x in out]


def noise(p, width):
    if width == 1:
        return perlin(p, 1)
    values = perlin(p, 3)[:width]
    if width == 4:
        values += perlin([a + k for a, k in zip(p, (19, 73, 29), strict=False)], 1)
    return values


def octaves(p, width, count, lacunarity, diminish):
    out, strength = [0.0] * width, 1.0
    for _ in range(count):
        out = [o + strength * v for o, v in zip(out, perlin(p, width), strict=True)]
        strength = strength * diminish
        p = [axis * lacunarity for axis in p]
    return out


def fractal(p, width, count, lacunarity, diminish):
    other = [a + k for a, k in zip(p, (19, 193, 17), strict=True)]
    rest = (count, lacunarity, diminish)
    if width == 1:
        return octaves(p, 1, *rest)
    if width == 2:
        return octaves(p, 1, *rest) + octaves(other, 1, *rest)
    return octaves(p, 3, *rest) + (octaves(other, 1, *rest) if width == 4 else [])


def cells(p, width):
    at = words_of([lattice(axis)[0] for axis in p])
    if width == 1:
        return [jenkins(*at) / 4294967295.0]
    return [jenkins(*at, np.full_like(at[0], k)) / 4294967295.0 for k in range(width)]


def worley(p, width, jitter, style):
    base, parts = zip(*(lattice(axis) for axis in p), strict=True)
    squares, offsets = [], []
    for cell in np.ndindex(*[3] * len(p)):
        at = words_of([b + d - 1 for b, d in zip(base, cell, strict=True)])
        away = []
        for i, (d, part) in enumerate(zip(cell, parts, strict=True)):
            value = jenkins(*at, np.full_like(at[0], i)) / 4294967295.0
            away.append(d - 1 + (value - 0.5) * jitter + 0.5 - part)
        squares.append(sum(a * a for a in away))
        offsets.append(away)
    order = np.argsort(np.array(squares), axis=0, kind="stable")
    if style == 1:
        nearest = [np.take_along_axis(np.array([o[i] for o in offsets]), order[:1], 0)[0]
                   for i in range(len(p))]  # fmt: skip
        return cells([a + b for a, b in zip(nearest, p, strict=True)], 1) * width
    near = np.sort(np.sqrt(np.array(squares)), axis=0)
    return list(near[:width])


def rgb_to_hsv(c):
    import colorsys

    return [np.array(x) for x in zip(*map(colorsys.rgb_to_hsv, *c), strict=True)]


def hsv_to_rgb(c):
    import colorsys

    return [np.array(x) for x in zip(*map(colorsys.hsv_to_rgb, *c), strict=True)]


def smoothstep(x, low, high):
    t = np.clip((x - low) / np.where(high == low, 1, high - low), 0, 1)
    return np.where(high == low, np.where(x < low, 0.0, 1.0), t * t * (3 - 2 * t))


def safe(divisor):
    return np.where(divisor == 0, 1, divisor)


FORMULAS = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: np.where(b == 0, 0, a / safe(b)),
    "modulo": lambda a, b: np.where(b == 0, 0, a - b * np.floor(a / safe(b))),
    "power": lambda a, b: np.where(b == 0, 1, np.where(a > 0, np.abs(a) ** b, 0)),
    "min": np.minimum,
    "max": np.maximum,
    "atan2": np.arctan2,
    "less": lambda a, b: (a < b) * 1.0,
    "equal": lambda a, b: (a == b) * 1.0,
    "mix": lambda a, b, c: a * (1 - c) + b * c,
    "clamp": lambda x, a, b: np.minimum(np.maximum(x, a), b),
    "select": lambda m, a, b: np.where(m != 0, a, b),
    "smoothstep": smoothstep,
    "abs": np.abs,
    "floor": np.floor,
    "sign": np.sign,
    "sqrt": lambda a: np.sqrt(np.maximum(a, 0)),
    "exp": lambda a: np.exp(np.clip(a, None, 88)),
    "log": lambda a: np.log(np.maximum(a, 1.17549435e-38)),
    "sin": np.sin,
    "cos": np.cos,
    "acos": lambda a: np.arccos(np.clip(a, -1, 1)),
}
"""Functions that work component by component."""


def evaluate(value, points):
    """Evaluates a value (of ``usd.graphs``) at points (n, 30). Textures are white."""
    points = np.asarray(points, np.float64)
    results = {}

    def get(part):
        return np.full(len(points), part) if isinstance(part, float) else results[part[0]][part[1]]

    for node in nodes_of(list(value)):
        args = [[get(part) for part in operand] for operand in node.operands]
        results[node] = _node(node, args, points)
    return np.stack([get(part) for part in value], axis=1)


def _node(node, args, points):
    code, width = node.code, node.width
    if code == "input":
        name = next(name for name, number in INPUTS.items() if number == node.number)
        if name == "bitangent":
            cross = np.cross(points[:, 9:12], points[:, 15:18])
            return [cross[:, i] for i in range(width)]
        return [points[:, COLUMNS[name] + i] for i in range(width)]
    if code == "image":
        return [np.ones(len(points))] * width
    if code == "dot":
        return [sum(a * b for a, b in zip(*args, strict=True))]
    if code == "cross":
        return list(np.cross(np.stack(args[0], 1), np.stack(args[1], 1)).T)
    if code in ("rgbtohsv", "hsvtorgb"):
        return (rgb_to_hsv if code == "rgbtohsv" else hsv_to_rgb)(args[0])
    if code in ("noise2", "noise3"):
        return noise(args[0], width)
    if code == "fractal3":
        return fractal(args[0], width, node.number, args[1][0], args[2][0])
    if code in ("cell2", "cell3"):
        return cells(args[0], width)
    if code in ("worley2", "worley3"):
        return worley(args[0], width, args[1][0], node.number)
    return [FORMULAS[code](*(operand[i] for operand in args)) for i in range(width)]
