# SPDX-License-Identifier: Apache-2.0
"""What a process that reads a stage can do, once a file of it has taken it over: little."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from parts import only_where

from wavecomb.run.isolate import box, landlock, seccomp

pytestmark = only_where(sys.platform == "linux", "the sandbox is Linux's")
with_landlock = pytest.mark.skipif(not landlock.version(), reason="this kernel has no Landlock")
with_seccomp = pytest.mark.skipif(not seccomp.is_known(), reason="this kernel has no seccomp")

START = """
import json, os, signal, socket, subprocess, sys, threading
from pathlib import Path
from wavecomb.run.isolate import box, supervisor
from wavecomb.run.isolate.broker import Outputs
supervisor.supervise()
place = Path(sys.argv[1])
tried = {}
def trying(name, deed):
    try:
        deed()
        tried[name] = "done"
    except BaseException as error:
        tried[name] = type(error).__name__
def answer():
    print(json.dumps(tried))
"""
ENTER = START + "box.enter(Outputs((str(place / 'out' / 'a.exr'),), (), ()))\n"

STAGE = """#usda 1.0
def Sphere "S" {
    double radius = 1
    asset mine = @../elsewhere/named.txt@
}
def "Far" ( references = @../elsewhere/far/far.usda@ ) {}
"""


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Folders for outputs and for the stage, and one that is neither's."""
    for name in ("out", "shot", "elsewhere/far", "secret", "tmp"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "shot/s.usda").write_text(STAGE)
    (tmp_path / "shot/beside.txt").write_text("beside the stage")
    (tmp_path / "elsewhere/named.txt").write_text("named by the stage")
    (tmp_path / "elsewhere/other.txt").write_text("not named")
    (tmp_path / "elsewhere/far/far.usda").write_text('#usda 1.0\n(defaultPrim = "F")\ndef "F" {}\n')
    (tmp_path / "secret/key").write_text("a key of the user's")
    (tmp_path / "out/other.exr").write_text("another picture")
    return tmp_path


