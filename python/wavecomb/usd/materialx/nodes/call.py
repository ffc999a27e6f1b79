# SPDX-License-Identifier: Apache-2.0
"""One MaterialX node while it is compiled: what its inputs come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from pxr import Sdf, Usd

from wavecomb.usd.graphs.surface import NORMAL, NUMBER
from wavecomb.usd.graphs.values import Expressions, Value, fit, numbers
from wavecomb.usd.looks.network import Source, word
from wavecomb.usd.stage.report import LoadReport

OF_MATRICES = ("transformmatrix", "transpose", "creatematrix", "constant", "dot")
"""Categories whose inputs may be matrices: values of 9 or 16 components."""


class Inputs(Protocol):
    """The inputs of a node: of a stage, or of a node graph of the library."""

    @property
    def path(self) -> Sdf.Path:
        """The prim that messages name."""

    def find(self, name: str, kind: str) -> Value | None:
        """What feeds an input; None where nothing does."""

    def source(self, name: str) -> Source | None:
        """The same of what is no number: strings and files."""

    def has(self, name: str) -> bool:
        """Whether an input is authored."""

    def names(self) -> list[str]:
        """Inputs that are authored."""


class NodeHost(Protocol):
    """What compiles the network that a node is in: ``network.Networks``."""

    material: Usd.Prim
    make: Expressions
    report: LoadReport
    time: Usd.TimeCode
    uv_names: list[str]
    converts: bool
    textures: Any

    def primvar(self, name: str, otherwise: Value) -> Value:
        """What each mesh gives for a primvar."""

    def compiled(self, call: NodeCall) -> Value | None:
        """What a node's output gives."""


class NodeCall:
    """One node that is being compiled.

    Attributes:
        networks: Compiles the network that it is in.
        inputs: What feeds it.
        category: Of the node, without types.
        identifier: Name of its definition.
        output: Name of the output that is asked for.
        width: Components of that output; 0: as they come.
        kind: What the value is for: ``graph_surface.BASE``, ``COLOUR``, ``NUMBER`` or ``NORMAL``.
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
        """Makes operations."""
        return self.networks.make

    def given(self, name: str) -> Value | None:
        """What feeds an input; None where nothing does. A matrix is cut where none can be."""
        found = self.inputs.find(name, self.kind)
        is_cut = found is not None and len(found) > 4 and self.category not in OF_MATRICES
        return found[:4] if found is not None and is_cut else found

    def value(
        self, name: str, default: float | Sequence[float] | None = 0.0, width: int = 0
    ) -> Value:
        """An input; of its own width where none is given."""
        found = self.given(name)
        if found is None:
            if isinstance(default, (int, float)):
                found = fit(numbers(float(default)), width or self.width or 1)
            else:
                found = numbers(*(default or (0.0,)))
        return fit(found, width) if width else found

    def number(self, name: str, default: float) -> float:
        """An input that must be one number for all; told where it is not."""
        found = self.inputs.find(name, NUMBER)
        if found is None:
            return default
        if not isinstance(found[0], float):
            what = f"MaterialX node {self.identifier} with {name} by a node (its default)"
            self.networks.report.missing(what, self.inputs.path)
            return default
        return found[0]

    def text(self, name: str, default: str) -> str:
        """A string or token."""
        source = self.inputs.source(name)
        return word(source.value, default) if source is not None and source.is_value else default

    def coordinates(self, name: str = "texcoord") -> Value:
        """Texture coordinates: of an input, else of the mesh."""
        found = self.inputs.find(name, NUMBER)
        return self.at_place("texcoord", "") if found is None else fit(found, 2)

    def place(self, kind: str, name: str, space: str) -> Value:
        """position, normal ...: of an input where it is authored, else of the surface."""
        found = self.inputs.find(name, NUMBER) if name else None
        return self.at_place(kind, space) if found is None else fit(found, 3)

    def at_place(self, kind: str, space: str) -> Value:
        """What the surface says: texcoord, position, normal, tangent, bitangent or viewdirection.

        ``view`` is the way back, to the camera. ``space``: object or world.
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
        """The position of the surface in the world, which the scene's may differ from."""
        position, origin = self.make.input("position"), self.networks.textures.origin
        return self.make.add(position, numbers(*origin)) if any(origin) else position


Handler = Callable[[NodeCall], Value | None]
"""Compiles a node. One that names no input of its own gives what the surface says."""


def adder(table: dict[str, Handler]) -> Callable[..., Callable[[Handler], Handler]]:
    """What puts functions in a table: ``@node("tan")`` of a category, or of several."""

    def node(*categories: str) -> Callable[[Handler], Handler]:
        def add(handler: Handler) -> Handler:
            table.update(dict.fromkeys(categories, handler))
            return handler

        return add

    return node
