# SPDX-License-Identifier: Apache-2.0
"""Tests that a compromised child process of a command can do very little."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import forks
import pytest
from click.testing import CliRunner
from parts import needs, not_here, only_where

from wavecomb.cli import main
from wavecomb.run.isolation import memory, sandbox, supervisor

pytestmark = [only_where(sys.platform == "linux", "the sandbox is for Linux"), needs("bin:bwrap")]

STAGE = '#usda 1.0\ndef Sphere "S" {\n    double radius = 1\n}\n'

PARENT = """
import sys
from wavecomb.run.isolation import memory, supervisor
from wavecomb.run.isolation.outputs import Outputs
place, reads, code = sys.argv[1:4]
supervisor.choices.words = (place,)
supervisor.choices.reads = tuple(reads.split(":")) if reads else ()
supervisor.run_in_sandbox(Outputs((place + "/out/a.exr",)), program=code)
"""
"""Runs code in the sandbox of a command."""

CHILD = """
import json, os, signal, socket, subprocess, sys, threading
from pathlib import Path
from wavecomb.image import files
place = Path(sys.argv[1])
own = Path(os.environ["TMPDIR"])
tried = {}
def trying(name, deed):
    try:
        deed()
        tried[name] = "done"
    except BaseException as error:
        tried[name] = type(error).__name__
"""


@pytest.fixture
def place() -> Iterator[Path]:
    """Three folders: for outputs, for the stage, and an unrelated one. None is below /tmp."""
    with tempfile.TemporaryDirectory(dir=Path.home(), prefix="wavecomb-test-") as name:
        folder = Path(name)
        for one in ("out", "shot", "secret"):
            (folder / one).mkdir()
        (folder / "shot/s.usda").write_text(STAGE)
        (folder / "secret/key").write_text("a key of the user's")
        (folder / "out/other.exr").write_text("another image")
        yield folder


def child(place: Path, code: str, *, reads: str = "", status: int = 0) -> dict[str, str]:
    """Runs code in the sandbox; returns the outcome of each attempt that the code records."""
    given = CHILD + code + "\nprint(json.dumps(tried))"
    done = subprocess.run(
        [sys.executable, "-c", PARENT, str(place), reads, given],
        capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert done.returncode == status, done.stderr
    assert not list(place.rglob(".wavecomb*")), "the private folder goes with the child"
    return dict(json.loads(done.stdout)) if done.stdout else {}


def test_only_the_private_folder_can_be_written(place: Path) -> None:
    tried = child(
        place,
        """
home = place / "secret"
trying("other file", lambda: (place / "out/other.exr").write_text("mine"))
trying("append", lambda: open(home / "key", "a"))
trying("truncate", lambda: os.truncate(home / "key", 0))
trying("new", lambda: (home / "new").write_text("x"))
trying("beside the output", lambda: (place / "out/.bashrc").write_text("x"))
trying("the output itself", lambda: (place / "out/a.exr").write_text("x"))
trying("folder", lambda: (home / "sub").mkdir())
trying("remove", lambda: (home / "key").unlink())
trying("rename", lambda: (home / "key").rename(home / "moved"))
trying("symlink", lambda: os.symlink(home / "key", place / "out/link"))
trying("pipe", lambda: os.mkfifo(home / "pipe"))
trying("mode", lambda: os.chmod(home / "key", 0o777))
trying("times", lambda: os.utime(home / "key", (1, 1)))
trying("attribute", lambda: os.setxattr(home / "key", "user.a", b"x"))
trying("mount", lambda: subprocess.run(["mount", "-o", "remount,rw", "/"], check=True, stderr=-3))
trying("private", lambda: (own / "x").write_text("x"))
""",
    )
    assert tried.pop("private") == "done"
    assert "done" not in tried.values(), tried
    assert (place / "secret/key").read_text() == "a key of the user's"
    assert os.listdir(place / "secret") == ["key"] and os.listdir(place / "out") == ["other.exr"]


def test_no_network_and_no_other_process(place: Path) -> None:
    """Sockets, shared memory, signals and priorities of other processes are out of reach."""
    with contextlib.ExitStack() as stack:
        listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        port = listening.getsockname()[1]
        abstract = stack.enter_context(socket.socket(socket.AF_UNIX))
        abstract.bind(f"\0wavecomb-{os.getpid()}")
        abstract.listen()
        folder = stack.enter_context(tempfile.TemporaryDirectory(dir="/tmp"))
        named = stack.enter_context(socket.socket(socket.AF_UNIX))
        named.bind(f"{folder}/socket")
        named.listen()
        tried = child(
            place,
            f"""
