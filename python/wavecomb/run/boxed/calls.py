# SPDX-License-Identifier: Apache-2.0
"""The calls that may come from a sandbox, with what each takes: one table for both sides.

A kind reads what JSON holds in place of a value, and the arrays that came with it; it raises
``Refused`` where that is something else. What values may be, ids before all, the core checks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from wavecomb.camera_table import camera_parameters
from wavecomb.light_table import MESH, LightParameter, light_parameters, of_kind
from wavecomb.material_table import material_parameters
from wavecomb.run.boxed.wire import Array, Refused

Kind = Callable[[Any, Sequence[Array]], Any]

_WHOLE = 1 << 32


def text(value: Any, arrays: Sequence[Array]) -> str:
    """A name."""
    if not isinstance(value, str):
        raise Refused("something for a text")
    return value


def number(value: Any, arrays: Sequence[Array]) -> float:
    """A number, not finite ones too: the core knows where they may be."""
    if type(value) not in (int, float) or (abs(value) > 1e308 and type(value) is int):
        raise Refused("something for a number")
    return float(value)


def whole(value: Any, arrays: Sequence[Array]) -> int:
    """An id or a count: 0 to 2^32 - 1."""
    if type(value) is not int or not 0 <= value < _WHOLE:
        raise Refused("something for a whole number")
    return value


def flag(value: Any, arrays: Sequence[Array]) -> bool:
    """True or False."""
    if type(value) is not bool:
        raise Refused("something for a switch")
    return value


def maybe(kind: Kind) -> Kind:
    """A value or None."""
    return lambda value, arrays: None if value is None else kind(value, arrays)


def one_of(*kinds: Kind) -> Kind:
    """The first kind that a value is of."""

    def read(value: Any, arrays: Sequence[Array]) -> Any:
        for kind in kinds:
            try:
                return kind(value, arrays)
            except Refused as error:
                last = error
        raise last

    return read


def many(kind: Kind) -> Kind:
    """A list of values of one kind."""

    def read(value: Any, arrays: Sequence[Array]) -> list[Any]:
        if not isinstance(value, list):
            raise Refused("something for a list")
        return [kind(entry, arrays) for entry in value]

    return read


def row(*kinds: Kind) -> Kind:
    """A tuple of values of these kinds."""

    def read(value: Any, arrays: Sequence[Array]) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != len(kinds):
            raise Refused(f"something for {len(kinds)} values")
        return tuple(kind(entry, arrays) for kind, entry in zip(kinds, value, strict=True))

    return read


def named(kind: Kind) -> Kind:
    """Values of one kind by name."""

    def read(value: Any, arrays: Sequence[Array]) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise Refused("something for values by name")
        return {key: kind(entry, arrays) for key, entry in value.items()}

    return read


def fields(**kinds: Kind) -> Kind:
    """Some of these, by name."""

    def read(value: Any, arrays: Sequence[Array]) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise Refused("something for values by name")
        return {key: _known(kinds, key)(entry, arrays) for key, entry in value.items()}

    return read


def _known(kinds: Mapping[str, Kind], name: str) -> Kind:
    if name not in kinds:
        raise Refused(f"a parameter {name[:64]!r}, which there is none of")
    return kinds[name]


def array(types: str, *dimensions: int) -> Kind:
    """An array of one of the types (as "<f4 <f8"), with so many dimensions."""

    def read(value: Any, arrays: Sequence[Array]) -> Array:
        if not isinstance(value, dict) or set(value) != {"array"}:
            raise Refused("something for an array")
        at = value["array"]
        if type(at) is not int or not 0 <= at < len(arrays):
            raise Refused("an array that did not come")
        found = arrays[at]
        if found.dtype.newbyteorder("=").str not in types.split() or found.ndim not in dimensions:
            raise Refused(f"an array of {found.dtype} with {found.ndim} dimensions")
        return found

    return read


def data(value: Any, arrays: Sequence[Array]) -> bytes:
    """Bytes."""
    return bytes(array("|u1", 1)(value, arrays).data)


COLOUR = row(number, number, number)
_FOUR = row(number, number, number, number)
_FLOATS, _IDS, _PIXELS = "<f4", "<u4", "|u1 <f2 <f4"
_MATRIX = array("<f8 <f4", 2)
_USE = fields(
    texture=whole, channel=text, scale=_FOUR, bias=_FOUR,
    uv=row(*(number,) * 6),
)  # fmt: skip
_ATTRIBUTES = named(row(text, array(_FLOATS, 2)))
_FACES: dict[str, Kind] = {
    "uvs": maybe(array(_FLOATS, 2, 3)),
    "face_materials": maybe(array(_IDS, 1)),
    "material": whole,
    "attributes": _ATTRIBUTES,
}
_SHAPE: dict[str, Kind] = {
    **_FACES,
    "name": text,
    "light_group": text,
    "asset_length": whole,
}
_VALUES: dict[str, Kind] = {
    "number": number, "colour": COLOUR, "flag": flag, "choice": text, "id": maybe(whole),
    "transforms": maybe(array("<f8", 3)),
}  # fmt: skip

_CAMERA_VALUES: dict[str, Kind] = {
    "number": number, "choice": text, "four": _FOUR, "planes": many(_FOUR),
}  # fmt: skip


CAMERA: dict[str, Kind] = {
    **{name: _CAMERA_VALUES[row.kind] for name, row in camera_parameters().items()},
    "motion": maybe(array("<f8", 3)),
}
"""What a camera is told beside its place."""


def _light(row: LightParameter) -> Kind:
    """What a parameter of a light takes."""
    return text if row.refers == "group" else _VALUES[row.kind]


_LIGHT: dict[str, Kind] = {
    "name": text,
    **{name: _light(row) for name, row in light_parameters().items() if row.kind != "choice"},
}
_MESH_LIGHT: dict[str, Kind] = {
    "name": text,
    **{row.name: _light(row) for row in of_kind(MESH) if row.kind != "choice"},
}


@dataclass(frozen=True)
class Call:
    """A method of ``SceneBuilder``.

    Attributes:
        first: Arguments that have to be there, in their order.
        more: Others, by name.
        counts: What its ids count; "": it gives none.
        keeps: Whether the scene keeps the arrays as they are.
    """

    first: dict[str, Kind]
    more: dict[str, Kind] = field(default_factory=dict)
    counts: str = ""
    keeps: bool = False

    def read(self, body: Mapping[str, Any], arrays: Sequence[Array]) -> dict[str, Any]:
        """Arguments by name. Raises Refused."""
        missing = self.first.keys() - body.keys()
        if missing:
            raise Refused(f"a call without {min(missing)}")
        kinds = {**self.first, **self.more}
        return {name: _known(kinds, name)(value, arrays) for name, value in body.items()}


GRIDS = ("density", "color", "emission_grid", "velocity")
"""Arguments of ``add_volume`` that are grids: numbers of ``make_volume_grid``."""

_MESH: dict[str, Kind] = {
    "positions": array(_FLOATS, 2, 3), "indices": array("<u4 <i4", 2),
}  # fmt: skip

CALLS: dict[str, Call] = {
    "add_texture": Call(
        {"pixels": array(_PIXELS, 2, 3), "srgb": flag},
        {"wrap_s": text, "wrap_t": text, "name": text},
        "textures",
    ),
    "share_texture": Call({"scene": whole, "texture": whole}, {}, "textures"),
    "add_tiles": Call({"name": text, "tiles": many(row(whole, whole)), "missing": _FOUR}, {},
                      "textures"),
    "add_graph": Call(
        {
            "ops": data, "constants": many(number), "images": many(row(whole, number)),
            "outputs": many(row(whole, whole)),
        },
        {"attributes": many(text)},
        "graphs",
    ),
    "add_material": Call(
        {"program": text},
        {
            "name": text,
            **{name: _VALUES[row.kind] for name, row in material_parameters().items()},
            "openpbr": named(one_of(flag, number, COLOUR)), "textures": named(_USE),
            "graph": maybe(whole), "opacity_graph": maybe(whole), "emission_graph": maybe(whole),
        },
        "materials",
    ),
    "add_mesh": Call(
        _MESH,
        {"normals": maybe(array(_FLOATS, 2, 3, 4)), **_SHAPE, "mesh_light": maybe(whole)},
        "meshes",
        keeps=True,
    ),
    "add_meshes": Call(
        {
            "positions": array(_FLOATS, 2), "indices": array(_IDS, 2),
            **dict.fromkeys(
                ("points", "triangles", "materials", "asset_lengths", "groups"), array(_IDS, 1)
            ),
            "names": many(text),
        },
        {},
        "meshes",
        keeps=True,
    ),
    "replace_mesh": Call(
        {"mesh": whole, **_MESH}, {"normals": maybe(array(_FLOATS, 2, 3, 4)), **_FACES}, keeps=True
    ),
    "add_curves": Call(
        {
            "kind": text, "positions": array(_FLOATS, 2, 3), "segments": array(_IDS, 1),
            "radii": array(_FLOATS, 1),
        },
        {"normals": maybe(array(_FLOATS, 2, 3)), **_SHAPE},
        "meshes",
        keeps=True,
    ),
    "add_points": Call(
        {"positions": array(_FLOATS, 2, 3), "radii": array(_FLOATS, 1)},
        _SHAPE,
        "meshes",
        keeps=True,
    ),
    "add_splats": Call(
        {
            "positions": array(_FLOATS, 2), "scales": array(_FLOATS, 2),
            "orientations": array(_FLOATS, 2), "opacities": array(_FLOATS, 1),
            "harmonics": array(_FLOATS, 3),
        },
        {"material": whole, "name": text, "light_group": text, "asset_length": whole},
        "meshes",
        keeps=True,
    ),
    "add_group": Call({}, {"name": text, "root": text}, "groups"),
    "add_to_group": Call({"group": whole, "mesh": whole}),
    "add_instances": Call(
        {"parent": whole, "child": whole, "transforms": array("<f8 <f4", 3)},
        {
            "materials": maybe(array(_IDS, 1)), "names": maybe(many(text)),
            "numbers": maybe(array(_IDS, 1)), "asset_lengths": maybe(many(whole)),
            "motion": maybe(array("<f8", 4)),
        },
    ),
    "add_light": Call({"kind": text, "transform": _MATRIX}, _LIGHT, "lights"),
    "add_mesh_light": Call(
        {"transform": _MATRIX, "material_sync": text}, _MESH_LIGHT, "mesh lights"
    ),
    "make_volume_grid": Call(
        {
            "origins": array("<i4", 2), "values": array("<f2 <f4", 4, 5),
            "index_to_object": _MATRIX, "background": number, "name": text,
        },
        {"is_signed": flag},
        "volume grids",
    ),
    "add_volume": Call(
        {"to_world": _MATRIX},
        {
            **dict.fromkeys(GRIDS, maybe(whole)),
            "bounds": row(COLOUR, COLOUR), "anisotropy": number, "name": text,
            "seconds": row(number, number),
            **dict.fromkeys(("extinction", "albedo", "emission"), COLOUR),
        },
        "volumes",
    ),
    "add_geometry_set": Call({"rules": named(text)}, {}, "sets"),
    "add_visibility": Call({"path": text, "rays": named(flag)}),
    "add_ies": Call(
        {"vertical": many(number), "horizontal": many(number), "candela": array(_FLOATS, 2)},
        {},
        "profiles",
    ),
    "add_light_filter": Call(
        {
            "transform": _MATRIX, "distance": number, "sides": row(*[COLOUR] * 4),
            "picture_u": COLOUR, "picture_v": COLOUR, "texture": maybe(whole), "decay": _FOUR,
            "density": number, "next": maybe(whole),
        },
        {},
        "filters",
    ),
    "set_camera": Call({"transform": _MATRIX}, CAMERA),
}  # fmt: skip
"""Methods of ``SceneBuilder`` that a sandbox may ask for."""
