# SPDX-License-Identifier: Apache-2.0
"""Compiles and evaluates single MaterialX nodes on a stage in memory."""

from __future__ import annotations

import functools
import random
import zlib
from types import SimpleNamespace

import numpy as np
from pxr import Usd, UsdShade

from wavecomb.usd.graphs.values import POINT_SIZE, assemble, fit
from wavecomb.usd.materialx.library import WIDTHS, library
from wavecomb.usd.materialx.nodes.network import Networks
from wavecomb.usd.materialx.nodes.node import NodeCall
from wavecomb.usd.materialx.prims import usd_type, usd_value
from wavecomb.usd.stage.report import LoadReport


class Textures:
    """Fake texture loader: every file exists and has four channels. Records distinct uses."""

    working = "rec709"
    origin = (0.0, 0.0, 0.0)

    def __init__(self):
        self.uses = []

    def image(self, path, prim):
        return SimpleNamespace(channels=4)

    def add(self, path, image, space, *wraps, is_colour=True):
        use = (path, space, *wraps, is_colour)
        if use not in self.uses:
            self.uses.append(use)
        return self.uses.index(use)

    def missing(self):
        return 99


class Node:
    """A shader node of a MaterialX definition. ``report`` collects the warnings."""

    def __init__(self, identifier):
        self.stage = Usd.Stage.CreateInMemory()
        self.material = self.stage.DefinePrim("/M", "Material")
        self.shader = UsdShade.Shader.Define(self.stage, "/M/N")
        self.shader.CreateIdAttr(identifier)
        self.definition = library().getNodeDef(identifier)
        assert self.definition is not None, identifier
        for output in self.definition.getActiveOutputs():
            self.shader.CreateOutput(output.getName(), usd_type(output.getType()))
        self.report = LoadReport()
        self.textures = Textures()
        self.networks = Networks(self.material, Usd.TimeCode.Default(), self.textures, self.report)

    def give(self, **values):
        """Sets inputs to constants, given as text in MaterialX syntax."""
        for name, text in values.items():
            kind = self.definition.getActiveInput(name).getType()
            self.shader.CreateInput(name, usd_type(kind)).Set(usd_value(str(text), kind))
        return self

    def feed(self, name, identifier, output="out", **values):
        """Connects an input to a new node."""
        source = UsdShade.Shader.Define(self.stage, f"/M/{name}")
        source.CreateIdAttr(identifier)
        definition = library().getNodeDef(identifier)
        for item, text in values.items():
            kind = definition.getActiveInput(item).getType()
            source.CreateInput(item, usd_type(kind)).Set(usd_value(str(text), kind))
        kind = usd_type(self.definition.getActiveInput(name).getType())
        source.CreateOutput(output, kind)
        self.shader.CreateInput(name, kind).ConnectToSource(source.ConnectableAPI(), output)
        return self

    def feed_at_random(self):
        """Sets inputs to random numbers or connects them to noise, except for settings."""
        chance = random.Random(zlib.crc32(self.definition.getName().encode()))
        for item in self.definition.getActiveInputs():
            kind, name = item.getType(), item.getName()
            is_setting = kind in ("integer", "boolean") or item.getIsUniform()
            if kind not in WIDTHS or WIDTHS[kind] > 4 or is_setting:
                continue
            if item.getDefaultGeomPropString():
                continue
            if chance.random() < 0.6:
                size = ",".join([f"{chance.uniform(0.3, 2.0):.3f}"] * WIDTHS[kind])
                pivot = f"{chance.uniform(-0.2, 0.8):.3f}"
                self.feed(name, f"ND_noise3d_{kind}", amplitude=size, pivot=pivot)
            elif chance.random() < 0.7:
                numbers = [f"{chance.uniform(-0.5, 1.5):.3f}" for _ in range(WIDTHS[kind])]
                self.give(**{name: ",".join(numbers)})
        return self

    def value(self, output="out", kind="number"):
        """Returns the compiled value of an output."""
        return self.networks.node(self.shader, output, kind)

    def call(self, output, kind="number"):
        """Returns the node call that ``Networks`` would make."""
        call = self.networks._call(self.shader, output, kind)
        assert isinstance(call, NodeCall)
        width = next(
            o.getType() for o in self.definition.getActiveOutputs() if o.getName() == output
        )
        call.width = WIDTHS[width]
        return call

    def run(self, points, output="out", kind="number"):
        """Evaluates an output at points."""
        return run(self.value(output, kind), points)


def run(value, points):
    """Evaluates a value at points; returns an array (n, components) and the operation count."""
    return assemble(dict(enumerate(fit(value, len(value))))).run(points)


def points(n=200):
    """Returns random points: uv in 0..1, positions in -1.5..1.5, unit directions."""
    chance = np.random.default_rng(3)
    table = chance.uniform(-1.5, 1.5, (n, POINT_SIZE)).astype(np.float32)
    table[:, :2] = chance.uniform(0, 1, (n, 2))
    table[:, 2] = 1e-3
    for first in (9, 12, 15, 18):
        table[:, first : first + 3] /= np.linalg.norm(table[:, first : first + 3], axis=1)[:, None]
    return table


@functools.cache
def patterns():
    """Returns the library's definitions that have numeric outputs, with these outputs, by name."""
    found = {}
    for definition in library().getNodeDefs():
        outputs = [o.getName() for o in definition.getActiveOutputs() if o.getType() in WIDTHS]
        if outputs:
            found[definition.getName()] = outputs
    return found
