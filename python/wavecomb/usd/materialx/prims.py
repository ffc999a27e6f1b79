# SPDX-License-Identifier: Apache-2.0
"""Creates prims with inputs and outputs in the layer of a MaterialX document."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from pxr import Gf, Sdf, Tf, Vt

from wavecomb.usd.materialx.files import image_file
from wavecomb.usd.stage.report import LoadReport

ReportSkipped = Callable[[Any, str], None]
"""Callback that receives an element of the document and a message about the element."""

TERMINALS = {
    "surfaceshader": "surface",
    "displacementshader": "displacement",
    "volumeshader": "volume",
    "lightshader": "light",
}
"""Names of a USD material's outputs by MaterialX shader type."""

_PLAIN_SPACES = ("", "none", "lin_rec709", "lin_rec709_scene")
"""Colour spaces that are not authored in the layer, since they are the default."""


def valid(name: str) -> str:
    """Converts a MaterialX name to a valid USD name; replaces ``:`` by two underscores."""
    return str(Tf.MakeValidIdentifier(name.replace(":", "__")))


def child(path: Sdf.Path, name: str) -> Sdf.Path:
    """Returns the path of a child prim with a MaterialX name."""
    return path.AppendChild(valid(name))


class Prims:
    """Writer of prims into a layer.

    Attributes:
        layer: Layer that receives the prims.
        file: File of the MaterialX document, to which image names are relative.
        tell: Callback for elements that cannot be written as prims.
        report: Report for notes.
    """

    def __init__(
        self, layer: Sdf.Layer, file: str, tell: ReportSkipped, report: LoadReport
    ) -> None:
        self.report = report
        self.layer = layer
        self.file = file
        self.report_skipped = tell

    def define(self, path: Sdf.Path, kind: str = "") -> Sdf.PrimSpec:
        """Defines a prim and its ancestors unless they exist; returns the prim."""
        spec = Sdf.CreatePrimInLayer(self.layer, path)
        for prefix in path.GetPrefixes():
            self.layer.GetPrimAtPath(prefix).specifier = Sdf.SpecifierDef
        if kind:
            spec.typeName = kind
        return spec

    def refer(self, path: Sdf.Path, target: Sdf.Path) -> Sdf.PrimSpec:
        """Defines a prim with a reference to another prim of the layer, added only once."""
        spec = self.define(path)
        reference = Sdf.Reference("", target)
        if reference not in list(spec.referenceList.prependedItems):
            spec.referenceList.Prepend(reference)
        return spec

    def port(self, prim: Sdf.PrimSpec, kind: str, name: str, type_name: str) -> Sdf.AttributeSpec:
        """Returns an input or output of a prim; creates the attribute if it does not exist.

        Args:
            prim: The prim that has the input or output.
            kind: "inputs" or "outputs".
            name: MaterialX name of the input or output.
            type_name: MaterialX type of the input or output.
        """
        full = f"{kind}:{valid(name)}"
        known = prim.attributes.get(full)
        if known is not None:
            return known
        usd = usd_type(type_name)
        spec = Sdf.AttributeSpec(prim, full, usd or Sdf.ValueTypeNames.Token)
        if usd is None and type_name not in TERMINALS:
            spec.SetInfo("renderType", type_name)
        return spec

    def identify(self, prim: Sdf.PrimSpec, identifier: str) -> None:
        """Writes ``info:id`` of a shader unless it is authored."""
        if "info:id" not in prim.attributes:
            Sdf.AttributeSpec(
                prim, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform
            ).default = identifier

    def give(self, port: Sdf.AttributeSpec, element: Any, *, makes_colour: bool = True) -> None:
        """Copies the value and the colour space of an element to an input.

        Args:
            port: The USD input to write.
            element: The MaterialX input to copy.
            makes_colour: For file names, whether the image holds colours.
        """
        kind, text = element.getType(), element.getValueString()
        if not text:
            return
        if port.typeName != (usd_type(kind) or Sdf.ValueTypeNames.Token):
            self.report_skipped(
                element, f"MaterialX value of type {kind} for {port.typeName} (left out)"
            )
            return
        space = element.getActiveColorSpace()
        if kind == "filename":
            text, is_bare = image_file(element, self.file)
            if is_bare:
                self.report.note("MaterialX fileprefix is not a folder (left out)", self.file)
            # Do not apply a document-wide linear Rec. 709 colour space to images, since OpenUSD
            # does not either.
            is_said = space not in _PLAIN_SPACES or element.hasColorSpace()
            if makes_colour and is_said:
                port.SetInfo("colorSpace", "raw" if space == "none" else space)
        elif kind in ("color3", "color4") and (
            space not in _PLAIN_SPACES or (space and element.hasColorSpace())
        ):
            port.SetInfo("colorSpace", "raw" if space == "none" else space)
        try:
            port.default = usd_value(text, kind)
        except ValueError as error:
            self.report_skipped(element, f"MaterialX value {error} (left out)")


def connect(port: Sdf.AttributeSpec, source: Sdf.Path) -> None:
    """Connects an input or output to a source."""
    port.connectionPathList.explicitItems = [source]


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
    """Returns the USD type of a MaterialX type; None for types that are written as tokens."""
    known = _TYPES.get(name)
    return None if known is None else known[0]


def usd_value(text: str, name: str) -> Any:
    """Parses a value of a MaterialX type.

    Raises:
        ValueError: The text is invalid.
    """
    known = _TYPES.get(name)
    if known is None:
        return text
    try:
        return known[1](text)
    except (ValueError, KeyError, OverflowError):
        raise ValueError(f"{text[:40]!r} is no {name}") from None
