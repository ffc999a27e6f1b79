# SPDX-License-Identifier: Apache-2.0
"""Interface to MaterialX: the only module that imports ``wavecomb.usd.materialx``.

Stages also load if ``wavecomb.usd.materialx`` or the ``materialx`` wheel is missing: MaterialX
materials are then replaced by displayColor or left out, which is reported once.
"""

from __future__ import annotations

import functools
import importlib.util
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdShade

from wavecomb.usd.graphs.values import Expressions, Value
from wavecomb.usd.layers.unopened_materialx import unopened_materialx
from wavecomb.usd.materials.network import shader_id, source_of

if TYPE_CHECKING:
    from wavecomb.usd.graphs.surface_parameters import Networks
    from wavecomb.usd.materials.surface import InputDefinition, Surface
    from wavecomb.usd.materials.texture import TextureTable
    from wavecomb.usd.stage.report import LoadReport

ABSENT = "MaterialX without the Python package materialx (pip install materialx)"
"""Message for a stage that uses MaterialX while MaterialX is not installed."""

MODELS = ("standard_surface", "open_pbr_surface", "gltf_pbr")
"""Supported MaterialX shading models."""

HAIR = "chiang_hair"
"""Name of the model of a ``surface`` node whose BSDF is a ``chiang_hair_bsdf``."""


def is_there() -> bool:
    """Returns whether MaterialX is available, without importing it."""
    return all(_is_there(name) for name in ("MaterialX", "wavecomb.usd.materialx"))


def _is_there(name: str) -> bool:
    return sys.modules[name] is not None if name in sys.modules else _can_be_found(name)


@functools.cache
def _can_be_found(name: str) -> bool:
    """Returns whether a module can be found; cached, since there may be thousands of materials."""
    return importlib.util.find_spec(name) is not None


def resolve(stage: Usd.Stage, *, everywhere: bool = False) -> None:
    """Makes a stage use the MaterialX files that its layers name.

    Changes the layers in memory, which then can no longer be saved. Unreadable files stay missing;
    ``report_problems`` reports them. The call is fast if no MaterialX file is missing.

    Args:
        stage: The stage.
        everywhere: Whether to include unselected variants, which takes a pass over all layers.
            Selecting other variants later, on any thread, then changes no layer.
    """
    if (everywhere or any(True for _ in unopened_materialx(stage))) and is_there():
        from wavecomb.usd.materialx import references

        references.resolve(stage, everywhere=everywhere)


def reload(stage: Usd.Stage) -> None:
    """Reloads changed files of a stage, including MaterialX files."""
    if not is_there():
        stage.Reload()
        return
    from wavecomb.usd.materialx import references

    references.reload(stage)


def report_problems(stage: Usd.Stage, report: LoadReport) -> None:
    """Reports MaterialX files that are missing, and problems of translated ones."""
    read_none = "wavecomb.usd.materialx.references" not in sys.modules
    if read_none and not any(True for _ in unopened_materialx(stage)):
        return
    if is_there():
        from wavecomb.usd.materialx import references

        references.report_problems(stage, report)
        return
    for error, _ in unopened_materialx(stage):
        report.warn(f"{ABSENT}: files left out", str(error.rootSite.path))


def translated_files(stage: Usd.Stage) -> list[str]:
    """Returns the MaterialX files that a stage uses."""
    if "wavecomb.usd.materialx.references" not in sys.modules:
        return []
    from wavecomb.usd.materialx import references

    return references.translated_files(stage)


def model_of(identifier: str) -> str:
    """Returns the shading model of an id such as ``ND_standard_surface_surfaceshader``, or "".

    MaterialX took standard_surface from Arnold, whose shader has the same inputs.
    """
    if identifier == "arnold:standard_surface":
        return "standard_surface"
    return next((name for name in MODELS if identifier.startswith(f"ND_{name}")), "")


def hair_bsdf(shader: UsdShade.Shader) -> UsdShade.Shader | None:
    """Returns the shader, or a ``surface`` node's BSDF, if it is a chiang_hair_bsdf; else None."""
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
    """Returns the surface of a shader; reports and returns None if MaterialX is not installed.

    Args:
        material: Material that contains the shader.
        time: Time code at which attributes are evaluated.
        textures: Textures of the scene.
        report: Collects unsupported features.
        shader: The surface shader.
        model: One of ``MODELS``, or ``HAIR``.
        values: Constants of the shader that replace the authored ones.
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
    """Returns the supported inputs of a shading model by name, in MaterialX's order.

    Returns nothing if MaterialX is not installed.

    Args:
        model: One of ``MODELS``; ``HAIR`` has no known inputs.
        identifier: Id of the shader, which may refer to an older version.
    """
    if model == HAIR or not is_there():
        return {}
    from wavecomb.usd.materialx.surfaces import inputs

    return inputs.definitions(model, identifier)


def networks(
    material: Usd.Prim, time: Usd.TimeCode, textures: TextureTable, report: LoadReport
) -> Networks:
    """Returns the networks of a material, which compile its nodes."""
    if not is_there():
        return _NoNodes(material, textures, report)
    from wavecomb.usd.materialx.nodes import network

    return network.Networks(material, time, textures, report)


class _NoNodes:
    """Implementation of ``Networks`` for use without MaterialX, which reports every node."""

    def __init__(self, material: Usd.Prim, textures: TextureTable, report: LoadReport) -> None:
        self.make = Expressions()
        self.material = material
        self.primvars: list[str] = []
        self.report = report
        self.textures = textures
        self.uv_names: list[str] = []

    def input(self, shader: UsdShade.Shader, name: str, kind: str) -> Value | None:
        """Reports the node and returns None."""
        return self.node(shader, name, kind)

    def node(self, shader: UsdShade.Shader, output: str, kind: str) -> Value | None:
        """Reports the node and returns None."""
        self.report.missing(f"{ABSENT}: nodes left out", shader.GetPath())
        return None

    def in_working_space(self) -> Networks:
        """Returns itself, since there are no constants to convert."""
        return self
