# SPDX-License-Identifier: Apache-2.0
"""A MaterialX node that is being compiled, with access to its inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from pxr import Sdf, Usd

from wavecomb.usd.graphs.surface_parameters import NORMAL, NUMBER
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.materials.network import Source, word
from wavecomb.usd.stage.report import LoadReport

OF_MATRICES = ("transformmatrix", "transpose", "creatematrix", "constant", "dot")
"""Categories of nodes whose inputs may be matrices, which have 9 or 16 components."""


class Inputs(Protocol):
    """Interface to the inputs of a node that is a prim or part of a library graph."""

    @property
    def path(self) -> Sdf.Path:
        """Path of the prim for messages."""

    def find(self, name: str, kind: str) -> Value | None:
        """Returns the value of a node input; None if it is not set."""

    def source(self, name: str) -> Source | None:
        """Returns the source of an input that holds a string or a file."""

    def has(self, name: str) -> bool:
        """Returns whether an input is authored."""

    def names(self) -> list[str]:
        """Returns the names of authored inputs."""


class NodeHost(Protocol):
    """Interface to the network that contains a node, which ``network.Networks`` implements."""

    material: Usd.Prim
    make: Expressions
    report: LoadReport
    time: Usd.TimeCode
    uv_names: list[str]
    converts: bool
    textures: Any

    def primvar(self, name: str, otherwise: Value) -> Value:
        """Returns the value of a primvar of the mesh."""

    def compiled(self, call: NodeCall) -> Value | None:
        """Returns the value of a node's output."""


class NodeCall:
    """A MaterialX node that is being compiled.

    Attributes:
        networks: Network that contains the node.
        inputs: Inputs of the node.
        category: Category of the node, such as "mix".
        identifier: Name of the node's definition.
        output: Name of the requested output.
        width: Number of components of the requested output; 0 accepts any number.
        kind: Use of the value: ``BASE``, ``COLOUR``, ``NUMBER`` or ``NORMAL`` of
            ``graphs.surface``.
    """

    def __init__(
        self,
        networks: NodeHost,
        inputs: Inputs,
        category: str,
        identifier: str,
        output: str,
        width: int,
        kind: str,
    ) -> None:
        self.networks = networks
        self.inputs = inputs
        self.category = category
        self.identifier = identifier
        self.output = output
        self.width = width
        self.kind = kind

    @property
    def make(self) -> Expressions:
        """Factory of operations."""
        return self.networks.make

    def given(self, name: str) -> Value | None:
        """Returns the value of an input; None if the input is not set.

        A matrix is cut to four components unless the node accepts matrices.
        """
        found = self.inputs.find(name, self.kind)
        is_cut = found is not None and len(found) > 4 and self.category not in OF_MATRICES
        return found[:4] if found is not None and is_cut else found

    def value(
        self, name: str, default: float | Sequence[float] | None = 0.0, width: int = 0
    ) -> Value:
        """Returns an input's value or its default, with ``width`` components (0 means any)."""
        found = self.given(name)
        if found is None:
            if isinstance(default, (int, float)):
                found = fit(numbers(float(default)), width or self.width or 1)
            else:
                found = numbers(*(default or (0.0,)))
        return fit(found, width) if width else found

    def number(self, name: str, default: float) -> float:
        """Returns the value of an input that must be constant; reports any other input."""
        found = self.inputs.find(name, NUMBER)
        if found is None:
            return default
        if not isinstance(found[0], float):
            what = f"MaterialX node {self.identifier} with {name} by a node (its default)"
            self.networks.report.missing(what, self.inputs.path)
            return default
        return found[0]

    def text(self, name: str, default: str) -> str:
        """Returns a string or token input."""
        source = self.inputs.source(name)
        return word(source.value, default) if source is not None and source.is_value else default

    def coordinates(self, name: str = "texcoord") -> Value:
        """Returns texture coordinates from an input, or the mesh's texture coordinates."""
        found = self.inputs.find(name, NUMBER)
        return self.at_place("texcoord", "") if found is None else fit(found, 2)

    def place(self, kind: str, name: str, space: str) -> Value:
        """Returns a geometric property from an input that is set, or at the shading point."""
        found = self.inputs.find(name, NUMBER) if name else None
        return self.at_place(kind, space) if found is None else fit(found, 3)

    def at_place(self, kind: str, space: str) -> Value:
        """Returns a geometric property of the shading point.

        ``kind`` is "texcoord", "position", "normal", "tangent", "bitangent" or "viewdirection".
        ``space`` is "object" or "world". The graph input ``view`` points from the surface to the
        camera.
        """
        make = self.make
        if kind == "texcoord":
            self.networks.uv_names.append("st")
            return make.input("uv")
        if kind == "viewdirection":
            return make.sub(0.0, make.input("view"))
        if kind == "normal" and self.kind == NORMAL:
            return numbers(0.0, 0.0, 1.0)
        if space != "world" and kind in ("position", "normal"):
            return make.input(f"local_{kind}")
        return self.world_position() if kind == "position" else make.input(kind)

    def world_position(self) -> Value:
        """Returns the shading point's world position, which is offset by the scene's origin."""
        position, origin = self.make.input("position"), self.networks.textures.origin
        return self.make.add(position, numbers(*origin)) if any(origin) else position


Handler = Callable[[NodeCall], Value | None]
"""Function that compiles a node; returns None if the node has no value."""


def adder(table: dict[str, Handler]) -> Callable[..., Callable[[Handler], Handler]]:
    """Returns a decorator such as ``@node("tan")`` that registers handlers of node categories."""

    def node(*categories: str) -> Callable[[Handler], Handler]:
        def add(handler: Handler) -> Handler:
            table.update(dict.fromkeys(categories, handler))
            return handler

        return add

    return node
