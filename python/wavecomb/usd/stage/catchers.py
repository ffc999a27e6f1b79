# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers: what each of the three renders sees that make one (docs/visibility.md)."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Sdf, Usd

from wavecomb import _core
from wavecomb.errors import WavecombError
from wavecomb.load_options import LoadOptions

IGNORED = {
    "through": frozenset[str](),
    "lit": frozenset({"holdout"}),
    "bare": frozenset({"holdout", "shadow", "bounces"}),
}
"""Kinds of rays of which prims have no say, by ``LoadOptions.catch``."""


def check_there(stage: Usd.Stage, option: str, paths: Iterable[str]) -> None:
    """Raises WavecombError for a path of an option that leads to no prim."""
    for path in paths:
        if not Sdf.Path.IsValidPathString(path) or not stage.GetPrimAtPath(path):
            raise WavecombError(f"{option} {path}: there is no such prim")


def set_catchers(
    stage: Usd.Stage, options: LoadOptions, authored: list[str], builder: _core.SceneBuilder
) -> tuple[str, ...]:
    """Tells the scene which rays see what; gives the paths of catchers.

    Args:
        stage: That was read.
        options: How.
        authored: Paths that the stage names.
        builder: Of the scene; it was told what prims say.

    Raises:
        WavecombError: A path that an option gives leads to no prim.
    """
    check_there(stage, "--catcher", options.catchers)
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
