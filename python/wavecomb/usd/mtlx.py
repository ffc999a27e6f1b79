# SPDX-License-Identifier: Apache-2.0
"""The door to MaterialX: the one module that imports ``wavecomb.usd.materialx``.

Without that package, or without the ``materialx`` wheel, stages load as they are: what asks for
MaterialX is drawn in its displayColor or left out, and said once.
"""

from __future__ import annotations

import functools
import importlib.util
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.graphs.values import Expressions, Value
from wavecomb.usd.looks.network import shader_id, source_of
from wavecomb.usd.stage.unread import unread_mtlx

if TYPE_CHECKING:
    from wavecomb.usd.graphs.surface import Networks
    from wavecomb.usd.looks.surface import InputDefinition, Surface
    from wavecomb.usd.looks.texture import TextureTable
    from wavecomb.usd.stage.report import LoadReport

ABSENT = "MaterialX without the Python package materialx (pip install materialx)"
"""What is said where a stage asks for MaterialX and it is not there."""

MODELS = ("standard_surface", "open_pbr_surface", "gltf_pbr")
"""Shading models that are read."""

HAIR = "chiang_hair"
"""The model of a ``surface`` whose BSDF is a ``chiang_hair_bsdf``."""


def is_there() -> bool:
    """Whether MaterialX can be read; imports nothing."""
    return all(_is_there(name) for name in ("MaterialX", "wavecomb.usd.materialx"))


def _is_there(name: str) -> bool:
    return sys.modules[name] is not None if name in sys.modules else _can_be_found(name)


@functools.cache
def _can_be_found(name: str) -> bool:
    """Looked for once: there may be thousands of materials."""
    return importlib.util.find_spec(name) is not None


def resolve(stage: Usd.Stage, *, everywhere: bool = False) -> None:
    """Makes a stage see the MaterialX files that its layers name.

    Those layers are changed in memory, and cannot be saved from then on. What cannot be read stays
    missing; ``tell`` says so. Costs next to nothing where no such file is missing.

    Args:
        stage: The stage.
        everywhere: Also where variants are not selected, so that selecting them later, on whatever
            thread, changes no layer. Looks through all layers.
    """
    if (everywhere or any(True for _ in unread_mtlx(stage))) and is_there():
        from wavecomb.usd.materialx import references

        references.resolve(stage, everywhere=everywhere)


def reload(stage: Usd.Stage) -> None:
    """Reads the files of a stage again that changed, MaterialX files among them."""
    if not is_there():
        stage.Reload()
        return
    from wavecomb.usd.materialx import references

    references.reload(stage)


def tell(stage: Usd.Stage, report: LoadReport) -> None:
    """Says which MaterialX files are missing from a stage, and what of others was left out."""
    read_none = "wavecomb.usd.materialx.references" not in sys.modules
    if read_none and not any(True for _ in unread_mtlx(stage)):
        return
    if is_there():
        from wavecomb.usd.materialx import references

        references.tell(stage, report)
        return
    for error, _ in unread_mtlx(stage):
        report.warn(f"{ABSENT}: files left out", str(error.rootSite.path))


def translated_files(stage: Usd.Stage) -> list[str]:
    """MaterialX files that a stage brought in."""
    if "wavecomb.usd.materialx.references" not in sys.modules:
        return []
    from wavecomb.usd.materialx import references

    return references.translated_files(stage)


def model_of(identifier: str) -> str:
    """The shading model of a shader id such as ``ND_standard_surface_surfaceshader``, or ''.

    MaterialX has its standard_surface from Arnold, whose shader has the same inputs.
    """
    if identifier == "arnold:standard_surface":
        return "standard_surface"
    return next((name for name in MODELS if identifier.startswith(f"ND_{name}")), "")


def hair_bsdf(shader: UsdShade.Shader) -> UsdShade.Shader | None:
    """The ``chiang_hair_bsdf`` of a ``surface`` node, or of itself; None of other shaders."""
    identifier = shader_id(shader)
    if identifier == "ND_surface":
        source = source_of(shader, "bsdf", Usd.TimeCode.Default())
        shader = UsdShade.Shader() if source is None or source.shader is None else source.shader
        identifier = shader_id(shader)
    return shader if identifier.startswith("ND_chiang_hair_bsdf") else None


def surface(
    material: Usd.Prim,
    time: Usd.TimeCode,
    textures: TextureTable,
    report: LoadReport,
    shader: UsdShade.Shader,
    model: str,
    values: Mapping[str, Any] | None = None,
) -> Surface | None:
    """The surface of a shader; None, and said, without MaterialX.

    Args:
        material: That the shader is in.
        time: Of evaluation.
        textures: Of the scene.
        report: Is told what is not supported.
        shader: The surface shader.
        model: One of ``MODELS``, or ``HAIR``.
        values: Constants of the shader in place of what the stage says.
    """
    if not is_there():
        report.missing(f"{ABSENT}: displayColor in its place", material.GetPath())
        return None
    if model == HAIR:
        from wavecomb.usd.materialx.surfaces.hair import HairReader

        return HairReader(material, time, textures, report).read(shader)
    from wavecomb.usd.materialx.surfaces.openpbr import MaterialXReader

    return MaterialXReader(material, time, textures, report, values).read(shader, model)


def definitions(model: str, identifier: str = "") -> dict[str, InputDefinition]:
    """Inputs of a shading model that are read, by name, in MaterialX's order; none without it.

    Args:
        model: One of ``MODELS``; of ``HAIR`` none are known.
        identifier: The shader's, which may name an older version.
    """
    if model == HAIR or not is_there():
        return {}
    from wavecomb.usd.materialx.surfaces import inputs

    return inputs.definitions(model, identifier)


def networks(
    material: Usd.Prim, time: Usd.TimeCode, textures: TextureTable, report: LoadReport
) -> Networks:
    """What compiles the networks of a material's nodes."""
    if not is_there():
        return _NoNodes(material, textures, report)
    from wavecomb.usd.materialx.nodes import network

    return network.Networks(material, time, textures, report)


class _NoNodes:
    """Networks of a material where no node can be read, as ``graph_surface.Networks``."""

    def __init__(self, material: Usd.Prim, textures: TextureTable, report: LoadReport) -> None:
        self.make = Expressions()
        self.material = material
        self.primvars: list[str] = []
        self.report = report
        self.textures = textures
        self.uv_names: list[str] = []

    def input(self, shader: UsdShade.Shader, name: str, kind: str) -> Value | None:
        """Nothing, and said."""
        return self.node(shader, name, kind)

    def node(self, shader: UsdShade.Shader, output: str, kind: str) -> Value | None:
        """Nothing, and said."""
        self.report.missing(f"{ABSENT}: nodes left out", shader.GetPath())
        return None

    def in_working_space(self) -> Networks:
        """The same."""
        return self
