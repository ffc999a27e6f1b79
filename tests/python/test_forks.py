# SPDX-License-Identifier: Apache-2.0
"""Tests that a forked process renders like a newly started process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import forks
import pytest
from parts import only_where

from wavecomb import processes

pytest.importorskip("wavecomb._core")
pytestmark = only_where(sys.platform == "linux", "elsewhere nothing is forked")

CODE = """
import os, sys, threading
print(__name__, sys.argv, sys.path[0], os.getcwd(), os.environ.get("HOME"), sys.stdin.read())
print(len(os.listdir("/proc/self/task")), threading.active_count(), sorted(os.listdir("/proc/self/fd"))[:3])
print(os.getpgrp() == os.getpid(), sys.stdout.isatty(), file=sys.stderr)
import atexit
atexit.register(lambda: print("at the end"))
beside = threading.Thread(target=lambda: print("beside"))
beside.start()
sys.exit({end})
"""  # noqa: E501
ENDS = ["0", "None", "3", "'why'", "1 / 0", "beside.join() or os.kill(os.getpid(), 15)",
        "beside.join() or os._exit(5)"]  # fmt: skip


def both(words: list[str], **options: object) -> list[tuple[int, str, str]]:
    """Returns (code, stdout, stderr) of a fresh process and of a forked one."""
    found = []
    for kind in (subprocess.Popen, forks.Popen):
        process = kind(
            [sys.executable, *words], text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options,
        )  # fmt: skip
        out, err = process.communicate("words", timeout=60)
        assert (getattr(process, "_told", None) is not None) == (kind is forks.Popen)
        found.append((process.returncode, out, err))
    return found


@pytest.mark.parametrize("end", ENDS)
def test_code(end: str, tmp_path: Path) -> None:
    environment = {**os.environ, "HOME": str(tmp_path)}
    words = ["-c", CODE.replace("{end}", end), "a", "--b"]
    fresh, forked = both(words, cwd=tmp_path, env=environment, start_new_session=end == "0")
    assert forked[:2] == fresh[:2]
    assert forked[2].splitlines()[-1:] == fresh[2].splitlines()[-1:]


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["--version"],
        ["nonsense"],
        ["info", "none.usda"],
        ["farm", "submit", "none.usda", "-o", "a.exr"],
    ],
)
def test_commands(words: list[str], tmp_path: Path) -> None:
    fresh, forked = both(["-m", "wavecomb", *words], cwd=tmp_path)
    assert forked == fresh
    assert fresh[0] == (0 if words == ["--version"] else 2)


def test_descriptors_and_signals() -> None:
    read, write = os.pipe()
    code = f"import os, time; os.write({write}, b'here'); time.sleep(60)"
    process = forks.Popen([sys.executable, "-c", code], pass_fds=(write,))
    os.close(write)
    assert os.read(read, 10) == b"here"
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == process.poll() == -signal.SIGTERM
    assert os.read(read, 10) == b""
    os.close(read)


def test_who_takes_too_long_is_killed() -> None:
    with pytest.raises(subprocess.TimeoutExpired):
        forks.code("import time; time.sleep(60)", timeout=0.2)


@pytest.mark.parametrize("variable", ["WAVECOMB_ISA", "PXR_PLUGINPATH_NAME"])
def test_what_is_read_at_import_makes_a_fresh_process(variable: str) -> None:
    fresh = forks.Popen([sys.executable, "-c", "pass"], env={**os.environ, variable: "x"})
    assert fresh.wait(60) == 0 and fresh._told is None
    other = forks.Popen(["true"])
    assert other.wait(60) == 0 and other._told is None


def test_processes_that_the_package_starts_are_forked() -> None:
    code = "import sys; print(sys.argv, '' in sys.path)"
    words = processes.command("-c", code, "a", parent=os.getpid())
    process = forks.Popen(words, stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert process._told is not None
    assert process.communicate(timeout=60)[0] == "['-c', 'a'] False\n" and process.returncode == 0
