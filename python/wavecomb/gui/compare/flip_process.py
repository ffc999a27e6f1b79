# SPDX-License-Identifier: Apache-2.0
"""Computes FLIP in a separate process, because the library holds Python's GIL for seconds.

When it is run as a program, this module reads a FLIP job in .npz format from stdin and writes the
result to stdout.
"""

from __future__ import annotations

import io
import subprocess
import sys
import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb import processes
from wavecomb.errors import WavecombError


class FlipProcess:
    """Runner of FLIP processes. Any thread may call ``stop`` to end the running process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def flip(
        self, a: NDArray[Any], b: NDArray[Any], high_range: bool, exposure: float
    ) -> NDArray[np.float32]:
        """Computes ``perceptual.flip`` of two images with shape (height, width, channels).

        Raises:
            WavecombError: The FLIP library is missing, or the process failed. The message of the
                error is one line.
        """
        job = io.BytesIO()
        np.savez(job, a=a, b=b, high_range=high_range, exposure=exposure)
        with self._lock:
            if self._closed:
                raise WavecombError("FLIP was stopped")
            self._process = processes.start(
                "wavecomb.gui.compare.flip_process",
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            process = self._process
        out, err = process.communicate(job.getvalue())
        if process.returncode != 0:
            said = err.decode(errors="replace").strip().splitlines()
            raise WavecombError(said[-1] if said else "FLIP was stopped")
        values: NDArray[np.float32] = np.load(io.BytesIO(out), allow_pickle=False)
        return values

    def stop(self) -> None:
        """Ends the running FLIP process and rejects further jobs."""
        with self._lock:
            self._closed = True
            if self._process is not None and self._process.poll() is None:
                self._process.kill()


def main() -> int:
    """Runs the FLIP job in this process, which ``FlipProcess`` started."""
    from wavecomb.image.compare.perceptual import flip

    job = np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False)
    try:
        values = flip(
            job["a"],
            job["b"],
            high_range=bool(job["high_range"]),
            exposure=float(job["exposure"]),
        )
    except (WavecombError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    out = io.BytesIO()
    np.save(out, values)
    sys.stdout.buffer.write(out.getbuffer())
    return 0


if __name__ == "__main__":
    sys.exit(main())
