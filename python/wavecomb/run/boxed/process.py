# SPDX-License-Identifier: Apache-2.0
"""Starts and ends the process in the sandbox."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import weakref
from pathlib import Path

from wavecomb.errors import WavecombError
from wavecomb.machine import temporary_folder
from wavecomb.run.isolate import memory, trail
from wavecomb.run.isolate.supervisor import CHATTER

_START = (
    "import json, sys; start = json.loads(sys.argv[1]); sys.path[:] = start['path']; "
    "from wavecomb.run.boxed.child import main; main(start)"
)
_WORDS = 1 << 20
"""Bytes of what its libraries print that are kept."""
_SEALS = getattr(fcntl, "F_ADD_SEALS", 1033), 0x0002 | 0x0004  # neither shorter nor longer
_PATIENCE_S = 5.0


def interpreter() -> str:
    """This Python, also where a program holds it within itself.

    Raises:
        WavecombError: There is none to be found.
    """
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    for name in (sys.executable, str(Path(sys.base_exec_prefix, "bin", version))):
        if name and Path(name).name.startswith(("python", "pypy")) and os.access(name, os.X_OK):
            return name
    raise WavecombError(
        "there is no Python to start a process with that reads the stage: give isolate=False, or "
        "WAVECOMB_ISOLATE=0"
    )


class Process:
    """One that waits to be asked.

    Attributes:
        channel: To ask by.
        is_idle: Whether it has nothing to do, as who asks knows.
    """

    def __init__(self) -> None:
        self.is_idle = True
        self.channel, its = socket.socketpair()
        for end in (self.channel, its):
            with contextlib.suppress(OSError):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        self._page = trail.new_page()
        self._words = os.memfd_create("wavecomb-words", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        os.ftruncate(self._words, _WORDS)
        with contextlib.suppress(OSError):
            fcntl.fcntl(self._words, *_SEALS)
        life, other = os.pipe()
        temporary: str | None = None
        with contextlib.suppress(OSError):
            temporary = tempfile.mkdtemp(prefix="wavecomb-", dir=temporary_folder())
        held = self.channel, (self._page, self._words, other), temporary
        start = {
            "path": [str(place) for place in sys.path], "channel": its.fileno(),
            "page": self._page, "life": life,
            "temporary": temporary,
        }  # fmt: skip
        flags = sys.flags
        ways = [
            way
            for way, wanted in (("-I", flags.isolated), ("-E", flags.ignore_environment),
                                ("-s", flags.no_user_site))
            if wanted
        ]  # fmt: skip
        try:
            self._process = subprocess.Popen(
                [interpreter(), *ways, "-c", _START, json.dumps(start)],
                stdin=subprocess.DEVNULL,
                stdout=self._words,
                stderr=self._words,
                pass_fds=(its.fileno(), self._page, life),
                start_new_session=True,
            )
        except BaseException:
            _let_go(None, *held)
            raise
        finally:
            its.close()
            os.close(life)
        # Also when nobody closed it: at the end of this process, or of the last who knew of it.
        self._finalizer = weakref.finalize(self, _let_go, self._process, *held)

    def is_alive(self) -> bool:
        """Whether it did not end."""
        return self._process.poll() is None

    def obituary(self) -> str:
        """Why it ended, or what is wrong with it; it is ended if it was not."""
        try:
            code = self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill()
            return "the process that reads it went silent"
        words = self._said()
        if code < 0:
            page = trail.open_page(self._page)
            return trail.obituary(-code, trail.read(page), words, memory.limit_of(page))
        said = words.strip().splitlines()
        last = said[-1] if said else "no word"
        return f"the process that reads it ended with code {code}: {last[:300]}"

    def kill(self) -> None:
        """Ends it at once."""
        with contextlib.suppress(OSError):
            self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Ends it, at once where it is not done, and removes what it left.

        What its libraries printed is passed on, unless it came to grief.
        """
        if not self._finalizer.alive:
            return
        with contextlib.suppress(OSError):
            self.channel.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_PATIENCE_S if self.is_idle else 0.0)
        self.kill()
        if self._process.returncode == 0:
            words = self._said().splitlines(keepends=True)
            rest = "".join(line for line in words if not line.startswith(CHATTER))
            os.write(2, rest.encode(errors="replace"))
        self._finalizer()

    def _said(self) -> str:
        return os.pread(self._words, _WORDS, 0).rstrip(b"\0").decode(errors="replace")


def _let_go(
    process: subprocess.Popen[bytes] | None,
    channel: socket.socket,
    descriptors: tuple[int, ...],
    temporary: str | None,
) -> None:
    """Ends a process, if there is one yet, and removes what is left of it."""
    if process is not None:
        with contextlib.suppress(OSError):
            process.kill()
        process.wait()
    channel.close()
    for descriptor in descriptors:
        os.close(descriptor)
    if temporary is not None:
        shutil.rmtree(temporary, ignore_errors=True)
