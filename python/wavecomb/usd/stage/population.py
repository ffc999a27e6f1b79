# SPDX-License-Identifier: Apache-2.0
"""Population masks: a part of a stage, and what that part needs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdRender

from wavecomb.errors import WavecombError
from wavecomb.usd.stage.patterns import PathPattern

_FOLLOWED = ("material:binding", "prototypes", "skel:", "light:filters", "portals", "field:")
"""What names of relationships begin with whose targets are needed to draw a prim."""

_PROXIES = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


def populate(stage: Usd.Stage, paths: Sequence[str]) -> None:
    """Leaves of a stage the prims at and below some paths, their ancestors, and what they need.

    That is: materials, prototypes of point instancers and what shaders connect to; all cameras,
    lights and render settings, but for those inside of instances that are left out.

    ``paths`` may be patterns (``patterns.py``), of prims that are in no instance.

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