def child(place: Path, code: str, status: int = 0) -> dict[str, str]:
    """What a supervised process could do."""
    done = subprocess.run(
        [sys.executable, "-c", code, str(place)], capture_output=True, text=True, timeout=120,
        env={**os.environ, "TMPDIR": str(place / "tmp")}, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert done.returncode == status, done.stderr
    assert not os.listdir(place / "tmp"), "the temporary folder goes with the child"
    assert not list(place.rglob(".wavecomb*")), "and so do its own"
    return dict(json.loads(done.stdout)) if done.stdout else {}


WRITES = """
import tempfile
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
trying("link", lambda: os.link(home / "key", place / "out/link"))
trying("symlink", lambda: os.symlink(home / "key", place / "out/link"))
trying("pipe", lambda: os.mkfifo(home / "pipe"))
trying("mode", lambda: os.chmod(home / "key", 0o777))
trying("times", lambda: os.utime(home / "key", (1, 1)))
trying("own folder", lambda: tempfile.NamedTemporaryFile().write(b"x"))
answer()
"""


@with_landlock
@with_seccomp
def test_writes_outside_are_refused(place: Path) -> None:
    tried = child(place, ENTER + WRITES)
    assert tried.pop("own folder") == "done"
    assert set(tried.values()) == {"PermissionError"}, tried
    assert (place / "secret/key").read_text() == "a key of the user's"
    assert os.listdir(place / "secret") == ["key"] and os.listdir(place / "out") == ["other.exr"]


@with_seccomp
def test_sockets_programs_and_other_processes_are_refused(place: Path) -> None:
    tried = child(
        place,
        ENTER
        + """
trying("tcp", lambda: socket.create_connection(("127.0.0.1", 9), 1))
trying("udp", lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
trying("tcp 6", lambda: socket.socket(socket.AF_INET6))
trying("unix", lambda: socket.socket(socket.AF_UNIX))
trying("netlink", lambda: socket.socket(socket.AF_NETLINK, socket.SOCK_RAW))
trying("program", lambda: subprocess.run(["/bin/true"], check=True))
trying("setuid", lambda: os.execv("/bin/su", ["su", "-c", "true"]))
trying("signal", lambda: os.kill(os.getppid(), signal.SIGTERM))
trying("signal to all", lambda: os.kill(-1, signal.SIGTERM))
trying("keys", lambda: __import__("fcntl").ioctl(0, 0x5412, b"x"))
trying("pair", socket.socketpair)
trying("threads", lambda: threading.Thread(target=int).start())
trying("itself", lambda: os.kill(os.getpid(), signal.SIGCONT))
trying("is there", lambda: os.kill(os.getppid(), 0))
tried["privileges"] = Path("/proc/self/status").read_text().split("NoNewPrivs:")[1].split()[0]
answer()
""",
    )
    assert tried.pop("privileges") == "1"
    good = {name for name, how in tried.items() if how == "done"}
    assert good <= {"pair", "threads", "itself", "is there"}
    assert {"pair", "threads", "itself"} <= good
    assert {tried[name] for name in tried.keys() - good} <= {"PermissionError", "OSError"}, tried


@with_landlock
def test_reads_are_what_the_stage_named(place: Path) -> None:
    """Of all threads: those that were there before, and those that come."""
    tried = child(
        place,
        ENTER
        + """
go, jobs = threading.Event(), []
def before():
    go.wait()
    trying("secret, before", lambda: (place / "secret/key").read_text())
thread = threading.Thread(target=before)
thread.start()
trying("secret, at first", lambda: (place / "secret/key").read_text())
from wavecomb.usd import load_stage
scene = load_stage(place / "shot/s.usda").scene
go.set()
thread.join()
trying("secret", lambda: (place / "secret/key").read_text())
trying("secret folder", lambda: os.listdir(place / "secret"))
trying("not named", lambda: (place / "elsewhere/other.txt").read_text())
trying("other picture", lambda: (place / "out/other.exr").read_text())
trying("parent", lambda: Path(f"/proc/{os.getppid()}/environ").read_text())
trying("named", lambda: (place / "elsewhere/named.txt").read_text())
trying("beside the stage", lambda: (place / "shot/beside.txt").read_text())
trying("far", lambda: (place / "elsewhere/far/far.usda").read_text())
late = threading.Thread(target=lambda: trying("late", lambda: os.listdir(place / "secret")))
late.start()
late.join()
import wave, sqlite3
answer()
""",
    )
    good = {"secret, at first", "named", "beside the stage", "far"}
    assert {name for name, how in tried.items() if how == "done"} == good, tried


@with_landlock
def test_the_parent_names_only_what_was_said(place: Path) -> None:
    tried = child(
        place,
        ENTER
        + """
from wavecomb.picture import files
from wavecomb.picture.files import check_writable, replacing
def write(name):
    with replacing(place / name, durable=True) as part:
        part.write_text("a picture")
own = Path(files.publisher.private[str(place / "out")])
def swap(kind):
    with replacing(place / "out/a.exr") as part:
        if kind == "symlink":
            os.symlink(place / "secret/key", part)
        elif kind == "outside":
            files.publisher.publish(place / "secret/key", place / "out/a.exr", durable=False)
        elif kind == "up":
            files.publisher.publish(own / "..", place / "out/a.exr", durable=False)
        else:
            os.mkdir(part)
trying("symlink", lambda: swap("symlink"))
trying("outside", lambda: swap("outside"))
trying("up", lambda: swap("up"))
trying("folder", lambda: swap("folder"))
trying("other", lambda: write("out/other.exr"))
trying("secret", lambda: write("secret/key"))
trying("dots", lambda: write("out/../secret/key"))
trying("again", lambda: files.publisher.seal(Outputs((str(place / "secret/key"),))))
trying("check", lambda: check_writable(place / "secret/key"))
trying("good", lambda: write("out/a.exr"))
trying("twice", lambda: write("out/a.exr"))
trying("good check", lambda: check_writable(place / "out/a.exr"))
answer()
""",
    )
    good = {name for name, how in tried.items() if how == "done"}
    assert good == {"good", "twice", "good check"}, tried
    assert (place / "out/a.exr").read_text() == "a picture"
    assert (place / "secret/key").read_text() == "a key of the user's"
    assert sorted(os.listdir(place / "out")) == ["a.exr", "other.exr"]


def test_nothing_is_left_of_a_child_that_is_killed(place: Path) -> None:
    code = ENTER + "(Path(os.environ['TMPDIR']) / 'x').write_text('x')\nos.kill(os.getpid(), 9)\n"
    child(place, code, 2)


@with_landlock
def test_what_a_killed_pair_left_goes_with_the_next(place: Path) -> None:
    left = place / "out/.wavecomb.4194300.part"
    left.mkdir()
    (left / "1.exr").write_text("half a picture")
    child(
        place,
        ENTER
        + "from wavecomb.picture.files import replacing\n"
        + "with replacing(place / 'out/a.exr') as part: part.write_text('x')\n",
    )
    assert sorted(os.listdir(place / "out")) == ["a.exr", "other.exr"]


@pytest.mark.slow
@with_landlock
@with_seccomp
def test_a_render_as_people_make_it(place: Path) -> None:
    """All kinds of outputs, with the sandbox required; the same picture as without."""
    stage = place / "shot/s.usda"

    def run(*words: object, code: int = 0) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "wavecomb", *map(str, words)],
            capture_output=True, text=True, timeout=120, cwd=place / "out", check=False,
        )  # fmt: skip
        assert done.returncode == code, done.stderr
        return done.stderr

    common = ("render", stage, "--size", 16, 16, "--spp", 2)
    boxed = (*common, "--sandbox", "on")
    outputs = (
        "--png",
        "b.png",
        "--stats",
        "b.json",
        "--checkpoint",
        "b.ckpt",
        "--preview",
        "p.png",
    )
    run(*boxed, "-o", "b.exr", *outputs, "--costs", "b-costs.json", "--texture-limit", 5)
    run(*common, "-o", "c.exr", "--sandbox", "off")
    assert "equal" in subprocess.run(
        [sys.executable, "-m", "wavecomb", "compare", "b.exr", "c.exr", "--sandbox", "on"],
        cwd=place / "out", capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    run(*boxed, "-o", "b.exr", "--resume", "b.ckpt")
    run(*boxed, "-o", "f.###.exr", "--frames", "1-2", "--split-aovs", "--aov", "normal")
    made = {"b.exr", "b.png", "b.json", "b.ckpt", "b-costs.json", "c.exr", "other.exr"}
    made |= {f"f.00{i}{layer}.exr" for i in (1, 2) for layer in ("", ".normal")}
    assert set(os.listdir(place / "out")) - {"p.png"} == made
    stderr = run(*boxed, "-o", place / "nowhere/a.exr", code=2)
    assert "nowhere does not exist; make it first" in stderr and stderr.count("\n") == 1


def test_required_and_not_there(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from click.testing import CliRunner

    from wavecomb.cli import main

    words = ["info", str(place / "shot/s.usda"), "--sandbox", "on"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 2 and "there is no child process" in result.stderr
    box.ask(mode="auto")
    monkeypatch.setattr(landlock, "version", lambda: 0)
    monkeypatch.setattr(seccomp, "is_known", lambda: False)
    assert [line.split(":")[0] for line in box.obstacles()] == [
        "no Landlock (Linux 5.13, and among the kernel's LSMs)",
        "no seccomp filter for this machine",
    ]
    result = CliRunner().invoke(main, ["info", "--machine"])
    assert result.exit_code == 0 and "no Landlock" in result.output
    result = CliRunner().invoke(main, ["info", "--machine", "--json"])
    assert json.loads(result.output)["sandbox"]["landlock"] == 0


def test_a_home_is_not_read_for_a_module(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    home = tmp_path / "home"
    (home / "lib").mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    assert [box.holds_home(str(p)) for p in (home, tmp_path, "/", home / "lib")] == [
        True, True, True, False,
    ]  # fmt: skip
    monkeypatch.setattr(sys, "path", [str(home), str(home / "lib"), ""])
    places = box.library_places()
    assert str(home / "lib") in places and str(home) not in places and os.getcwd() not in places


SPY = """
import os, socket, sys
said = os.open({said!r}, os.O_WRONLY | os.O_CREAT)
def tries(deed):
    try:
        deed()
        return "done"
    except OSError as error:
        return type(error).__name__
def hook(event, what):
    if event == "import" and what[0] == "wavecomb.usd.stage.load":
        os.write(said, " ".join([
            tries(lambda: open({secret!r}, "w")), tries(socket.socket),
            tries(lambda: open(os.environ["TMPDIR"] + "/x", "w")),
        ]).encode())
sys.addaudithook(hook)
"""
