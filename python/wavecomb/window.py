# SPDX-License-Identifier: Apache-2.0
"""The window from Python: in a process of its own, so that a notebook or a script goes on."""

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
"""What the window is opened with; all else is chosen in it."""


class Window:
    """A window that is open, or was.

    Attributes:
        pid: Of its process.
    """

    def __init__(self, process: subprocess.Popen[bytes], said: IO[str]) -> None:
        self._process, self._said = process, said
        self.pid = process.pid

    @property
    def is_open(self) -> bool:
        """Whether it is."""
        return self._process.poll() is None

    def wait(self, timeout: float | None = None) -> None:
        """Waits until it is closed.

        Args:
            timeout: Seconds; None: any.

        Raises:
            TimeoutError: It is still open.
            WavecombError: It could not be opened.
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
        """Closes it, as if its user did."""
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
    """Opens a window on a stage, in a process of its own, and comes back at once.

    The window reads the stage's file: what was changed in a ``LoadedStage`` is not in it.

    Args:
        stage: .usd, .usda, .usdc or .usdz, or what ``load`` gave; None: an empty window.
        size: Width and height of the picture, pixels.
        spp: Samples per pixel.
        denoise: Whether the picture is shown without its noise.
        wait: Come back when the window is closed.
        **options: Of ``LoadOptions`` camera, frame, variants and purposes, of ``Settings``
            max_depth, seed, threads, policy, ray_order and roulette.

    >>> window = wavecomb.view("mixed.usdc", size=(960, 540), camera="/World/Cam")  # doctest: +SKIP
    >>> window.close()  # doctest: +SKIP

    Raises:
        WavecombError: The extra ``gui`` is missing, there is no display, or no such file.
        TypeError: There is no such option.
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
    # It outlives this program, and a Ctrl-C that is meant for this one.
    said = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115
    command = processes.command("wavecomb", "view", *words)
    process = processes.popen(command, stdin=subprocess.DEVNULL, stderr=said)
    window = Window(process, said)
    if wait:
        window.wait()
    return window


def arguments(options: Mapping[str, Any]) -> list[str]:
    """Keywords as options of ``wavecomb view``.

    >>> arguments({"camera": "/Cam", "variants": {"lod": "high"}, "seed": 3})
    ['--camera', '/Cam', '--variant', 'lod=high', '--seed', '3']

    Raises:
        TypeError: There is no such option.
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
