# SPDX-License-Identifier: Apache-2.0
"""Reads a stage in a process of its own, so that a crash hits that and not the caller.

``check`` is the caller's side. ``python -m wavecomb.run.isolate.probe``, the process, which is in
the sandbox, opens and composes a stage, reads every array and decodes every image, builds nothing,
and answers.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.machine import temporary_folder
from wavecomb.run.isolate import box, memory, patience, trail
from wavecomb.run.isolate.broker import Outputs


def is_wanted(isolate: bool | None = None) -> bool:
    """Whether a stage is to be read by such a process first; None: as WAVECOMB_ISOLATE says."""
    if isolate is None:
        isolate = os.environ.get("WAVECOMB_ISOLATE", "0") not in ("", "0")
    return isolate


def check(
    path: Path,
    options: dict[str, Any],
    load_limit: float | None = None,
    memory_limit: float | None = None,
) -> None:
    """Raises WavecombError where a stage cannot be read, or would crash who reads it.

    Args:
        path: The stage's file.
        options: Keyword arguments of ``wavecomb.usd.load_stage``.
        load_limit: As of ``wavecomb.load``.
        memory_limit: Likewise.
    """
    page = trail.new_page()
    temporary = None
    with contextlib.suppress(OSError):
        temporary = tempfile.mkdtemp(prefix="wavecomb-", dir=temporary_folder())
    try:
        job = {
            "path": os.fspath(path), "options": options, "page": page, "limit": load_limit,
            "memory": memory_limit, "temporary": temporary,
        }  # fmt: skip
        done = subprocess.run(
            [sys.executable, "-m", "wavecomb.run.isolate.probe"],
            input=json.dumps(job),
            capture_output=True,
            text=True,
            errors="replace",
            pass_fds=(page,),
        )
        seen = trail.open_page(page)
    finally:
        os.close(page)
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
    if done.returncode < 0:
        where, limit = trail.read(seen), memory.limit_of(seen)
        line = trail.obituary(-done.returncode, where, done.stderr, limit)
        raise WavecombError(f"{path}: {line}")
    try:
        error = json.loads(done.stdout)
    except ValueError:
        said = done.stderr.strip().splitlines()
        raise WavecombError(
            f"{path}: the process that reads it first ended with code {done.returncode}: "
            f"{said[-1] if said else 'no word'}"
        ) from None
    if error is not None:
        raise WavecombError(error)


class Nowhere:
    """A scene builder that takes everything and keeps nothing."""

    def make_surfaces(self, descriptions: list[dict[str, Any]], threads: int = 0) -> Any:
        """Refined meshes, as what follows looks into them."""
        from wavecomb import _core

        return _core.SceneBuilder(threads).make_surfaces(descriptions, threads)

    def build(self) -> Any:
        """No scene."""
        return None

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: 0


def main() -> None:
    """Reads the job from stdin; answers with the line of an error, or null."""
    job = json.load(sys.stdin)
    answer = os.dup(1)
    os.dup2(2, 1)
    trail.follow(job["page"])
    patience.limit_s = job["limit"]

    def say(error: str | None) -> None:
        os.write(answer, json.dumps(error).encode())
        # Nothing is worth to be tidied up here.
        os._exit(0)

    patience.on_end = say
    from wavecomb.run.faults import describe

    try:
        memory.limit(job["memory"])
        if job["temporary"] is not None:
            os.environ["TMPDIR"] = job["temporary"]
        box.enter(Outputs(), temporary=job["temporary"])
        from wavecomb.usd import load_stage

        load_stage(job["path"], builder_factory=Nowhere, **job["options"])  # type: ignore[arg-type]
    except Exception as error:
        say(" ".join(describe(error).split()))
    say(None)


if __name__ == "__main__":
    main()
