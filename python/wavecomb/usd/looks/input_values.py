# SPDX-License-Identifier: Apache-2.0
"""Values of shader inputs that are one value for each object, such as a texture's scale."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.graphs.node import is_constant
from wavecomb.usd.looks.network import MAX_DEPTH, shader_id, source_of

if TYPE_CHECKING:
    from wavecomb.usd.graphs.surface import Networks
    from wavecomb.usd.stage.report import LoadReport


class InputValues:
    """Finds such values behind node graphs, interfaces, primvar readers and constant nodes.

    Attributes:
        reads: Primvars of the object that values come from, first use first.
    """

    def __init__(
        self,
        time: Usd.TimeCode,
        report: LoadReport,
        networks: Networks,
        primvars: Mapping[str, Any] | None = None,
    ) -> None:
        """``primvars``: values of the object's primvars; others have the fallback of the reader."""
        self.reads: dict[str, None] = {}
        self._time = time
        self._report = report
        self._networks = networks
        self._primvars = primvars or {}
        self._depth = 0

    def of(
        self, shader: UsdShade.Shader, name: str, default: Any = None, *, by_object: bool = True
    ) -> Any:
        """The value of an input; the default where there is none, and listed where it varies.

        ``by_object``: whether a primvar may give it; where it may not, that is listed.
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
            value = self._networks.node(node, source.output, "number")
            if value is not None and is_constant(value):
                numbers = tuple(float(part) for part in value)  # type: ignore[arg-type]
                return numbers if len(numbers) > 1 else numbers[0]
        by = identifier or "a node without info:id"
        what = f"{shader_id(shader)} input {name} by {by} (its default)"
        self._report.missing(what, shader.GetPath())
        return default

    def _read(self, reader: UsdShade.Shader, default: Any) -> Any:
        """The value of a primvar reader; its varname and fallback may be connected too."""
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
