# SPDX-License-Identifier: Apache-2.0
"""Lens properties besides focus: distortion, aperture, rolling shutter (docs/cameras.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb.core_table import camera_parameters
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_layers
from wavecomb.usd.stage.report import LoadReport

_ARNOLD = "primvars:arnold:"
ATTRIBUTES = {
    "aperture_blades": ("wavecomb:lens:apertureBlades", f"{_ARNOLD}aperture_blades"),
    "aperture_rotation": ("wavecomb:lens:apertureRotation", f"{_ARNOLD}aperture_rotation"),
    "lens_squeeze": ("wavecomb:lens:squeeze",),
    "lens_k1": ("wavecomb:lens:k1",),
    "lens_k2": ("wavecomb:lens:k2",),
    "lens_k3": ("wavecomb:lens:k3",),
    "lens_p1": ("wavecomb:lens:p1",),
    "lens_p2": ("wavecomb:lens:p2",),
    "rolling_shutter": ("wavecomb:lens:rollingShutter", f"{_ARNOLD}rolling_shutter"),
    "rolling_duration": ("wavecomb:lens:rollingDuration", f"{_ARNOLD}rolling_shutter_duration"),
}
"""USD attributes by camera parameter of the core; the first attribute that is authored is used."""

MAP_NODES = 256
"""Number of grid points of an ST map along each edge of the image."""


def lens_values(
    prim: Usd.Prim | None, time: Usd.TimeCode | None, chosen: Mapping[str, str], report: LoadReport
) -> dict[str, Any]:
    """Returns lens parameters for ``set_camera``; ``chosen`` overrides the prim's attributes.

    Args:
        prim: The camera prim, or None.
        time: Time code at which attributes are evaluated.
        chosen: Lens settings by parameter name, as text.
        report: Collects warnings about invalid attributes.

    Raises:
        WavecombError: A value of ``chosen`` is invalid.
    """
    out: dict[str, Any] = {}
    for name in ATTRIBUTES:
        if name in chosen:
            value = _value(name, chosen[name])
            if value is None:
                raise WavecombError(f"--lens-setting {name}={chosen[name]}: must be {_kind(name)}")
        else:
            value = None if prim is None else _authored(prim, name, time, report)
        if value is not None:
            out[name] = value
    return out


def _authored(prim: Usd.Prim, name: str, time: Usd.TimeCode | None, report: LoadReport) -> Any:
    """Returns the authored value of a parameter, or None if it is missing or invalid."""
    for attribute in ATTRIBUTES[name]:
        there = prim.GetAttribute(attribute)
        given = there.Get(time or Usd.TimeCode.Default()) if there else None
        if given is None:
            continue
        value = _value(name, given)
        if value is None:
            report.warn(f"{attribute} of a camera left out: it is invalid", prim.GetPath())
        return value
    return None


def check_names(chosen: Mapping[str, str]) -> None:
    """Raises WavecombError if a name is not a lens setting."""
    for name in chosen:
        if name not in ATTRIBUTES:
            raise WavecombError(
                f"--lens-setting {name}: is not known; there are {', '.join(ATTRIBUTES)}"
            )


def _kind(name: str) -> str:
    choices = camera_parameters()[name].choices
    return f"one of {', '.join(choices)}" if choices else "a number"


def _value(name: str, given: Any) -> Any:
    """Converts a value of a lens parameter; returns None if the value is invalid."""
    row = camera_parameters()[name]
    if row.choices:
        return str(given) if str(given) in row.choices else None
    try:
        value = float(given)
    except (TypeError, ValueError):
        return None
    is_good = np.isfinite(value) and (row.least is None or value >= row.least)
    return value if is_good else None


def read_map(path: str) -> list[list[float]]:
    """Reads an ST map as the ``lens_map`` argument of ``set_camera``.

    The red channel is s (rightwards) and the green channel is t (upwards). For each pixel of the
    distorted image, (s, t) is the position in the undistorted image. Positions go from (0, 0) at
    the lower left corner to (1, 1) at the upper right corner.

    Raises:
        WavecombError: The file lacks the red or green channel, or values are not finite.
        OSError: The file cannot be read.
    """
    layers = read_layers(path)
    plane = layers.get("beauty")
    if plane is None or plane.ndim != 3 or plane.shape[2] < 2:
        raise WavecombError(
            f"{path}: an ST map has the channels R and G; this file does not have them"
        )
    values = np.asarray(plane[:, :, :2], np.float64)
    if not np.isfinite(values).all():
        raise WavecombError(f"{path}: is not an ST map: some of its values are not finite")
    values = np.stack([values[:, :, 0], 1.0 - values[:, :, 1]], axis=2)
    nodes = _resampled(_resampled(values, 0), 1).astype(np.float32)
    four: list[list[float]] = nodes.reshape(-1, 4).tolist()
    return four


def _resampled(values: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Resamples pixels along an axis to grid points from edge to edge; extrapolates at edges."""
    values = np.moveaxis(values, axis, 0)
    size = len(values)
    at = np.linspace(0.0, size, MAP_NODES) - 0.5
    first = np.clip(np.floor(at).astype(int), 0, max(size - 2, 0))
    part = (at - first)[:, None, None]
    after = np.minimum(first + 1, size - 1)
    mixed = values[first] + (values[after] - values[first]) * part
    return np.moveaxis(mixed, 0, axis)
