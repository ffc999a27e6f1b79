# SPDX-License-Identifier: Apache-2.0
"""Reads MaterialX documents with their includes, and resolves the files that they name."""

from __future__ import annotations

import os
import posixpath
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

from pxr import Ar, UsdShade

from wavecomb.image.files.output_file import kind_of
from wavecomb.path_maps import mapped, own_maps
from wavecomb.usd.materialx.library import library

MAX_DEPTH = 64
"""Deepest nesting of XML elements, since MaterialX parses elements recursively."""

MAX_INCLUDES = 256
"""Maximum number of files that a document may include directly or indirectly."""

MAX_CHAIN = 32
"""Longest chain of includes; each file in a chain copies the contents of the files that it
includes."""

MAX_BYTES = 1 << 26
"""Maximum number of bytes of a document with all its includes."""

_INCLUDE = "http://www.w3.org/2001/XInclude include"


class MtlxError(Exception):
    """Raised if a MaterialX file cannot be read; the message gives the reason."""


@dataclass(frozen=True)
class Document:
    """A document that refers to MaterialX's standard library.

    Attributes:
        root: MaterialX's document object. The object has access to the definitions of the standard
            library.
        file: The file that was requested.
        graphs: Node graphs of the document, without the library's node graphs.
        definitions: Names of the document's node definitions, without the library's definitions.
    """

    root: Any
    file: str
    graphs: tuple[Any, ...]
    definitions: frozenset[str]


def read_document(path: str) -> Document:
    """Reads a MaterialX file with its includes and converts it to the current MaterialX version.

    Args:
        path: Path that USD's asset resolver returned; the file may be inside a .usdz package.

    Raises:
        MtlxError: The file cannot be read.
    """
    root = _read(path, (), _Budget())
    graphs = tuple(root.getNodeGraphs())
    definitions = frozenset(item.getName() for item in root.getNodeDefs())
    root.setDataLibrary(library())
    return Document(root, path, graphs, definitions)


@dataclass
class _Budget:
    """Numbers of files and bytes that a document may still include."""

    files: int = MAX_INCLUDES
    bytes: int = MAX_BYTES


def _read(path: str, above: tuple[str, ...], left: _Budget) -> Any:
    """Reads one file; ``above`` lists the files that include it."""
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
                raise MtlxError(f"it includes {name}, which does not exist")
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
                # For a chain of includes, report only the innermost file.
                known = str(error).startswith("in ")
                why = error if known else f"in {name}, which it includes: {error}"
                raise MtlxError(str(why)) from None
    except UnicodeDecodeError:
        raise MtlxError("it is not UTF-8") from None
    except MtlxError:
        raise
    # The MaterialX bindings raise library-specific exception types.
    except Exception as error:
        raise MtlxError(" ".join(str(error).split())[:200]) from None
    return document


def _bytes(path: str, most: int) -> bytes:
    if not (Ar.IsPackageRelativePath(path) or "://" in path or os.path.isfile(path)):
        kind = kind_of(path)
        raise MtlxError("it is not a file" if kind is None else f"it is {kind}, not a regular file")
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise MtlxError("it cannot be opened")
    if asset.GetSize() > most:
        raise MtlxError(f"it and its includes have more than {MAX_BYTES >> 20} MB")
    return bytes(asset.GetBuffer() or b"")


def _check(data: bytes) -> list[str]:
    """Validates the XML of a document and returns the files that it includes.

    Raises:
        MtlxError: The file is not XML, not MaterialX, or too deeply nested.
    """
    includes: list[str] = []
    open_elements: list[str] = []

    def begin(name: str, attributes: dict[str, str]) -> None:
        if not open_elements and name != "materialx":
            raise MtlxError(f"it is <{name}>, not <materialx>")
        if len(open_elements) >= MAX_DEPTH:
            raise MtlxError(f"elements are nested more than {MAX_DEPTH} deep")
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
    """Resolves a file name relative to another file; returns an empty string if no file exists."""
    resolver = Ar.GetResolver()
    return str(resolver.Resolve(beside(name, anchor)))


def beside(name: str, anchor: str) -> str:
    """Resolves a file name relative to the file that contains the name, unless it is absolute."""
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
    """Returns the file of a filename element, and whether ``fileprefix`` was ignored.

    File names are relative to the document or else to the file that contains the element. The
    attribute ``fileprefix`` is ignored if a file exists only under the name without the prefix.

    Args:
        value: The element with the file name.
        document: The requested file; ``value`` may be in a file that the document includes.
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
