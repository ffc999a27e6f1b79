# SPDX-License-Identifier: Apache-2.0
"""The two images of a comparison, from files or frames. The module is independent of Qt."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image.compare.comparison import layers_of
from wavecomb.image.files.output_file import reason

if TYPE_CHECKING:
    from wavecomb.gui.viewport.frames import Frame

Array = NDArray[Any]
SUFFIXES = (".exr", ".png", ".npy", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr", ".pfm")
"""File name extensions that are accepted as images when dropped."""

_numbers = itertools.count(1)


@dataclass(frozen=True)
class Side:
    """An image to compare.

    Attributes:
        name: Displayed name, such as a file name or "viewport".
        layers: Linear layers by name, float32 (height, width, channels); there is at least one
            layer.
        note: Text about the origin of the image or the progress of its render.
        path: Path of the image file, or None.
        variance: Variance of each pixel's mean, shaped like the beauty layer; None if unknown.
        live: Whether the image is a frame of a render that is still running.
        number: Unique identifier of the image.
    """

    name: str
    layers: Mapping[str, Array]
    note: str = ""
    path: Path | None = None
    variance: Array | None = None
    live: bool = False
    number: int = field(default_factory=lambda: next(_numbers))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image in pixels."""
        first = next(iter(self.layers.values()))
        return int(first.shape[1]), int(first.shape[0])

    def layer(self, name: str) -> Array | None:
        """Returns a layer of the image by name.

        If the image has a single layer, as a PNG file has, this layer is used as the beauty.
        """
        if name == "beauty" and name not in self.layers and len(self.layers) == 1:
            return next(iter(self.layers.values()))
        return self.layers.get(name)


def read_side(path: Path) -> Side:
    """Reads an image file: EXR with all layers, PNG and others, .npy of a results folder.

    A file NAME_var.exr beside NAME.exr is read as the variance of NAME.exr; golden images have such
    a file.

    Raises:
        WavecombError: The file cannot be read. The message of the error is one line that names the
            file.
    """
    try:
        layers = _read_npy(path) if path.suffix.lower() == ".npy" else layers_of(path)
    except OSError as error:
        text = str(error) if error.errno is None else f"{path}: {reason(error)}"
        raise WavecombError(text) from error
    except ValueError as error:
        raise WavecombError(f"{path}: cannot be read as an image: {error}") from error
    width, height = Side("", layers).size
    variance = layers.get("variance")
    note = f"{width} x {height}"
    beside = path.with_name(f"{path.stem}_var{path.suffix}")
    if variance is None and beside.is_file():
        found = next(iter(layers_of(beside).values()))
        if found.shape == next(iter(layers.values())).shape:
            variance, note = found, f"{note}, variance of {beside.name}"
    return Side(path.name, layers, note, path, variance)


def _read_npy(path: Path) -> dict[str, Array]:
    array = np.load(path, allow_pickle=False)
    return layers_of(array)


def side_of_frame(frame: Frame, name: str, *, live: bool) -> Side:
    """Makes an image to compare from a frame of a live render, sharing the frame's arrays."""
    layers = {layer: _three(frame.layer(layer)) for layer in frame.names()}
    done = frame.status.get("samples_done")
    note = f"{frame.width} x {frame.height}"
    if done:
        note += f", {done / (frame.width * frame.height):.3g} samples a pixel"
    if frame.scale > 1:
        note += f", 1/{frame.scale} of the size"
    note += ", done" if frame.final else ", rendering" if live else ""
    return Side(name, layers, note, None, layers.get("variance"), live and not frame.final)


def _three(layer: Array | None) -> Array:
    assert layer is not None
    array = np.asarray(layer, np.float32)
    return array[:, :, None] if array.ndim == 2 else array


def common_layers(a: Side | None, b: Side | None) -> list[str]:
    """Returns the layer names of both images, or of the only image. The beauty comes first."""
    sides = [side for side in (a, b) if side is not None]
    names: list[str] = []
    for name in ("beauty", *(name for side in sides for name in side.layers)):
        if name not in names and all(side.layer(name) is not None for side in sides):
            names.append(name)
    return names if sides else []


def problem(a: Side | None, b: Side | None, layer: str) -> str:
    """Returns why the two images cannot be compared and how to fix it, or "" if they can."""
    if a is None or b is None:
        missing = "A and B" if a is None and b is None else "A" if a is None else "B"
        return f"Choose {missing}: open or drop a picture, or take the viewport's."
    if a.size != b.size:
        return (
            f"A is {a.size[0]} x {a.size[1]}, B is {b.size[0]} x {b.size[1]}: only pictures of one "
            "size can be subtracted. Render or choose one at the size of the other."
        )
    one, two = a.layer(layer), b.layer(layer)
    if one is None or two is None:
        return f"{'A' if one is None else 'B'} has no layer {layer}; choose another layer."
    if one.shape != two.shape and not (min(one.shape[2], two.shape[2]) >= 3):
        return (
            f"{layer} has {one.shape[2]} channels in A and {two.shape[2]} in B: "
            "choose another layer."
        )
    return ""


def pair(a: Side, b: Side, layer: str) -> tuple[Array, Array]:
    """Returns the same layer of both images, dropping alpha if only one of the images has it."""
    one, two = a.layer(layer), b.layer(layer)
    assert one is not None and two is not None
    channels = min(one.shape[2], two.shape[2])
    if one.shape[2] != two.shape[2]:
        channels = 3
    return one[:, :, :channels], two[:, :, :channels]
