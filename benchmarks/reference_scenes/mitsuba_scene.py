# SPDX-License-Identifier: Apache-2.0
"""Mitsuba 3's XML scenes, which Mitsuba's parser reads, and Mitsuba as a reference renderer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np


class Scene:
    """A parsed scene, which consists of nodes that refer to each other by index."""

    def __init__(self, mi: Any, file: Path, width: int = 0) -> None:
        """Parse a file. ``width`` scales the image to this width in pixels; 0 keeps the size."""
        self.mi = mi
        self.file = file
        self.config = mi.parser.ParserConfig(mi.variant())
        self.config.merge_meshes = self.config.merge_equivalent = False
        self.folders = [
            str(path.get("value")) for path in ElementTree.parse(file).getroot().iter("path")
        ]
        self.state = mi.parser.parse_file(self.config, str(file))
        mi.parser.transform_all(self.config, self.state)
        for node in self.state.nodes:
            if width and str(node.type).endswith("Film"):
                height = round(int(node.props["height"]) * width / int(node.props["width"]))
                node.props["width"], node.props["height"] = width, height

    def kind(self, number: int) -> str:
        """Plugin name of a node."""
        return str(self.state.nodes[number].props.plugin_name())

    def category(self, number: int) -> str:
        """Object type of a node in Mitsuba, such as Shape, BSDF or Emitter."""
        return str(self.state.nodes[number].type).rsplit(".", 1)[-1]

    def props(self, number: int) -> Any:
        """Parameters of a node."""
        return self.state.nodes[number].props

    def children(self, number: int) -> dict[str, int]:
        """Child nodes by name."""
        props = self.props(number)
        reference = self.mi.Properties.Type.ResolvedReference
        names = list(props.keys())
        return {name: props[name].index() for name in names if props.type(name) == reference}

    def all_of(self, number: int, category: str) -> Iterator[int]:
        """Children of a category."""
        return (n for n in self.children(number).values() if self.category(n) == category)

    def path(self, name: str) -> Path | None:
        """Return a file that the scene refers to, or None if the file does not exist."""
        here = self.file.parent
        for folder in (here, *(here / file for file in self.folders)):
            if (folder / name).is_file():
                return folder / name
        return None

    def missing_file(self, number: int) -> str:
        """Return the first missing file below a node, or ""."""
        props = self.props(number)
        if "filename" in props and self.path(str(props["filename"])) is None:
            return str(props["filename"])
        for child in self.children(number).values():
            if missing := self.missing_file(child):
                return missing
        return ""

    def colour(
        self, number: int, key: str, default: float = 0.5, emits: bool = False
    ) -> list[float]:
        """Return a parameter in linear Rec.709, with Mitsuba's conversion of spectra."""
        props = self.props(number)
        if key not in props:
            return [default] * 3
        get = props.get_emissive_texture if emits else props.get_unbounded_texture
        if emits and str(props.type(key)).endswith("Color"):
            return [float(v) for v in props[key]]
        texture = get(key)
        dr = __import__("drjit")
        value = np.array(texture.eval(dr.zeros(self.mi.SurfaceInteraction3f))).reshape(-1)
        return [float(v) for v in (value if len(value) == 3 else value.repeat(3))]


def referee(scene: Scene, as_ours: bool) -> Any:
    """Load the scene in Mitsuba, without shapes whose files are missing.

    ``as_ours`` applies the approximations of ``to_stage``. Loading consumes the parsed scene, which
    cannot be used afterwards.
    """
    root = scene.props(0)
    if not any(scene.category(n) == "Integrator" for n in scene.children(0).values()):
        root["integrator"] = scene.mi.load_dict({"type": "path"})
    for key, number in scene.children(0).items():
        if scene.category(number) == "Shape" and scene.missing_file(number):
            root.remove_property(key)
    for number, node in enumerate(scene.state.nodes):
        props = node.props
        if "filename" in props and (found := scene.path(str(props["filename"]))):
            props["filename"] = str(found)
        if as_ours and scene.category(number) == "BSDF":
            if "distribution" in props or "rough" in scene.kind(number):
                props["distribution"] = "ggx"
            if "plastic" in scene.kind(number):
                props["nonlinear"] = False
        if as_ours and scene.category(number) == "Shape" and list(scene.all_of(number, "Emitter")):
            for child in scene.all_of(number, "BSDF"):
                scene.props(child)["reflectance"] = 0.0
    loaded = scene.mi.parser.instantiate(scene.config, scene.state)
    return loaded[0] if isinstance(loaded, (list, tuple)) else loaded
