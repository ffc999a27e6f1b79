# SPDX-License-Identifier: Apache-2.0
"""Writes the files of a render, one for all layers or one per AOV, with metadata."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image import cryptomatte
from wavecomb.image.files.exr import ALPHA, Compression, Window, check_options, is_exact, write_exr
from wavecomb.image.files.output_file import replacing_all

if TYPE_CHECKING:
    from wavecomb._core import Scene


def scene_metadata(
    scene: Scene, width: int, height: int, origin: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, Any]:
    """Returns the EXR attributes of a scene, mainly the camera's matrices.

    Attributes with default values are left out: "PixelAspectRatio" of square pixels,
    "wavecomb:exposure" of 1, and "wavecomb:projection" of perspective. A latlong image has no
    attribute "worldToNDC".

    Both matrices are for row vectors, p' = p M. "worldToCamera" transforms to the space of a camera
    that looks along -z with y up. "worldToNDC" transforms to x and y in [-1, 1] across the image,
    with y up, and z in [-1, 1] between the clipping planes, after division by w. ``origin`` is the
    world position of the scene's origin.
    """
    camera = getattr(scene, "camera", None)
    if camera is None:
        return {}
    to_world = np.array(camera["to_world"], np.float64)
    to_world[3, :3] += origin
    to_camera = np.linalg.inv(to_world)
    out: dict[str, Any] = {"worldToCamera": to_camera, "wavecomb:scene": scene_digest(scene)}
    shape = pixel_aspect(camera, width, height)
    if abs(shape - 1.0) > 1e-5:
        out["PixelAspectRatio"] = float(shape)
    if camera.get("exposure", 1.0) != 1.0:
        out["wavecomb:exposure"] = float(camera["exposure"])
    projection_name = camera.get("projection", "perspective")
    if projection_name != "perspective":
        out["wavecomb:projection"] = projection_name
    if projection_name == "latlong":
        return out
    x0, x1, y0, y1 = camera_window(camera, width, height)
    near, far = camera["near_clip"], min(camera["far_clip"], 1e30)
    near = max(near, 1e-6 * min(far, 1e6))
    if projection_name == "orthographic":
        return {**out, "worldToNDC": to_camera @ _parallel(x0, x1, y0, y1, near, far)}
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 / (x1 - x0), 2 / (y1 - y0)
    projection[2, 0], projection[2, 1] = (x1 + x0) / (x1 - x0), (y1 + y0) / (y1 - y0)
    projection[2, 2], projection[3, 2] = (near + far) / (near - far), 2 * far * near / (near - far)
    projection[2, 3] = -1.0
    return {**out, "worldToNDC": to_camera @ projection}


def _parallel(
    x0: float, x1: float, y0: float, y1: float, near: float, far: float
) -> NDArray[np.float64]:
    """Returns the orthographic projection matrix of a window."""
    projection = np.diag([2 / (x1 - x0), 2 / (y1 - y0), 2 / (near - far), 1.0])
    projection[3, :3] = (
        (x0 + x1) / (x0 - x1), (y0 + y1) / (y0 - y1), (near + far) / (near - far)
    )  # fmt: skip
    return projection


def scene_digest(scene: Scene) -> str:
    """Returns a hash of a scene's counts, bounds, camera, lights, materials and names.

    The hash excludes points and texels, since hashing them would take as long as reading them.
    """
    facts: list[Any] = [
        getattr(scene, name)
        for name in (
            "triangles",
            "instanced_triangles",
            "mesh_count",
            "instance_count",
            "lights",
            "materials",
            "textures",
            "bounds",
            "camera",
            "light_groups",
        )
    ]
    facts.append(scene.fingerprint(arrays=False))
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


def fitted_window(
    window: Iterable[float],
    width: int,
    height: int,
    conform: str = "expandAperture",
    pixel_aspect: float = 1.0,
) -> tuple[float, float, float, float]:
    """Fits the window of a camera to the aspect ratio of the image, as the renderer does.

    Args:
        window: x0, x1, y0, y1.
        width: Image width in pixels.
        height: Image height in pixels.
        conform: UsdRender's aspectRatioConformPolicy.
        pixel_aspect: Width of a pixel divided by its height.

    >>> fitted_window((-1, 1, -1, 1), 200, 100, "cropAperture")
    (-1.0, 1.0, -0.5, 0.5)
    """
    x0, x1, y0, y1 = window
    cx, cy, half_x, half_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    aspect = width / height * pixel_aspect
    follows = "expandAperture" if half_x / half_y < aspect else "cropAperture"
    if conform in ("adjustApertureWidth", follows):
        half_x = half_y * aspect
    elif conform != "adjustPixelAspectRatio":
        half_y = half_x / aspect
    return cx - half_x, cx + half_x, cy - half_y, cy + half_y


def camera_window(
    camera: Mapping[str, Any], width: int, height: int
) -> tuple[float, float, float, float]:
    """Returns the ``fitted_window`` of a camera.

    The camera is ``Scene.camera``, or a mapping with the arguments of ``set_camera``.
    """
    if camera.get("projection") == "latlong":
        x0, x1, y0, y1 = (float(edge) for edge in camera["window"])
        return x0, x1, y0, y1
    return fitted_window(
        camera["window"],
        width,
        height,
        camera.get("conform", "expandAperture"),
        camera.get("pixel_aspect", 1.0),
    )


def pixel_aspect(camera: Mapping[str, Any], width: int, height: int) -> float:
    """Returns the displayed width of a pixel divided by its height."""
    x0, x1, y0, y1 = camera_window(camera, width, height)
    return (x1 - x0) / (y1 - y0) * height / width


def aov_of(layer: str) -> str:
    """Returns the AOV to which a layer of a file belongs.

    >>> aov_of("CryptoObject01"), aov_of("depth")
    ('crypto_object', 'depth')
    """
    if layer == ALPHA:
        return "beauty"
    for aov, name in cryptomatte.LEVELS.items():
        if cryptomatte.is_crypto(layer) and layer.startswith(name):
            return aov
    return layer


def split_names(path: str | os.PathLike[str], aovs: Collection[str]) -> dict[str, Path]:
    """Returns the file name of each AOV.

    Beauty gets ``path``; other AOVs get ".NAME" before the extension.

    >>> split_names("out/a.exr", ["beauty", "depth"])["depth"].name
    'a.depth.exr'
    """
    whole = Path(path)
    for aov in aovs:
        if "/" in aov or "\0" in aov or len(os.fsencode(aov)) > 128:
            raise WavecombError(f"{whole}: layer {aov[:64]!r} cannot be part of a file's name")
    return {
        aov: whole if aov == "beauty" else whole.with_name(f"{whole.stem}.{aov}{whole.suffix}")
        for aov in aovs
    }


def by_aov(layers: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, NDArray[Any]]]:
    """Groups layers by AOV. Only Cryptomatte AOVs have several layers."""
    grouped: dict[str, dict[str, NDArray[Any]]] = {}
    for name, pixels in layers.items():
        grouped.setdefault(aov_of(name), {})[name] = pixels
    return grouped


def compression_for(layers: Iterable[str], compression: Compression) -> Compression:
    """Returns the compression for a file with these layers.

    The result is "zip" if the given compression would make a layer useless.
    """
    return "zip" if any(map(is_exact, layers)) else compression


def save_layers(
    path: str | os.PathLike[str],
    layers: Mapping[str, NDArray[Any]],
    metadata: Mapping[str, Any],
    manifests: Mapping[str, Mapping[str, int]],
    *,
    half: bool = False,
    compression: Compression = "zip",
    tile: int = 0,
    split: bool = False,
    window: Window | None = None,
) -> list[Path]:
    """Writes layers to one file, or to one file per AOV, atomically as a set.

    Files with ids or positions are compressed by zip if the chosen compression is lossy.

    Returns:
        The names of the files that were written.
    """
    if not split:
        attributes = {**metadata, **cryptomatte.metadata(manifests)}
        write_exr(
            path, layers, half=half, compression=compression, tile=tile, metadata=attributes,
            window=window,
        )  # fmt: skip
        return [Path(path)]
    check_options(os.fspath(path), (), compression, tile)
    grouped = by_aov(layers)
    files = split_names(path, grouped)
    with replacing_all(files.values()) as parts:
        for (aov, its_layers), part in zip(grouped.items(), parts, strict=True):
            own = {aov: manifests[aov]} if aov in manifests else {}
            write_exr(
                part,
                its_layers,
                half=half,
                compression=compression_for(its_layers, compression),
                tile=tile,
                metadata={**metadata, **cryptomatte.metadata(own)},
                window=window,
                called=files[aov],
            )
    return list(files.values())
