# SPDX-License-Identifier: Apache-2.0
"""What is visible on a stage, and what must be said to make it so. Authors nothing."""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Sdf, Usd, UsdGeom

Words = dict[Sdf.Path, str]
"""Prim -> "invisible" or "inherited"."""

VISIBLE, HIDDEN, HIDDEN_ABOVE, NOT_DRAWN = "visible", "hidden", "hidden above", ""
"""``state``: drawn; hidden itself; by an ancestor; not a thing to be drawn."""


def uneditable(prim: Usd.Prim) -> str:
    """Why the visibility of a prim cannot be edited; "" where it can."""
    if not prim:
        return "it is not on the stage"
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        return "it is inside an instance; show or hide the whole instance"
    if not prim.IsA(UsdGeom.Imageable):
        return f"a {prim.GetTypeName() or 'prim without a type'} is not drawn"
    return ""


def says_hidden(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Whether the prim's own attribute says invisible."""
    return bool(prim.GetAttribute("visibility").Get(time) == "invisible")


def state(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[str, Sdf.Path | None]:
    """The state of a prim, and the prim that hides it."""
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
    """What ``UsdGeom.Imageable.MakeInvisible`` would author.

    Args:
        prim: Imageable.
        time: Of the stage.
        pending: Prims that are about to be hidden (True) or not.
    """
    known = (pending or {}).get(prim.GetPath())
    hidden = says_hidden(prim, time) if known is None else known
    return {} if hidden else {prim.GetPath(): "invisible"}


def show(
    prim: Usd.Prim, time: Usd.TimeCode, pending: Mapping[Sdf.Path, bool] | None = None
) -> Words:
    """What ``UsdGeom.Imageable.MakeVisible`` would author: shows this prim and nothing else.

    An ancestor that hides it no longer does, and so that all else below that one stays hidden,
    what is beside the way to the prim is hidden itself.
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
