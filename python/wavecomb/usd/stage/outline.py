# SPDX-License-Identifier: Apache-2.0
"""The outline of a stage: what a window shows and edits of it, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ids = NDArray[np.uint32]

NOTHING = 0xFFFFFFFF
"""In place of a parent: a root; of a prototype: no instance."""

SPECIFIERS = ("SpecifierDef", "SpecifierOver", "SpecifierClass")
OWN_FACTS = frozenset(
    {"subLayers", "subLayerOffsets", "comment", "documentation", "customLayerData", "owner"}
)
"""Metadata of a root layer that nothing over it repeats."""

MOST_PRIMS = 1 << 25
MOST_NESTING = 256
"""Prims above one another, with what instances bring."""
MOST_VALUES = 256
"""Values of an array that an attribute may hold."""

INTEGERS = ("uchar", "int", "uint", "int64", "uint64")
FLOATS = ("half", "float", "double", "timecode")
TEXTS = ("token", "string")
ROWS = {
    **dict.fromkeys(("int2", "int3", "int4"), INTEGERS),
    **{f"{name}{n}": FLOATS for name in FLOATS[:3] for n in (2, 3, 4)},
    **{f"{name}{n}{t}": FLOATS for name, sizes in (
        ("color", (3, 4)), ("normal", (3,)), ("vector", (3,)), ("point", (3,)),
        ("texCoord", (2, 3)),
    ) for n in sizes for t in "hfd"},
}  # fmt: skip
"""Types of some numbers in a row, and of which they are."""
MATRICES = {"matrix2d": 2, "matrix3d": 3, "matrix4d": 4, "frame4d": 4}
TYPES = frozenset({"bool", "asset", *INTEGERS, *FLOATS, *TEXTS, *ROWS, *MATRICES})
"""Types of values, by Sdf's names; with "[]" of arrays of them."""


@dataclass(frozen=True)
class Attribute:
    """An attribute of a prim, at one time.

    Attributes:
        prim: Its number.
        name: Such as "inputs:intensity".
        type_name: Of ``TYPES``, with "[]" of an array.
        uniform: Its variability.
        value: Bool, int, float or str; a list of what has several; None: it has none.
        connections: Paths.
        space: Its colour space; "": none.
    """

    prim: int
    name: str
    type_name: str
    uniform: bool
    value: Any
    connections: list[str]
    space: str


@dataclass(frozen=True)
class Relationship:
    """A relationship of a prim; ``strength`` is of a binding, "": as usual."""

    prim: int
    name: str
    targets: list[str]
    strength: str


@dataclass(frozen=True)
class Variants:
    """A variant set of a prim, with what the stage selects; "": nothing."""

    prim: int
    name: str
    choices: list[str]
    choice: str


@dataclass(frozen=True)
class Outline:
    """What is known of a stage without its files.

    Prims stand in the stage's order, each after the one that it is in. What is in instances is
    there once, in prototypes.

    Attributes:
        holder: Name of the root prim that holds the prototypes.
        names: Of prims.
        parents: Of each prim; NOTHING: a root, or a prototype.
        kinds: (type, applied schemas), those that there are.
        kind: Of each prim.
        specifier: Of each prim: of ``SPECIFIERS``.
        hidden: Whether each prim says invisible.
        prototype: That each prim is an instance of; NOTHING: none.
        prototypes: Prims that are prototypes.
        bound: (n, 2): prim, and path in ``materials`` that is bound to it.
        materials: Paths.
        attributes: Of materials, lights, cameras, and of what these need.
        relationships: Bindings that are not in ``bound``, and collections.
        variants: Variant sets.
        counts: Prim -> points of a point instancer.
        facts: Metadata of the root layer by name.
        files: Of the layers in use.
        selected: (prim, variant set, choice) that the caller asked for.
    """

    holder: str
    names: list[str]
    parents: Ids
    kinds: list[tuple[str, list[str]]]
    kind: Ids
    specifier: NDArray[np.uint8]
    hidden: NDArray[np.uint8]
    prototype: Ids
    prototypes: Ids
    bound: Ids
    materials: list[str]
    attributes: list[Attribute]
    relationships: list[Relationship]
    variants: list[Variants]
    counts: list[tuple[int, int]]
    facts: Mapping[str, Any]
    files: list[str]
    selected: list[tuple[str, str, str]]
