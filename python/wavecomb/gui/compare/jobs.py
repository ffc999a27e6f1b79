# SPDX-License-Identifier: Apache-2.0
"""Background computation of a comparison: images, difference values, FLIP and difference map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from wavecomb.gui.compare.differences import Numbers, numbers
from wavecomb.gui.compare.flip_process import FlipProcess
from wavecomb.gui.compare.picture_sides import Side, pair, problem
from wavecomb.gui.swatch import to_qimage
from wavecomb.gui.viewport.display import Look, show
from wavecomb.gui.worker import Worker
from wavecomb.image.compare.heatmap import Kind, Scale, scale_of, z_scale
from wavecomb.image.files import image
from wavecomb.image.layer_view import DisplayLayer, Legend


@dataclass(frozen=True)
class Ask:
    """Request to show a comparison.

    Attributes:
        a: Image A, or None.
        b: Image B, the reference image, or None.
        look: Layer, exposure and tone mapping of both images.
        kind: Kind of the difference map, a key of ``differences.MAPS``.
    """

    a: Side | None
    b: Side | None
    look: Look
    kind: str

    @property
    def problem(self) -> str:
        """Reason why no difference of the images can be computed, or ""."""
        return problem(self.a, self.b, self.look.layer)

    def pictures(self) -> tuple[Any, ...]:
        """Returns a key that is equal for requests whose displayed images are equal."""
        return (*self._sides(), self.look)

    def figures(self) -> tuple[Any, ...]:
        """Returns a key that is equal for requests whose difference values are equal."""
        return (*self._sides(), self.look.layer, self.look.exposure)

    def _sides(self) -> tuple[int, int]:
        return (self.a.number if self.a else 0, self.b.number if self.b else 0)


class Jobs(QObject):
    """Four background workers: for displayed images, difference values, FLIP and difference map.

    Each worker computes only its newest request.

    Signals:
        images(A, B): Displayed images as QImage; None for a missing image.
        numbers(Numbers): Difference values. They are emitted first without FLIP, then with FLIP;
            None if there is no comparison.
        map(QImage, Scale): Difference map and its colour scale; both are None if there is no map.
        failed(str): Emitted on an error, with a message of one line.
    """

    images = Signal(object, object)
    numbers = Signal(object)
    map = Signal(object, object)
    failed = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pictures = Worker("images", self)
        self._figures = Worker("figures", self)
        self._looks = Worker("flip", self)
        self._map = Worker("map", self)
        self._process = FlipProcess()
        self._ask: Ask | None = None
        self._shown: dict[str, object] = {}
        self._numbers: Numbers | None = None
        self._flip: dict[object, NDArray[np.float32] | str] = {}
        self._pictures.done.connect(self._take_images)
        self._figures.done.connect(self._take_numbers)
        self._looks.done.connect(self._take_flip)
        self._map.done.connect(self._take_map)
        for worker in (self._pictures, self._figures, self._map):
            worker.failed.connect(self._tell_failed)

    @property
    def busy(self) -> bool:
        """Whether any worker is computing."""
        return any(w.busy for w in (self._pictures, self._figures, self._looks, self._map))

    def want(self, ask: Ask) -> None:
        """Computes those results of a request that are not already displayed."""
        self._ask = ask
        if self._shown.get("pictures") != ask.pictures():
            self._shown["pictures"] = ask.pictures()
            self._pictures.submit(partial(_images, ask), ask.pictures())
        if ask.problem:
            for worker in (self._figures, self._looks, self._map):
                worker.cancel()
            self._shown.pop("figures", None)
            self._shown.pop("map", None)
            self._numbers = None
            self.numbers.emit(None)
            self.map.emit(None, None)
            return
        if self._shown.get("figures") != ask.figures():
            self._shown["figures"] = ask.figures()
            self._figures.submit(partial(_figures, ask), ask.figures())
        self._want_map()

    def close(self) -> None:
        """Stops all four workers."""
        self._process.stop()
        for worker in (self._pictures, self._figures, self._looks, self._map):
            worker.close()
        self._ask = self._numbers = None
        self._flip.clear()

    # ---- inside --------------------------------------------------------------------------------

    def _take_numbers(self, key: object, result: tuple[Ask, Numbers]) -> None:
        ask, found = result
        before = self._numbers
        if ask.figures() in self._flip:
            found = self._with_flip(ask, found)
        elif before is not None and before.flip is not None and (ask.a.live or ask.b.live):  # type: ignore[union-attr]
            # Show the FLIP value of the previous frame until the value of this frame has been
            # computed.
            found = found.with_flip(before.flip)
        self._numbers = found
        self.numbers.emit(found)
        self._want_flip(ask, high_range=False)
        if self._ask is not None and self._ask.kind == "z":
            self._shown.pop("map", None)
            self._want_map()

    def _want_flip(self, ask: Ask, high_range: bool) -> None:
        key = (*ask.figures(), *(["high"] if high_range else []))
        if key in self._flip or ask.problem:
            return
        self._looks.submit(partial(_flip, self._process, ask, high_range), key)

    def _take_flip(self, key: object, result: tuple[Ask, NDArray[np.float32] | str]) -> None:
        ask, found = result
        self._flip = {k: v for k, v in list(self._flip.items())[-3:]} | {key: found}
        if key == ask.figures() and self._numbers is not None:
            self._numbers = self._with_flip(ask, self._numbers)
            self.numbers.emit(self._numbers)
        self._want_map()
        if self._ask is not None and self._ask.figures() not in self._flip:
            # Compute FLIP again, since the images have changed since the last computation.
            self._want_flip(self._ask, high_range=False)

    def _with_flip(self, ask: Ask, found: Numbers) -> Numbers:
        values = self._flip[ask.figures()]
        if isinstance(values, str):
            return found.with_flip(None, values)
        return found.with_flip(float(values.mean(dtype=float)))

    def _want_map(self) -> None:
        ask = self._ask
        if ask is None or ask.problem:
            return
        values = None
        if ask.kind in ("flip-ldr", "flip-hdr"):
            high = ask.kind == "flip-hdr"
            found = self._flip.get((*ask.figures(), *(["high"] if high else [])))
            if found is None:
                self._want_flip(ask, high)
                return
            if isinstance(found, str):
                self.map.emit(None, found)
                return
            values = found
        test = self._numbers.test if self._numbers is not None else None
        key = (*ask.figures(), ask.kind)
        if self._shown.get("map") == key:
            return
        if ask.kind == "z" and test is None:
            if self._numbers is not None:
                self.map.emit(None, f"z-test: {self._numbers.test_note}")
            return
        self._shown["map"] = key
        self._map.submit(partial(_map, ask, values, test), key)

    def _take_map(self, key: object, result: tuple[NDArray[np.uint8], Scale]) -> None:
        if self._ask is not None and not self._ask.problem:
            pixels, scale = result
            self.map.emit(to_qimage(pixels), scale)

    def _take_images(
        self, key: object, pictures: tuple[DisplayLayer | None, DisplayLayer | None]
    ) -> None:
        a, b = (to_qimage(one.pixels) if one is not None else None for one in pictures)
        self.images.emit(a, b)

    def _tell_failed(self, key: object, line: str) -> None:
        self.failed.emit(line)


def _pair(ask: Ask) -> tuple[NDArray[Any], NDArray[Any]]:
    assert ask.a is not None and ask.b is not None
    return pair(ask.a, ask.b, ask.look.layer)


def _figures(ask: Ask) -> tuple[Ask, Numbers]:
    assert ask.a is not None and ask.b is not None
    return ask, numbers(ask.a, ask.b, ask.look.layer, ask.look.exposure)


def _flip(
    process: FlipProcess, ask: Ask, high_range: bool
) -> tuple[Ask, NDArray[np.float32] | str]:
    try:
        return ask, process.flip(*_pair(ask), high_range, ask.look.exposure)
    except Exception as error:
        return ask, str(error)


def _map(
    ask: Ask, values: NDArray[np.float32] | None, test: Any
) -> tuple[NDArray[np.uint8], Scale]:
    if ask.kind == "z":
        scale = z_scale(test)
    else:
        kind: Kind = ask.kind  # type: ignore[assignment]
        scale = scale_of(*_pair(ask), kind, exposure=ask.look.exposure, flip_values=values)
    return image.display(scale.pixels()), scale


def _images(ask: Ask) -> tuple[DisplayLayer | None, DisplayLayer | None]:
    """Returns both displayed images. False colours use one scale for both images."""
    layers = [
        _drawable(side.layer(ask.look.layer)) if side is not None else None
        for side in (ask.a, ask.b)
    ]
    look = ask.look
    shown = [show(layer, look) if layer is not None else None for layer in layers]
    legends: list[Legend] = [s.legend for s in shown if s is not None and s.legend is not None]
    if len(legends) == 2:
        look = replace(
            look,
            low=min(legend.low for legend in legends),
            high=max(legend.high for legend in legends),
        )
        shown = [show(layer, look) if layer is not None else None for layer in layers]
    first, second = shown
    return first, second


def _drawable(layer: NDArray[Any] | None) -> NDArray[Any] | None:
    """Converts a layer for ``show``: drops alpha and repeats a grey channel."""
    if layer is None:
        return None
    channels = layer.shape[2]
    if channels == 1:
        return layer[:, :, 0]
    return layer[:, :, :3] if channels >= 3 else layer
