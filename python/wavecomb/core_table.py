# SPDX-License-Identifier: Apache-2.0
"""Parameter tables of the core as rows: materials, programs, lights and cameras."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Protocol, TypeVar


class _Named(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Named)


def rows_by_name(row: type[R], given: Iterable[Mapping[str, Any]]) -> Mapping[str, R]:
    """Returns the rows of a table by name, in the table's order.

    Args:
        row: Class of a row.
        given: Result of ``_core.setting_table()`` or a similar function. Float32 values of the
            table become the shortest decimal numbers that represent them, such as 0.53. Whole
            numbers stay exact.
    """

    def plain(value: Any) -> Any:
        if not isinstance(value, float) or (value.is_integer() and abs(value) < 2**53):
            return value
        return float(f"{value:.7g}")

    made = [row(**{key: plain(value) for key, value in one.items()}) for one in given]
    return MappingProxyType({one.name: one for one in made})


@dataclass(frozen=True)
class MaterialParameter:
    """A parameter of materials.

    Attributes:
        name: Keyword of ``add_material``.
        kind: "number", "colour" or "flag".
        default: Default value, the same as in UsdPreviewSurface.
        program: The only program with this parameter; "" if all materials accept it.
        least: Smallest valid value of the parameter; None means no limit.
        most: Largest number; None means no limit.
    """

    name: str
    kind: str
    default: Any
    program: str = ""
    least: float | None = None
    most: float | None = None

    @property
    def annotation(self) -> str:
        """Python type annotation for the stub _core.pyi.

        >>> material_parameters()["emission"].annotation
        'tuple[float, float, float]'
        """
        types = {"number": "float", "colour": "tuple[float, float, float]", "flag": "bool"}
        return types[self.kind]

    @property
    def attribute(self) -> str:
        """Attribute of the material prim, for parameters of a single program."""
        return f"wavecomb:{self.name}"

    def in_range(self, value: float) -> float:
        """Clamps a number to the valid range."""
        least = value if self.least is None else max(value, self.least)
        return least if self.most is None else min(least, self.most)


@dataclass(frozen=True)
class Program:
    """A shading program and the parameters that it reads.

    Attributes:
        name: Name for ``add_material``.
        inputs: Parameters that textures can drive, by their names in ``add_material``.
        reads_ior: Whether the program uses the index of refraction.
        has_more: Whether the program has parameters that UsdPreviewSurface lacks (true for
            openpbr).
    """

    name: str
    inputs: tuple[str, ...]
    reads_ior: bool
    has_more: bool

    @property
    def reads(self) -> frozenset[str]:
        """Parameters that the program shares with UsdPreviewSurface.

        >>> sorted(programs()["plastic"].reads)
        ['base_color', 'ior', 'normal', 'roughness']
        """
        more = {"ior"} if self.reads_ior else set()
        if "opacity" in self.inputs:
            more.add("opacity_threshold")
        return frozenset({*self.inputs, *more})


@cache
def material_parameters() -> Mapping[str, MaterialParameter]:
    """Returns every parameter by name, in the table's order.

    >>> material_parameters()["roughness"].default
    0.5
    """
    from wavecomb import _core

    return rows_by_name(MaterialParameter, _core.material_table())


def own_parameters(program: str) -> tuple[MaterialParameter, ...]:
    """Returns the parameters that only a given program has, in the table's order."""
    return tuple(row for row in material_parameters().values() if row.program == program)


@cache
def programs() -> Mapping[str, Program]:
    """Returns every program by name.

    >>> programs()["emissive"].inputs
    ('emission',)
    """
    from wavecomb import _core

    return rows_by_name(Program, _core.program_table())


@cache
def preview_programs() -> tuple[str, ...]:
    """Returns the programs that a UsdPreviewSurface can select.

    >>> "principled" in preview_programs(), "openpbr" in preview_programs()
    (True, False)
    """
    return tuple(name for name, program in programs().items() if not program.has_more)


MESH = "triangle"
"""Kind of mesh lights, for ``SceneBuilder.add_mesh_light``."""

EDITABLE = ("number", "colour", "flag")
"""Kinds of values that an edit can change."""


