# SPDX-License-Identifier: Apache-2.0
"""Rendered tiles as OpenEXR files whose header has a key and a checksum.

The channels hold all layers of the tile as floats, without loss. Attributes of the header:

- ``wavecomb:part_key``: hash of all inputs that determine the pixels (``Job.tile_key``);
- ``wavecomb:part_facts``: JSON with the layers of the channels and other data of the image;
- ``wavecomb:part_checksum``: SHA-256 of the facts and the pixels.

A tile file is valid only if its key is the expected one and its checksum is right.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.farm.tiling import Rectangle
from wavecomb.image.files.output_file import one_line, problem_of, reason
from wavecomb.image.rendered import Picture
from wavecomb.run.stats import plain

_LAYERS = ("beauty", "albedo", "normal", "depth", "samples", "error", "variance")
AOV = "aov."
_KEY, _FACTS, _CHECKSUM = (f"wavecomb:part_{name}" for name in ("key", "facts", "checksum"))
_EXACT = 1 << 24
"""Largest integer N for which 32-bit floats represent all integers from 0 to N exactly. ``MAX_SPP``
does not exceed this number."""


class InvalidTile(WavecombError):
    """Error for a tile whose file is missing or damaged, or has another key.

    The tile must be rendered again.
    """


@dataclass(frozen=True)
class RenderedTile:
    """A rendered tile.

    Attributes:
        name: File of the tile.
        key: Key from the header.
        tile: Rectangle of the tile in the image, in pixels.
        layers: Arrays of the image by name, of shape (height, width) or (height, width, channels);
            names of AOVs begin with "aov.".
        empty: For each layer, the value of pixels without samples, if the image has such pixels.
        stats: Statistics from ``make_stats``.
        metadata: As in ``Picture.metadata``.
        manifests: As in ``Picture.manifests``.
        costs: As in ``Picture.costs``.
        passes: Number of passes over the pixels; an adaptive render checks errors after each pass.
        checks: Number of error checks that the border around the tile allows for.
        machine: Class of the machine that rendered the tile.
        job: The job as JSON, for tiles outside of a job's folder.
        number: Index of the tile.
    """

    name: str
    key: str
    tile: Rectangle
    layers: dict[str, NDArray[Any]]
    empty: dict[str, NDArray[Any]]
    stats: dict[str, Any]
    metadata: dict[str, Any]
    manifests: dict[str, dict[str, int]]
    costs: dict[str, dict[str, float]]
    passes: int
    checks: int
    machine: str
    job: dict[str, Any] | None
    number: int


def layers_of(picture: Picture) -> dict[str, NDArray[Any]]:
    """Returns all arrays of an image by their names in a tile file."""
    found = {name: getattr(picture, name) for name in _LAYERS}
    found |= {AOV + name: array for name, array in picture.aovs.items()}
    return {name: array for name, array in found.items() if array is not None}


@contextlib.contextmanager
def replacing_quickly(path: Path) -> Iterator[Path]:
    """Yields a temporary file name beside ``path``, and renames the file to ``path`` at the end.

    Unlike ``output_file.replacing``, this function does not search the folder for leftovers of
    killed processes, since a search is slow in folders with many files. The folder of tiles, with
    any leftovers, is removed when its image is finished.
    """
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.stem}.{secrets.token_hex(6)}.part{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, f"{path}: cannot be written: {reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def save_tile(
    path: Path,
    picture: Picture,
    *,
    key: str,
    number: int,
    tile: Rectangle,
    rendered: Rectangle,
    machine: str,
    checks: int = 0,
    empty: Picture | None = None,
    job: Mapping[str, Any] | None = None,
    replacing: Any = replacing_quickly,
) -> None:
    """Writes a tile atomically.

    Args:
        path: File to write.
        picture: Rendered pixels.
        key: Key from ``Job.tile_key``.
        number: Index of the tile.
        tile: Rectangle of the tile in the image, in pixels.
        rendered: Rectangle of ``picture`` in the image, which is the tile with its border, if any.
        machine: Class of this machine.
        checks: Number of error checks that the border allows for.
        empty: An image whose last pixel has the values of pixels without samples.
        job: The job as JSON, for a tile outside of a job's folder.
        replacing: Context manager that yields the temporary name.
    """
    x, y = tile[0] - rendered[0], tile[1] - rendered[1]
    width, height = tile[2] - tile[0], tile[3] - tile[1]
    arrays = {
        name: array[y : y + height, x : x + width] for name, array in layers_of(picture).items()
    }
    facts = {
        "tile": list(tile), "number": number, "machine": machine, "looks": checks, "job": job,
        "layers": [[name, a.dtype.name, list(a.shape[2:])] for name, a in arrays.items()],
        "empty": {} if empty is None else {
            name: array[-1, -1].tobytes().hex() for name, array in layers_of(empty).items()
        },
        "stats": plain(picture.stats), "metadata": _metadata_text(picture.metadata),
        "manifests": picture.manifests, "costs": plain(picture.costs),
        "passes": int(picture.stats.get("passes", 0)),
    }  # fmt: skip
    pixels = np.concatenate(
        [_as_floats(array).reshape(height, width, -1) for array in arrays.values()], axis=2
    )
    text = json.dumps(facts)
    attributes = {_KEY: key, _FACTS: text, _CHECKSUM: _checksum(text, pixels)}
    with replacing(path) as part:
        _write(part, path, pixels, attributes)


def _as_floats(array: NDArray[Any]) -> NDArray[np.float32]:
    if array.dtype == np.float32:
        return np.ascontiguousarray(array)
    if array.dtype != np.uint32 or (array.size and int(array.max()) > _EXACT):
        raise WavecombError(f"a layer of {array.dtype.name} cannot be stored exactly in a tile")
    return array.astype(np.float32)


def _checksum(facts: str, pixels: NDArray[np.float32]) -> str:
    found = hashlib.sha256(facts.encode())
    found.update(np.ascontiguousarray(pixels).data)
    return found.hexdigest()


def _write(
    file: Path, called: Path, pixels: NDArray[np.float32], attributes: Mapping[str, str]
) -> None:
    import OpenImageIO as oiio

    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, "float")
    spec.channelnames = tuple(f"c{k:05d}" for k in range(channels))
    spec.attribute("compression", "zips")
    for name, value in attributes.items():
        spec.attribute(name, value)
    output = oiio.ImageOutput.create(str(file))
    if output is None:
        raise OSError(f"{called}: no writer for OpenEXR: {one_line(oiio.geterror(), str(called))}")
    good = output.open(str(file), spec) and output.write_image(pixels)
    why = "" if good else problem_of(output)
    if not (output.close() and good):
        # Write the file again without OpenImageIO, because Python then raises an OSError that
        # states why writing fails.
        file.write_bytes(bytes(pixels.nbytes))
        raise OSError(
            f"{called}: cannot be written: {one_line(why or problem_of(output), str(file))}"
        )


def read_tile(path: str | os.PathLike[str], size: tuple[int, int] | None = None) -> RenderedTile:
    """Reads a tile and verifies its checksum.

    Args:
        path: File to read.
        size: Required width and height in pixels; None allows any.

    Raises:
        InvalidTile: The file is missing or damaged.
    """
    name = os.fspath(path)
    try:
        attributes, pixels = _read(name, size)
        text = str(attributes[_FACTS])
        if _checksum(text, pixels) != attributes[_CHECKSUM]:
            raise ValueError("its checksum is wrong")
        facts = json.loads(text)
        layers, k = {}, 0
        for layer, kind, rest in facts["layers"]:
            count = int(np.prod(rest, dtype=int))
            block = pixels[:, :, k : k + count].reshape(*pixels.shape[:2], *rest)
            layers[layer] = block if kind == "float32" else block.astype(kind)
            k += count
        kinds = {layer: (kind, rest) for layer, kind, rest in facts["layers"]}
        x0, y0, x1, y1 = (int(edge) for edge in facts["tile"])
        return RenderedTile(
            name=name, key=str(attributes[_KEY]), tile=(x0, y0, x1, y1), layers=layers,
            empty={
                layer: np.frombuffer(bytes.fromhex(data), kinds[layer][0]).reshape(kinds[layer][1])
                for layer, data in facts["empty"].items() if layer in kinds
            },
            stats=facts["stats"], metadata=_metadata_of(facts["metadata"]),
            manifests=facts["manifests"], costs=facts["costs"], passes=facts["passes"],
            checks=facts["looks"], machine=facts["machine"], job=facts["job"],
            number=facts["number"],
        )  # fmt: skip
    except FileNotFoundError:
        raise InvalidTile(f"{name}: is missing; the tile must be rendered again") from None
    except (OSError, KeyError, TypeError, ValueError) as error:
        why = error.args[0] if error.args else type(error).__name__
        raise InvalidTile(f"{name}: is damaged: {why}; the tile must be rendered again") from None


def load_tile(path: Path, key: str, tile: Rectangle, checks: int = 0) -> RenderedTile:
    """Reads a tile that must have a given key.

    Args:
        path: File to read.
        key: Key from ``Job.tile_key``.
        tile: Rectangle of the tile in the image, in pixels.
        checks: Number of error checks that its border must allow for.

    Raises:
        InvalidTile: The tile is missing or damaged, has another key, or its border is too narrow.
    """
    part = read_tile(path, (tile[2] - tile[0], tile[3] - tile[1]))
    if part.key != key or part.tile != tile:
        raise InvalidTile(f"{path}: has settings, files or a machine other than the job's")
    if part.checks < checks:
        raise InvalidTile(f"{path}: its border is too narrow for {checks} error checks")
    return part


def has_tile(path: Path, key: str, tile: Rectangle, checks: int = 0) -> bool:
    """Returns whether ``load_tile`` would succeed."""
    if not path.exists():
        return False
    try:
        load_tile(path, key, tile, checks)
    except InvalidTile:
        return False
    return True


def _read(name: str, size: tuple[int, int] | None) -> tuple[dict[str, Any], NDArray[np.float32]]:
    import OpenImageIO as oiio

    # Open the file with Python first, whose exceptions have an errno. OpenImageIO's errors have
    # none.
    with open(name, "rb") as file:
        if file.read(4) != b"\x76\x2f\x31\x01":
            raise ValueError("it is not an OpenEXR file")
    source = oiio.ImageInput.open(name)
    if source is None:
        raise ValueError(one_line(problem_of(oiio), name))
    try:
        spec = source.spec()
        if spec.depth > 1 or spec.deep or (size and (spec.width, spec.height) != size):
            raise ValueError("it has another size")
        attributes = {one.name: one.value for one in spec.extra_attribs}
        order = sorted(range(spec.nchannels), key=lambda k: spec.channelnames[k])
        pixels = source.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
        if pixels is None:
            raise ValueError(one_line(problem_of(source), name))
    finally:
        source.close()
    shaped = np.asarray(pixels, np.float32).reshape(spec.height, spec.width, spec.nchannels)
    return attributes, shaped if order == list(range(len(order))) else shaped[:, :, order]


def _metadata_text(metadata: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: {"matrix": value.tolist()} if isinstance(value, np.ndarray) else plain(value)
        for name, value in metadata.items()
    }


def _metadata_of(text: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: np.array(value["matrix"], np.float64) if isinstance(value, dict) else value
        for name, value in text.items()
    }
