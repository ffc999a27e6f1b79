# SPDX-License-Identifier: Apache-2.0
"""Merges images of the same stage that were rendered with different seeds."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image import cryptomatte
from wavecomb.image.files.image import read_layers, read_metadata
from wavecomb.options import expectation
from wavecomb.options import settings as known_settings
from wavecomb.run.aovs import of_kind

SQUARED = ("variance",)
"""Layers that contain variances of means, which are merged with squared weights."""
SPREAD = ("error",)
"""Layers that contain standard errors, which are square roots of the variances of means."""
_HITS = "_hits "
"""Prefix of internal layers with the number of samples that hit a surface. Means over hits need
these layers."""


def _sums() -> tuple[str, ...]:
    """Returns the layers whose values are added when images are merged."""
    return ("samples", *of_kind("sum"))


def _counted() -> tuple[str, ...]:
    """Returns the layers in which merging ignores values that are not finite."""
    return (*of_kind("mean_of_hits"), *of_kind("median"))


@dataclass(frozen=True)
class MergedImage:
    """The merged image.

    Attributes:
        layers: Layers by name, as ``read_layers`` returns them.
        metadata: Attributes of the EXR header.
        manifests: For each Cryptomatte level, the object names and their ids.
        seeds: Seeds of all images that were merged.
        window: Position of the pixels, as for ``write_exr``. None means that the pixels fill the
            displayed image.
    """

    layers: dict[str, NDArray[Any]]
    metadata: dict[str, Any]
    manifests: dict[str, dict[str, int]] = field(default_factory=dict)
    seeds: tuple[int, ...] = ()
    window: tuple[int, int, int, int] | None = None


@dataclass(frozen=True)
class _Source:
    """An image that is to be merged."""

    name: str
    attributes: dict[str, Any]
    settings: dict[str, Any]
    seeds: tuple[int, ...]


def merge(paths: Sequence[str | os.PathLike[str]]) -> MergedImage:
    """Merges images pixel by pixel, weighted by their sample counts.

    Sample counts and costs are added. Variances and errors become the variances and errors of the
    merged image. Cryptomatte coverage is weighted like colours, and the largest ranks are kept.
    Depths that are not finite are ignored. Position, texture coordinates and ids belong to single
    samples, so they come from the first image with a sample in the pixel. The denoised layer is
    left out.

    >>> merge(["a.exr", "b.exr"]).layers["samples"].max()  # doctest: +SKIP
    128.0

    Args:
        paths: Two or more EXR files from ``wavecomb render`` or ``wavecomb merge``.

    Raises:
        WavecombError: The images cannot be merged. The message names the file and the difference.
        OSError: A file cannot be read.
    """
    if len(paths) < 2:
        raise WavecombError("merge needs at least two images")
    sources = [_source(os.fspath(path)) for path in paths]
    first = sources[0]
    seeds: dict[int, str] = {}
    for source in sources:
        _check_fit(first, source)
        for seed in source.seeds:
            if seed in seeds:
                raise WavecombError(
                    f"{source.name}: has seed {seed}, as {seeds[seed]} has: the same samples twice "
                    "do not reduce noise; render it with another --seed"
                )
            seeds[seed] = source.name
    sums: dict[str, NDArray[Any]] = {}
    pairs: dict[str, list[NDArray[Any]]] = {}
    names: dict[str, dict[str, int]] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    for source in sources:
        layers = read_layers(source.name)
        # Leave out the denoised layer, since it would have to be computed from the merged image.
        layers.pop("denoised", None)
        _check_shapes(source, layers, shapes)
        _check_layers(first.name, sums, source.name, layers, pairs)
        _add(sums, pairs, layers)
        try:
            manifests = cryptomatte.manifests(source.attributes)
        except (ValueError, TypeError, AttributeError, RecursionError):
            raise WavecombError(f"{source.name}: a Cryptomatte manifest in it is damaged") from None
        for level, manifest in manifests.items():
            names.setdefault(level, {}).update(manifest)
    all_seeds = tuple(seeds)
    metadata, beyond = _metadata(sources, all_seeds), _overscan(first)
    height, width = sums["samples"].shape[:2]
    window = (-beyond, -beyond, width - 2 * beyond, height - 2 * beyond) if beyond else None
    return MergedImage(_means(sums, pairs), metadata, names, all_seeds, window)


def _overscan(source: _Source) -> int:
    """Returns the overscan of an image.

    Raises WavecombError if the image's settings are invalid.
    """
    beyond = source.settings.get("overscan", 0)
    edges = [source.settings.get(name) for name in ("width", "height")]
    if isinstance(beyond, int) and all(isinstance(e, int) and 0 <= 2 * beyond < e for e in edges):
        return beyond
    raise WavecombError(f"{source.name}: its overscan is invalid: the file is damaged")


def _source(name: str) -> _Source:
    """Reads the settings and seeds of an image."""
    attributes = read_metadata(name)
    try:
        settings = json.loads(str(attributes["wavecomb:settings"]))
        seeds = json.loads(str(attributes.get("wavecomb:seeds", f"[{settings['seed']}]")))
        if not isinstance(settings, dict) or not isinstance(seeds, list):
            raise TypeError
        return _Source(name, attributes, settings, tuple(int(seed) for seed in seeds))
    except (KeyError, ValueError, TypeError, OverflowError, RecursionError):
        raise WavecombError(
            f"{name}: has no render settings in its metadata; give EXR files of wavecomb render"
        ) from None


def _check_fit(first: _Source, other: _Source) -> None:
    """Raises WavecombError if two images have settings with different expected pixel values."""

    def refuse(what: str, a: Any, b: Any) -> None:
        raise WavecombError(f"{other.name}: {what} is {b}, that of {first.name} is {a}")

    rows = known_settings()
    for key in expectation():
        if key == "overscan":
            # The overscan is compared below, together with the image size.
            continue
        # A setting that is missing in a file has its default value, since older versions of
        # Wavecomb did not have all settings.
        a, b = (one.settings.get(key, rows[key].default) for one in (first, other))
        if a != b:
            refuse(key, a, b)
    for key, what in (("wavecomb:stage", "the stage"), ("wavecomb:camera", "the camera")):
        a, b = (str(source.attributes.get(key, "")) for source in (first, other))
        if os.path.basename(a) != os.path.basename(b):
            refuse(what, a or "unknown", b or "unknown")
    if _overscan(first) != _overscan(other):
        refuse("overscan", _overscan(first), _overscan(other))
    scenes: list[Any] = [source.attributes.get("wavecomb:scene") for source in (first, other)]
    # In a damaged file, the attribute wavecomb:scene may be an array.
    if not np.array_equal(*scenes):
        raise WavecombError(
            f"{other.name}: its stage is not that of {first.name}: other prims, lights, materials, "
            "camera or frame"
        )


def _check_shapes(
    source: _Source, layers: dict[str, NDArray[Any]], shapes: dict[str, tuple[int, ...]]
) -> None:
    """Raises WavecombError if the size or channel count of a layer is inconsistent.

    ``shapes`` holds the layer shapes of earlier images. The function adds new layers to it.
    """
    size = source.settings.get("height"), source.settings.get("width")
    for name, layer in layers.items():
        channels = layer.shape[2]
        good = layer.shape[:2] == size and shapes.setdefault(name, layer.shape) == layer.shape
        if name == "samples":
            good = good and channels == 1
        if cryptomatte.is_crypto(name):
            good = good and channels == 4
        if not good:
            raise WavecombError(
                f"{source.name}: its layer {name} is {layer.shape[1]} x {layer.shape[0]} with "
                f"{channels} channels, which does not fit its settings or the other pictures"
            )


def _check_layers(
    first: str,
    sums: dict[str, NDArray[Any]],
    name: str,
    layers: dict[str, NDArray[Any]],
    pairs: dict[str, list[NDArray[Any]]],
) -> None:
    if "samples" not in layers or "beauty" not in layers:
        raise WavecombError(
            f"{name}: has no layer {'samples' if 'beauty' in layers else 'beauty'}, which merging "
            "needs; render with --aov samples"
        )
    if not sums:
        return
    there = {layer for layer in layers if not cryptomatte.is_crypto(layer)}
    there |= set(cryptomatte.gather(layers))
    known = {layer for layer in sums if not layer.startswith("_")} | set(pairs)
    for layer in sorted(there ^ known):
        lacking = name if layer in known else first
        raise WavecombError(f"{lacking}: has no layer {layer}, which the other image has")


def _add(
    sums: dict[str, NDArray[Any]],
    pairs: dict[str, list[NDArray[Any]]],
    layers: dict[str, NDArray[Any]],
) -> None:
    """Adds the layers of an image to the weighted sums."""
    samples = layers["samples"].astype(np.float64)
    for level, ranks in cryptomatte.gather(layers).items():
        weighted = ranks.copy()
        weighted[:, :, 1::2] *= samples.astype(np.float32)
        pairs.setdefault(level, []).append(weighted)
    had = sums["samples"] > 0 if sums else np.zeros(samples.shape, bool)
    for name, layer in layers.items():
        if cryptomatte.is_crypto(name):
            continue
        if name in of_kind("nearest"):
            sums[name] = np.where(had, sums[name], layer) if name in sums else layer
            continue
        # Set pixels without samples to 0, since their values are undefined.
        values = np.where(samples > 0, layer, 0).astype(np.float64)
        if name in SQUARED:
            values = values * samples**2
        elif name in SPREAD:
            values = (values * samples) ** 2
        elif name in _counted():
            hit = np.isfinite(values)
            values = np.where(hit, values, 0) * samples
            hits = _HITS + name
            sums[hits] = sums.get(hits, 0) + np.where(hit, samples, 0)
        elif name not in _sums():
            values = values * samples
        sums[name] = sums[name] + values if name in sums else values


def _means(
    sums: dict[str, NDArray[Any]], pairs: dict[str, list[NDArray[Any]]]
) -> dict[str, NDArray[Any]]:
    samples = sums["samples"]
    weight = 1.0 / np.maximum(samples, 1.0)
    out: dict[str, NDArray[Any]] = {}
    for name, values in sums.items():
        if name.startswith(_HITS):
            continue
        if name in SQUARED:
            values = values * weight**2
        elif name in SPREAD:
            values = np.sqrt(values) * weight
        elif name in _counted():
            hits = sums[_HITS + name]
            values = np.where(hits > 0, values / np.maximum(hits, 1.0), np.inf)
        elif name not in _sums() and name not in of_kind("nearest"):
            values = values * weight
        out[name] = values.astype(np.float32)
    for level, weighted in pairs.items():
        out.update(cryptomatte.layers(level, _merge_ranks(weighted, samples)))
    return out


def _merge_ranks(weighted: list[NDArray[Any]], samples: NDArray[np.float64]) -> NDArray[np.float32]:
    """Adds the coverage of equal ids and keeps the largest ranks, one row at a time."""
    height, width = samples.shape[:2]
    ranks = weighted[0].shape[2] // 2
    out = np.zeros((height, width, 2 * ranks), np.float32)
    for y in range(height):
        row = np.concatenate([one[y] for one in weighted], axis=1)
        ids = np.ascontiguousarray(row[:, 0::2]).view(np.uint32)
        same = ids[:, :, None] == ids[:, None, :]
        counts = (same * row[:, None, 1::2].astype(np.float64)).sum(axis=2)
        # If an id occurs several times in a pixel, its first entry gets the total count, and the
        # count of its other entries becomes 0.
        repeated = (same & np.tri(ids.shape[1], k=-1, dtype=bool)).any(axis=2)
        counts[repeated] = 0
        order = np.lexsort((ids, -counts), axis=1)[:, :ranks]
        best = np.take_along_axis(counts, order, axis=1)
        chosen = np.where(best > 0, np.take_along_axis(ids, order, axis=1), 0).astype(np.uint32)
        out[y, :, 0::2] = chosen.view(np.float32)
        out[y, :, 1::2] = best / np.maximum(samples[y], 1.0)
    return out


def _metadata(sources: list[_Source], seeds: tuple[int, ...]) -> dict[str, Any]:
    """Returns the metadata of the first image with all seeds and the total render time."""
    first = sources[0]
    kept = ("Software", "worldToCamera", "worldToNDC", "chromaticities")
    metadata = {
        key: value
        for key, value in first.attributes.items()
        if key in kept or key.startswith("wavecomb:")
    }
    for key in ("worldToCamera", "worldToNDC"):
        if key in metadata:
            matrix = np.asarray(metadata.pop(key))
            if matrix.size == 16 and matrix.dtype.kind == "f":
                metadata[key] = matrix.reshape(4, 4)
    seconds = [source.attributes.get("wavecomb:render_seconds", 0.0) for source in sources]
    known = [float(value) for value in seconds if isinstance(value, (int, float))]
    metadata["wavecomb:render_seconds"] = sum(known)
    metadata["wavecomb:seeds"] = json.dumps(list(seeds))
    return metadata
