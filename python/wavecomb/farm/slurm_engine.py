# SPDX-License-Identifier: Apache-2.0
"""Workers that Slurm starts: an array of jobs, which this process watches."""

from __future__ import annotations

import contextlib
import re
import subprocess
import time

from wavecomb.errors import WavecombError
from wavecomb.farm.elsewhere import Elsewhere
from wavecomb.farm.export import write_slurm
from wavecomb.farm.folder import Folder

_ANSWER_S = 60.0
"""For sbatch, squeue and scancel."""
_ASK_S = 10.0
"""Between two questions to squeue."""


class Slurm(Elsewhere):
    """An array of workers in Slurm's queue."""

    def __init__(self, folder: Folder, workers: int) -> None:
        """Submits nothing yet. ``workers``: how many."""
        super().__init__(folder)
        self._workers = workers
        self._id = ""
        self._next = 0.0
        self._is_there = True

    def begin(self) -> None:
        """Has sbatch take the script."""
        script = self._folder.path / "slurm.sh"
        write_slurm(str(script), self._folder, self._workers)
        said = _ask("sbatch", "--parsable", str(script))
        match = re.fullmatch(r"(\d+)(;\S+)?", said.strip().splitlines()[-1] if said.strip() else "")
        if match is None:
            raise WavecombError(f"--on slurm: sbatch said no number of a job: {said.strip()!r}")
        self._id = match[1]
        self._next = time.monotonic() + _ASK_S

    def tend(self) -> bool:
        """Whether the queue still has any of them."""
        if time.monotonic() < self._next:
            return self._is_there
        self._next = time.monotonic() + _ASK_S
        try:
            self._is_there = bool(_ask("squeue", "--noheader", "--jobs", self._id).strip())
        except WavecombError as error:
            # Of a job that is long over squeue knows nothing; else it is asked again.
            self._is_there = "Invalid job id" not in str(error)
        return self._is_there

    def end(self) -> None:
        """Takes those that wait out of the queue; those that work have ended, or are told to."""
        if self._id:
            with contextlib.suppress(WavecombError):
                _ask("scancel", self._id)


def _ask(*words: str) -> str:
    """What a command of Slurm says. Raises WavecombError."""
    try:
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=_ANSWER_S
        )
    except FileNotFoundError:
        raise WavecombError(
            f"--on slurm: the command {words[0]} is not here; `wavecomb farm export --slurm` "
            "writes a script for where it is"
        ) from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise WavecombError(f"--on slurm: {words[0]}: {error}") from None
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"]
        raise WavecombError(f"--on slurm: {words[0]}: {said[-1]}")
    return done.stdout
