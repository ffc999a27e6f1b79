# SPDX-License-Identifier: Apache-2.0
"""Restricts stages to subsets of their prims: population masks, payloads, path patterns.

Patterns of prim paths follow OpenUSD's path expressions, such as ``/World/set/*`` or ``//lamp?``.
``*`` matches any characters of a name, ``?`` one character, ``[ab]`` one of the characters a and b,
and ``//`` any number of path elements.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from fnmatch import translate

from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdRender

from wavecomb.errors import WavecombError
from wavecomb.usd.stage.report import LoadReport

_FOLLOWED = ("material:binding", "prototypes", "skel:", "light:filters", "portals", "field:")
"""Prefixes of relationships whose targets are needed to render a prim."""

_PROXIES = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


def populate(stage: Usd.Stage, paths: Sequence[str]) -> None:
    """Restricts a stage to given prims with their descendants, ancestors and dependencies.

    Dependencies are materials, prototypes of point instancers and sources of shader connections.
    All cameras, lights and render settings are kept, unless they are inside instances that are left
    out.

    ``paths`` may contain patterns, which match only prims outside of instances.

    Raises:
        WavecombError: A path or pattern matches no prim.
    """
    mask = Usd.StagePopulationMask()
    for text in paths:
        pattern = PathPattern(text, "mask")
        found = _matching(stage, pattern) if pattern.is_pattern else [Sdf.Path(text)]
        if not found or not stage.GetPrimAtPath(found[0]):
            raise WavecombError(f"mask {text}: the stage has no such prim")
        for path in found:
            mask.Add(_outside_instances(stage, path))
    for path in list(_always(stage)):
        mask.Add(path)
    stage.SetPopulationMask(mask)
    todo = [stage.GetPrimAtPath(path) for path in mask.GetPaths()]
    while todo:
        new = [path for path in set(_needed(todo)) if not mask.IncludesSubtree(path)]
        for path in new:
            mask.Add(path)
        stage.SetPopulationMask(mask)
        todo = [prim for prim in map(stage.GetPrimAtPath, new) if prim]


def _matching(stage: Usd.Stage, pattern: PathPattern) -> list[Sdf.Path]:
    """Returns the topmost prims whose paths match a pattern."""
    found = []
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot()))
    for prim in prims:
        if pattern.matches(prim.GetPath()):
            found.append(prim.GetPath())
            prims.PruneChildren()
    return found


def _outside_instances(stage: Usd.Stage, path: Sdf.Path) -> Sdf.Path:
    """Returns the path of a prim or, for a prim inside an instance, the path of the instance."""
    for prefix in path.GetPrefixes():
        if stage.GetPrimAtPath(prefix).IsInstance():
            return prefix
    return path


def _always(stage: Usd.Stage) -> Iterator[Sdf.Path]:
    """Yields cameras, lights and render settings that are not inside instances."""
    kinds: dict[str, bool] = {}
    for prim in stage.Traverse():
        name = prim.GetTypeName()
        if name not in kinds:
            kinds[name] = any(
                prim.IsA(kind)
                for kind in (
                    UsdGeom.Camera,
                    UsdLux.BoundableLightBase,
                    UsdLux.NonboundableLightBase,
                    UsdRender.SettingsBase,
                )
            )
        if kinds[name]:
            yield prim.GetPath()


def _needed(prims: Iterable[Usd.Prim]) -> Iterator[Sdf.Path]:
    """Yields the prims to which given prims, their descendants or their ancestors refer."""
    for top in prims:
        if not top:
            continue
        above = top.GetParent()
        while above:
            yield from _targets(above)
            above = above.GetParent()
        for prim in Usd.PrimRange(top, _PROXIES):
            yield from _targets(prim)


def _targets(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    for relation in prim.GetAuthoredRelationships():
        if relation.GetName().startswith(_FOLLOWED):
            for target in relation.GetTargets():
                # Skip targets that are collections. A prim need not be loaded just because it
                # belongs to a collection.
                if target.IsPrimPath():
                    yield target
    for attribute in prim.GetAuthoredAttributes():
        if attribute.HasAuthoredConnections():
            for source in attribute.GetConnections():
                yield source.GetPrimPath()


NONE = "none"
"""Value of the payload option that loads no payloads."""


def load_payloads(stage: Usd.Stage, wanted: Sequence[str]) -> None:
    """Loads payloads of a stage that was opened without any.

    The function loads the payloads of prims that match a pattern, of their descendants, and of
    those ancestors that the pattern names explicitly.

    Args:
        stage: A stage opened with ``Usd.Stage.LoadNone``.
        wanted: Patterns, or ``NONE``.

    Raises:
        WavecombError: A pattern is invalid, or the stage has no matching payload.
    """
    if NONE in wanted:
        if len(wanted) > 1:
            raise WavecombError(f"payloads: {NONE} cannot be combined with a pattern")
        return
    patterns = [PathPattern(text, "payloads") for text in wanted]
    met: set[str] = set()
    seen: set[Sdf.Path] = set()
    while True:
        new = [path for path in stage.FindLoadable() if path not in seen]
        seen.update(new)
        chosen = set()
        for path in new:
            mine = [one.text for one in patterns if one.is_at_or_above(path)]
            met.update(mine)
            if mine or any(one.may_be_below(path) for one in patterns):
                chosen.add(path)
        if not chosen:
            break
        stage.LoadAndUnload(chosen, set(), Usd.LoadWithoutDescendants)
    for text in wanted:
        if text not in met:
            raise WavecombError(f"payloads {text}: the stage has no such payload")


def report_unloaded_payloads(stage: Usd.Stage, report: LoadReport) -> None:
    """Reports payloads that are not loaded."""
    if stage.GetLoadRules() == Usd.StageLoadRules.LoadAll():
        return
    loaded = set(stage.GetLoadSet())
    for path in stage.FindLoadable():
        if path not in loaded:
            report.note("payloads that are not loaded", path)


class PathPattern:
    """A pattern of prim paths, or the path of one prim."""

    def __init__(self, text: str, what: str) -> None:
        """``what`` names the option in errors. Raises WavecombError for invalid patterns."""
        self.text = text
        self.is_pattern = any(mark in text for mark in ("*", "?", "[", "//"))
        plain = re.sub(r"\[[^]/]*\]|[*?]", "a", text).replace("//", "/")
        good = Sdf.Path.IsValidPathString(plain) and plain.startswith("/")
        if not (good and Sdf.Path(plain).IsAbsoluteRootOrPrimPath()):
            kind = "pattern of absolute paths of prims" if self.is_pattern else ""
            raise WavecombError(f"{what} {text}: is not the {kind or 'absolute path of a prim'}")
        head = text.split("//")[0]
        self._names = [re.compile(translate(name)) for name in head.split("/")[1:] if name]
        self._whole = None
        if "//" in text:
            parts = [
                "".join("/" + _of_name(name) for name in part.split("/") if name)
                for part in text.split("//")
            ]
            between = "(?:/[^/]+)*"
            self._whole = re.compile(between.join(parts) + r"\Z")

    def matches(self, path: Sdf.Path) -> bool:
        """Returns whether the pattern matches this prim path."""
        if self._whole is not None:
            return self._whole.match(path.pathString) is not None
        names = _names(path)
        return len(names) == len(self._names) and self._fits(names)

    def may_be_below(self, path: Sdf.Path) -> bool:
        """Returns whether prims below a path can match the pattern's names before ``//``."""
        names = _names(path)
        return len(names) < len(self._names) and self._fits(names)

    def is_at_or_above(self, path: Sdf.Path) -> bool:
        """Returns whether the pattern matches a prim or one of its ancestors."""
        return any(self.matches(prefix) for prefix in path.GetPrefixes())

    def _fits(self, names: list[str]) -> bool:
        return all(want.match(name) for want, name in zip(self._names, names, strict=False))


