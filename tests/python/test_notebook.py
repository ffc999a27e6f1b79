# SPDX-License-Identifier: Apache-2.0
"""Tests images and progress in a notebook (with a fake IPython), and the window from Python."""

from __future__ import annotations

import base64
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from parts import needs

import wavecomb
from wavecomb import window
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import display, read_codes
from wavecomb.image.rendered import Picture
from wavecomb.image.thumbnails import encode_image, shrink
from wavecomb.run import live_view


def picture(width: int = 40, height: int = 24, **more: Any) -> Picture:
    rng = np.random.default_rng(5)
    depth = np.full((height, width), 3.0, np.float32)
    depth[0, 0] = np.inf
    return Picture(
        beauty=rng.gamma(1.0, 0.8, (height, width, 3)).astype(np.float32),
        albedo=rng.random((height, width, 3), np.float32),
        normal=np.zeros((height, width, 3), np.float32),
        depth=depth,
        samples=np.full((height, width), 16, np.uint32),
        stats={"seconds": {"render": 1.25}},
        **more,
    )


def codes_of(png: bytes, folder: Path) -> np.ndarray:
    file = folder / "shown.png"
    file.write_bytes(png)
    return read_codes(file)


def test_png_is_the_tone_mapped_picture(tmp_path: Path) -> None:
    shown = picture()
    expected = display(shown.beauty, tone_map="neutral")
    assert np.array_equal(codes_of(shown._repr_png_(), tmp_path), expected)
    grey = np.full((24, 40, 3), 0.5, np.float32)
    shown = codes_of(picture(denoised=grey)._repr_png_(), tmp_path)
    assert np.array_equal(shown, display(grey, tone_map="neutral"))


def test_bundle_has_picture_layers_and_a_line(tmp_path: Path) -> None:
    bundle = picture(cancelled=True)._repr_mimebundle_()
    assert set(bundle) == {"text/html", "image/png", "text/plain"}
    markup = bundle["text/html"]
    assert "40 x 24, 16 samples a pixel, 1.2 s, stopped before its end" in markup
    for name in ("albedo", "normal", "depth: 3<", "samples: 16<"):
        assert name in markup
    sources = re.findall(r"src='data:image/png;base64,([^']+)'", markup)
    assert len(sources) == 5
    assert base64.b64decode(sources[0]) == base64.b64decode(bundle["image/png"])
    assert codes_of(base64.b64decode(sources[2]), tmp_path)[0, 0].tolist() == [128, 128, 128]
    assert "<script" not in markup and "http" not in markup


def test_bundle_makes_only_what_is_asked_for() -> None:
    assert set(picture()._repr_mimebundle_(include={"image/png"})) == {"image/png"}
    assert "text/html" not in picture()._repr_mimebundle_(exclude=["text/html"])


def test_it_says_what_it_is_in_a_line() -> None:
    assert repr(picture()) == (
        "<wavecomb.Picture 40 x 24, 16 samples a pixel, 1.2 s; "
        "beauty, albedo, normal, depth, samples>"
    )


def test_large_pictures_are_made_smaller() -> None:
    wide = np.zeros((10, 4001, 3), np.float32)
    wide[:, ::2] = 2.0
    small = shrink(wide, 1600)
    assert small.shape == (3, 1333, 3)
    assert small.mean() == pytest.approx(1.0, rel=1e-3)
    assert shrink(wide[:, :100], 1600).shape == (10, 100, 3)
    assert shrink(np.ones((1, 5000, 3)), 100).shape == (1, 100, 3)


def test_jpeg_is_close_and_small() -> None:
    codes = np.tile(np.linspace(0, 255, 256).astype(np.uint8)[None, :, None], (64, 1, 3))
    jpeg = encode_image(codes, "jpeg")
    assert jpeg[:2] == b"\xff\xd8" and len(jpeg) < codes.size / 8


# ---- progress ------------------------------------------------------------------------------------


class Handle:
    def __init__(self) -> None:
        self.shown: list[str] = []

    def update(self, markup: Any) -> None:
        self.shown.append(markup.data)


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Handle:
    """A fake Jupyter kernel without ipywidgets."""
    handle = Handle()
    outputs = ModuleType("IPython.display")
    outputs.HTML = lambda data: SimpleNamespace(data=data)  # type: ignore[attr-defined]
    outputs.display = lambda *what, display_id: handle  # type: ignore[attr-defined]
    ipython = ModuleType("IPython")
    ipython.display = outputs  # type: ignore[attr-defined]
    ipython.get_ipython = lambda: SimpleNamespace(kernel=object())  # type: ignore[attr-defined]
    for name, module in (("IPython", ipython), ("IPython.display", outputs), ("ipywidgets", None)):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(live_view, "FIRST_S", 0.0)
    return handle


def scene() -> Any:
    builder = wavecomb.SceneBuilder()
    builder.add_light("dome", np.eye(4))
    builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5))
    return builder.build()


