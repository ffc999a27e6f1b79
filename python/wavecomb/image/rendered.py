# SPDX-License-Identifier: Apache-2.0
"""A rendered image: its layers, and methods that save it."""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wavecomb.image.files.exr import ALPHA
from wavecomb.run import aovs as aov_names

if TYPE_CHECKING:
    from wavecomb._core import Result, Scene
    from wavecomb.image.files.deep import DeepPicture
    from wavecomb.image.files.exr import Compression
    from wavecomb.image.files.image import Transfer

NOWHERE = (0.0, 0.0, 0.0)
"""World position of the scene's origin if the scene uses world coordinates."""


@dataclass(frozen=True, repr=False)
class Picture:
    """A rendered image. Row 0 is the top.

    Attributes:
        beauty: Linear colours (height, width, 3) in Rec.709, or in the stage's working space.
        albedo: Albedo (height, width, 3). This attribute, ``normal`` and ``depth`` are None if they
            were not requested.
        normal: Normals (height, width, 3) in world space.
        depth: Depth (height, width) along the camera's axis; infinite for pixels without a hit.
        samples: Number of samples of each pixel, with shape (height, width).
        error: Error estimate of adaptive sampling (height, width); infinite for pixels with too few
            samples (docs/render.md). None unless the render was adaptive or had the option
            ``error=True``.
        variance: Variance (height, width, 3) of each pixel's mean, under the assumption that its
            samples are independent. None unless the render was adaptive or had the option
            ``error=True``.
        denoised: Denoised beauty (height, width, 3); None if it was not requested.
        stats: Statistics of the render, with the schema in docs/statistics.md.
        cancelled: Whether the render was stopped early. The image then contains the samples that
            were finished.
        learned: Guiding field, which can initialise another render; empty if no field was trained.
        costs: Shading costs by material and texture name, which can initialise another render.
        aovs: Further AOVs (docs/aovs.md) by name, with shape (height, width) or (height, width,
            channels). Cryptomatte AOVs are pairs of id and coverage, which `wavecomb.cryptomatte`
            reads.
        manifests: For each Cryptomatte level, the names and ids of the objects in the image.
        deep: Deep image (docs/deep.md); None unless the AOV ``deep`` was requested.
        metadata: Further attributes for the EXR header.
        chosen: Names of the layers to save. An empty tuple means all layers.
    """

    beauty: NDArray[np.float32]
    albedo: NDArray[np.float32] | None
    normal: NDArray[np.float32] | None
    depth: NDArray[np.float32] | None
    samples: NDArray[np.uint32]
    error: NDArray[np.float32] | None = None
    variance: NDArray[np.float32] | None = None
    denoised: NDArray[np.float32] | None = None
    stats: dict[str, Any] = field(default_factory=dict, repr=False)
    cancelled: bool = False
    costs: dict[str, dict[str, float]] = field(default_factory=dict, repr=False)
    learned: bytes = field(default=b"", repr=False)
    aovs: dict[str, NDArray[np.float32]] = field(default_factory=dict, repr=False)
    manifests: dict[str, dict[str, int]] = field(default_factory=dict, repr=False)
    deep: DeepPicture | None = field(default=None, repr=False)
    metadata: dict[str, Any] = field(default_factory=dict, repr=False)
    chosen: tuple[str, ...] = ()

    def layers(self) -> dict[str, NDArray[Any]]:
        """Returns the layers of an EXR file by name, in file order.

        A Cryptomatte AOV has several layers.
        """
        from wavecomb.image import cryptomatte

        arrays = {
            "beauty": self.beauty,
            "denoised": self.denoised,
            "albedo": self.albedo,
            "normal": self.normal,
            "depth": self.depth,
            "samples": self.samples,
            "error": self.error,
            "variance": self.variance,
        }
        out: dict[str, NDArray[Any]] = {}
        more = dict(self.aovs)
        if self.has_alpha:
            out = {"beauty": self.beauty, ALPHA: more["alpha"]}
            if "alpha" not in self.chosen:
                del more["alpha"]
        wanted = set(self.chosen or {**arrays, **self.aovs}) | {"denoised"}
        if self.chosen == aov_names.DEFAULT:
            wanted |= {"error", "variance"}
        for name, array in {**arrays, **more}.items():
            may_be_kept_only = name in arrays or name in aov_names.GUIDES
            if array is None or (may_be_kept_only and name not in wanted):
                continue
            out.update(
                cryptomatte.layers(name, array) if name in cryptomatte.LEVELS else {name: array}
            )
        return out

    @property
    def has_alpha(self) -> bool:
        """Whether the image has an alpha channel for compositing (setting ``alpha``)."""
        return bool(self.stats.get("settings", {}).get("alpha")) and "alpha" in self.aovs

    def with_denoised(self, *, threads: int = 0) -> Picture:
        """Returns a copy with the layer ``denoised``, computed by Open Image Denoise.

        The AOVs guide_albedo and guide_normal guide the denoiser. If the image lacks them, albedo
        and normal are used. The guide AOVs describe the surfaces that are visible in mirrors and
        through clear glass.

        Raises:
            WavecombError: The extra ``denoise`` is not installed, or a guide AOV is missing.
        """
        from wavecomb.errors import WavecombError
        from wavecomb.image.denoise import denoise

        albedo = self.aovs.get("guide_albedo", self.albedo)
        normal = self.aovs.get("guide_normal", self.normal)
        if albedo is None or normal is None:
            raise WavecombError(
                "denoising needs the AOVs guide_albedo and guide_normal: also render them"
            )
        start = time.perf_counter()
        denoised = denoise(self.beauty, albedo, normal, threads=threads)
        seconds = {**self.stats.get("seconds", {}), "denoise": time.perf_counter() - start}
        return replace(self, denoised=denoised, stats={**self.stats, "seconds": seconds})

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        half: bool = False,
        compression: Compression = "zip",
        tile: int = 0,
        split: bool = False,
        exposure: float = 0.0,
        tone_map: Transfer = "clamp",
    ) -> list[Path]:
        """Writes all layers (.exr) or the displayed image (.png) atomically.

        A .png file shows the denoised image if there is one.

        Args:
            path: File name that ends in .exr or .png.
            half: For .exr files, whether to store colours as 16-bit floats.
            compression: For .exr files: "none", "rle", "zips", "zip", "piz", "pxr24", "b44",
                "b44a", "dwaa" or "dwab".
            tile: For .exr files, the edge of tiles in pixels, which is a multiple of 16; 0 means
                scanlines.
            split: For .exr files, whether to write one file per AOV, named path.NAME.exr. The
                beauty is written to ``path``.
            exposure: For .png files, the exposure in stops.
            tone_map: For .png files: "clamp", "neutral", or "ocio:VIEW" for a view of OpenColorIO.

        Returns:
            The names of the files that were written.

        >>> picture = wavecomb.render("mixed.usdc")  # doctest: +SKIP
        >>> picture.save("mixed.exr", half=True)  # doctest: +SKIP
        >>> picture.save("mixed.png", exposure=0.5)  # doctest: +SKIP
        """
        from wavecomb.image.files.image import write_png
        from wavecomb.image.files.render_output import save_layers

        kind = Path(path).suffix.lower()
        if kind == ".exr":
            return save_layers(
                path,
                self.layers(),
                self.file_metadata(),
                self.manifests,
                half=half,
                compression=compression,
                tile=tile,
                split=split,
                window=self.window(),
            )
        if kind == ".png":
            alpha = self.aovs["alpha"] if self.has_alpha else None
            write_png(path, self.shown(), exposure=exposure, tone_map=tone_map, alpha=alpha)
            return [Path(path)]
        raise ValueError(f"{os.fspath(path)}: images are saved as .exr or .png")

    def save_deep(self, path: str | os.PathLike[str], *, half: bool = False) -> Path:
        """Writes the deep image (.exr) atomically.

        Args:
            path: File name that ends in .exr.
            half: Whether to store colours and alpha as 16-bit floats.

        >>> picture = wavecomb.render("shot.usd", aovs=["deep"])  # doctest: +SKIP
        >>> picture.save_deep("shot.deep.exr")  # doctest: +SKIP

        Raises:
                WavecombError: The render has no deep image, or the name does not end in .exr.
        """
        from wavecomb.errors import WavecombError

        if self.deep is None:
            raise WavecombError("the image has no deep samples: also render the AOV deep")
        metadata = self.file_metadata()
        return self.deep.save(path, half=half, metadata=metadata, window=self.window())

    def save_learned(self, path: str | os.PathLike[str]) -> None:
        """Writes the guiding field atomically, for the option ``learn_from`` of another render.

        Raises:
            WavecombError: No guiding field was trained.
        """
        from wavecomb.run.guiding_file import save_learned

        save_learned(path, self.learned)

    def shown(self) -> NDArray[Any]:
        """Returns the colours for a PNG file in linear Rec.709, denoised if possible."""
        from wavecomb.image.working_space import to_rec709

        shown = self.beauty if self.denoised is None else self.denoised
        return to_rec709(shown, self.stats.get("working_space", "rec709"))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """Returns the beauty (height, width, 3) for ``np.asarray``."""
        if dtype is None or self.beauty.dtype == dtype:
            return self.beauty.copy() if copy else self.beauty
        if copy is False:
            raise ValueError(f"the image is float32; {dtype} needs a copy")
        return self.beauty.astype(dtype)

    def __repr__(self) -> str:
        from wavecomb.image.notebook import facts

        return f"<wavecomb.Picture {facts(self)}; {', '.join(self.layers())}>"

    def _repr_png_(self) -> bytes:
        """Returns the image as PNG for a notebook, with the tone mapping "neutral"."""
        from wavecomb.image.notebook import codes
        from wavecomb.image.thumbnails import encode_image

        return encode_image(codes(self))

    def _repr_mimebundle_(
        self, include: Collection[str] | None = None, exclude: Collection[str] | None = None
    ) -> dict[str, str]:
        """Returns the image for a notebook, with a summary line and collapsible layers."""
        from wavecomb.image.notebook import mime_bundle

        return mime_bundle(self, include, exclude)

    def window(self) -> tuple[int, int, int, int] | None:
        """Returns the position of the pixels in the displayed image, for ``write_exr``.

        The result is None if the pixels exactly fill the displayed image.
        """
        return window_of(self.stats.get("settings", {}))

    def file_metadata(self) -> dict[str, Any]:
        """Returns the attributes of an EXR file.

        The attributes describe version, stage, camera, settings, times and matrices.
        """
        from wavecomb.run.stats import image_metadata

        return {**image_metadata(self.stats), **self.metadata}


