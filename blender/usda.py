# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes USD layers as text. Blender 4.2 brings no OpenUSD that Python can import."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np


class Asset(str):
    """A file name, which USD text encloses in at signs (@)."""


class Path(str):
    """A path of a prim or property, which USD text encloses in angle brackets."""


def text_of(value: Any) -> str:
    """Returns a value as USD text: numbers, strings, tuples, lists, matrices, arrays."""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, Asset):
        return f"@@@{value}@@@" if "@" in value else f"@{value}@"
    if isinstance(value, Path):
        return f"<{value}>"
    if isinstance(value, str):
        safe = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{safe}"'
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, tuple):
        return "(" + ", ".join(map(text_of, value)) + ")"
    if isinstance(value, list):
        return "[" + ", ".join(map(text_of, value)) + "]"
    if isinstance(value, int):
        return str(value)
    return repr(float(value)) if abs(float(value)) < 1e30 else ("1e30" if value > 0 else "-1e30")


def _array(values: np.ndarray) -> str:
    if values.ndim == 1:
        return "[" + ", ".join(map(repr, values.tolist())) + "]"
    return "[" + ", ".join(map(repr, map(tuple, values.tolist()))) + "]"


def matrix_rows(matrix: Any) -> tuple[tuple[float, ...], ...]:
    """Returns a matrix of Blender (column vectors) in the layout of USD (row vectors)."""
    return tuple(tuple(float(v) for v in row) for row in matrix.transposed())


class Prim:
    """A prim specification of a layer.

    Attributes:
        lines: Lines of its properties.
        children: Its child specifications by name.
    """

    def __init__(self, specifier: str = "over", kind: str = "") -> None:
        self.specifier, self.kind = specifier, kind
        self.metadata: list[str] = []
        self.lines: list[str] = []
        self.children: dict[str, Prim] = {}

    def set(self, declaration: str, value: Any) -> None:
        """Authors an attribute, declared by type and name as in ``"float inputs:angle"``."""
        self.lines.append(f"{declaration} = {text_of(value)}")

    def sample(self, declaration: str, values: Mapping[float, Any]) -> None:
        """Authors time samples of an attribute; a single value becomes its default."""
        if len(values) == 1:
            self.set(declaration, next(iter(values.values())))
            return
        inner = ", ".join(f"{time!r}: {text_of(value)}" for time, value in sorted(values.items()))
        self.lines.append(f"{declaration}.timeSamples = {{ {inner} }}")

    def connect(self, declaration: str, target: str) -> None:
        """Connects an attribute."""
        self.lines.append(f"{declaration}.connect = <{target}>")

    def relate(self, name: str, *targets: str) -> None:
        """Authors a relationship."""
        self.lines.append(f"rel {name} = [{', '.join(f'<{one}>' for one in targets)}]")

    def apply(self, *schemas: str) -> None:
        """Applies API schemas."""
        self.metadata.append(f"prepend apiSchemas = {text_of(list(schemas))}")

    def transform(self, samples: Mapping[float, Any]) -> None:
        """Replaces the transform of the prim by Blender's matrices, given by time."""
        rows = {time: matrix_rows(matrix) for time, matrix in samples.items()}
        self.sample("matrix4d xformOp:transform", rows)
        self.lines.append('uniform token[] xformOpOrder = ["xformOp:transform"]')

    def write(self, name: str, depth: int, out: list[str]) -> None:
        """Appends the text of this prim and its children to ``out``."""
        space = "    " * depth
        head = " ".join(filter(None, (self.specifier, self.kind, f'"{name}"')))
        if self.metadata:
            head += " (\n" + "".join(f"{space}    {line}\n" for line in self.metadata) + f"{space})"
        out.append(f"{space}{head}\n{space}{{")
        out.extend(f"{space}    {line}" for line in self.lines)
        for child, prim in self.children.items():
            prim.write(child, depth + 1, out)
        out.append(f"{space}}}")


class Layer:
    """A layer under construction."""

    def __init__(self) -> None:
        self.metadata: list[str] = []
        self.roots: dict[str, Prim] = {}

    def over(self, path: str) -> Prim:
        """Returns the specification at a path, after creating missing ones as overs."""
        return self._at(path)

    def define(self, path: str, kind: str = "") -> Prim:
        """Returns the specification at a path, as a definition of the prim type ``kind``.

        Outside of the exporter's prims, missing ancestors become scopes: a prim below an
        undefined one is not traversed.
        """
        prim = self._at(path)
        names = path.strip("/").split("/")
        if names[0] != "root":
            for depth in range(1, len(names)):
                above = self._at("/".join(names[:depth]))
                if above.specifier == "over":
                    above.specifier, above.kind = "def", "Scope"
        prim.specifier, prim.kind = "def", kind
        return prim

    def _at(self, path: str) -> Prim:
        below, found = self.roots, None
        for name in path.strip("/").split("/"):
            found = below.setdefault(name, Prim())
            below = found.children
        assert found is not None
        return found

    def text(self) -> str:
        """Returns the layer as .usda text."""
        head = "".join(f"    {line}\n" for line in self.metadata)
        out = ["#usda 1.0", f"(\n{head})\n"] if head else ["#usda 1.0\n"]
        for name, prim in self.roots.items():
            prim.write(name, 0, out)
        return "\n".join(out) + "\n"

    def save(self, file: str) -> None:
        """Writes the layer; the file is either complete or unchanged."""
        with open(file + ".part", "w", encoding="utf-8") as stream:
            stream.write(self.text())
        os.replace(file + ".part", file)


def safe_name(name: str) -> str:
    """Returns the prim name that Blender's exporter gives to an object, without Unicode.

    Each byte that is not allowed in an identifier becomes an underscore.
    """
    data = name.encode() or b"_"
    letters = [chr(b) if chr(b).isascii() and (chr(b).isalnum() or b == 95) else "_" for b in data]
    if letters[0].isdigit():
        letters[0] = "_"
    return "".join(letters)


def unique_names(names: Iterable[str]) -> dict[str, str]:
    """Returns distinct prim names for distinct names."""
    used: set[str] = set()
    found: dict[str, str] = {}
    for name in names:
        base = made = safe_name(name)
        number = 1
        while made in used:
            made, number = f"{base}_{number}", number + 1
        used.add(made)
        found[name] = made
    return found
