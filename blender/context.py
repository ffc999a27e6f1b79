# SPDX-License-Identifier: GPL-3.0-or-later
"""State that all parts of the translation of one scene share."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

from .report import Report
from .usda import Layer, safe_name

ROOT = "/root"
"""Prim under which Blender's exporter writes the scene."""
OWN = "/Wavecomb"
"""Prim under which the correction layer defines lights, camera and materials."""


@dataclass
class Translation:
    """State of the translation of a Blender scene to a USD stage.

    Attributes:
        depsgraph: Evaluated scene.
        folder: Folder of the stage and its files.
        layer: The correction layer.
        report: Messages about unsupported and approximated features.
        time: Time code of the frame.
        options: Additional options of ``wavecomb render``.
        samples: World matrices of moving objects over the shutter interval, by object name.
        instancing: Whether the exporter wrote instances as prototypes.
        instanced: Names of materials of instances.
        bakes: Sockets of materials to bake (``textures``).
    """

    depsgraph: Any
    folder: str
    layer: Layer
    report: Report
    time: float
    options: list[str] = field(default_factory=list)
    samples: dict[str, dict[float, Any]] = field(default_factory=dict)
    instancing: bool = False
    instanced: set[str] = field(default_factory=set)
    bakes: list[dict[str, Any]] = field(default_factory=list)

    @property
    def scene(self) -> Any:
        """The evaluated scene."""
        return self.depsgraph.scene_eval

    def file(self, name: str) -> str:
        """Returns the path of a file in the folder of the stage."""
        return os.path.join(self.folder, name)

    def matrices(self, name: str, matrix: Any) -> dict[float, Any]:
        """Returns the matrices of an object by time; a static object has a single matrix."""
        return self.samples.get(name) or {self.time: matrix}


def local_matrix(thing: Any) -> Any:
    """Returns the transform of an object to its parent, or to the world if it has no parent."""
    world = thing.matrix_world.copy()
    return world if thing.parent is None else thing.parent.matrix_world.inverted_safe() @ world


def object_path(thing: Any) -> str:
    """Returns the path of the prim that the exporter writes for an object."""
    names = []
    while thing is not None:
        names.append(safe_name(thing.name))
        thing = thing.parent
    return f"{ROOT}/" + "/".join(reversed(names))


def data_path(thing: Any) -> str:
    """Returns the path of the prim that the exporter writes for an object's data."""
    return f"{object_path(thing)}/{safe_name(thing.data.name)}"


def material_path(material: Any) -> str:
    """Returns the path of the prim that the exporter writes for a material."""
    return f"{ROOT}/_materials/{safe_name(material.name)}"