def connect(name):
    socket.socket(socket.AF_UNIX).connect(name)
trying("tcp", lambda: socket.create_connection(("127.0.0.1", {port}), 1))
trying("abstract", lambda: connect("\\0wavecomb-{os.getpid()}"))
trying("named", lambda: connect("{folder}/socket"))
trying("signal", lambda: os.kill({os.getpid()}, 0))
trying("priority", lambda: os.setpriority(os.PRIO_PROCESS, {os.getpid()}, 5))
trying("parent's memory", lambda: open("/proc/{os.getpid()}/mem"))
tried["processes"] = str(sum(name.isdecimal() for name in os.listdir("/proc")))
tried["capabilities"] = Path("/proc/self/status").read_text().split("CapEff:")[1].split()[0]
tried["interfaces"] = " ".join(name for _, name in socket.if_nameindex())
tried["segments"] = str(len(Path("/proc/sysvipc/shm").read_text().splitlines()) - 1)
trying("terminal", lambda: __import__("fcntl").ioctl(0, 0x5412, b"x"))
""",
        )
    assert int(tried.pop("processes")) <= 3
    assert int(tried.pop("capabilities"), 16) == 0
    assert tried.pop("interfaces") == "lo" and tried.pop("segments") == "0"
    assert "done" not in tried.values(), tried


def test_it_inherits_nothing(place: Path) -> None:
    """The child inherits no open file, and no variable that affects Python's imports."""
    (place / "json.py").write_text("raise SystemExit(77)")
    with (place / "secret/key").open("r+") as key:
        os.set_inheritable(key.fileno(), True)
        done = subprocess.run(
            [sys.executable, "-c", PARENT, str(place), "", CHILD + """
names = [os.readlink(f"/proc/self/fd/{n}") for n in os.listdir("/proc/self/fd")
         if os.path.islink(f"/proc/self/fd/{n}")]
print(json.dumps({"files": [name for name in names if "key" in name],
                  "cwd": any(path in ("", ".", os.getcwd()) for path in sys.path),
                  "python": [name for name in os.environ if name.startswith("PYTHON")]}))
"""],
            capture_output=True, text=True, close_fds=False, stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}, check=False, cwd=place / "shot",
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"files": [], "cwd": False, "python": []}


def test_only_outputs_get_a_name(place: Path) -> None:
    tried = child(
        place,
        """
from wavecomb.image.files.output_file import check_writable, replacing
def write(name):
    with replacing(place / name, durable=True) as part:
        part.write_text("an image")
def swap(kind):
    with replacing(place / "out/a.exr") as part:
        if kind == "symlink":
            os.symlink(place / "secret/key", part)
        elif kind == "up":
            files.publisher.publish(own / "..", place / "out/a.exr", durable=False)
        elif kind == "outside":
            files.publisher._ask("move", "../../secret/key", str(place / "out/a.exr"), False)
        elif kind == "nonsense":
            files.publisher._ask("move", 3)
        else:
            os.mkdir(part)
for kind in ("symlink", "up", "outside", "nonsense", "folder"):
    trying(kind, lambda: swap(kind))
trying("other", lambda: write("out/other.exr"))
trying("secret", lambda: write("secret/key"))
trying("dots", lambda: write("out/../secret/key"))
trying("check", lambda: check_writable(place / "secret/key"))
trying("good", lambda: write("out/a.exr"))
trying("twice", lambda: write("out/a.exr"))
trying("good check", lambda: check_writable(place / "out/a.exr"))
""",
    )
    good = {name for name, how in tried.items() if how == "done"}
    assert good == {"good", "twice", "good check"}, tried
    assert (place / "out/a.exr").read_text() == "an image"
    assert (place / "secret/key").read_text() == "a key of the user's"
    assert sorted(os.listdir(place / "out")) == ["a.exr", "other.exr"]