@pytest.mark.slow
@needs("wavecomb._core")
def test_a_notebook_shows_a_bar_and_the_picture_so_far(notebook: Handle) -> None:
    made = wavecomb.render(scene(), size=(192, 192), spp=200, seed=3)
    assert not made.cancelled
    bars = [one for one in notebook.shown if "<progress" in one]
    assert "samples/s" in bars[0]
    assert any("<img src='data:image/png;base64," in one for one in bars)
    assert notebook.shown[-1] == ""
    before = len(notebook.shown)
    plain = wavecomb.render(scene(), size=(192, 192), spp=200, seed=3, progress=False)
    assert len(notebook.shown) == before
    assert wavecomb.compare(made, plain).equal
    wavecomb.render(scene(), size=(8, 8), spp=1, progress=lambda done, total: None)
    assert len(notebook.shown) == before


def test_widgets_are_taken_where_they_are(
    notebook: Handle, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []

    def widget(*children: Any, **options: Any) -> SimpleNamespace:
        one = SimpleNamespace(layout=SimpleNamespace(), closed=False, **options_of(options))
        one.close = lambda: setattr(one, "closed", True)
        made.append(one)
        return one

    def options_of(options: dict[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in options.items() if key != "layout"}

    kinds = ("FloatProgress", "Label", "Image", "HBox", "VBox")
    widgets = SimpleNamespace(**dict.fromkeys(kinds, widget))
    monkeypatch.setitem(sys.modules, "ipywidgets", widgets)
    monkeypatch.setattr(sys.modules["IPython.display"], "display", lambda what: None)
    view = live_view.make_view()
    assert isinstance(view, live_view.WidgetView)
    view.bar(0.25, "25 %")
    view.picture(b"png")
    bar, text, image, _, everything = made
    assert (bar.value, text.value, image.value, image.layout.display) == (0.25, "25 %", b"png", "")
    view.close()
    assert everything.closed


def test_no_notebook_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not live_view.in_notebook()
    with live_view.watching(None) as shown:
        assert shown is None
    monkeypatch.setattr(live_view, "progress_console", lambda: None)
    with live_view.watching(True) as shown:
        assert shown is None


# ---- the window ----------------------------------------------------------------------------------


def test_window_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wavecomb.extras.missing_modules", lambda extra: ["PySide6"])
    with pytest.raises(WavecombError, match=r"^the window needs PySide6: pip install 'PySide6"):
        wavecomb.view("shot.usd")
    monkeypatch.setattr("wavecomb.extras.missing_modules", lambda extra: [])
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(WavecombError, match="no display to open a window on"):
        wavecomb.view("shot.usd")
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    with pytest.raises(WavecombError, match=r"shot\.usd: no such file"):
        wavecomb.view("shot.usd")


@needs("wavecomb._core")
def test_window_is_started_with_what_was_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    started: list[Any] = []

    def start(command: list[str], **how: Any) -> Any:
        started.append((command, how))
        return SimpleNamespace(pid=1, poll=lambda: None)

    monkeypatch.setattr(window.subprocess, "Popen", start)
    monkeypatch.setattr("wavecomb.extras.missing_modules", lambda extra: [])
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    stage = tmp_path / "-a.usda"
    stage.write_text("#usda 1.0\n")
    opened = wavecomb.view(
        SimpleNamespace(stage_path=stage), size=(64, 32), spp=4, denoise=True, camera="/Cam",
        purposes=["proxy"], variants={"lod": "high"}, frame=None, roulette="off",
    )  # fmt: skip
    command, how = started[0]
    start = command.index("wavecomb")
    assert command[1] == "-I" and not any(word.startswith("--parent") for word in command[:start])
    assert command[start:] == [
        "wavecomb", "view", "--size", "64", "32", "--spp", "4", "--denoise",
        "--camera", "/Cam", "--purpose", "proxy", "--variant", "lod=high", "--roulette", "off",
        "--", str(stage),
    ]  # fmt: skip
    assert how["start_new_session"] and opened.is_open and "open" in repr(opened)
    with pytest.raises(TypeError, match=r"no option 'shutter' of the window; there are camera"):
        wavecomb.view(stage, shutter=(0, 1))


@pytest.mark.slow
@needs("wavecomb._core", "PySide6.QtWidgets", "pyqtgraph")
def test_a_window_opens_and_closes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    opened = wavecomb.view()
    until = time.monotonic() + 60
    # The process has installed its signal handlers once its second thread runs.
    while len(os.listdir(f"/proc/{opened.pid}/task")) < 2 and time.monotonic() < until:
        time.sleep(0.1)
    assert opened.is_open
    opened.close()
    assert not opened.is_open and "closed" in repr(opened)
    with pytest.raises(WavecombError, match="each edge must be from 1"):
        wavecomb.view(size=(0, 10), wait=True)


def test_a_window_that_is_open_is_waited_for(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    with (tmp_path / "said").open("w+") as said:
        opened = window.Window(process, said)
        with pytest.raises(TimeoutError, match=r"still open after 0\.01 s"):
            opened.wait(0.01)
        opened.close()
        assert not opened.is_open
