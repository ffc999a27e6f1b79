# SPDX-License-Identifier: Apache-2.0
"""Shader networks: finds the source of an input and reads values, colours and file paths."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.graphs.values import Value, is_constant
from wavecomb.usd.materials.colour_space import canonical, convert_colour
from wavecomb.usd.stage.report import LoadReport

Colour = tuple[float, float, float]

MAX_DEPTH = 32
"""Longest chain of connected shaders; longer chains are treated as cycles."""

UDIM = "<UDIM>"
_SMALL_UDIM = "<udim>"
_NO_ID = "a shader without info:id"


@dataclass(frozen=True)
class Source:
    """The source of an input's value, either a shader's output or an attribute with a value.

    Attributes:
        shader: Shader to which the input is connected; None if the source is an attribute.
        output: Name of the shader's output.
        value: Value of the attribute; None if the source is a shader.
        attribute: Attribute that holds the value.
    """

    shader: UsdShade.Shader | None = None
    output: str = ""
    value: Any = None
    attribute: Usd.Attribute | None = None

    @property
    def is_value(self) -> bool:
        """Whether the source is a plain value without a shader."""
        return self.value is not None


def source_of(shader: UsdShade.Shader, name: str, time: Usd.TimeCode) -> Source | None:
    """Returns the source of an input; None if the input is not set or its connection is invalid.

    Connections to inputs of other shaders are followed, whereas UsdShade follows only connections
    to inputs of containers.
    """
    shader_input = shader.GetInput(name)
    return _source_of(shader_input, time, MAX_DEPTH) if shader_input else None


def _source_of(shader_input: UsdShade.Input, time: Usd.TimeCode, depth: int) -> Source | None:
    for attribute in UsdShade.Utils.GetValueProducingAttributes(shader_input):
        if UsdShade.Output.IsOutput(attribute):
            node = UsdShade.Shader(attribute.GetPrim())
            if node:
                return Source(shader=node, output=UsdShade.Output(attribute).GetBaseName())
            continue
        value = attribute.Get(time)
        if value is not None:
            return Source(value=value, attribute=attribute)
    for path in shader_input.GetAttr().GetConnections() if depth else ():
        attribute = shader_input.GetAttr().GetStage().GetAttributeAtPath(path)
        if UsdShade.Input.IsInput(attribute):
            source = _source_of(UsdShade.Input(attribute), time, depth - 1)
            if source is not None:
                return source
    value = shader_input.Get(time)
    return None if value is None else Source(value=value, attribute=shader_input.GetAttr())


def value_of(shader: UsdShade.Shader, name: str, time: Usd.TimeCode, default: Any = None) -> Any:
    """Returns the constant value of an input, or the default."""
    source = source_of(shader, name, time)
    return source.value if source is not None and source.is_value else default


def layer_of_value(attribute: Usd.Attribute | None) -> Sdf.Layer | None:
    """Returns the layer with an attribute's strongest value, to which relative paths refer.

    Layers whose stronger opinions have only metadata or a connection are skipped.
    """
    for spec in attribute.GetPropertyStack() if attribute else []:
        has_default = spec.HasDefaultValue() and not isinstance(spec.default, Sdf.ValueBlock)
        if has_default or spec.layer.GetNumTimeSamplesForPath(spec.path):
            return spec.layer
    return None


def shader_id(shader: UsdShade.Shader) -> str:
    """Returns the ``info:id`` of a shader, or an empty string."""
    return str(shader.GetIdAttr().Get() or "") if shader else ""


def number(value: Any, default: float) -> float:
    """Returns a number or the first component of a vector; the default if not finite."""
    try:
        result = float(value[0]) if hasattr(value, "__getitem__") else float(value)
    except (TypeError, ValueError, IndexError, OverflowError):
        return default
    return result if result - result == 0 else default


def word(value: Any, default: str = "") -> str:
    """Returns a token or string as a string, or the default for a value of another type."""
    return value if isinstance(value, str) else default


def pair(value: Any, default: tuple[float, float]) -> tuple[float, float]:
    """Returns the first two components of a value, or the default unless both are finite."""
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) < 2:
        return default
    return number(value[0], default[0]), number(value[1], default[1])


def colour(value: Any, default: tuple[float, float, float]) -> tuple[float, float, float]:
    """Converts a value to three finite floats; a single number becomes grey."""
    try:
        if hasattr(value, "__len__"):
            r, g, b = (float(value[i]) for i in range(3))
        else:
            r = g = b = float(value)
    except (TypeError, ValueError, IndexError):
        return default
    return (r, g, b) if (r - r) + (g - g) + (b - b) == 0 else default


# ---- colour spaces -------------------------------------------------------------------------------


def space_of(attribute: Usd.Attribute | None) -> str:
    """Returns the colour space of an attribute, authored or inherited, or an empty string.

    The colour space of an ancestor applies to colour values only, not to files.
    """
    if not attribute:
        return ""
    if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset or attribute.HasColorSpace():
        return str(attribute.GetColorSpace())
    # USD's own search ignores colour space names that it does not know, such as srgb_texture.
    prim = attribute.GetPrim()
    while prim and not prim.IsPseudoRoot():
        if prim.HasAPI(Usd.ColorSpaceAPI):
            name = Usd.ColorSpaceAPI(prim).GetColorSpaceNameAttr().Get()
            if name:
                return str(name)
        prim = prim.GetParent()
    return ""


def linear_colour(colour: Colour, attribute: Usd.Attribute | None) -> Colour:
    """Converts an attribute's colour to linear Rec.709.

    Raises:
        ValueError: OpenColorIO does not know the colour space.
    """
    name = space_of(attribute)
    if not name:
        return colour
    space = canonical(name)
    if space is None:
        raise ValueError(f"colour space {name}")
    return convert_colour(colour, space, "rec709")


def read_colour(
    colour: Colour, attribute: Usd.Attribute | None, report: LoadReport, place: object
) -> Colour:
    """Converts an attribute's colour to linear Rec.709; reports an unknown colour space."""
    try:
        return linear_colour(colour, attribute)
    except ValueError as error:
        report.missing(f"{error} (read as linear)", place)
        return colour


