# SPDX-License-Identifier: Apache-2.0
"""Patterns of prim paths: ``/World/set/*``, ``//lamp?``, as OpenUSD's path expressions have them.

``*`` and ``?`` stand for any letters and any one letter of a name, ``[ab]`` for one of those, and
``//`` for any number of names between.
"""

from __future__ import annotations

import re
from fnmatch import translate

from pxr import Sdf

from wavecomb.errors import WavecombError


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
