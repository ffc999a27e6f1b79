# SPDX-License-Identifier: Apache-2.0
"""A rendered picture: its layers, and how it is saved."""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.picture.exr import ALPHA
from wavecomb.run import aovs as aov_names

if TYPE_CHECKING:
    from wavecomb._core import Result, Scene
    from wavecomb.picture.deep import DeepPicture
    from wavecomb.picture.exr import Compression
    from wavecomb.picture.image import Transfer

NOWHERE = (0.0, 0.0, 0.0)
"""Origin of scenes in world coordinates."""


@dataclass(frozen=True, repr=False)
class Picture:
    """A rendered picture. Row 0 is the top.

    Attributes:
        beauty: (height, width, 3), linear Rec.709, or in the working space of the stage.
        albedo: (height, width, 3). Like normal and depth, None where it was not asked for.
        normal: (height, width, 3), world space.
        depth: (height, width), along the camera's axis; infinite where nothing was hit.
        samples: (height, width), samples that each pixel got.
        error: (height, width), what adaptive sampling goes by (docs/render.md); infinite where
            there are too few samples. None unless the render was adaptive or had error=True.
        variance: (height, width, 3), of each pixel's mean, as if its samples were independent;
            None likewise.
        denoised: (height, width, 3), the beauty without its noise; None unless asked for.
        stats: What was done and how long it took; docs/statistics.md has the schema.
        cancelled: Progress asked to stop; the picture holds what was done.
        learned: What guided the render, for another to start from; empty: nothing was learned.
        costs: What shading took, by name of material and texture: a profile that another render
            can start from.
        aovs: Further AOVs by name, (height, width) or (height, width, channels): docs/aovs.md.
            Cryptomatte levels are pairs of id and coverage, as `wavecomb.cryptomatte` reads them.
        manifests: Cryptomatte level -> name -> id, of what the picture holds.
        deep: Samples by depth; None unless the AOV deep was asked for (docs/deep.md).
        metadata: For the header of a file, beside what the statistics say.
        chosen: Names of the layers that are saved; all that there are where it is empty.
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
        """The layers of an EXR file by name and in order; a Cryptomatte is several there."""
        from wavecomb.picture import cryptomatte

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
        """Whether it goes over another: it was rendered with the setting ``alpha``."""
        return bool(self.stats.get("settings", {}).get("alpha")) and "alpha" in self.aovs

    def with_denoised(self, *, threads: int = 0) -> Picture:
        """The picture with its layer ``denoised``, by Open Image Denoise; the beauty stays.

        Guided by the AOVs guide_albedo and guide_normal, which see through mirrors and clear glass,
        or else by albedo and normal.

        Raises:
            WavecombError: The extra ``denoise`` is missing; says how to install it.
        """
        from wavecomb.errors import WavecombError
        from wavecomb.picture.denoise import denoise

        albedo = self.aovs.get("guide_albedo", self.albedo)
        normal = self.aovs.get("guide_normal", self.normal)
        if albedo is None or normal is None:
            raise WavecombError(
                "denoising needs the AOVs guide_albedo and guide_normal: render with them, too"
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
        """Writes all layers (.exr) or the picture for display (.png), whole or not at all.

        A .png is of the denoised picture where there is one.

        Args:
            path: By its ending .exr or .png.
            half: EXR: 16 bit colours and normals.
            compression: EXR: none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa or dwab.
            tile: EXR: edge of tiles in pixels, a multiple of 16; 0: scanlines.
            split: EXR: a file for each AOV, path.NAME.exr, the beauty in ``path`` itself.
            exposure: PNG: in stops.
            tone_map: PNG: "clamp" or "neutral".

        Returns:
            The files that were written.

        >>> picture = wavecomb.render("mixed.usdc")  # doctest: +SKIP
        >>> picture.save("mixed.exr", half=True)  # doctest: +SKIP
        >>> picture.save("mixed.png", exposure=0.5)  # doctest: +SKIP
        """
        from wavecomb.picture.image import write_png
        from wavecomb.picture.output import save_layers

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
        raise ValueError(f"{os.fspath(path)}: pictures are saved as .exr or .png")

    def save_deep(self, path: str | os.PathLike[str], *, half: bool = False) -> Path:
        """Writes the deep picture (.exr); whole or not at all.

        Args:
            path: Ends in .exr.
            half: 16 bit colours and alpha.

        >>> picture = wavecomb.render("shot.usd", aovs=["deep"])  # doctest: +SKIP
        >>> picture.save_deep("shot.deep.exr")  # doctest: +SKIP

        Raises:
            WavecombError: There is none, or the name does not end in .exr.
        """
        from wavecomb.errors import WavecombError

        if self.deep is None:
            raise WavecombError("the picture has no deep samples: render with the AOV deep, too")
        metadata = self.file_metadata()
        return self.deep.save(path, half=half, metadata=metadata, window=self.window())

    def save_learned(self, path: str | os.PathLike[str]) -> None:
        """Writes what guided the render, for ``learn_from`` of another; whole or not at all.

        Raises:
            WavecombError: Nothing was learned.
        """
        from wavecomb.run.learned import save_learned

        save_learned(path, self.learned)

    def shown(self) -> NDArray[Any]:
        """The colours of a PNG, linear Rec.709: the denoised picture where there is one."""
        from wavecomb.picture.working_space import to_rec709

        shown = self.beauty if self.denoised is None else self.denoised
        return to_rec709(shown, self.stats.get("working_space", "rec709"))

    def __repr__(self) -> str:
        from wavecomb.picture.notebook import facts

        return f"<wavecomb.Picture {facts(self)}; {', '.join(self.layers())}>"

    def _repr_png_(self) -> bytes:
        """In a notebook: the picture, highlights rolled off towards white."""
        from wavecomb.picture.embedded import encoded
        from wavecomb.picture.notebook import codes

        return encoded(codes(self))

    def _repr_mimebundle_(
        self, include: Collection[str] | None = None, exclude: Collection[str] | None = None
    ) -> dict[str, str]:
        """In a notebook: the picture, a line about it, and its layers behind a fold."""
        from wavecomb.picture.notebook import mime_bundle

        return mime_bundle(self, include, exclude)

    def window(self) -> tuple[int, int, int, int] | None:
        """Where the pixels lie, as ``write_exr`` takes it; None: they are what is shown."""
        return window_of(self.stats.get("settings", {}))

    def file_metadata(self) -> dict[str, Any]:
        """Attributes of an EXR file: version, stage, camera, settings, times, matrices."""
        from wavecomb.run.stats import picture_metadata

        return {**picture_metadata(self.stats), **self.metadata}


def picture_of(
    result: Result,
    stats: dict[str, Any],
    *,
    scene: Scene | None = None,
    aovs: Sequence[str] = aov_names.DEFAULT,
) -> Picture:
    """A result of the core as a picture.

    Args:
        result: Of ``_core.render``.
        stats: Of ``make_stats``.
        scene: What was rendered, for the camera's matrices.
        aovs: Names as ``aovs.expand`` gives them.
    """
    from wavecomb.picture.deep import deep_of
    from wavecomb.picture.output import scene_metadata

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
    """AOVs whose positions are in the world, as precise as floats are.

    Pixels without a hit keep 0: no surface is at 0, 0, 0 of a scene that has another origin.
    """
    if "position" not in aovs or not any(origin):
        return aovs
    found = aovs["position"]
    moved = (found.astype(np.float64) + np.asarray(origin)).astype(np.float32)
    return {**aovs, "position": np.where(found.any(axis=-1, keepdims=True), moved, found)}


def window_of(settings: Mapping[str, Any]) -> tuple[int, int, int, int] | None:
    """Column and row of the first pixel in the picture that is shown, and the size of that one.

    None where the pixels are those that are shown: without a crop, and without overscan.
    """
    is_cropped = settings.get("crop") and settings.get("region") is not None
    beyond = int(settings.get("overscan", 0))
    if not is_cropped and not beyond:
        return None
    x0, y0 = settings["region"][:2] if is_cropped else (0, 0)
    width, height = int(settings["width"]), int(settings["height"])
    return int(x0) - beyond, int(y0) - beyond, width - 2 * beyond, height - 2 * beyond
