# SPDX-License-Identifier: Apache-2.0
"""The outline of a stage as plain data, and back: nothing of it is believed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from pxr import Sdf

from wavecomb.run.boxed import calls
from wavecomb.run.boxed.calls import array, data, flag, many, named, number, row, text, whole
from wavecomb.run.boxed.wire import Array, Refused
from wavecomb.usd.stage.outline import (
    FLOATS,
    INTEGERS,
    MATRICES,
    MOST_NESTING,
    MOST_PRIMS,
    MOST_VALUES,
    NOTHING,
    ROWS,
    SPECIFIERS,
    TEXTS,
    TYPES,
    Attribute,
    Ids,
    Outline,
    Relationship,
    Variants,
)

_LONGEST = 1 << 16
"""Characters of a text; more in what becomes names and paths of prims than anybody writes."""


def of_outline(outline: Outline) -> dict[str, Any]:
    """An outline as plain data."""
    found = {one.name: getattr(outline, one.name) for one in fields(outline)}
    for name in ("attributes", "relationships", "variants"):
        found[name] = [list(vars(one).values()) for one in found[name]]
    return {**found, "names": "\n".join(outline.names).encode()}


def _is_short(found: str) -> bool:
    """Whether a text has a sensible length, and nothing that ends one for C."""
    return len(found) <= _LONGEST and "\0" not in found


def _short(value: Any, arrays: Sequence[Array]) -> str:
    found = text(value, arrays)
    if not _is_short(found):
        raise Refused("a text that is none")
    return found


def _named_as(is_valid: Callable[[str], bool], what: str) -> calls.Kind:
    def read(value: Any, arrays: Sequence[Array]) -> str:
        found = _short(value, arrays)
        if not is_valid(found):
            raise Refused(f"something for {what}")
        return found

    return read


def _is_path(found: str) -> bool:
    """Whether a text is the absolute path of a prim or property, not of one in a variant."""
    if not found.startswith("/") or not Sdf.Path.IsValidPathString(found):
        return False
    path = Sdf.Path(found)
    is_one = path.IsPrimPath() or path.IsPrimPropertyPath()
    is_one = is_one and not path.ContainsPrimVariantSelection()
    return is_one and path.pathElementCount <= MOST_NESTING


def _is_variant(found: str) -> bool:
    body = found.removeprefix(".").replace("|", "").replace("-", "")
    return body.replace("_", "").isalnum() or (body != "" and set(body) == {"_"})


_NAME = _named_as(Sdf.Path.IsValidIdentifier, "the name of a prim")
_PROPERTY = _named_as(Sdf.Path.IsValidNamespacedIdentifier, "the name of a property")
_SCHEMA = _named_as(Sdf.Path.IsValidNamespacedIdentifier, "a schema")
_TYPE = _named_as(lambda found: not found or Sdf.Path.IsValidIdentifier(found), "a type of prims")
_PATH = _named_as(_is_path, "a path")
_VARIANT = _named_as(_is_variant, "a variant")
_CHOICE = _named_as(lambda found: not found or _is_variant(found), "a variant")
_VALUE_TYPE = _named_as(lambda found: found.removesuffix("[]") in TYPES, "a type of values")
_STRENGTH = _named_as(
    lambda found: found in ("", "strongerThanDescendants", "weakerThanDescendants"), "a strength"
)


def _plain(value: Any, arrays: Sequence[Array]) -> Any:
    """A flag, number or text."""
    if isinstance(value, str):
        return _short(value, arrays)
    if type(value) is int and abs(value) < 1 << 63:
        return value
    if type(value) not in (bool, float):
        raise Refused("something for a value")
    return value


def _anything(value: Any, arrays: Sequence[Array]) -> Any:
    """What ``_check_value`` looks at."""
    return value


_IDS = array("<u4", 1)
_OUTLINE = calls.fields(
    holder=_NAME, names=data, parents=_IDS, kinds=many(row(_TYPE, many(_SCHEMA))), kind=_IDS,
    specifier=array("|u1", 1), hidden=array("|u1", 1), prototype=_IDS, prototypes=_IDS,
    bound=array("<u4", 2), materials=many(_PATH),
    attributes=many(row(whole, _PROPERTY, _VALUE_TYPE, flag, _anything, many(_PATH), _short)),
    relationships=many(row(whole, _PROPERTY, many(_PATH), _STRENGTH)),
    variants=many(row(whole, _VARIANT, many(_VARIANT), _CHOICE)),
    counts=many(row(whole, whole)), facts=named(calls.one_of(_plain, named(_plain))),
    files=many(_short), selected=many(row(_PATH, _VARIANT, _CHOICE)),
)  # fmt: skip


def read_outline(value: Any, arrays: Sequence[Array]) -> Outline:
    """The outline of plain data. Raises Refused."""
    read = _OUTLINE(value, arrays)
    for one in fields(Outline):
        if one.name not in read:
            raise Refused(f"an outline without {one.name}")
    try:
        names = read["names"].decode()
    except UnicodeDecodeError:
        raise Refused("names that are no text") from None
    read["names"] = names.split("\n") if names else []
    _check_prims(read)
    count = len(read["names"])
    for name, kind in (
        ("attributes", Attribute), ("relationships", Relationship), ("variants", Variants),
    ):  # fmt: skip
        read[name] = [kind(*entry) for entry in read[name]]
    for one in (*read["attributes"], *read["relationships"], *read["variants"]):
        if one.prim >= count:
            raise Refused("something of a prim that there is none of")
    if any(prim >= count for prim, _ in read["counts"]):
        raise Refused("something of a prim that there is none of")
    for one in read["attributes"]:
        _check_value(one.type_name, one.value)
    if set(read["facts"]) & _NO_FACTS:
        raise Refused("layers in an outline")
    return Outline(**read)


_NO_FACTS = {"subLayers", "subLayerOffsets", "customLayerData", "layerRelocates", "primChildren"}


def _check_prims(read: dict[str, Any]) -> None:
    """That columns are of one length, and numbers in them of what is there."""
    names, count = read["names"], len(read["names"])
    if count > MOST_PRIMS:
        raise Refused(f"{count:,} prims")
    columns = ("parents", "kind", "specifier", "hidden", "prototype")
    if any(len(read[name]) != count for name in columns):
        raise Refused("columns of an outline that differ in length")
    is_valid = Sdf.Path.IsValidIdentifier
    if not all(map(is_valid, set(names))):
        raise Refused("something for the name of a prim")
    parents: Ids = read["parents"]
    if np.any((parents >= np.arange(count, dtype=np.uint32)) & (parents != NOTHING)):
        raise Refused("prims that are in none before them")
    if np.any(read["kind"] >= len(read["kinds"])):
        raise Refused("a kind of prims that there is none of")
    if np.any(read["specifier"] >= len(SPECIFIERS)):
        raise Refused("a specifier that there is none of")
    tops: Ids = read["prototypes"]
    if np.any(tops >= count) or len(np.unique(tops)) != len(tops):
        raise Refused("prototypes that are no prims")
    if np.any(parents[tops] != NOTHING):
        raise Refused("prototypes that are in other prims")
    instances: Ids = read["prototype"]
    if np.any((instances >= len(tops)) & (instances != NOTHING)):
        raise Refused("instances of what there is none of")
    if np.any(instances[tops] != NOTHING):
        raise Refused("prototypes that are instances")
    bound: Ids = read["bound"]
    if bound.shape[1] != 2 or np.any(bound[:, 0] >= count):
        raise Refused("bindings of prims that there are none of")
    if np.any(bound[:, 1] >= len(read["materials"])):
        raise Refused("bindings to nothing")
    _check_nesting(parents, instances, tops)


def _check_nesting(parents: Ids, instances: Ids, tops: Ids) -> None:
    """That prims stand in no more than so many others, instances and all."""
    depths: list[int] = []
    within: list[int] = []  # the root that each is below
    inside: dict[int, list[tuple[int, int]]] = {}  # root: depth and prototype of its instances
    for i, (parent, prototype) in enumerate(zip(parents.tolist(), instances.tolist(), strict=True)):
        depths.append(1 if parent == NOTHING else depths[parent] + 1)
        within.append(i if parent == NOTHING else within[parent])
        if depths[i] > MOST_NESTING:
            raise Refused("prims that are nested too deep")
        if prototype != NOTHING:
            inside.setdefault(within[i], []).append((depths[i], prototype))
    deepest = [0] * len(tops)
    number_of = {top: i for i, top in enumerate(tops.tolist())}
    for depth, top in zip(depths, within, strict=True):
        if top in number_of:
            deepest[number_of[top]] = max(deepest[number_of[top]], depth)
    # Where a prototype is in itself, this does not come to rest.
    for _ in range(MOST_NESTING):
        before = list(deepest)
        for top, found in inside.items():
            most = max(depth + before[prototype] for depth, prototype in found)
            if most > MOST_NESTING:
                raise Refused("instances that are nested too deep")
            if top in number_of:
                deepest[number_of[top]] = max(deepest[number_of[top]], most)
        if deepest == before:
            return
    raise Refused("instances that are nested too deep")


def _check_value(type_name: str, value: Any) -> None:
    """That a value is of a type. Raises Refused."""
    if value is None:
        return
    if type_name.endswith("[]"):
        if not isinstance(value, list) or len(value) > MOST_VALUES:
            raise Refused(f"something for values of type {type_name}")
        for one in value:
            if one is None:
                raise Refused(f"something for values of type {type_name}")
            _check_value(type_name[:-2], one)
        return
    if not _is_value(type_name, value):
        raise Refused(f"something for a value of type {type_name}")


def _is_value(type_name: str, value: Any) -> bool:
    if type_name in MATRICES:
        return _is_row(value, MATRICES[type_name] ** 2, FLOATS)
    if type_name in ROWS:
        size = int("".join(c for c in type_name if c.isdigit()))
        return _is_row(value, size, ROWS[type_name])
    if type_name == "bool":
        return type(value) is bool
    if type_name == "asset" or type_name in TEXTS:
        return isinstance(value, str) and _is_short(value)
    return _is_number(value, INTEGERS if type_name in INTEGERS else FLOATS)


def _is_row(value: Any, size: int, of: tuple[str, ...]) -> bool:
    return isinstance(value, list) and len(value) == size and all(_is_number(v, of) for v in value)


def _is_number(value: Any, of: tuple[str, ...]) -> bool:
    if of == INTEGERS:
        return type(value) is int and abs(value) < 1 << 63
    try:
        number(value, ())
    except Refused:
        return False
    return True


def digest(outline: Outline) -> str:
    """What tells outlines that differ apart."""
    found = hashlib.sha256()
    for one in fields(outline):
        value = getattr(outline, one.name)
        found.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    return found.hexdigest()
