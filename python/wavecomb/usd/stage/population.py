# SPDX-License-Identifier: Apache-2.0
"""Parts of a stage: population masks, payloads, and prims of a kind.

Patterns of prim paths are OpenUSD's path expressions, as ``/World/set/*`` or ``//lamp?``: ``*`` and
``?`` stand for any letters and any one letter of a name, ``[ab]`` for one of those, and ``//`` for
any number of names between.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from fnmatch import translate

from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdRender

from wavecomb.errors import WavecombError
from wavecomb.usd.stage.report import LoadReport

_FOLLOWED = ("material:binding", "prototypes", "skel:", "light:filters", "portals", "field:")
"""What names of relationships begin with whose targets are needed to draw a prim."""

_PROXIES = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


def populate(stage: Usd.Stage, paths: Sequence[str]) -> None:
    """Leaves of a stage the prims at and below some paths, their ancestors, and what they need.

    That is: materials, prototypes of point instancers and what shaders connect to; all cameras,
    lights and render settings, but for those inside of instances that are left out.

    ``paths`` may be patterns, of prims that are in no instance.

    Raises:
        WavecombError: A path or pattern names no prim.
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
    """Prims that a pattern is the path of, but those below others."""
    found = []
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot()))
    for prim in prims:
        if pattern.matches(prim.GetPath()):
            found.append(prim.GetPath())
            prims.PruneChildren()
    return found


def _outside_instances(stage: Usd.Stage, path: Sdf.Path) -> Sdf.Path:
    """The path, or that of the instance around it: masks know no prims inside of instances."""
    for prefix in path.GetPrefixes():
        if stage.GetPrimAtPath(prefix).IsInstance():
            return prefix
    return path


def _always(stage: Usd.Stage) -> Iterator[Sdf.Path]:
    """Cameras, lights and render settings that are in no instance."""
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
    """Prims that those at and below some prims, or above them, point to."""
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
                # What a collection holds is there or is not; naming it asks for none of it.
                if target.IsPrimPath():
                    yield target
    for attribute in prim.GetAuthoredAttributes():
        if attribute.HasAuthoredConnections():
            for source in attribute.GetConnections():
                yield source.GetPrimPath()


NONE = "none"
"""In place of patterns: no payload."""


def load_payloads(stage: Usd.Stage, wanted: Sequence[str]) -> None:
    """Loads payloads of a stage that was opened without any.

    Those of prims that a pattern is the path of, or that are below such prims, and those above that
    the names of a pattern lead through.

    Args:
        stage: Opened with ``Usd.Stage.LoadNone``.
        wanted: Patterns, or ``NONE``.

    Raises:
        WavecombError: A pattern is none, or the stage has no such payload.
    """
    if NONE in wanted:
        if len(wanted) > 1:
            raise WavecombError(f"payloads: {NONE} goes with no pattern")
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


def tell_unloaded(stage: Usd.Stage, report: LoadReport) -> None:
    """Notes payloads that the stage was opened without."""
    if stage.GetLoadRules() == Usd.StageLoadRules.LoadAll():
        return
    loaded = set(stage.GetLoadSet())
    for path in stage.FindLoadable():
        if path not in loaded:
            report.note("payloads that are not loaded", path)


class PathPattern:
    """A pattern, or the path of one prim."""

    def __init__(self, text: str, what: str) -> None:
        """``what``: The option, for errors. Raises WavecombError where it is no pattern."""
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
        """Whether it is the path of a prim."""
        if self._whole is not None:
            return self._whole.match(path.pathString) is not None
        names = _names(path)
        return len(names) == len(self._names) and self._fits(names)

    def may_be_below(self, path: Sdf.Path) -> bool:
        """Whether names that it spells out, those before ``//``, lead through a prim."""
        names = _names(path)
        return len(names) < len(self._names) and self._fits(names)

    def is_at_or_above(self, path: Sdf.Path) -> bool:
        """Whether it is the path of a prim or of one of its ancestors."""
        return any(self.matches(prefix) for prefix in path.GetPrefixes())

    def _fits(self, names: list[str]) -> bool:
        return all(want.match(name) for want, name in zip(self._names, names, strict=False))


def _names(path: Sdf.Path) -> list[str]:
    return [name for name in path.pathString.split("/") if name]


def _of_name(pattern: str) -> str:
    """A regular expression of what a pattern says of one name."""
    marks = re.split(r"(\*|\?|\[[^]]*\])", pattern)
    words = {"*": "[^/]*", "?": "[^/]"}
    return "".join(words.get(mark) or _letters(mark) for mark in marks)


def _letters(text: str) -> str:
    """A regular expression of letters or of ``[these]``; ranges that are none match none."""
    if not (text.startswith("[") and text.endswith("]")):
        return re.escape(text)
    found = "[^" + text[2:] if text.startswith("[!") else text
    try:
        re.compile(found)
    except re.error:
        return "(?!)"
    return found


Test = Callable[[Usd.Prim], bool]


def every(stage: Usd.Stage, wanted: Test) -> Iterator[Usd.Prim]:
    """Such prims in the stage's order; in instances as proxies, one for each instance.

    Instances that hold none are passed by: a few of them, nested, may mean billions of prims.
    """
    holding = holders(stage, wanted)
    walk = iter(Usd.PrimRange.Stage(stage, _PROXIES if holding else Usd.PrimDefaultPredicate))
    for prim in walk:
        if wanted(prim):
            yield prim
        if holding and prim.IsInstance() and prim.GetPrototype().GetPath() not in holding:
            walk.PruneChildren()


def holders(stage: Usd.Stage, wanted: Test) -> set[Sdf.Path]:
    """Prototypes with such a prim in them, or in what they instance."""
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
