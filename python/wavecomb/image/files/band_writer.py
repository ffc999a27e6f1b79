# SPDX-License-Identifier: Apache-2.0
"""Writes image files in bands of rows, so that the whole image is never in memory."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.files.exr import ExrLayout, RowFile, Window
from wavecomb.image.files.image import Transfer, display, png_spec
from wavecomb.image.files.output_file import replacing
from wavecomb.image.files.render_output import by_aov, compression_for, split_names

if TYPE_CHECKING:
    from types import TracebackType

    from wavecomb.image.rendered import Picture


class BandFiles:
    """Image files that are written in bands: one EXR file or one per AOV, and a PNG file.

    As a context manager, the object renames the files on success and removes them on an exception.

    Attributes:
        written: Names of the files, which are known after the first band.
        rows: Number of rows written so far.
    """

    def __init__(
        self,
        output: str | None,
        png: str | None,
        *,
        height: int,
        window: Window | None,
        file_options: Mapping[str, Any],
        exposure: float = 0.0,
        tone_map: Transfer = "clamp",
    ) -> None:
        """Stores the arguments of ``Picture.save`` and the height of the whole image.

        Args:
            output: File name that ends in .exr, or None.
            png: File name that ends in .png, or None.
            height: Number of rows of the whole image.
            window: Position of the image in a larger image, as in ``write_exr``.
            file_options: The arguments ``half``, ``compression``, ``tile`` and ``split`` of
                ``Picture.save``.
            exposure: Exposure of the PNG in stops.
            tone_map: Tone mapping of the PNG.
        """
        self.written: list[str] = []
        self.rows = 0
        self._output, self._png = output, png
        self._height, self._window = height, window
        self._options = {"half": False, "compression": "zip", "tile": 0, **file_options}
        self._split = bool(self._options.pop("split", False))
        self._exposure, self._tone_map = exposure, tone_map
        self._parts = contextlib.ExitStack()
        self._sheets: dict[str, tuple[ExrLayout, RowFile]] = {}
        self._display: RowFile | None = None

    def __enter__(self) -> BandFiles:
        """Returns this writer. The files are opened when the first band is written."""
        return self

    def add(self, band: Picture) -> None:
        """Writes the next rows. All bands must have the same layers."""
        self.rows += len(band.beauty)
        layers = self._by_file(band.layers())
        if not self.written:
            self._open(layers, band)
        for name, its_layers in layers.items():
            sheet, file = self._sheets[name]
            file.add(sheet.values(its_layers))
        if self._display is not None:
            alpha = band.aovs["alpha"] if band.has_alpha else None
            shown = band.shown()
            self._display.add(
                display(shown, exposure=self._exposure, tone_map=self._tone_map, alpha=alpha)
            )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Completes the files, or removes them after an exception."""
        files = [file for _, file in self._sheets.values()]
        files += [self._display] if self._display is not None else []
        if error is None:
            with self._parts:
                for file in files:
                    file.close()
            return
        for file in files:
            with contextlib.suppress(OSError):
                file.close()
        self._parts.__exit__(kind, error, trace)

    def _by_file(
        self, layers: dict[str, NDArray[np.float32]]
    ) -> dict[str, dict[str, NDArray[np.float32]]]:
        if self._output is None:
            return {}
        if not self._split:
            return {self._output: layers}
        grouped = by_aov(layers)
        names = split_names(self._output, grouped)
        return {str(names[aov]): its_layers for aov, its_layers in grouped.items()}

    def _open(self, layers: Mapping[str, Mapping[str, NDArray[np.float32]]], band: Picture) -> None:
        metadata = band.file_metadata()
        for name, its_layers in layers.items():
            options = dict(self._options)
            if self._split:
                options["compression"] = compression_for(its_layers, options["compression"])
            sheet = ExrLayout(
                name, its_layers, metadata=metadata, window=self._window, height=self._height,
                **options,
            )  # fmt: skip
            part: Path = self._parts.enter_context(replacing(name))
            self._sheets[name] = sheet, RowFile(part, sheet.spec, name)
            self.written.append(name)
        if self._png is not None:
            part = self._parts.enter_context(replacing(self._png))
            spec = png_spec(self._height, band.beauty.shape[1], has_alpha=band.has_alpha)
            self._display = RowFile(part, spec, self._png)
            self.written.append(self._png)
