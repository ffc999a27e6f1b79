# SPDX-License-Identifier: Apache-2.0
"""Inputs of MaterialX surface shaders for user interfaces: groups, names, defaults and ranges.

All values come from MaterialX's standard node definitions.
"""

from __future__ import annotations

import functools
import math
from typing import Any

from wavecomb.usd.materials.surface import COLOUR, NUMBER, SWITCH, InputDefinition
from wavecomb.usd.materialx.surfaces.openpbr import MODELS, LayerInputs, layers_of

_KINDS = {"float": NUMBER, "color3": COLOUR, "boolean": SWITCH}
_MAX_VALUE = 1e6
"""Maximum of an input's value if MaterialX does not specify one."""

_SHORT = (("index of refraction", "ior"), ("diffuse roughness", "roughness"))
_SLIDERS = {"emissive_strength": 10.0, "attenuation_distance": 10.0, "thickness": 1.0}
"""Upper ends of sliders if MaterialX does not specify them."""


class _ReadInputs(LayerInputs):
    """Fake shader whose inputs are all 1; it records the inputs that ``layers_of`` reads."""

    def __init__(self) -> None:
        self.read: set[str] = set()

    def constant(self, name: str, parameter: str) -> Any:
        self.read.add(name)
        return 1.0

    def ignored(self, *names: str) -> None:
        pass

    def approximated(self, what: str) -> None:
        pass


@functools.cache
def read_inputs(model: str) -> frozenset[str]:
    """Returns the inputs of a shading model that Wavecomb uses, except normals."""
    names = _ReadInputs()
    layers_of(model, names)
    for row in MODELS[model].textured.values():
        names.read |= {name for name in (row.input, row.weight[0]) if name}
    return frozenset(names.read)


@functools.cache
def definitions(model: str, identifier: str = "") -> dict[str, InputDefinition]:
    """Returns the inputs of a shading model that Wavecomb reads, by name, in MaterialX's order.

    Args:
        model: A key of ``MODELS``.
        identifier: Id of the shader, which may refer to an older version.
    """
    found = _documented(model)
    definition = found.getNodeDef(identifier) or found.getNodeDef(f"ND_{model}_surfaceshader")
    read, out = read_inputs(model), {}
    for one in definition.getActiveInputs():
        if one.getName() in read and one.getType() in _KINDS:
            out[one.getName()] = _definition(one, model)
    return out


@functools.cache
def _documented(model: str) -> Any:
    """Returns the MaterialX document that defines a shading model."""
    import MaterialX as mx

    document = mx.createDocument()
    file = mx.getDefaultDataSearchPath().find(f"libraries/bxdf/{model}.mtlx")
    mx.readFromXmlFile(document, file.asString())
    return document


def _definition(one: Any, model: str) -> InputDefinition:
    name, kind = one.getName(), _KINDS[one.getType()]
    numbers = _numbers(one.getValueString())
    default: Any
    if kind == SWITCH:
        default = one.getValueString() == "true"
    elif kind == COLOUR and _is_number(model, name):
        kind, default = NUMBER, numbers[0]
    elif kind == COLOUR:
        default = tuple(numbers)
    else:
        default = numbers[0] if numbers else 0.0
    group = one.getAttribute("uifolder") or "Surface"

    def limit(attribute: str, otherwise: float) -> float:
        values = _numbers(one.getAttribute(attribute))
        return values[0] if values else otherwise

    low, high = limit("uimin", 0.0), limit("uimax", 100.0 if "ior" in name.lower() else _MAX_VALUE)
    shown = 1.0 if kind == COLOUR else _SLIDERS.get(name, 1.0)
    soft_low = limit("uisoftmin", low)
    soft_high = limit("uisoftmax", high if one.getAttribute("uimax") else shown)
    if name.startswith("emiss") and kind == COLOUR:
        # Emission colours often exceed the maximum that MaterialX suggests for its user interface.
        high = _MAX_VALUE
    return InputDefinition(
        name, group, _label(one.getAttribute("uiname") or name, group), kind, one.getType(),
        default, low, high, soft_low, soft_high,
    )  # fmt: skip


def _is_number(model: str, name: str) -> bool:
    """Returns whether Wavecomb reads a colour input as one number, as in the case of opacity."""
    return MODELS[model].textured["opacity"].input == name


def _label(name: str, group: str) -> str:
    """Returns the name of an input in lower case without the name of its group.

    >>> _label("Coat Index of Refraction", "Coat"), _label("Base", "Base"), _label("Sheen", "Sheen")
    ('ior', 'weight', 'weight')
    """
    words = name.lower()
    if words == group.lower():
        return words if words == "alpha" else "weight"
    words = words.removeprefix(group.lower()).strip()
    return dict(_SHORT).get(words, words)


def _numbers(text: str) -> list[float]:
    values = [float(word) for word in text.replace(",", " ").split() if _is_float(word)]
    return [value for value in values if math.isfinite(value)]


def _is_float(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