def holds_colour(attribute: Usd.Attribute | None) -> bool:
    """Returns whether the attribute's type has the colour role and thus a colour space."""
    return attribute is not None and attribute.GetTypeName().role == "Color"


# ---- outputs of materials ------------------------------------------------------------------------


def surface_outputs(material: UsdShade.Material) -> list[tuple[str, UsdShade.Shader]]:
    """Returns names and shaders of a material's connected surface outputs, in stage order.

    The result includes outputs for other renderers, such as ``outputs:ri:surface``.
    """
    return [
        (str(output.GetFullName()), shader)
        for output in material.GetSurfaceOutputs()
        for attribute in UsdShade.Utils.GetValueProducingAttributes(output)
        if (shader := UsdShade.Shader(attribute.GetPrim()))
    ]


def shader_name(shader: UsdShade.Shader) -> str:
    """Returns the ``info:id`` of a shader, or the name of its source asset."""
    if name := shader_id(shader):
        return name
    authored = {one.GetName(): one for one in shader.GetPrim().GetAuthoredAttributes()}
    for name, attribute in authored.items():
        if name.endswith(":sourceAsset:subIdentifier"):
            return word(attribute.Get()) or _NO_ID
    for name, attribute in authored.items():
        value = attribute.Get() if name.endswith(":sourceAsset") else None
        if isinstance(value, Sdf.AssetPath):
            return str(value.path)
    return _NO_ID


# ---- values for each object ----------------------------------------------------------------------


