# SPDX-License-Identifier: Apache-2.0
"""Tests that the caller gets one line if a library crashes or hangs in a child process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from parts import only_where

from wavecomb.run.isolation import progress_notes, time_limit

pytestmark = only_where(sys.platform == "linux", "isolation is for Linux")

SUPERVISED = (
    "from wavecomb.run.isolation import progress_notes, supervisor; supervisor.supervise()\n"
)

GOOD = '#usda 1.0\ndef Sphere "Ball" {}\n'


def python(code: str, *, session: bool = False) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", SUPERVISED + code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=session,
    )


def finished(code: str) -> tuple[int, str, str]:
    process = python(code)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def doubling(path: Path) -> Path:
    """Writes forty lines that compose to 2^40 prims."""
    text = "#usda 1.0\n"
    for i in range(40):
        inside = "".join(f'def "C{j}" (references = </P{i + 1}>) {{}}\n' for j in range(2))
        text += f'def Xform "P{i}" {{\n{inside}}}\n'
    path.write_text(text + 'def Sphere "P40" {}\n')
    return path


@pytest.mark.parametrize("code", [0, 1, 2, 77])
def test_exit_codes_and_streams_pass_through(code: int) -> None:
    text = f"import sys; print('out'); print('err', file=sys.stderr); sys.exit({code})"
    assert finished(text) == (code, "out\n", "err\n")


@pytest.mark.parametrize(
    ("deed", "words"),
    [
        ("import ctypes; ctypes.string_at(0)", "SIGSEGV"),
        ("import os; os.write(2, b'corrupted heap\\n'); os.abort()", "(SIGABRT) while reading /A"),
        ("import os; os.write(2, b'corrupted heap\\n'); os.abort()", "corrupted heap"),
        ('import os; os.write(2, b"what(): std::bad_alloc\\n"); os.abort()', "out of memory"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "more memory than there is"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGBUS)", "SIGBUS"),
    ],
)
def test_a_crash_is_one_line_and_code_2(deed: str, words: str) -> None:
    code, out, err = finished(f"progress_notes.note('reading', '/A')\n{deed}")
    assert (code, out) == (2, "")
    assert err.startswith("error: ") and err.count("\n") == 1
    assert words in err and "/A" in err


def test_what_libraries_print_is_passed_on_but_for_what_a_warning_says() -> None:
    text = "import os; os.write(2, b'libpng error: CRC\\nsomething else\\n')"
    assert finished(text) == (0, "", "something else\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("group", [False, True])
def test_signals_are_passed_on_once(number: int, group: bool) -> None:
    """Signals to the process (as by kill) and to its group (as by a terminal) arrive once."""
    code = (
        "import signal, sys, time\n"
        "seen = []\n"
        f"signal.signal({int(number)}, lambda *_: seen.append(1))\n"
        "print('ready', flush=True)\n"
        "end = time.monotonic() + 30\n"
        "while not seen and time.monotonic() < end: time.sleep(0.01)\n"
        "time.sleep(0.2)\n"
        "sys.exit(40 + len(seen))"
    )
    process = python(code, session=True)
    assert process.stdout is not None
    process.stdout.readline()
    if group:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode == 41


def test_a_signal_that_ends_the_child_ends_the_parent_likewise() -> None:
    process = python("import time; print('ready', flush=True); time.sleep(60)")
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGTERM and err == ""


def test_no_child_outlives_its_parent() -> None:
    process = python("import os, time; print(os.getpid(), flush=True); time.sleep(60)")
    assert process.stdout is not None
    child = int(process.stdout.readline())
    assert child != process.pid
    process.kill()
    process.communicate(timeout=60)
    end = time.monotonic() + 10
    while Path(f"/proc/{child}").exists() and time.monotonic() < end:
        time.sleep(0.02)
    # The entry remains if init does not reap the process, but the process has ended.
    stat = Path(f"/proc/{child}/stat")
    assert not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z"


def test_stop_and_go_on() -> None:
    code = "import os, time; print(os.getpid(), flush=True); time.sleep(1); print('end')"
    process = python(code)
    assert process.stdout is not None
    child = int(process.stdout.readline())

    def state(pid: int) -> str:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]

    process.send_signal(signal.SIGTSTP)
    end = time.monotonic() + 10
    while (state(process.pid), state(child)) != ("T", "T") and time.monotonic() < end:
        time.sleep(0.01)
    assert (state(process.pid), state(child)) == ("T", "T")
    process.send_signal(signal.SIGCONT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0 and out == "end\n"


@pytest.mark.slow
def test_the_command_says_where_usd_crashed(tmp_path: Path) -> None:
    stage = tmp_path / "bad.usda"
    stage.write_text(GOOD)
    code = (
        "import ctypes, sys\n"
        "from wavecomb.cli import main\n"
        "import wavecomb.usd.stage.load as loader\n"
        "loader.Usd.Stage.Open = lambda *_: ctypes.string_at(0)\n"
        "main(sys.argv[1:])"
    )
    arguments = ["render", stage, "-o", tmp_path / "a.exr", "--isolate", "on"]
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 2 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ") and f"opening {stage}" in line and "SIGSEGV" in line
    assert [path.name for path in tmp_path.iterdir()] == ["bad.usda"]


def test_an_image_library_that_crashes_is_named_with_its_file(tmp_path: Path) -> None:
    code = (
        "progress_notes.note('reading', '/A')\n"
        "progress_notes.note('decoding', 'sky.exr', 'image')\n"
        "import os; os.abort()"
    )
    _, _, err = finished(code)
    assert "while reading /A, decoding sky.exr" in err


@pytest.mark.slow
def test_composition_without_end(tmp_path: Path) -> None:
    stage = doubling(tmp_path / "many.usda")
    done = subprocess.run(
        [sys.executable, "-m", "wavecomb", "info", str(stage), "--load-limit", "0.4"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "many.usda" in line and "--load-limit" in line


def test_limit_follows_the_layers() -> None:
    assert time_limit.allowed_s(0) == time_limit.BASE_S
    assert time_limit.allowed_s(10 * time_limit.BYTES_PER_S) == time_limit.BASE_S + 10


def test_notes_cost_nothing_without_a_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not progress_notes.is_expendable()
    progress_notes.note("reading", "/A")
    page = progress_notes.new_page()
    try:
        assert progress_notes.read(progress_notes.open_page(page)) == ""
        monkeypatch.setattr(progress_notes, "_page", progress_notes.open_page(page))
        progress_notes.note("reading", "/" + "A" * 5000)
        progress_notes.note("decoding", "b.png", "image")
        text = progress_notes.read(progress_notes.open_page(page))
        assert text.startswith("reading /AAA") and text.endswith(", decoding b.png")
    finally:
        os.close(page)