@dataclass(frozen=True)
class LightParameter:
    """A parameter of lights.

    Attributes:
        name: Keyword of ``add_light``.
        label: Label of the parameter in the window.
        help: Description with unit, one sentence.
        input: UsdLux name without "inputs:"; "" if UsdLux has no equivalent.
        group: "emission", "shape", "shaping" or "response".
        kind: "number", "colour", "flag", "choice", "id" or "transforms".
        refers: Kind of object that the parameter refers to by id ("texture", "profile", "set") or
            by name ("group").
        default: Default value; None for ids.
        least: Smallest number; None means no limit.
        most: Largest number; None means no limit.
        usual: Upper end of the slider in the window, for parameters without an upper limit.
        choices: Allowed values of a parameter of kind "choice".
        kinds: Kinds of light that have the parameter.
    """

    name: str
    label: str
    help: str
    input: str
    group: str
    kind: str
    refers: str
    default: Any
    least: float | None
    most: float | None
    usual: float
    choices: tuple[str, ...]
    kinds: tuple[str, ...]

    @property
    def annotation(self) -> str:
        """Python type annotation for the stub _core.pyi.

        >>> light_parameters()["color"].annotation, light_parameters()["ies"].annotation
        ('tuple[float, float, float]', 'int | None')
        """
        if self.refers == "group":
            return "str"
        types = {
            "number": "float", "colour": "tuple[float, float, float]", "flag": "bool",
            "choice": "str", "id": "int | None", "transforms": "NDArray[np.float64] | None",
        }  # fmt: skip
        return types[self.kind]


@cache
def light_parameters() -> Mapping[str, LightParameter]:
    """Returns every parameter by name, in the table's order.

    >>> light_parameters()["radius"].kinds
    ('disk', 'sphere', 'cylinder')
    """
    from wavecomb import _core

    return rows_by_name(LightParameter, _core.light_table())


def of_kind(kind: str) -> tuple[LightParameter, ...]:
    """Returns the parameters of a kind of light, in the table's order.

    >>> [row.name for row in of_kind("distant")][:2]
    ['color', 'angle']
    """
    return tuple(row for row in light_parameters().values() if kind in row.kinds)


@cache
def kind_of_prims() -> Mapping[str, str]:
    """Returns the kind of light by USD prim type.

    >>> kind_of_prims()["DomeLight_1"]
    'dome'
    """
    from wavecomb import _core

    return MappingProxyType({prim: kind for kind, prims in _core.light_kinds() for prim in prims})


@dataclass(frozen=True)
class CameraParameter:
    """A parameter of cameras.

    Attributes:
        name: Keyword of ``set_camera``.
        help: Description with unit, one sentence.
        kind: "number", "choice", "four" (numbers) or "planes".
        default: Default value; None if ``set_camera`` requires the parameter.
        least: Smallest number; None means no limit.
        choices: Allowed values of a parameter of kind "choice".
    """

    name: str
    help: str
    kind: str
    default: Any
    least: float | None
    choices: tuple[str, ...]

    @property
    def annotation(self) -> str:
        """Python type annotation for the stub _core.pyi.

        >>> camera_parameters()["window"].annotation
        'tuple[float, float, float, float]'
        """
        return {
            "number": "float",
            "choice": "Literal[" + ", ".join(f'"{name}"' for name in self.choices) + "]",
            "four": "tuple[float, float, float, float]",
            "planes": "Sequence[Sequence[float]]",
        }[self.kind]


@cache
def camera_parameters() -> Mapping[str, CameraParameter]:
    """Returns every parameter by name, in the table's order.

    >>> camera_parameters()["projection"].choices
    ('perspective', 'orthographic', 'latlong')
    """
    from wavecomb import _core

    return rows_by_name(CameraParameter, _core.camera_table())


def camera_defaults() -> dict[str, Any]:
    """Returns the defaults of ``set_camera`` for all optional parameters.

    >>> camera_defaults()["pixel_aspect"]
    1.0
    """
    return {
        name: row.default for name, row in camera_parameters().items() if row.default is not None
    }
