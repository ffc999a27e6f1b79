# SPDX-License-Identifier: Apache-2.0
"""What a worker of Dask runs: text in, text out, a process of its own in between.

Dask sends functions by the name of their module, where they can be imported: nothing of ours is
pickled but this one's name and a line of JSON.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import tempfile
import time

from wavecomb import processes

_POLL_S = 0.25
_LOOK_S = 5.0
_MOST_LOOKS = 3
"""That see a job that is over: then its worker hangs, and is ended."""
_STOP_S = 60.0
_DIE_S = 10.0
_MOST_SAID = 1 << 16


def work(text: str) -> str:
    """Runs `wavecomb farm worker` on a job until it ends.

    The process ends with this one: by the end of its stdin, and where this one is killed by the
    kernel.

    Args:
        text: JSON: ``job``, the folder, and ``options``, words for the command.

    Returns:
        JSON: ``code``, and ``said``, the last line of standard error.
    """
    told = json.loads(text)
    words = ["farm", "worker", str(told["job"]), "--tied", "--quiet", *map(str, told["options"])]
    with tempfile.TemporaryFile() as said:
        process = processes.start(
            "wavecomb", *words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said
        )
        try:
            look, over = time.monotonic() + _LOOK_S, 0
            while process.poll() is None and over < _MOST_LOOKS:
                time.sleep(_POLL_S)
                if time.monotonic() > look:
                    look = time.monotonic() + _LOOK_S
                    over = over + 1 if _is_over(str(told["job"])) else 0
        finally:
            assert process.stdin is not None
            with contextlib.suppress(OSError):
                process.stdin.close()
            try:
                process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(_DIE_S)
        said.seek(0)
        lines = said.read(_MOST_SAID).decode(errors="replace").strip().splitlines()
    return json.dumps({"code": process.returncode, "said": lines[-1] if lines else ""})


def _is_over(job: str) -> bool:
    from wavecomb.errors import WavecombError
    from wavecomb.farm.folder import Folder

    try:
        return Folder(job).is_over()
    except (OSError, WavecombError):
        return False  # the share may be gone for a while
