# SPDX-License-Identifier: Apache-2.0
"""Ray visibility of prims, holdouts and shadow catchers (docs/visibility.md)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from pxr import Sdf, Usd

from wavecomb import _core
from wavecomb.errors import WavecombError
from wavecomb.load_options import LoadOptions
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport

_OWN = {
    "primvars:wavecomb:visibility:camera": "camera",
    "primvars:wavecomb:visibility:shadow": "shadow",
    "primvars:wavecomb:visibility:bounces": "bounces",
    "primvars:wavecomb:holdout": "holdout",
}
"""Attributes of Wavecomb, which precede those of other renderers on the same prim."""
_OTHERS = {
    "primvars:arnold:visibility:camera": "camera",
    "primvars:arnold:visibility:shadow": "shadow",
    "primvars:arnold:matte": "holdout",
    "primvars:karma:object:holdoutmode": "holdout",
    "primvars:ri:attributes:visibility:camera": "camera",
    "primvars:ri:attributes:visibility:transmission": "shadow",
    "primvars:ri:attributes:visibility:indirect": "bounces",
    "primvars:ri:attributes:trace:holdout": "holdout",
    "primvars:ri:attributes:Ri:Matte": "holdout",
}
"""Attributes for a single kind of ray; any value other than 0 means visible (or holdout), as for
``_OWN``. If a prim authors the attributes of several renderers, the last entry applies."""
_ARNOLD_BOUNCES = tuple(
    f"primvars:arnold:visibility:{kind}"
    for kind in ("diffuse_reflect", "specular_reflect", "diffuse_transmit", "specular_transmit")
)
_KARMA = "primvars:karma:object:rendervisibility"
_KARMA_KINDS = {
    "primary": "camera",
    "shadow": "shadow",
    "diffuse": "bounces",
    "reflect": "bounces",
    "refract": "bounces",
}
_BY_KIND = "visibility by kinds of bounces"
_CATCHER = "primvars:wavecomb:catcher"
NAMES = frozenset({*_OWN, *_OTHERS, *_ARNOLD_BOUNCES, _KARMA, _CATCHER})
"""Names of all attributes that this module reads."""


class RayVisibility:
    """Reader of the ray visibility of prims, which passes the visibility to the scene.

    Attributes:
        catchers: Paths of prims that are shadow catchers.
    """

    def __init__(self, context: LoadContext, ignored: frozenset[str] = frozenset()) -> None:
        """``ignored`` lists kinds of visibility whose attributes are not read."""
        self._builder, self._report = context.builder, context.report
        self._ignored = ignored
        self.catchers: list[str] = []

    def read(self, prim: Usd.Prim) -> None:
        """Reads the visibility of a prim that authors at least one of ``NAMES``."""
        rays = rays_of(prim, self._report)
        rays = {kind: seen for kind, seen in rays.items() if kind not in self._ignored}
        if prim.GetAttribute(_CATCHER).Get():
            self.catchers.append(self._report.place(str(prim.GetPath())))
        if rays:
            self._builder.add_visibility(self._report.place(str(prim.GetPath())), rays)


def rays_of(prim: Usd.Prim, report: LoadReport | None = None) -> dict[str, bool]:
    """Returns the visibility for kinds of rays that a prim authors.

    Keys are "camera", "shadow", "bounces" and "holdout". The report, if given, receives what is not
    supported.
    """
    rays = _flags(prim, _OTHERS)
    missing: list[str] = []
    bounces = [
        value for name in _ARNOLD_BOUNCES if (value := prim.GetAttribute(name).Get()) is not None
    ]
    if bounces:
        whole = len(bounces) == len(_ARNOLD_BOUNCES) and not any(bounces)
        if not whole and not all(bounces):
            missing.append(_BY_KIND)
        rays["bounces"] = not whole
    mask = prim.GetAttribute(_KARMA).Get()
    if mask is not None:
        rays |= _karma(str(mask), missing)
    rays |= _flags(prim, _OWN)
    if report is not None:
        for what in missing:
            report.missing(what, prim.GetPath())
    return rays


def _flags(prim: Usd.Prim, names: Mapping[str, str]) -> dict[str, bool]:
    """Returns the visibility by the attributes in ``names`` that a prim authors."""
    return {
        kind: bool(value)
        for name, kind in names.items()
        if (value := prim.GetAttribute(name).Get()) is not None
    }


def inherited_rays(prim: Usd.Prim) -> dict[str, bool]:
    """Returns what ``rays_of`` finds on a prim and, where the prim says nothing, above it."""
    rays: dict[str, bool] = {}
    while prim and not prim.IsPseudoRoot():
        if not NAMES.isdisjoint(prim.GetAuthoredPropertyNames()):
            rays = rays_of(prim) | rays
        prim = prim.GetParent()
    return rays


def _karma(mask: str, missing: list[str]) -> dict[str, bool]:
    """Parses a visibility mask of Karma, such as "primary|shadow", "-primary" or "*".

    Adds what is not supported to ``missing``.
    """
    words = [word for word in re.split(r"[|&,\s]+|(?=-)", mask) if word]
    left_out = bool(words) and all(word.startswith("-") for word in words)
    kinds = {word.removeprefix("-") for word in words}
    if "*" in kinds:
        kinds = set(_KARMA_KINDS)
    if not kinds <= _KARMA_KINDS.keys():
        missing.append(f"visibility {mask!r}")
        return {}
    seen = {kind: (kind in kinds) != left_out for kind in _KARMA_KINDS}
    bounces = [seen[kind] for kind, ours in _KARMA_KINDS.items() if ours == "bounces"]
    if any(bounces) and not all(bounces):
        missing.append(_BY_KIND)
    return {"camera": seen["primary"], "shadow": seen["shadow"], "bounces": any(bounces)}


IGNORED = {
    "through": frozenset[str](),
    "lit": frozenset({"holdout"}),
    "bare": frozenset({"holdout", "shadow", "bounces"}),
}
"""Kinds of visibility whose attributes are ignored, for each value of ``LoadOptions.catch``."""


def check_exists(stage: Usd.Stage, option: str, paths: Iterable[str]) -> None:
    """Raises WavecombError if a path that an option gives is not a prim."""
    for path in paths:
        if not Sdf.Path.IsValidPathString(path) or not stage.GetPrimAtPath(path):
            raise WavecombError(f"{option} {path}: there is no such prim")


def set_catchers(
    stage: Usd.Stage, options: LoadOptions, authored: list[str], builder: _core.SceneBuilder
) -> tuple[str, ...]:
    """Sets the visibility of shadow catchers and of all other prims; returns the catchers' paths.

    Args:
        stage: The loaded stage.
        options: Options of the load.
        authored: Paths of catchers that the stage declares.
        builder: Builder of the scene, which already has the prims' authored visibility.

    Raises:
        WavecombError: A path that an option gives is not a prim.
    """
    check_exists(stage, "--catcher", options.catchers)
    paths = tuple(dict.fromkeys((*authored, *options.catchers)))
    if not paths:
        return ()
    if options.catch == "through":
        of_catchers = {"camera": False}
    else:
        rest, of_catchers = {"holdout": True}, {"holdout": False, "camera": True}
        if options.catch == "bare":
            rest |= {"shadow": False, "bounces": False}
            of_catchers |= {"shadow": True, "bounces": True}
        for prim in stage.GetPseudoRoot().GetAllChildren():
            builder.add_visibility(str(prim.GetPath()), rest)
    for path in paths:
        builder.add_visibility(path, of_catchers)
    return paths