def test_sandbox_read_narrows_what_can_be_read(place: Path) -> None:
    code = """
trying("secret", lambda: (place / "secret/key").read_text())
trying("stage", lambda: (place / "shot/s.usda").read_text())
import wavecomb.usd, OpenImageIO
from wavecomb.usd import load_stage
load_stage(place / "shot/s.usda")
"""
    wide = child(place, code)
    assert wide == {"secret": "done", "stage": "done"}
    # The command line must not name the folder, since the sandbox would make it readable.
    parent = PARENT.replace("choices.words = (place,)", "choices.words = ()")
    given = CHILD.replace("sys.argv[1]", repr(str(place))) + code + "\nprint(json.dumps(tried))"
    done = subprocess.run(
        [sys.executable, "-c", parent, str(place), str(place / "shot"), given],
        capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"secret": "FileNotFoundError", "stage": "done"}


def test_nothing_is_left_of_a_child_that_is_killed(place: Path) -> None:
    child(place, "(own / 'x').write_text('x')\nos.kill(os.getpid(), 9)\n", status=2)


def test_nothing_outlives_the_command(place: Path) -> None:
    """Even a process that the child starts in another session ends with the command."""
    code = CHILD + (
        "subprocess.Popen(['sleep', '4321.5'], start_new_session=True)\n"
        "print('ready', flush=True)\nthreading.Event().wait(60)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(place), "", code], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    assert _running("4321.5")
    process.kill()
    process.wait()
    end = time.monotonic() + 10
    while _running("4321.5") and time.monotonic() < end:
        time.sleep(0.05)
    assert not _running("4321.5")


def _running(word: str) -> bool:
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            if entry.name.isdecimal() and word.encode() in (entry / "cmdline").read_bytes():
                return True
    return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGUSR1])
