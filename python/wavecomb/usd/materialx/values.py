# SPDX-License-Identifier: Apache-2.0
"""Types and values of MaterialX as those of USD."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from pxr import Gf, Sdf, Vt

_NUMBERS = re.compile(r"[\s,]+")


def _numbers(text: str, count: int) -> list[float]:
    values = [float(word) for word in _NUMBERS.split(text.strip()) if word]
    if len(values) != count:
        raise ValueError
    return values


def _vector(kind: Any, count: int) -> Callable[[str], Any]:
    return lambda text: kind(*_numbers(text, count))


def _integer(text: str) -> int:
    value = int(text)
    if not -(2**31) <= value < 2**31:
        raise ValueError
    return value


def _boolean(text: str) -> bool:
    return {"true": True, "false": False}[text.strip()]


def _strings(text: str) -> Any:
    return Vt.StringArray([word.strip() for word in text.split(",")])


def _words(text: str) -> list[str]:
    return [word for word in _NUMBERS.split(text.strip()) if word]


def _vectors(array: Any, kind: Any, count: int) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        numbers = [float(word) for word in _words(text)]
        if len(numbers) % count:
            raise ValueError
        rows = range(0, len(numbers), count)
        return array([kind(*numbers[i : i + count]) for i in rows])

    return read


_T = Sdf.ValueTypeNames
_TYPES: dict[str, tuple[Sdf.ValueTypeName, Callable[[str], Any]]] = {
    "boolean": (_T.Bool, _boolean),
    "integer": (_T.Int, _integer),
    "float": (_T.Float, float),
    "color3": (_T.Color3f, _vector(Gf.Vec3f, 3)),
    "color4": (_T.Color4f, _vector(Gf.Vec4f, 4)),
    "vector2": (_T.Float2, _vector(Gf.Vec2f, 2)),
    "vector3": (_T.Float3, _vector(Gf.Vec3f, 3)),
    "vector4": (_T.Float4, _vector(Gf.Vec4f, 4)),
    "matrix33": (_T.Matrix3d, _vector(Gf.Matrix3d, 9)),
    "matrix44": (_T.Matrix4d, _vector(Gf.Matrix4d, 16)),
    "string": (_T.String, str),
    "filename": (_T.Asset, Sdf.AssetPath),
    "geomname": (_T.String, str),
    "integerarray": (_T.IntArray, lambda text: Vt.IntArray([_integer(w) for w in _words(text)])),
    "floatarray": (_T.FloatArray, lambda text: Vt.FloatArray([float(w) for w in _words(text)])),
    "color3array": (_T.Color3fArray, _vectors(Vt.Vec3fArray, Gf.Vec3f, 3)),
    "color4array": (_T.Color4fArray, _vectors(Vt.Vec4fArray, Gf.Vec4f, 4)),
    "vector2array": (_T.Float2Array, _vectors(Vt.Vec2fArray, Gf.Vec2f, 2)),
    "vector3array": (_T.Float3Array, _vectors(Vt.Vec3fArray, Gf.Vec3f, 3)),
    "vector4array": (_T.Float4Array, _vectors(Vt.Vec4fArray, Gf.Vec4f, 4)),
    "stringarray": (_T.StringArray, _strings),
    "geomnamearray": (_T.StringArray, _strings),
}


def usd_type(name: str) -> Sdf.ValueTypeName | None:
    """The USD type of a MaterialX type; None where it has none: tokens stand for such."""
    known = _TYPES.get(name)
    return None if known is None else known[0]


def usd_value(text: str, name: str) -> Any:
    """A value of a MaterialX type.

    Raises:
        ValueError: The text is none.
    """
    known = _TYPES.get(name)
    if known is None:
        return text
    try:
        return known[1](text)
    except (ValueError, KeyError, OverflowError):
        raise ValueError(f"{text[:40]!r} is no {name}") from None
