# SPDX-License-Identifier: Apache-2.0
"""Loads and renders broken stages one after another: the worker process of ``fuzz_stages``.

Reads the path of a stage from each line of stdin. Answers with a line of JSON: ``outcome`` (one of
``OUTCOMES``) and ``said``. Crashes of libraries end the process.
"""

from __future__ import annotations

import functools
import json
import os
import resource
import sys
import tempfile
import traceback
from pathlib import Path
from typing import NoReturn, TextIO

LOAD_LIMIT_S = 1.5
"""Time limit for loading. The default limit would make thousands of cases take hours."""

OUTCOMES = ("rendered", "warned", "refused", "wrong")


def read(case: Path) -> tuple[str, str]:
    """Reads an input that is not a stage, with the reader that matches its file name. Returns
    (outcome, message).
    """
    import wavecomb
    from wavecomb.image.merge import merge
    from wavecomb.run.cost_profile import load_costs
    from wavecomb.scenes import SceneError
    from wavecomb.scenes.models.mesh_file import load_dragon

    stage = case.with_name("stage.usda")
    small = {"size": (8, 8), "spp": 1, "threads": 1}
    if case.name.startswith("mesh."):
        try:
            load_dragon(case)
        except SceneError as error:
            line = str(error)
            return ("refused" if line and "\n" not in line else "wrong"), line
    elif case.name == "case.ckpt":
        wavecomb.render(stage, size=(8, 8), spp=2, threads=1, resume=case)
    elif case.name == "case.exr":
        try:
            merge([case, case.with_name("good.exr")])
        # merge() may raise OSError, which the command `wavecomb merge` prints as one line.
        except OSError as error:
            line = str(error)
            return ("refused" if line and "\n" not in line else "wrong"), line
    else:
        wavecomb.render(stage, policy="adaptive", costs=load_costs(case), **small)
    return "rendered", ""


def judge(stage: str) -> tuple[str, str]:
    """Loads and renders a stage. Returns (outcome, message)."""
    import numpy as np

    import wavecomb
    from wavecomb import _core
    from wavecomb.errors import WavecombError

    try:
        if not Path(stage).name.startswith("stage."):
            return read(Path(stage))
        loaded = wavecomb.load(stage, threads=1, size=(8, 8))
        picture = wavecomb.render(loaded, size=(8, 8), spp=1, threads=1, max_depth=3)
    except (WavecombError, _core.Error) as error:
        line = str(error)
        clear = line and "\n" not in line and len(line) < 1000
        return ("refused" if clear else "wrong"), line
    except MemoryError:
        return "refused", "out of memory"
    except Exception:
        return "wrong", "\n".join(traceback.format_exc().splitlines()[-4:])
    lines = [*loaded.report.lines(), *loaded.scene.warnings]
    if any("\n" in line for line in lines):
        return "wrong", "\n".join(lines)
    if not np.isfinite(picture.beauty).all():
        return "wrong", "\n".join(["the picture is not finite", *lines])
    told = [*loaded.report.warnings, *loaded.scene.warnings]
    return ("warned" if told else "rendered"), "; ".join(lines)


def watch_writes(inside: str) -> list[str]:
    """Starts to record the paths outside of a folder that Python writes to; returns the list."""
    written: list[str] = []
    writing = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            if not isinstance(path, (str, bytes)) or not (int(str(flags or 0)) & writing):
                return
            paths: tuple[object, ...] = (path,)
        elif event in ("os.rename", "os.link", "os.symlink"):
            paths = arguments[:2]
        elif event in ("os.mkdir", "os.remove", "os.rmdir", "os.truncate"):
            paths = arguments[:1]
        else:
            return
        for path in paths:
            if isinstance(path, (str, bytes)):
                name = os.path.realpath(os.fsdecode(path))
                if not name.startswith((inside + "/", "/dev/", "/proc/")):
                    written.append(f"{event} {name}")

    sys.addaudithook(hook)
    return written


def give_up(answers: TextIO, line: str) -> NoReturn:
    """Answers and ends the process.

    This is the only way to stop USD, which never finishes composing some stages.
    """
    answer = {"outcome": "refused", "said": line, "ended": True}
    print(json.dumps(answer), file=answers, flush=True)
    os._exit(0)


def main() -> None:
    """Answers requests until stdin ends."""
    from wavecomb.run.isolation import progress_notes, time_limit
    from wavecomb.run.isolation.supervisor import CHATTER

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    limit = int(sys.argv[1])
    if limit:
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    answers = os.fdopen(os.dup(1), "w")
    progress_notes.start(progress_notes.new_page())
    time_limit.limit_s = LOAD_LIMIT_S
    time_limit.end_process = functools.partial(give_up, answers)
    judge(sys.argv[2])  # import all modules before the first case, whose time is measured
    with tempfile.TemporaryFile() as spilt:
        written = watch_writes(os.path.realpath(os.path.dirname(sys.argv[2])))
        os.dup2(spilt.fileno(), 1)
        os.dup2(spilt.fileno(), 2)
        print(json.dumps({"outcome": "ready", "said": ""}), file=answers, flush=True)
        for line in sys.stdin:
            outcome, said = judge(line.rstrip("\n"))
            if written:
                outcome, said = "wrong", f"outside of its folder: {'; '.join(written)}"
                written.clear()
            sys.stdout.flush()
            sys.stderr.flush()
            if os.fstat(1).st_size:
                words = os.pread(1, 4096, 0).decode(errors="replace")
                # The supervisor ignores output lines that start with CHATTER.
                if not all(text.startswith(CHATTER) for text in words.splitlines()):
                    outcome, said = "wrong", f"spilt: {words}"
                os.ftruncate(1, 0)
                os.lseek(1, 0, os.SEEK_SET)
            print(json.dumps({"outcome": outcome, "said": said}), file=answers, flush=True)


if __name__ == "__main__":
    main()