class InputValues:
    """Reads shader inputs that have one value per object, such as the scale of a texture.

    Values may come from node graphs, interface inputs, primvar readers and constant nodes.

    Attributes:
        reads: Names of the primvars of the object that were read, in order of use.
    """

    def __init__(
        self,
        time: Usd.TimeCode,
        report: LoadReport,
        node_value: Callable[[UsdShade.Shader, str, str], Value | None],
        primvars: Mapping[str, Any] | None = None,
    ) -> None:
        """``node_value`` evaluates MaterialX nodes (``Networks.node``).

        ``primvars`` has values of the object's primvars; readers of other primvars return their
        fallback.
        """
        self.reads: dict[str, None] = {}
        self._time = time
        self._report = report
        self._node_value = node_value
        self._primvars = primvars or {}
        self._depth = 0

    def of(
        self, shader: UsdShade.Shader, name: str, default: Any = None, *, by_object: bool = True
    ) -> Any:
        """Returns the value of an input, or the default if the input is not set.

        Reports inputs that vary over the surface and, unless ``by_object`` is set, inputs that read
        a primvar.
        """
        source = source_of(shader, name, self._time)
        if source is None:
            return default
        if source.shader is None:
            return source.value
        node, identifier = source.shader, shader_id(source.shader)
        if identifier.startswith("UsdPrimvarReader_") and self._depth < MAX_DEPTH:
            if by_object:
                return self._read(node, default)
        elif identifier.startswith("ND_"):
            value = self._node_value(node, source.output, "number")
            if value is not None and is_constant(value):
                numbers = tuple(float(part) for part in value)  # type: ignore[arg-type]
                return numbers if len(numbers) > 1 else numbers[0]
        by = identifier or "a node without info:id"
        what = f"{shader_id(shader)} input {name} by {by} (its default)"
        self._report.missing(what, shader.GetPath())
        return default

    def _read(self, reader: UsdShade.Shader, default: Any) -> Any:
        """Returns the value of a primvar reader, whose inputs may be connected."""
        self._depth += 1
        try:
            name = self.of(reader, "varname", "")
            if isinstance(name, str) and name:
                self.reads[name] = None
                if name in self._primvars:
                    return self._primvars[name]
            return self.of(reader, "fallback", default)
        finally:
            self._depth -= 1


# ---- files ---------------------------------------------------------------------------------------


def asset_file(value: Any, attribute: Usd.Attribute | None) -> str:
    """Returns the resolved file of an asset value, or the authored path if it does not resolve.

    For a UDIM texture, the result is the pattern that contains ``<UDIM>``.
    """
    if not isinstance(value, Sdf.AssetPath):
        return _file_of_text(str(value or ""), attribute)
    # Arnold writes the wrap mode token in lower case.
    if _SMALL_UDIM in value.path:
        return _file_of_text(value.path, attribute)
    path = value.resolvedPath or value.path
    if UDIM not in path and UDIM not in value.path:
        return path
    if UDIM in value.resolvedPath:
        return value.resolvedPath
    layer = layer_of_value(attribute)
    found = UsdShade.UdimUtils.ResolveUdimPath(value.path, layer)
    if not found and layer is not None and ":" not in value.path:
        # No tile of the UDIM pattern exists; the absolute pattern is used in messages. Of the
        # folders that a resolver searches for "tex/a.png", the one next to the layer is the first.
        is_search_path = not value.path.startswith((".", "/"))
        return str(layer.ComputeAbsolutePath("./" * is_search_path + value.path))
    return found or value.path


def _file_of_text(name: str, attribute: Usd.Attribute | None) -> str:
    """Returns the path of the file that a string value names.

    Relative paths refer to the layer in which the string is authored.
    """
    name = name.replace(_SMALL_UDIM, UDIM)
    layer = layer_of_value(attribute)
    return str(layer.ComputeAbsolutePath(name)) if name and layer is not None else name


def tile_files(pattern: str) -> list[tuple[int, str]]:
    """Returns numbers (1001 to 1100) and files of the existing tiles of a UDIM pattern."""
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(pattern, None)
    return [(int(number), path) for path, number in found]


def missing_tiles(pattern: str) -> str:
    """Returns the reason why a UDIM pattern has no tiles; the reason names their folder."""
    folder, name = os.path.split(pattern)
    if folder and not os.path.isdir(folder):
        return f"the folder of its tiles, {folder}, does not exist"
    return f"no tile {name} is in the folder {folder or os.curdir}"


def image_files(material: Usd.Prim, time: Usd.TimeCode) -> Iterator[str]:
    """Yields files that shaders of a material name, which are probably images of the material."""
    for prim in _each_once(material):
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
                value = attribute.Get(time)
                if value is None:
                    continue
                if UDIM in value.path:
                    yield from (path for _, path in tile_files(asset_file(value, attribute)))
                elif value.resolvedPath:
                    yield value.resolvedPath


def _each_once(top: Usd.Prim) -> Iterator[Usd.Prim]:
    """Yields a prim and its descendants; prims inside instances are visited once per prototype."""
    tops = [top.GetPrimInPrototype() if top.IsInstanceProxy() else top]
    known: set[Sdf.Path] = set()
    while tops:
        for prim in Usd.PrimRange(tops.pop()):
            yield prim
            if prim.IsInstance() and (prototype := prim.GetPrototype()).GetPath() not in known:
                known.add(prototype.GetPath())
                tops.append(prototype)
