# SPDX-License-Identifier: Apache-2.0
"""Renders .blend files, which Blender exports as a stage in a separate process.

The export is done by the Blender extension in ``blender/`` of a checkout, which has another licence
and is not part of this package.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from wavecomb import processes, terminal
from wavecomb.errors import WavecombError

LIMIT_S = 1800.0
"""Time limit of the export in seconds."""


def extension() -> Path:
    """Returns the folder of the Blender extension.

    Raises:
        WavecombError: The extension was not found.
    """
    named = os.environ.get("WAVECOMB_BLENDER_EXTENSION")
    places = [Path(named).absolute()] if named else []
    places.append(Path(__file__).resolve().parents[2] / "blender")
    for place in places:
        if (place / "export_file.py").is_file():
            return place
    raise WavecombError(
        "the Blender extension was not found: set WAVECOMB_BLENDER_EXTENSION to the folder "
        "`blender` of a checkout of Wavecomb"
    )


_SCRIPT = """import runpy, sys
runpy.run_path(sys.argv[1], run_name="__main__")
"""


def command(script: str, *words: str) -> list[str]:
    """Returns the command that runs a script in Blender while scripts in .blend files are disabled.

    The process is isolated by ``wavecomb.processes``. The program is ``$WAVECOMB_BLENDER``, which
    is the path of Blender or of a Python interpreter with the module bpy. Without this variable,
    the program is ``blender`` on PATH, or else the running Python interpreter if it has bpy.

    Args:
        script: Absolute path of the script.
        *words: Arguments of the script.

    Raises:
        WavecombError: Neither Blender nor a Python interpreter with bpy was found.
    """
    named = os.environ.get("WAVECOMB_BLENDER")
    found = shutil.which(named or "blender")
    if found is None and named:
        raise WavecombError(f"WAVECOMB_BLENDER: {named} is not a program")
    if found is None and importlib.util.find_spec("bpy") is not None:
        return processes.command("-c", _SCRIPT, script, "--", *words, parent=os.getpid())
    if found is None:
        raise WavecombError(
            "rendering a .blend file needs Blender 4.2 or later: put `blender` on PATH, or set "
            "WAVECOMB_BLENDER to it or to a Python with bpy"
        )
    found = os.path.abspath(found)
    if Path(found).name.startswith("python"):
        run = (_SCRIPT, script, "--", *words)
        return processes.command("-c", *run, parent=os.getpid(), python=found)
    options = ["--background", "--factory-startup", "--disable-autoexec"]
    options += ["--python-exit-code", "1", "--python", script, "--"]
    return processes.program(found, *options, *words)


def _run(words: Sequence[str], folder: str) -> subprocess.CompletedProcess[str]:
    """Runs Blender in a folder that contains no files of the user, and returns its output.

    Raises:
        subprocess.TimeoutExpired: Blender took longer than ``LIMIT_S``.
        OSError: Blender could not be started.
    """
    variables = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    child = processes.popen(
        words, cwd=folder, env=variables, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, errors="replace",
    )  # fmt: skip
    try:
        out, err = child.communicate(timeout=LIMIT_S)
    except BaseException:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
        raise
    return subprocess.CompletedProcess(child.args, child.returncode, out, err)


def export(blend: str, folder: str, frame: float | None) -> tuple[str, list[str], list[str]]:
    """Exports the scene of a file.

    Args:
        blend: The file.
        folder: Folder for the stage.
        frame: Frame; None means the current one of the file.

    Returns:
        The stage, options of ``wavecomb render``, and messages about what was not translated.

    Raises:
        WavecombError: The file could not be exported.
    """
    if not os.path.isfile(blend):
        raise WavecombError(f"{blend}: there is no such file")
    script = str(extension() / "export_file.py")
    folder = os.path.abspath(folder)
    words = [os.path.abspath(blend), folder, *([] if frame is None else [repr(frame)])]
    try:
        done = _run(command(script, *words), folder)
    except subprocess.TimeoutExpired as error:
        raise WavecombError(f"{blend}: Blender took more than {LIMIT_S:.0f} s") from error
    except OSError as error:
        raise WavecombError(f"Blender does not start: {error}") from error
    result = Path(folder, "stage.json")
    if done.returncode != 0 or not result.is_file():
        lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
        last = lines[-1].removeprefix("error: ") if lines else f"{blend}: Blender could not open it"
        raise WavecombError(last)
    row = json.loads(result.read_text(encoding="utf-8"))
    return row["stage"], row["options"], row["messages"]


def render(blend: str, frame: float | None, arguments: Sequence[str]) -> int:
    """Runs ``wavecomb render`` on the exported stage of a file; returns its exit code.

    Args:
        blend: The .blend file, which is also one of ``arguments``.
        frame: Frame to export; None means the current one of the file.
        arguments: Arguments of the command.

    Raises:
        WavecombError: The file could not be exported.
    """
    with tempfile.TemporaryDirectory(prefix="wavecomb-blend-") as folder:
        stage, options, messages = export(blend, folder, frame)
        for line in messages:
            terminal.say(line, err=True)
        at = list(arguments).index(blend)
        words = [*arguments[:at], stage, *options, *arguments[at + 1 :]]
        command = processes.command("wavecomb", "render", *words, parent=os.getpid())
        child = processes.popen(command, start_new_session=False)
        while True:
            try:
                code = child.wait()
                return code if code >= 0 else 128 - code
            except KeyboardInterrupt:
                child.terminate()