def test_signals_reach_the_child_once(place: Path, number: int) -> None:
    code = (
        "import signal, sys, time\nseen = []\n"
        f"signal.signal({int(number)}, lambda *_: seen.append(1))\n"
        "print('ready', flush=True)\nend = time.monotonic() + 30\n"
        "while not seen and time.monotonic() < end: time.sleep(0.01)\n"
        "time.sleep(0.2)\nsys.exit(40 + len(seen))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(place), "", code], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode == 41


@pytest.mark.parametrize(
    ("deed", "words"),
    [
        ("import ctypes; ctypes.string_at(0)", "SIGSEGV"),
        ("os.write(2, b'corrupted heap\\n'); os.abort()", "corrupted heap"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "more memory than there is"),
    ],
)
def test_a_crash_is_one_line(place: Path, deed: str, words: str) -> None:
    imports = "from wavecomb.run.isolation import progress_notes\n"
    code = f"{imports}progress_notes.note('reading', '/A')\n{deed}"
    done = subprocess.run(
        [sys.executable, "-c", PARENT, str(place), "", CHILD + code],
        capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    assert words in done.stderr and "/A" in done.stderr


def test_shared_mappings_count_as_memory(place: Path) -> None:
    """RLIMIT_DATA does not count shared mappings.

    If a control group can be created, it counts shared mappings.
    """
    group = memory.Group.make(300_000_000)
    if group is None:
        not_here("no control group may be made here")
    group.close()
    code = PARENT.replace(
        "supervisor.choices.words", "memory.request_limit(300)\nsupervisor.choices.words", 1
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(place), "", CHILD + """
import mmap
held = mmap.mmap(-1, 600_000_000)
for at in range(0, len(held), 4096):
    held[at] = 1
"""],
        capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert done.returncode == 2 and "memory" in done.stderr


@pytest.mark.slow
def test_a_render_as_people_make_it(place: Path) -> None:
    """A render with all kinds of outputs in the sandbox gives the same image as without it."""
    stage = place / "shot/s.usda"

    def run(*words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [sys.executable, "-m", "wavecomb", *map(str, words)],
            capture_output=True, text=True, timeout=120, cwd=place / "out", check=False,
        )  # fmt: skip
        assert done.returncode == code, done.stderr
        return done

    common = ("render", stage, "--size", 16, 16, "--spp", 2)
    boxed = (*common, "--sandbox", "on")
    outputs = (
        *("--png", "b.png", "--stats", "b.json", "--checkpoint", "b.ckpt"),
        *("--preview", "p.png", "--costs", "b-costs.json", "--texture-limit", 5),
    )
    run(*boxed, "-o", "b.exr", *outputs)
    words = (*common, "-o", "c.exr", "--sandbox", "off")
    assert forks.wavecomb(*words, cwd=place / "out").returncode == 0
    assert "equal" in run("compare", "b.exr", "c.exr", "--sandbox", "on").stdout
    run(*boxed, "-o", "b.exr", "--resume", "b.ckpt")
    frames = ("--frames", "1-2", "--split-aovs", "--aov", "normal")
    run(*boxed, "-o", place / "new/folder/f.###.exr", *frames)
    images = {f"f.00{i}{layer}.exr" for i in (1, 2) for layer in ("", ".normal")}
    assert set(os.listdir(place / "new/folder")) == images
    run(*boxed, "-o", place / "shot/d.exr", "--png", "d.png", "--sandbox-read", place / "shot")
    made = {"b.exr", "b.png", "b.json", "b.ckpt", "b-costs.json", "c.exr", "d.png", "other.exr"}
    assert set(os.listdir(place / "out")) - {"p.png"} == made
    assert set(os.listdir(place / "shot")) == {"s.usda", "d.exr"}
    stderr = run(*boxed, "-o", place / "shot/d.exr/a.exr", code=2).stderr
    assert "d.exr is not a folder" in stderr and stderr.count("\n") == 1


@pytest.mark.slow
def test_stages_below_tmp_keep_their_assets() -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        folder = Path(name)
        for one in ("shots", "assets"):
            (folder / one).mkdir()
        (folder / "assets/a.usda").write_text(STAGE)
        (folder / "shots/s.usda").write_text(
            '#usda 1.0\ndef "A" (references = @../assets/a.usda@</S>) {\n}\n'
        )
        for stage in (folder / "shots/s.usda", Path("s.usda")):
            done = subprocess.run(
                [sys.executable, "-m", "wavecomb", "info", str(stage), "--sandbox", "on", "--json"],
                capture_output=True, text=True, cwd=folder / "shots", check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            assert json.loads(done.stdout)["warnings"] == []


def test_required_and_not_there(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["info", str(place / "shot/s.usda"), "--sandbox", "on"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 2 and "there is no child process" in result.stderr
    monkeypatch.setattr(sandbox, "obstacle", lambda: "bubblewrap is not installed")
    monkeypatch.setattr(supervisor, "can_fork", lambda: True)
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 2
    assert result.stderr == "error: --sandbox on: bubblewrap is not installed\n"
    result = CliRunner().invoke(main, ["info", "--machine"])
    assert result.exit_code == 0 and "bubblewrap is not installed" in result.output
    result = CliRunner().invoke(main, ["info", "--machine", "--json"])
    assert json.loads(result.output)["sandbox"] == {
        "available": False, "obstacle": "bubblewrap is not installed",
    }  # fmt: skip


@pytest.mark.slow
def test_without_user_namespaces_auto_works_without(place: Path, tmp_path: Path) -> None:
    """Makes bubblewrap fail, as on systems that do not permit user namespaces."""
    fake = tmp_path / "bwrap"
    fake.write_text("#!/bin/sh\necho 'bwrap: No permissions to create new namespace' >&2\nexit 1\n")
    fake.chmod(0o755)
    env = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    env.pop("WAVECOMB_SANDBOX", None)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        line = [sys.executable, "-m", "wavecomb", "info", str(place / "shot/s.usda"), *words]
        return subprocess.run(line, capture_output=True, text=True, env=env, check=False)

    done = run()
    assert done.returncode == 0 and done.stderr == ""
    done = run("--sandbox", "on")
    assert done.returncode == 2
    assert done.stderr == (
        "error: --sandbox on: bubblewrap does not run here "
        "(No permissions to create new namespace)\n"
    )
