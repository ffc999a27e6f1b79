# SPDX-License-Identifier: Apache-2.0
"""Adds materials to the scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdShade

from wavecomb.image.working_space import LUMINANCE, from_rec709
from wavecomb.usd import mtlx
from wavecomb.usd.graphs.surface_parameters import graphs_of, in_working_space, sampled
from wavecomb.usd.graphs.values import PARAMETERS, Expressions, GraphTooLarge, fit, numbers
from wavecomb.usd.materials.network import shader_id, shader_name, surface_outputs
from wavecomb.usd.materials.preview_surface import PreviewReader
from wavecomb.usd.materials.surface import (
    COLOUR_PARAMETERS,
    DEFAULTS,
    OPENPBR_COLOURS,
    Surface,
    fallback_surface,
    is_cloudy,
)
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.material import filling

if TYPE_CHECKING:
    from wavecomb.usd.graphs.values import Graph

INHERIT_MATERIAL = 0xFFFFFFFF
"""Material id that means "use the instance's material"; equals ``_core.INHERIT_MATERIAL``."""

DEFAULT_COLOUR = (0.5, 0.5, 0.5)
"""Colour of geometry with neither a material nor a display colour."""


PREVIEW = "preview"
"""Kind of surface that ``surface_source`` returns for UsdPreviewSurface."""

MIN_EMISSION = 1.0
"""Smallest emission at which a material counts as a light, so that the stage gets no default
dome."""

_INSTEAD = "displayColor in its place"

SPLATS = Surface("splats", "emissive", {"emission": (1.0, 1.0, 1.0)})
"""Material of Gaussian splats, whose emission of 1 is multiplied by the radiance of each splat."""


def surface_source(material: UsdShade.Material) -> tuple[str, UsdShade.Shader]:
    """Returns the kind of a material's surface and its shader.

    The kind is ``PREVIEW`` or a MaterialX shading model. The kind is empty if Wavecomb supports
    none of the material's surface outputs.
    """
    shader = material.ComputeSurfaceSource()[0]
    # If a material has a MaterialX surface and a preview surface, use the MaterialX surface.
    others = (one for _, one in surface_outputs(material))
    for candidate in chain((material.ComputeSurfaceSource("mtlx")[0], shader), others):
        name = shader_id(candidate)
        if name.startswith(("ND_UsdPreviewSurface", "UsdPreviewSurface")):
            return PREVIEW, candidate
        if model := mtlx.model_of(name):
            return model, candidate
        if (hair := mtlx.hair_bsdf(candidate)) is not None:
            return mtlx.HAIR, hair
    return "", shader


class MaterialTable:
    """The materials of a scene; equal materials are stored once."""

    def __init__(self, context: LoadContext, textures: TextureTable, apart: bool = False) -> None:
        """``apart`` stores materials of different prims separately even if they are equal."""
        self._apart = apart
        self._names: list[str] = []
        self._builder, self._report = context.builder, context.report
        self.time = context.time
        self._textures = textures
        self._surfaces: dict[Sdf.Path, Surface] = {}
        self._by_object: dict[int, tuple[UsdShade.Material, Surface]] = {}
        self._of_objects: dict[tuple[Any, ...], Surface] = {}
        self._ids: dict[str, int] = {}
        self._graph_ids: dict[Graph, int] = {}
        self._surface_ids: dict[int, tuple[Surface, int]] = {}
        self._varied: dict[tuple[int, tuple[str, ...]], tuple[Surface, Surface]] = {}
        self._plain: dict[tuple[Any, ...], int] = {}
        self.emits = False
        """Whether a material in use emits at least ``MIN_EMISSION`` and thus counts as a light."""
        self._emitting: set[int] = set()
        self._emission: dict[int, tuple[Surface, float]] = {}
        self.scattering_interiors: list[str] = []
        """Names of materials in use that refract light into a scattering medium."""

    @property
    def working(self) -> str:
        """The working colour space."""
        return self._textures.working

    def expect(self, material: UsdShade.Material) -> None:
        """Starts reading the images of a material before the material is used."""
        if material.GetPath() not in self._surfaces:
            self._textures.expect(material.GetPrim(), self.time)

    def surface(self, material: UsdShade.Material) -> Surface:
        """Returns the surface of a bound material."""
        known = self._by_object.get(id(material))
        if known is not None:
            return known[1]
        path = material.GetPath()
        surface = self._surfaces.get(path)
        if surface is None:
            try:
                surface = self._convert(material)
            except (Tf.ErrorException, RecursionError):
                what = "material network cannot be read: displayColor in its place"
                self._report.warn(what, path)
                surface = _stand_in(material.GetPrim())
            if str(path).startswith("/__Prototype_"):
                surface = replace(surface, name=self._report.place(path))
            self._surfaces[path] = surface
            if is_cloudy(surface):
                self.scattering_interiors.append(surface.name)
            self._report.tally("materials")
        # Keep the material alive, so that Python does not reuse its id, the key.
        self._by_object[id(material)] = material, surface
        return surface

    def surface_of_object(
        self, material: UsdShade.Material, primvars: Mapping[str, Any]
    ) -> Surface:
        """Returns the surface of a material for an object with these primvar values."""
        key = (material.GetPath(), tuple(sorted(primvars.items())))
        surface = self._of_objects.get(key)
        if surface is None:
            surface = self.surface(material)
            shader = surface_source(material)[1]
            # Discard the messages of this second reading, since the first reading of the material
            # has reported the same problems.
            again = LoadReport()
            prim = material.GetPrim()
            reader = PreviewReader(prim, self.time, self._textures, again, primvars)
            surface = replace(reader.read(shader), name=surface.name)
            self._report.absorb_new(again)
            self._of_objects[key] = surface
        return surface

    def add(self, surface: Surface, brightest: float = 0.0) -> int:
        """Adds a surface as a material unless an equal one exists; returns the material id.

        ``brightest`` is the highest emission due to primvars.
        """
        number = self._add(surface)
        if brightest > 0:
            self._emitting.add(number)
            self._emission[number] = (surface, brightest)
            self.emits = self.emits or brightest >= MIN_EMISSION
        return number

    def varied(self, surface: Surface, varying: tuple[str, ...]) -> Surface:
        """Returns the surface with the parameters ``varying`` read from primvars at each hit."""
        if not varying:
            return surface
        known = self._varied.get((id(surface), varying))
        if known is not None:
            return known[1]
        try:
            varied = with_attributes(surface, varying, self.working)
        except GraphTooLarge as error:
            what = f"shading network too large for primvars ({error}): left out"
            self._report.missing(what, surface.name)
            varied = surface
        # Keep the surface alive, so that Python does not reuse its id in the key.
        self._varied[id(surface), varying] = surface, varied
        return varied

    def _add(self, surface: Surface) -> int:
        known = self._surface_ids.get(id(surface))
        if known is not None:
            return known[1]
        key = surface.key() + (surface.name if self._apart else "")
        number = self._ids.get(key)
        if number is None:
            brightest = surface.brightest()
            parameters = self._in_working_space(surface.parameters)
            self.emits = self.emits or brightest >= MIN_EMISSION
            number = self._builder.add_material(
                surface.program,
                name=surface.name,
                **parameters,
                textures=surface.textures,
                **self._graphs_of(surface),
            )
            self._ids[key] = number
            self._names.append(surface.name)
            if brightest > 0:
                self._emitting.add(number)
                self._emission[number] = (surface, 0.0)
        # Keep the surface alive, so that Python does not reuse its id, the key.
        self._surface_ids[id(surface)] = (surface, number)
        return number

    def _graphs_of(self, surface: Surface) -> dict[str, Any]:
        """Returns ids of a surface's graphs; equal graphs share an id."""
        if surface.graph is None:
            return {}
        graphs = {
            "graph": surface.graph.whole,
            "opacity_graph": surface.graph.opacity,
            "emission_graph": surface.graph.emission,
        }
        for graph in graphs.values():
            if graph is not None and graph not in self._graph_ids:
                self._graph_ids[graph] = self._builder.add_graph(
                    graph.ops, graph.constants, graph.images, graph.outputs, graph.names
                )
        return {name: self._graph_ids[g] for name, g in graphs.items() if g is not None}

    def _in_working_space(self, parameters: dict[str, Any]) -> dict[str, Any]:
        """Returns the parameters with colours converted to the working space."""
        working = self.working
        if working == "rec709":
            return parameters

        def converted(values: dict[str, Any], colours: Iterable[str]) -> dict[str, Any]:
            there = {
                name: tuple(float(x) for x in from_rec709(np.array(values[name]), working))
                for name in colours
                if name in values
            }
            return {**values, **there}

        parameters = converted(parameters, COLOUR_PARAMETERS)
        if "openpbr" in parameters:
            parameters["openpbr"] = converted(parameters["openpbr"], OPENPBR_COLOURS)
        return parameters

    def in_use(self, material: UsdShade.Material) -> tuple[Surface, int] | None:
        """Returns a material's surface, and its id if meshes already use the material."""
        known = self._by_object.get(id(material))
        return None if known is None else self._surface_ids.get(id(known[1]))

    def plain_in_use(self) -> int | None:
        """Returns the id of the default display colour if meshes already use that colour."""
        return self._plain.get((*DEFAULT_COLOUR, 1.0))

    def paths(self) -> tuple[str, ...]:
        """Returns the prim path of each material by id; empty for materials of display colours."""
        return tuple(name if name.startswith("/") else "" for name in self._names)

    def any_emits(self, material: int, faces: NDArray[np.uint32] | None) -> bool:
        """Returns whether a mesh with these materials, one or one per face, emits light."""
        if faces is None or not self._emitting:
            return material in self._emitting
        return bool(np.isin(faces, list(self._emitting)).any())

    def mean_emission(self, material: int) -> float:
        """Returns the mean luminance that a material emits; 0 if too low to count as a light.

        Textures contribute the mean of their files, and primvars their highest value.
        """
        surface, highest = self._emission.get(material, (None, 0.0))
        if surface is None or max(highest, surface.brightest()) < MIN_EMISSION:
            return 0.0
        rgb = mean_emission(surface, self._textures)
        return max(float(rgb @ np.array(LUMINANCE)), highest)

    def plain(
        self,
        colour: Iterable[float] = DEFAULT_COLOUR,
        opacity: float = 1.0,
        varying: tuple[str, ...] = (),
    ) -> int:
        """Returns the material id of a display colour.

        ``varying`` lists the parameters, base_color or opacity, that read primvars at each hit.
        """
        key = (*colour, opacity, *varying)
        number = self._plain.get(key)
        if number is None:
            r, g, b = (max(float(value), 0.0) for value in colour)
            surface = fallback_surface((r, g, b), float(opacity), varying=varying)
            number = self._plain[key] = self.add(self.varied(surface, varying))
        return number

    def splats(self) -> int:
        """Returns the material id for Gaussian splats, which store their radiance."""
        return self.add(SPLATS)

    def _convert(self, material: UsdShade.Material) -> Surface:
        prim = material.GetPrim()
        kind, shader = surface_source(material)
        if kind == PREVIEW:
            return PreviewReader(prim, self.time, self._textures, self._report).read(shader)
        if kind:
            read = mtlx.surface(prim, self.time, self._textures, self._report, shader, kind)
            return read or _stand_in(prim)
        found = surface_outputs(material)
        if not found and (inside := filling(material, self.time, self._report)) is not None:
            return inside
        if found:
            what = ", ".join(f"{shader_name(one)} of {output}" for output, one in found)
            self._report.missing(f"surface shader {what} ({_INSTEAD})", prim.GetPath())
        elif not material.GetSurfaceOutputs():
            self._report.warn(f"material without a surface: {_INSTEAD}", prim.GetPath())
        else:
            what = f"material whose surface output is not connected: {_INSTEAD}"
            self._report.warn(what, prim.GetPath())
        return _stand_in(prim)