def _names(path: Sdf.Path) -> list[str]:
    return [name for name in path.pathString.split("/") if name]


def _of_name(pattern: str) -> str:
    """Converts the pattern of one path element to a regular expression."""
    marks = re.split(r"(\*|\?|\[[^]]*\])", pattern)
    words = {"*": "[^/]*", "?": "[^/]"}
    return "".join(words.get(mark) or _letters(mark) for mark in marks)


def _letters(text: str) -> str:
    """Converts literal text or ``[...]`` to a regular expression.

    An invalid character range becomes an expression that matches nothing.
    """
    if not (text.startswith("[") and text.endswith("]")):
        return re.escape(text)
    found = "[^" + text[2:] if text.startswith("[!") else text
    try:
        re.compile(found)
    except re.error:
        return "(?!)"
    return found


Test = Callable[[Usd.Prim], bool]


def matching_prims(stage: Usd.Stage, wanted: Test) -> Iterator[Usd.Prim]:
    """Yields matching prims in stage order; prims inside instances are proxies, once per instance.

    Instances without matching prims are skipped, since nested instances may contain billions of
    prims.
    """
    holding = containing_prototypes(stage, wanted)
    walk = iter(Usd.PrimRange.Stage(stage, _PROXIES if holding else Usd.PrimDefaultPredicate))
    for prim in walk:
        if wanted(prim):
            yield prim
        if holding and prim.IsInstance() and prim.GetPrototype().GetPath() not in holding:
            walk.PruneChildren()


def containing_prototypes(stage: Usd.Stage, wanted: Test) -> set[Sdf.Path]:
    """Returns the prototypes that contain a matching prim, directly or in nested instances."""
    holding: set[Sdf.Path] = set()
    users: dict[Sdf.Path, list[Sdf.Path]] = {}
    for prototype in stage.GetPrototypes():
        path = prototype.GetPath()
        for prim in Usd.PrimRange(prototype):
            if prim != prototype and wanted(prim):
                holding.add(path)
            if prim.IsInstance():
                users.setdefault(prim.GetPrototype().GetPath(), []).append(path)
    found = list(holding)
    for path in found:
        for user in users.get(path, ()):
            if user not in holding:
                holding.add(user)
                found.append(user)
    return holding
