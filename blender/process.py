# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs Wavecomb as a separate process, with its own Python and its own OpenUSD."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from typing import Any

_WAIT = """
import importlib, json, os, sys
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError:
        pass
line = sys.stdin.readline()
if not line:
    sys.exit(0)
os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
parent, *words = json.loads(line)
from wavecomb.boot import end_with_parent
end_with_parent(parent)
from wavecomb.cli import main
sys.argv[:] = ["wavecomb", *words]
main(prog_name="wavecomb")
"""
"""Program that loads modules, then waits for a line with Blender's process and the arguments.

The program ends if the line does not come because Blender has ended. Linux ends a process together
with the thread that started it, and Blender renders in threads. Therefore the program asks to end
with Blender only when the render begins.
"""
_MODULES = (
    "wavecomb.cli.render", "wavecomb.cli.frames", "wavecomb.cli.planning", "wavecomb.cli.job",
    "wavecomb.usd.stage.load", "wavecomb.run.callbacks", "wavecomb.run.cost_profile",
    "wavecomb.image.files.exr", "wavecomb.image.files.deep", "wavecomb._core", "OpenImageIO",
    "pxr.UsdRender", "pxr.UsdSkel", "pxr.UsdUI", "pxr.UsdUtils", "pxr.UsdVol",
)  # fmt: skip
"""Modules that every render needs."""
_FOUND: dict[str, tuple[str, str]] = {}


class WavecombError(Exception):
    """Raised if Wavecomb cannot be started or fails; the message is one line."""


def locate(wanted: str) -> tuple[str, str]:
    """Returns Wavecomb's Python interpreter and the module that starts isolated processes.

    Args:
        wanted: Program ``wavecomb`` or its Python; empty searches PATH.

    Raises:
        WavecombError: Wavecomb was not found, or does not start.
    """
    program = shutil.which(wanted or "wavecomb")
    if program is None:
        where = f"{wanted} is not a program" if wanted else "no wavecomb on PATH"
        raise WavecombError(
            f"Wavecomb was not found ({where}): install it with pip and set its program in the "
            "preferences of the add-on"
        )
    if program not in _FOUND:
        python = _python_of(program)
        code = "import importlib.util as u; print(u.find_spec('wavecomb').origin)"
        try:
            done = subprocess.run(
                [python, "-I", "-c", code], capture_output=True, text=True, timeout=60, check=False,
                env=environment(),
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            raise WavecombError(f"{python} does not start: {error}") from error
        if done.returncode != 0:
            raise WavecombError(f"{python} has no Wavecomb: install it there with pip")
        boot = os.path.join(os.path.dirname(done.stdout.strip()), "boot.py")
        _FOUND[program] = (python, boot)
    return _FOUND[program]


def _python_of(program: str) -> str:
    """Returns the interpreter of a script, from its first line, or the program itself."""
    with open(program, "rb") as stream:
        first = stream.readline(512)
    if first.startswith(b"#!"):
        words = first[2:].decode(errors="replace").split()
        if words and "python" in os.path.basename(words[0]):
            return words[0]
    beside = os.path.join(os.path.dirname(program), "python")
    return beside if os.path.exists(beside) and first.startswith(b"#!") else program


def environment() -> dict[str, str]:
    """Returns Blender's environment without variables that redirect Python, USD or libraries."""
    drop = ("PYTHON", "PXR_", "USD_", "LD_PRELOAD", "MATERIALX", "OCIO")
    return {k: v for k, v in os.environ.items() if not k.startswith(drop)}


class Render:
    """A process that loads Wavecomb, waits for the scene, and then renders it."""

    def __init__(self, program: str) -> None:
        """Starts the process, which ends when this process ends.

        Raises:
            WavecombError: The render could not be started.
        """
        python, boot = locate(program)
        words = [python, "-I", boot, "-c", _WAIT, *_MODULES]
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        try:
            self._process = subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                env=environment(),
                start_new_session=True,
            )
        except OSError as error:
            raise WavecombError(f"Wavecomb does not start: {error}") from error
        self._events: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def begin(self, arguments: Sequence[str]) -> None:
        """Starts ``wavecomb render`` with these arguments.

        The process is already separate from Blender, so that it needs no child of its own.
        """
        request = [os.getpid(), "render", *arguments, "--progress", "json", "--isolate", "off"]
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError), self._process.stdin as stream:
            stream.write(json.dumps(request).encode() + b"\n")

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                event = json.loads(line)
            except ValueError:
                continue
            if isinstance(event, dict):
                self._events.put(event)

    def event(self, wait_s: float) -> dict[str, Any] | None:
        """Returns the next progress event, or None if no event arrives within ``wait_s``."""
        try:
            return self._events.get(timeout=wait_s)
        except queue.Empty:
            return None

    @property
    def is_running(self) -> bool:
        """Whether the process is running, or has events that were not read."""
        return self._process.poll() is None or not self._events.empty()

    def stop(self) -> None:
        """Asks the render to stop, which keeps the finished samples."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Kills the render process and its child processes."""
        if self._process.poll() is None:
            try:
                os.killpg(self._process.pid, signal.SIGKILL)
            except OSError:
                self._process.kill()
            self._process.wait()

    def finish(self) -> list[str]:
        """Waits for the end of the render; returns its warnings.

        Raises:
            WavecombError: The render failed; the message is its last line of output.
        """
        code = self._process.wait()
        self._reader.join(timeout=10.0)
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").splitlines()
        self._errors.close()
        lines = [line.strip() for line in lines if line.strip()]
        if code == 0 or code in (128 + signal.SIGTERM, 128 + signal.SIGINT):
            return lines
        if code < 0:
            name = signal.Signals(-code).name
            raise WavecombError(f"Wavecomb was ended by {name}; Blender and the scene are intact")
        errors = [line for line in lines if line.startswith(("error:", "Error:"))]
        last = (errors or lines or [f"Wavecomb ended with code {code}"])[-1]
        raise WavecombError(last.removeprefix("error: "))