def _stand_in(material: Usd.Prim) -> Surface:
    """Returns the surface that replaces a material that cannot be rendered."""
    return replace(fallback_surface(DEFAULT_COLOUR, name=str(material.GetPath())), stand_in=True)


def with_attributes(surface: Surface, varying: Sequence[str], working: str) -> Surface:
    """Returns the surface with the parameters ``varying`` read from primvars at each hit.

    Raises:
        GraphTooLarge: The extended graph exceeds the size limit.
    """
    make = Expressions()
    graph = surface.graph
    outputs = {} if graph is None else dict(graph.outputs)
    names = () if graph is None else graph.primvars
    for parameter in varying:
        width = PARAMETERS[parameter][1]
        given = surface.parameters.get(parameter, DEFAULTS[parameter])
        constant = given if isinstance(given, (tuple, list)) else (given,)
        fallback = fit(numbers(*(float(x) for x in constant)), width)
        value = make.attribute(surface.primvars[parameter], width, fallback)
        if parameter in COLOUR_PARAMETERS:
            value = in_working_space(make, value, working)
        outputs[parameter] = value
    rest = {key: name for key, name in surface.primvars.items() if key not in varying}
    return replace(surface, primvars=rest, graph=graphs_of(outputs, names))


def mean_emission(surface: Surface, textures: TextureTable) -> NDArray[np.float64]:
    """Returns the mean emission (3,) over texture coordinates; for graphs it is an estimate."""
    graph = surface.graph
    if graph is not None and graph.emission is not None:
        value = dict(graph.outputs)["emission"]
        white = np.broadcast_to(sampled(value).mean(axis=0, dtype=np.float64), 3)
        means = [textures.mean(texture)[:3] for texture, _ in graph.emission.images]
        return np.asarray(white * np.mean(means, axis=0) if means else white)
    use = surface.textures.get("emission")
    if use is None:
        emission = surface.parameters.get("emission", (0.0, 0.0, 0.0))
        return np.asarray(emission, np.float64)
    texel = textures.mean(use["texture"])
    value = texel * np.array(use["scale"]) + np.array(use["bias"])
    if use["channel"] == "rgb":
        return np.asarray(value[:3])
    return np.full(3, value["rgba".index(use["channel"])])
