# SPDX-License-Identifier: Apache-2.0
"""Compares two images numerically."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from wavecomb.image.rendered import Picture

    Source: TypeAlias = str | os.PathLike[str] | Picture | NDArray[Any]

REL_MSE_FLOOR = 0.01
TRIMMED_SHARE = 0.001


@dataclass(frozen=True)
class Comparison:
    """Differences between image A and the reference image B.

    Differences are A - B in linear values. A pixel in which a channel of A or B is NaN or infinite
    is counted, but excluded from all means and maxima. Such a pixel still counts for ``equal``.

    Attributes:
        equal: Whether all common layers are bit-identical. In this comparison, -0 differs from 0,
            and a NaN equals itself. Layers that only one of the images has do not affect ``equal``.
        width: Width in pixels.
        height: Height in pixels.
        channels: Number of channels of the colour layer.
        pixels_different: Number of pixels of the colour layer with different bits.
        pixels_not_finite: Number of excluded pixels, which have a NaN or infinite channel.
        not_finite_differ: Number of excluded pixels whose bits differ.
        luminance_mean_abs: Mean absolute difference of Rec.709 luminance.
        luminance_max_abs: Largest absolute difference of Rec.709 luminance.
        luminance_max_at: Column and row, counted from 0 at the top left, of the pixel with the
            largest luminance difference. None if there are no differences.
        max_abs: Largest absolute difference of any channel.
        mean_signed: Mean difference of each channel.
        mean_abs: Mean absolute difference of each channel.
        rmse: Square root of the mean squared difference over pixels and channels.
        rel_mse: Mean of (A - B)^2 / (B^2 + 0.01) over pixels and channels.
        rel_mse_trimmed: ``rel_mse`` without the 0.1 % of pixels with the largest terms, because few
            outliers can dominate ``rel_mse``.
        layers: Result for each further common layer, {"equal": bool, "max_abs": float}. ``max_abs``
            ignores values that are not finite in A or B; it is None if the shapes differ.
        only_a: Names of layers that only A has.
        only_b: Names of layers that only B has.
    """

    equal: bool
    width: int
    height: int
    channels: int
    pixels_different: int
    pixels_not_finite: int
    not_finite_differ: int
    luminance_mean_abs: float
    luminance_max_abs: float
    luminance_max_at: tuple[int, int] | None
    max_abs: float
    mean_signed: tuple[float, ...]
    mean_abs: tuple[float, ...]
    rmse: float
    rel_mse: float
    rel_mse_trimmed: float
    layers: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    only_a: tuple[str, ...] = ()
    only_b: tuple[str, ...] = ()

    def within(self, tolerance: float) -> bool:
        """Returns whether all channels differ by at most ``tolerance``.

        Excluded pixels must be bit-identical.
        """
        return self.max_abs <= tolerance and self.not_finite_differ == 0

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields as a dictionary that can be written as JSON."""
        return dataclasses.asdict(self)


def compare(a: Source, b: Source) -> Comparison:
    """Compares two images: files, ``Picture`` objects or arrays.

    >>> import numpy as np
    >>> difference = compare(np.ones((4, 4, 3)), np.zeros((4, 4, 3)))
    >>> difference.equal, difference.rmse, difference.rel_mse
    (False, 1.0, 100.0)

    Raises:
            ValueError: The sizes or the numbers of channels differ.
            OSError: A file cannot be read.
    """
    layers_a, layers_b = layers_of(a), layers_of(b)
    colour_a, colour_b = _colour_pair(a, layers_a, b, layers_b)
    others: dict[str, dict[str, Any]] = {}
    for name, layer in layers_a.items():
        if name in layers_b and layer is not colour_a:
            others[name] = _layer_difference(layer, layers_b[name])
    only_a = tuple(name for name in layers_a if name not in layers_b)
    only_b = tuple(name for name in layers_b if name not in layers_a)
    return _comparison(colour_a, colour_b, others, only_a, only_b)


def layers_of(source: Source) -> dict[str, NDArray[Any]]:
    """Returns the layers of an image by name, as float32 arrays (height, width, channels)."""
    import numpy as np

    if isinstance(source, (str, os.PathLike)):
        from wavecomb.image.files.image import read_layers

        return dict(read_layers(source))
    named = getattr(source, "layers", None)
    arrays: Mapping[str, Any] = named() if callable(named) else {"beauty": source}
    result: dict[str, NDArray[Any]] = {}
    for name, pixels in arrays.items():
        array = np.asarray(pixels, dtype=np.float32)
        array = array[:, :, None] if array.ndim == 2 else array
        if array.ndim != 3 or array.size == 0:
            raise ValueError(f"an image has the shape (height, width, channels), not {array.shape}")
        result[name] = array
    return result


def colour_layer(layers: Mapping[str, NDArray[Any]], name: str) -> NDArray[Any]:
    """Returns the beauty layer, or the only layer of the image."""
    if "beauty" in layers:
        return layers["beauty"]
    if len(layers) == 1:
        return next(iter(layers.values()))
    raise ValueError(f"{name}: has no colour channels R, G, B, only {', '.join(layers)}")