def picture_of(
    result: Result,
    stats: dict[str, Any],
    *,
    scene: Scene | None = None,
    aovs: Sequence[str] = aov_names.DEFAULT,
) -> Picture:
    """Converts a result of the core to a picture.

    Args:
        result: Result of ``_core.render``.
        stats: Result of ``make_stats``.
        scene: The rendered scene, which provides the camera's matrices.
        aovs: Names from ``aovs.expand``.
    """
    from wavecomb.image.files.deep import deep_of
    from wavecomb.image.files.render_output import scene_metadata

    height, width = result.beauty.shape[:2]
    settings = stats.get("settings", {})
    beyond = 2 * settings.get("overscan", 0)
    width = settings.get("width", width + beyond) - beyond
    height = settings.get("height", height + beyond) - beyond
    return Picture(
        beauty=result.beauty,
        albedo=result.albedo,
        normal=result.normal,
        depth=result.depth,
        samples=result.samples,
        error=result.error,
        variance=result.variance,
        stats=stats,
        cancelled=result.cancelled,
        costs=result.costs,
        learned=result.learned,
        aovs=in_world(result.aovs, stats.get("origin", NOWHERE)),
        manifests=result.manifests,
        deep=deep_of(result.deep),
        metadata={}
        if scene is None
        else scene_metadata(scene, width, height, stats.get("origin", NOWHERE)),
        chosen=tuple(aovs),
    )


def in_world(
    aovs: dict[str, NDArray[np.float32]], origin: Sequence[float]
) -> dict[str, NDArray[np.float32]]:
    """Converts positions in the AOVs to world space, as exactly as float32 permits.

    Pixels without a hit keep the value 0. If the scene's origin is not the world's origin, no
    surface has this position.
    """
    if "position" not in aovs or not any(origin):
        return aovs
    found = aovs["position"]
    moved = (found.astype(np.float64) + np.asarray(origin)).astype(np.float32)
    return {**aovs, "position": np.where(found.any(axis=-1, keepdims=True), moved, found)}


def window_of(settings: Mapping[str, Any]) -> tuple[int, int, int, int] | None:
    """Returns column and row of the first pixel in the displayed image, and that image's size.

    The result is None without crop and overscan, because the pixels then fill the displayed image.
    """
    is_cropped = settings.get("crop") and settings.get("region") is not None
    beyond = int(settings.get("overscan", 0))
    if not is_cropped and not beyond:
        return None
    x0, y0 = settings["region"][:2] if is_cropped else (0, 0)
    width, height = int(settings["width"]), int(settings["height"])
    return int(x0) - beyond, int(y0) - beyond, width - 2 * beyond, height - 2 * beyond
