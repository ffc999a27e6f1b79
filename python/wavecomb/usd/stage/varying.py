# SPDX-License-Identifier: Apache-2.0
"""What of an open stage changes with time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from pxr import Sdf, Usd

# Prototypes of point instancers may be overs or classes.
_ANY = Usd.PrimIsActive & Usd.PrimIsLoaded
_PROXIES = Usd.TraverseInstanceProxies(_ANY)

_FRAMES = ("", "Xform", "Scope", "Camera")
"""Types of prims that draw nothing and give nothing to what is drawn."""

_UNREAD = ("RenderSettings", "RenderProduct", "RenderVar", "RenderPass")
"""Types whose values at a time are never read."""


class Varying:
    """The attributes of a stage whose values may change with time, found once.

    By samples, splines and value clips, as USD says. The stage must not change meanwhile.
    """

    def __init__(self, stage: Usd.Stage) -> None:
        self._prims: dict[Sdf.Path, list[str]] = {}
        sources: set[Sdf.Path] = set()
        # Clips may bring values to attributes that nothing else authors.
        clipped = any(prim.HasAuthoredMetadata("clips") for prim in _everything(stage))
        for prim in _everything(stage):
            names = []
            for attribute in prim.GetAttributes() if clipped else prim.GetAuthoredAttributes():
                if attribute.ValueMightBeTimeVarying() or _carries(attribute):
                    names.append(attribute.GetName())
                if attribute.HasAuthoredConnections():
                    sources.update(path.GetPrimPath() for path in attribute.GetConnections())
            if names:
                self._prims[prim.GetPath()] = names
        self._stage = stage
        self._is_view_only = all(
            path not in sources and self._is_harmless(path, names)
            for path, names in self._prims.items()
        )

    @property
    def is_view_only(self) -> bool:
        """Whether at most the views of cameras change: all that is drawn stays."""
        return self._is_view_only

    @property
    def paths(self) -> list[Sdf.Path]:
        """Prims with attributes that change."""
        return list(self._prims)

    def of(self, prim: Usd.Prim, inherited: Sequence[Any] = ()) -> bool:
        """Whether the attributes of a prim change, or the primvars that it inherits."""
        if not self._prims:
            return False
        path = prim.GetPath()
        return path in self._prims or any(
            primvar.GetAttr().GetPrimPath() in self._prims for primvar in inherited
        )

    def _is_harmless(self, path: Sdf.Path, names: Sequence[str]) -> bool:
        """Whether what changes on a prim acts on cameras only."""
        prim = self._stage.GetPrimAtPath(path)
        kind = prim.GetTypeName()
        if kind in _UNREAD:
            return True
        if kind != "Camera" and not all(
            name.startswith("xformOp:") or name == "visibility" for name in names
        ):
            return False
        return all(
            below.GetTypeName() in _FRAMES and not below.IsInstance()
            for below in Usd.PrimRange(prim, _PROXIES)
        )


def _everything(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Every prim that may be read, those of instances once."""
    yield from Usd.PrimRange.Stage(stage, _ANY)
    for prototype in stage.GetPrototypes():
        yield from Usd.PrimRange(prototype, _ANY)


def _carries(attribute: Usd.Attribute) -> bool:
    """Whether a single sample of it moves points at other times."""
    return attribute.GetName() == "velocities" and attribute.GetNumTimeSamples() > 0