def colour_pair(a: Source, b: Source) -> tuple[NDArray[Any], NDArray[Any]]:
    """Returns the colour layers of two images of equal size.

    Raises:
        ValueError: The sizes or the numbers of channels differ.
    """
    return _colour_pair(a, layers_of(a), b, layers_of(b))


def _colour_pair(
    a: Source, layers_a: Mapping[str, NDArray[Any]], b: Source, layers_b: Mapping[str, NDArray[Any]]
) -> tuple[NDArray[Any], NDArray[Any]]:
    names = _name(a, "A"), _name(b, "B")
    colour_a, colour_b = colour_layer(layers_a, names[0]), colour_layer(layers_b, names[1])
    if colour_a.shape != colour_b.shape:
        raise ValueError(
            f"{names[0]} is {_size(colour_a)}, {names[1]} is {_size(colour_b)}: "
            "only images of the same size can be compared"
        )
    return colour_a, colour_b


def trimmed_mean(values: NDArray[Any], share: float = TRIMMED_SHARE) -> float:
    """Returns the mean without the floor(share * size) largest values; 0 for an empty array.

    >>> import numpy as np
    >>> trimmed_mean(np.array([1.0, 2.0, 3.0, 100.0]), 0.25)
    2.0
    """
    import numpy as np

    kept = values.size - int(share * values.size)
    return float(np.partition(values.ravel(), kept - 1)[:kept].mean()) if kept else 0.0


def luminance(pixels: NDArray[Any]) -> NDArray[Any]:
    """Returns the Rec.709 luminance in float64.

    With fewer than 3 channels, returns the first channel.
    """
    import numpy as np

    from wavecomb.image.working_space import LUMINANCE

    values = np.asarray(pixels, dtype=np.float64)
    if values.shape[2] < 3:
        return values[:, :, 0]
    return values[:, :, :3] @ np.asarray(LUMINANCE)


def _comparison(
    a: NDArray[Any],
    b: NDArray[Any],
    others: dict[str, dict[str, Any]],
    only_a: tuple[str, ...],
    only_b: tuple[str, ...],
) -> Comparison:
    import numpy as np

    height, width, channels = a.shape
    other_bits = _other_bits(a, b).any(axis=2)
    finite = np.isfinite(a).all(axis=2) & np.isfinite(b).all(axis=2)
    kept = max(int(finite.sum()), 1)
    wide_b = np.where(finite[:, :, None], b, 0).astype(np.float64)
    difference = np.where(finite[:, :, None], a, 0).astype(np.float64) - wide_b
    squared = difference**2
    light = np.abs(luminance(difference))
    peak = int(light.argmax())
    terms = squared / (wide_b**2 + REL_MSE_FLOOR)
    others_equal = all(entry["equal"] for entry in others.values())
    return Comparison(
        equal=others_equal and not bool(other_bits.any()),
        width=width,
        height=height,
        channels=channels,
        pixels_different=int(other_bits.sum()),
        pixels_not_finite=int((~finite).sum()),
        not_finite_differ=int((other_bits & ~finite).sum()),
        luminance_mean_abs=float(light.sum() / kept),
        luminance_max_abs=float(light.max()),
        luminance_max_at=(peak % width, peak // width) if light.max() > 0 else None,
        max_abs=float(np.abs(difference).max()),
        mean_signed=tuple(float(v) for v in difference.sum(axis=(0, 1)) / kept),
        mean_abs=tuple(float(v) for v in np.abs(difference).sum(axis=(0, 1)) / kept),
        rmse=float(np.sqrt(squared.sum() / (kept * channels))),
        rel_mse=float(terms.sum() / (kept * channels)),
        rel_mse_trimmed=trimmed_mean(terms[finite].mean(axis=1)),
        layers=others,
        only_a=only_a,
        only_b=only_b,
    )


def _layer_difference(a: NDArray[Any], b: NDArray[Any]) -> dict[str, Any]:
    import numpy as np

    if a.shape != b.shape:
        return {"equal": False, "max_abs": None}
    finite = np.isfinite(a) & np.isfinite(b)
    difference = np.where(finite, a, 0).astype(np.float64) - np.where(finite, b, 0)
    return {
        "equal": not bool(_other_bits(a, b).any()),
        "max_abs": float(np.abs(difference).max()),
    }


def _other_bits(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    import numpy as np

    return np.ascontiguousarray(a).view(np.uint32) != np.ascontiguousarray(b).view(np.uint32)


def _name(source: Source, fallback: str) -> str:
    return os.fspath(source) if isinstance(source, (str, os.PathLike)) else f"image {fallback}"


def _size(pixels: NDArray[Any]) -> str:
    height, width, channels = pixels.shape
    return f"{width} x {height} with {channels} channel{'s' if channels > 1 else ''}"
