# SPDX-License-Identifier: Apache-2.0
"""MaterialX documents: the XML of a file and of what it includes, and the files that it names."""

from __future__ import annotations

import os
import posixpath
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

from pxr import Ar, UsdShade

from wavecomb.path_maps import mapped, own_maps
from wavecomb.picture.files import kind_of
from wavecomb.usd.materialx.library import library

MAX_DEPTH = 64
"""Elements inside of each other; MaterialX reads them with as many calls inside of each other."""

MAX_INCLUDES = 256
"""Files that one document may include, those of its includes too."""

MAX_CHAIN = 32
"""Files that include each other, one the next: each copies what those below it hold."""

MAX_BYTES = 1 << 26
"""Most bytes of a document with all that it includes."""

_INCLUDE = "http://www.w3.org/2001/XInclude include"


class MtlxError(Exception):
    """Why a file cannot be read, as a few words."""


@dataclass(frozen=True)
class Document:
    """A document with the definitions that come with MaterialX behind it.

    Attributes:
        root: MaterialX's own. Once it has definitions behind it, it gives these with its own ones.
        file: That was asked for.
        graphs: Its node graphs.
        definitions: Names of the node definitions that are its own.
    """

    root: Any
    file: str
    graphs: tuple[Any, ...]
    definitions: frozenset[str]


def read_document(path: str) -> Document:
    """The document of a file with all that it includes, of the newest version.

    Args:
        path: As Ar resolved it; may be in a .usdz.

    Raises:
        MtlxError: It cannot be read.
    """
    root = _read(path, (), _Budget())
    graphs = tuple(root.getNodeGraphs())
    definitions = frozenset(item.getName() for item in root.getNodeDefs())
    root.setDataLibrary(library())
    return Document(root, path, graphs, definitions)


@dataclass
class _Budget:
    """What a document may still include."""

    files: int = MAX_INCLUDES
    bytes: int = MAX_BYTES


def _read(path: str, above: tuple[str, ...], left: _Budget) -> Any:
    """One file; ``above``: those that include it."""
    import MaterialX as mx

    data = _bytes(path, left.bytes)
    left.bytes -= len(data)
    includes = _check(data)
    options = mx.XmlReadOptions()
    options.readXIncludeFunction = None
    document = mx.createDocument()
    try:
        mx.readFromXmlString(document, data.decode("utf-8-sig"), mx.FileSearchPath(), options)
        document.setSourceUri(path)
        for name in includes:
            other = resolve(name, path)
            if not other:
                raise MtlxError(f"it includes {name}, which is not there")
            if other in (*above, path):
                raise MtlxError(f"it includes {name}, which includes it")
            left.files -= 1
            if left.files < 0:
                raise MtlxError(f"it includes more than {MAX_INCLUDES} files")
            if len(above) + 1 >= MAX_CHAIN:
                raise MtlxError(f"more than {MAX_CHAIN} files include each other")
            try:
                document.importLibrary(_read(other, (*above, path), left))
            except MtlxError as error:
                # Of a chain the last file says enough.
                known = str(error).startswith("in ")
                why = error if known else f"in {name}, which it includes: {error}"
                raise MtlxError(str(why)) from None
    except UnicodeDecodeError:
        raise MtlxError("it is not UTF-8") from None
    except MtlxError:
        raise
    except Exception as error:  # bindings raise types of their own
        raise MtlxError(" ".join(str(error).split())[:200]) from None
    return document


def _bytes(path: str, most: int) -> bytes:
    if not (Ar.IsPackageRelativePath(path) or "://" in path or os.path.isfile(path)):
        kind = kind_of(path)
        raise MtlxError("it is no file" if kind is None else f"it is {kind}, not a regular file")
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise MtlxError("it cannot be opened")
    if asset.GetSize() > most:
        raise MtlxError(f"with what it includes it has more than {MAX_BYTES >> 20} MB")
    return bytes(asset.GetBuffer() or b"")


def _check(data: bytes) -> list[str]:
    """The files that a document includes.

    Raises:
        MtlxError: It is no XML, no MaterialX, or nested more than MaterialX may be given.
    """
    includes: list[str] = []
    open_elements: list[str] = []

    def begin(name: str, attributes: dict[str, str]) -> None:
        if not open_elements and name != "materialx":
            raise MtlxError(f"it is <{name}>, not <materialx>")
        if len(open_elements) >= MAX_DEPTH:
            raise MtlxError(f"more than {MAX_DEPTH} elements are inside of each other")
        open_elements.append(name)
        if name == _INCLUDE:
            includes.append(attributes.get("href", ""))

    def entity(*_: Any) -> None:
        raise MtlxError("it declares entities")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise MtlxError(f"it is not XML: {error}") from None
    return includes


def resolve(name: str, anchor: str) -> str:
    """The file of that name beside another, resolved; "" where there is none."""
    resolver = Ar.GetResolver()
    return str(resolver.Resolve(beside(name, anchor)))


def beside(name: str, anchor: str) -> str:
    """What a name in a file means: relative to that file unless it is absolute."""
    if os.path.isabs(name) or "://" in name:
        return mapped(name, own_maps())
    if Ar.IsPackageRelativePath(anchor):
        package, inner = Ar.SplitPackageRelativePathInner(anchor)
        inner = posixpath.normpath(posixpath.join(posixpath.dirname(inner), name))
        return str(Ar.JoinPackageRelativePath([package, inner]))
    if not name.startswith("./"):
        name = f"./{name}"
    return str(Ar.GetResolver().CreateIdentifier(name, Ar.ResolvedPath(anchor)))


def image_file(value: Any, document: str) -> tuple[str, bool]:
    """The file that an element of type filename means, and whether ``fileprefix`` was left out.

    Args:
        value: The element.
        document: The file that was asked for; ``value`` may be from one that it includes.

    A name counts from the document, else from the file that it is written in. A prefix that leads
    nowhere is left out where the name alone leads to a file.
    """
    full, plain = value.getResolvedValueString(), value.getValueString()
    anchors = [document]
    source = value.getActiveSourceUri()
    if source and source != document:
        anchors.append(source)
    names = [full] if full == plain else [full, plain]
    for name in names:
        for anchor in anchors:
            path = beside(name, anchor)
            if _is_there(path):
                return path, name != full
    return beside(full, document), False


def _is_there(path: str) -> bool:
    if "<UDIM>" in path:
        return bool(UsdShade.UdimUtils.ResolveUdimTilePaths(path, None))
    if Ar.IsPackageRelativePath(path):
        return bool(Ar.GetResolver().Resolve(path))
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False
