# SPDX-License-Identifier: Apache-2.0
"""MaterialX volumes: ``volume`` with distribution functions, whose coefficients are per metre."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import UsdShade

from wavecomb.usd.looks.network import MAX_DEPTH, shader_id, source_of
from wavecomb.usd.volumes.inputs import Inputs
from wavecomb.usd.volumes.look import BLACK, WHITE, Driven, VolumeLook, grey, share, total

IDENTIFIERS = ("ND_volume", "ND_volume_volumeshader")

_NOTHING = Driven()


@dataclass(frozen=True)
class Medium:
    """What a distribution function says.

    Attributes:
        absorption: Coefficient, per metre.
        scattering: Likewise.
        anisotropy: Mean cosine.
    """

    absorption: Driven = _NOTHING
    scattering: Driven = _NOTHING
    anisotropy: float = 0.0


class ClosureReader:
    """Reads the volume shader of one material."""

    def __init__(self, inputs: Inputs, metres_per_unit: float) -> None:
        self._inputs = inputs
        self._metres = metres_per_unit

    def read(self, shader: UsdShade.Shader) -> VolumeLook:
        """The look of ``volume``."""
        medium = self._medium(shader, "vdf", 0)
        glow = self._glow(shader, "edf", 0)
        absorption = medium.absorption.scaled(grey(self._metres))
        scattering = medium.scattering.scaled(grey(self._metres))
        both = self._sum(absorption, scattering)
        return VolumeLook(
            extinction=both.colour,
            albedo=share(scattering.colour, both.colour),
            anisotropy=medium.anisotropy,
            emission=glow.scaled(grey(self._metres)).colour,
            density=both.field,
            glow=glow.field,
            name=str(self._inputs.material.GetPath()),
        )

    def _sum(self, one: Driven, two: Driven) -> Driven:
        """Of two that read one field; of others the second one's counts, and that is said."""
        if one.is_black:
            return two
        if two.is_black:
            return one
        if one.field != two.field:
            what = "volume coefficients that read several fields (one taken for all)"
            self._inputs.report.missing(what, self._inputs.material.GetPath())
        return Driven(total(one.colour, two.colour), two.field or one.field)

    def _closure(self, shader: UsdShade.Shader, name: str) -> UsdShade.Shader | None:
        source = source_of(shader, name, self._inputs.time)
        return None if source is None else source.shader

    def _medium(self, shader: UsdShade.Shader, name: str, depth: int) -> Medium:
        """The distribution function that feeds an input; nothing where nothing does."""
        node = self._closure(shader, name)
        if node is None:
            return Medium()
        kind, inputs = shader_id(node), self._inputs
        if kind.startswith("ND_anisotropic_vdf"):
            return Medium(
                inputs.driven(node, "absorption"),
                inputs.driven(node, "scattering"),
                inputs.number(node, "anisotropy", 0.0),
            )
        if kind.startswith("ND_absorption_vdf"):
            return Medium(inputs.driven(node, "absorption"))
        if depth < MAX_DEPTH:
            if kind.startswith("ND_multiply_vdf"):
                return self._times(self._medium(node, "in1", depth + 1), node)
            if kind.startswith("ND_add_vdf"):
                one, two = (self._medium(node, each, depth + 1) for each in ("in1", "in2"))
                return self._added(one, two)
            if kind.startswith("ND_mix_vdf"):
                mix = min(max(inputs.number(node, "mix", 0.0), 0.0), 1.0)
                front = _scaled(self._medium(node, "fg", depth + 1), mix)
                back = _scaled(self._medium(node, "bg", depth + 1), 1.0 - mix)
                return self._added(front, back)
        self._left_out(node)
        return Medium()

    def _times(self, medium: Medium, node: UsdShade.Shader) -> Medium:
        by = self._inputs.driven(node, "in2", WHITE)
        return Medium(
            self._driven_by(medium.absorption, by),
            self._driven_by(medium.scattering, by),
            medium.anisotropy,
        )

    def _driven_by(self, one: Driven, by: Driven) -> Driven:
        if one.field and by.field and not one.is_black:
            what = "products of fields in a volume (the first taken)"
            self._inputs.report.missing(what, self._inputs.material.GetPath())
        return Driven(one.scaled(by.colour).colour, one.field or by.field)

    def _added(self, one: Medium, two: Medium) -> Medium:
        scattering = self._sum(one.scattering, two.scattering)
        weight = sum(one.scattering.colour), sum(two.scattering.colour)
        mean = one.anisotropy * weight[0] + two.anisotropy * weight[1]
        return Medium(
            self._sum(one.absorption, two.absorption),
            scattering,
            mean / sum(weight) if sum(weight) > 0 else 0.0,
        )

    def _glow(self, shader: UsdShade.Shader, name: str, depth: int) -> Driven:
        """The radiance of the emission that feeds an input."""
        node = self._closure(shader, name)
        if node is None:
            return Driven(BLACK)
        kind = shader_id(node)
        if kind.startswith("ND_uniform_edf"):
            return self._inputs.driven(node, "color", WHITE)
        if kind.startswith("ND_multiply_edf") and depth < MAX_DEPTH:
            by = self._inputs.driven(node, "in2", WHITE)
            return self._driven_by(self._glow(node, "in1", depth + 1), by)
        if kind.startswith("ND_add_edf") and depth < MAX_DEPTH:
            one, two = (self._glow(node, each, depth + 1) for each in ("in1", "in2"))
            return self._sum(one, two)
        self._left_out(node)
        return Driven(BLACK)

    def _left_out(self, node: UsdShade.Shader) -> None:
        kind = shader_id(node) or "node without an id"
        self._inputs.report.missing(f"{kind} in a volume (left out)", node.GetPath())


def _scaled(medium: Medium, by: float) -> Medium:
    weight = grey(by)
    return Medium(
        medium.absorption.scaled(weight), medium.scattering.scaled(weight), medium.anisotropy
    )
