# SPDX-License-Identifier: Apache-2.0
"""Opens the viewer window in a separate process, so that notebooks and scripts continue."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Mapping
from typing import IO, TYPE_CHECKING, Any

from wavecomb import processes
from wavecomb.errors import WavecombError
from wavecomb.load_options import rows
from wavecomb.options import settings

if TYPE_CHECKING:
    from wavecomb.usd import LoadedStage

LOADING = ("camera", "frame", "variants", "purposes")
SETTINGS = ("max_depth", "seed", "threads", "policy", "ray_order", "roulette")
"""Settings that the window accepts when it is opened; the user chooses all others in the window."""


class Window:
    """A viewer window, which may have been closed.

    Attributes:
        pid: Process id of the window.
    """

    def __init__(self, process: subprocess.Popen[bytes], said: IO[str]) -> None:
        self._process, self._said = process, said
        self.pid = process.pid

    @property
    def is_open(self) -> bool:
        """Whether the window is open."""
        return self._process.poll() is None

    def wait(self, timeout: float | None = None) -> None:
        """Waits until the window is closed.

        Args:
            timeout: Seconds; None waits without limit.

        Raises:
            TimeoutError: The window is still open.
            WavecombError: The window could not be opened.
        """
        try:
            code = self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"the window is still open after {timeout:g} s") from None
        if code > 0:
            self._said.seek(0)
            errors = [line for line in self._said if line.startswith("error: ")]
            ended = f"the window ended with code {code}"
            raise WavecombError(errors[-1].removeprefix("error: ") if errors else ended)

    def close(self) -> None:
        """Closes the window as its user would."""
        if self.is_open:
            self._process.terminate()
        self._process.wait()

    def __repr__(self) -> str:
        return f"<wavecomb.Window {'open' if self.is_open else 'closed'}, process {self.pid}>"


def view(
    stage: str | os.PathLike[str] | LoadedStage | None = None,
    *,
    size: tuple[int, int] | None = None,
    spp: int | None = None,
    denoise: bool = False,
    wait: bool = False,
    **options: Any,
) -> Window:
    """Opens a window on a stage in a separate process and returns at once.

    The window reads the stage's file, so that changes of a ``LoadedStage`` are not visible.

    Args:
        stage: .usd, .usda, .usdc or .usdz, or a result of ``load``; None opens an empty window.
        size: Width and height of the image in pixels.
        spp: Samples per pixel.
        denoise: Whether to show the denoised image.
        wait: Whether to return only when the window is closed.
        **options: The fields camera, frame, variants and purposes of ``LoadOptions``, and
            max_depth, seed, threads, policy, ray_order and roulette of ``Settings``.

    >>> window = wavecomb.view("mixed.usdc", size=(960, 540), camera="/World/Cam")  # doctest: +SKIP
    >>> window.close()  # doctest: +SKIP

    Raises:
        WavecombError: The extra ``gui`` is missing, there is no display, or the file does not
            exist.
        TypeError: An option does not exist.
    """
    from wavecomb.gui.needs import check_window

    check_window()
    path: Any = getattr(stage, "stage_path", stage)
    if path is not None and not os.path.exists(path):
        raise WavecombError(f"{os.fspath(path)}: no such file")
    words: list[str] = []
    if size is not None:
        words += ["--size", *map(str, size)]
    if spp is not None:
        words += ["--spp", str(spp)]
    words += ["--denoise"] * denoise + arguments(options)
    words += [] if path is None else ["--", os.fspath(path)]
    # The window's process continues after this program ends, and pressing Ctrl-C in this program's
    # terminal does not end it.
    said = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115
    command = processes.command("wavecomb", "view", *words)
    process = processes.popen(command, stdin=subprocess.DEVNULL, stderr=said)
    window = Window(process, said)
    if wait:
        window.wait()
    return window


def arguments(options: Mapping[str, Any]) -> list[str]:
    """Converts keywords to options of ``wavecomb view``.

    >>> arguments({"camera": "/Cam", "variants": {"lod": "high"}, "seed": 3})
    ['--camera', '/Cam', '--variant', 'lod=high', '--seed', '3']

    Raises:
        TypeError: An option does not exist.
    """
    loading = {name: row.option for name, row in rows().items() if name in LOADING}
    out: list[str] = []
    for name, value in options.items():
        if name not in loading and name not in SETTINGS:
            there_are = ", ".join(sorted((*LOADING, *SETTINGS, "size", "spp", "denoise")))
            raise TypeError(f"no option {name!r} of the window; there are {there_are}")
        option = loading[name] if name in loading else settings()[name].option
        if value is None:
            continue
        if isinstance(value, Mapping):
            values = [f"{key}={choice}" for key, choice in value.items()]
        else:
            values = [str(value)] if name != "purposes" else [str(one) for one in value]
        for one in values:
            out += [option, one]
    return out
