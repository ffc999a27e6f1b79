# SPDX-License-Identifier: Apache-2.0
"""Visibility of prims on a stage, and the visibility opinions that show or hide a prim."""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Sdf, Usd, UsdGeom

Words = dict[Sdf.Path, str]
"""Visibility opinion of each prim, "invisible" or "inherited"."""

VISIBLE, HIDDEN, HIDDEN_ABOVE, NOT_DRAWN = "visible", "hidden", "hidden above", ""
"""Results of ``state``: drawn, hidden by an opinion of the prim, hidden by an ancestor, or not
drawable."""


def uneditable(prim: Usd.Prim) -> str:
    """Returns why the visibility of a prim cannot be edited, or "" if it can."""
    if not prim:
        return "it is not on the stage"
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        return "it is inside an instance; show or hide the whole instance"
    if not prim.IsA(UsdGeom.Imageable):
        return f"a {prim.GetTypeName() or 'prim without a type'} is not drawn"
    return ""


def says_hidden(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Returns whether the prim's attribute is "invisible"."""
    return bool(prim.GetAttribute("visibility").Get(time) == "invisible")


def state(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[str, Sdf.Path | None]:
    """Returns the visibility state of a prim, and the prim that hides it (or None)."""
    if not prim or not prim.IsA(UsdGeom.Imageable):
        return NOT_DRAWN, None
    if says_hidden(prim, time):
        return HIDDEN, prim.GetPath()
    above = prim.GetParent()
    while above and not above.IsPseudoRoot():
        if says_hidden(above, time):
            return HIDDEN_ABOVE, above.GetPath()
        above = above.GetParent()
    return VISIBLE, None


def hide(
    prim: Usd.Prim, time: Usd.TimeCode, pending: Mapping[Sdf.Path, bool] | None = None
) -> Words:
    """Returns the opinions that ``UsdGeom.Imageable.MakeInvisible`` would author.

    Args:
        prim: An imageable prim.
        time: Time code of the stage.
        pending: Prims that will be hidden (True) or shown (False).
    """
    known = (pending or {}).get(prim.GetPath())
    hidden = says_hidden(prim, time) if known is None else known
    return {} if hidden else {prim.GetPath(): "invisible"}


def show(
    prim: Usd.Prim, time: Usd.TimeCode, pending: Mapping[Sdf.Path, bool] | None = None
) -> Words:
    """Returns the opinions that ``UsdGeom.Imageable.MakeVisible`` would author.

    The opinions show the given prim and no other hidden prim. An invisible ancestor of the prim
    becomes visible. Siblings along the path to the prim become invisible, so that everything below
    the ancestor except the prim stays hidden.
    """
    chain = [prim]
    while chain[-1].GetParent() and not chain[-1].GetParent().IsPseudoRoot():
        chain.append(chain[-1].GetParent())
    planned = dict(pending or {})

    def hidden(one: Usd.Prim) -> bool:
        known = planned.get(one.GetPath())
        return says_hidden(one, time) if known is None else known

    out: Words = {}
    above_hidden = False
    for step, below in zip(reversed(chain), [*reversed(chain[:-1]), None], strict=True):
        if hidden(step):
            out[step.GetPath()] = "inherited"
            above_hidden = True
        if below is None or not above_hidden:
            continue
        for child in step.GetAllChildren():
            beside = child != below and child.IsA(UsdGeom.Imageable)
            if beside and not hidden(child):
                out[child.GetPath()] = "invisible"
    return out
