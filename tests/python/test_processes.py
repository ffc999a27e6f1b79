# SPDX-License-Identifier: Apache-2.0
"""Tests the Python processes that Wavecomb starts: imports, inheritance and lifetime."""

from __future__ import annotations

import ast
import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from parts import needs, only_where

from wavecomb import boot, processes
from wavecomb.errors import WavecombError

PACKAGE = Path(boot.PACKAGE)

HOSTILE = (
    "json", "re", "os", "runpy", "ctypes", "site", "sitecustomize", "usercustomize", "wavecomb",
    "numpy", "pxr", "click", "multiprocessing", "pickle", "threading",
)  # fmt: skip

PLANTED = """
import sys
open({marker!r}, "a").write("{name} by " + " ".join(sys.argv) + "\\n")
"""

STAGE = """#usda 1.0
def Sphere "S" {}
def DistantLight "L" {}
"""


class Place:
    """A working folder and the folder of a stage, both with malicious modules."""

    def __init__(self, folder: Path) -> None:
        self.work, self.shot = folder / "work", folder / "shot"
        self.marker, self.safe = folder / "marker", folder / "safe"
        self.safe.mkdir()
        for place in (self.work, self.shot):
            place.mkdir()
            for name in HOSTILE:
                text = PLANTED.format(marker=str(self.marker), name=name)
                (place / f"{name}.py").write_text(text)
        self.stage = self.shot / "a.usda"
        self.stage.write_text(STAGE)

    def run(self, words: list[str], **variables: str) -> str:
        """Runs a command in the working folder and returns its output."""
        names = ("PYTHONPATH", "WAVECOMB_ISOLATE")
        kept = {key: value for key, value in os.environ.items() if key not in names}
        done = subprocess.run(
            words, cwd=self.work, capture_output=True, text=True, timeout=120,
            env={**kept, "QT_QPA_PLATFORM": "offscreen", **variables},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def program(self, code: str, *arguments: object) -> str:
        """Runs a script from a folder without malicious modules."""
        script = self.safe / "program.py"
        script.write_text(code)
        return self.run([sys.executable, str(script), *map(str, arguments)])

    def check(self) -> None:
        """Fails if one of the malicious modules was executed."""
        assert not self.marker.exists(), self.marker.read_text()


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


def wavecomb_script() -> list[str]:
    """Returns the installed command: a script beside the interpreter."""
    script = Path(sys.executable).with_name("wavecomb")
    assert script.is_file()
    return [sys.executable, str(script)]


def test_the_planted_files_would_be_executed(place: Place) -> None:
    with contextlib.suppress(AssertionError):
        place.run([sys.executable, "-m", "wavecomb", "--version"])
    assert place.marker.read_text()


SEVERAL = """
import os, subprocess, sys, threading
from wavecomb import processes
code = ("import json, re, numpy, wavecomb, wavecomb._core, sys, os; "
        "print(wavecomb.__file__); assert '' not in sys.path and os.getcwd() not in sys.path")
def start():
    process = processes.start("-c", code, stdout=subprocess.PIPE, text=True)
    print(process.communicate()[0], end="")
    assert process.returncode == 0
for value in (None, "", ":", ".:", os.getcwd(), os.path.relpath(sys.argv[1])):
    os.environ.pop("PYTHONPATH", None)
    if value is not None:
        os.environ["PYTHONPATH"] = value
    start()
sys.path.insert(0, "")
sys.path.insert(0, os.getcwd())
thread = threading.Thread(target=start)
thread.start()
thread.join()
words = processes.command("wavecomb", "--version")
subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
"""


@pytest.mark.slow
def test_started_processes_import_nothing_from_the_working_folder(place: Place) -> None:
    out = place.program(SEVERAL, place.shot)
    assert set(out.split()) == {str(PACKAGE / "__init__.py")} and len(out.split()) == 7
    place.check()


@pytest.mark.slow
@needs("wavecomb._core")
def test_commands_import_nothing_from_the_working_folder(place: Place) -> None:
    out = place.safe / "a.exr"
    words = (str(place.stage), "-o", str(out), "--size", "8", "8", "--spp", "1")
    place.run([*wavecomb_script(), "render", *words])
    assert out.is_file()
    place.run([*wavecomb_script(), "info", str(place.stage)])
    place.run([*wavecomb_script(), "doctor"])
    place.run([*wavecomb_script(), "completion", "bash"])
    place.check()


FROM_PYTHON = """
import sys, wavecomb
wavecomb.render(sys.argv[1], size=(8, 8), spp=1, progress=False).save(sys.argv[2])
"""


@needs("wavecomb._core")
@pytest.mark.slow
def test_a_program_that_renders_imports_nothing_from_its_folder(place: Place) -> None:
    place.program(FROM_PYTHON, place.stage, place.safe / "a.exr")
    place.check()


@pytest.mark.slow
@needs("wavecomb._core", "distributed")
def test_farms_import_nothing_from_the_working_folder(place: Place) -> None:
    out = place.safe / "a.exr"
    words = (str(place.stage), "-o", str(out), "--size", "8", "8", "--spp", "1")
    place.run([*wavecomb_script(), "farm", "submit", *words, "--on", "local:1"])
    assert out.is_file()
    place.check()


BENCH = """
import sys
from pathlib import Path
from wavecomb.bench.process import run_worker
job = {"stage": sys.argv[1], "camera": None, "settings": {"size": [8, 8], "spp": 1}, "cpus": None,
       "warm": 0, "profile": None, "golden": None, "image": None, "perf": None}
answer = run_worker(job, {}, Path(sys.argv[2])).answer
assert answer["status"] == "ok", answer
"""


@pytest.mark.slow
@needs("wavecomb._core")
def test_bench_workers_import_nothing_from_the_working_folder(place: Place) -> None:
    place.program(BENCH, place.stage, place.safe)
    place.check()


EXPORT = """
import json, os, re, sys
words = sys.argv[sys.argv.index("--") + 1:]
assert os.getpgrp() == os.getpid()
numbers = [int(name) for name in os.listdir("/dev/fd")]
assert 9 not in numbers, numbers
if "wait" in words[0]:
    import time
    open(words[0], "w").write(str(os.getpid()))
    time.sleep(60)
open(words[1] + "/stage.usda", "w").write('#usda 1.0\\ndef Sphere "ball" {}\\n')
row = {"stage": words[1] + "/stage.usda", "options": [], "messages": ["exported"]}
json.dump(row, open(words[1] + "/stage.json", "w"))
"""
BLENDERS = {
    "python-with-bpy": 'exec {python} "$@"',
    # A Blender whose Python has the working folder on its module path.
    "blender": """
while [ "$1" != --python ]; do shift; done
script=$2; shift; shift
exec {python} -c "import json, sys; exec(open('$script').read())" "$@"
""",
}
"""Programs that stand in for Blender."""


def blender(folder: Path, name: str) -> dict[str, str]:
    """Creates a stand-in for Blender and an extension; returns the variables that select them."""
    (folder / "export_file.py").write_text(EXPORT)
    program = folder / name
    program.write_text("#!/bin/sh\n" + BLENDERS[name].format(python=sys.executable))
    program.chmod(0o755)
    return {"WAVECOMB_BLENDER": str(program), "WAVECOMB_BLENDER_EXTENSION": str(folder)}


@needs("wavecomb._core")
@pytest.mark.parametrize("name", list(BLENDERS))
@pytest.mark.slow
def test_blender_imports_nothing_from_folders_of_the_user(place: Place, name: str) -> None:
    """Blender imports nothing from the working folder or the folder of the .blend file.

    Blender's process inherits no descriptors and has a separate process group.
    """
    variables = blender(place.safe, name)
    file, out = place.shot / "a.blend", place.safe / "a.exr"
    file.write_bytes(b"")
    words = [*wavecomb_script(), "render", str(file), "-o", str(out), "--size", "8", "8"]
    place.run(["sh", "-c", 'exec "$0" "$@" 9< /dev/null', *words, "--spp", "1"], **variables)
    assert out.is_file()
    place.check()


@only_where(sys.platform == "linux", "the kernel ends a child with its parent on Linux only")
@pytest.mark.parametrize("name", list(BLENDERS))
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_blender_ends_with_the_command(place: Place, name: str, number: int) -> None:
    file = place.shot / "wait.blend"
    file.write_bytes(b"")
    with subprocess.Popen(
        [*wavecomb_script(), "render", str(file), "-o", str(place.safe / "a.exr")],
        cwd=place.work, env={**os.environ, **blender(place.safe, name)},
        stderr=subprocess.PIPE, text=True,
    ) as command:  # fmt: skip
        until = time.monotonic() + 60
        while not (text := file.read_text()):
            assert time.monotonic() < until and command.poll() is None
            time.sleep(0.02)
        command.send_signal(number)
        _, said = command.communicate(timeout=60)
    assert "Traceback" not in said
    while is_running(int(text)):
        assert time.monotonic() < until, "it outlived the command"
        time.sleep(0.02)


def test_a_blender_that_does_not_start_is_one_line(tmp_path: Path) -> None:
    program = tmp_path / "blender"
    program.write_text("#!/nowhere/sh\n")
    program.chmod(0o755)
    (tmp_path / "a.blend").write_bytes(b"")
    done = subprocess.run(
        [*wavecomb_script(), "render", str(tmp_path / "a.blend"), "-o", "a.exr"],
        cwd=tmp_path, env={**os.environ, **blender(tmp_path, "python-with-bpy"),
                           "WAVECOMB_BLENDER": str(program)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == f"error: {program} does not start: No such file or directory\n"


WINDOW = """
import subprocess, sys, time
import numpy as np
from PySide6.QtCore import QCoreApplication
from wavecomb import processes, window
from wavecomb.gui.command import Command
from wavecomb.gui.compare.flip_process import FlipProcess
application = QCoreApplication([])
command = Command()
ended = []
command.finished.connect(lambda *how: ended.append(how))
command.finished.connect(application.quit)
command.start(["--version"])
application.exec()
assert ended[0][0] == 0 and ended[0][1].startswith("wavecomb "), ended
image = np.zeros((16, 16, 3), np.float32)
assert FlipProcess().flip(image, image, False, 0.0).max() == 0
opened = window.view(sys.argv[1], size=(16, 16), spp=1)
time.sleep(2)
opened.close()
"""


@pytest.mark.slow
@needs("PySide6.QtWidgets", "pyqtgraph", "flip_evaluator")
def test_windows_import_nothing_from_the_working_folder(place: Place) -> None:
    place.program(WINDOW, place.stage)
    place.check()


def test_a_process_finds_the_package_that_lies_in_the_working_folder() -> None:
    """The package is found in the working folder, which is not on the module path."""
    words = processes.command("-c", "import wavecomb, sys; print(wavecomb.__file__, sys.path)")
    done = subprocess.run(
        words, cwd=PACKAGE.parent, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.startswith(str(PACKAGE / "__init__.py"))


def test_folders_that_are_handed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good, here = tmp_path / "good", tmp_path / "here"
    good.mkdir()
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(("", ".", "relative", str(here), str(good))))
    assert processes.folders()[0] == [str(good)]
    monkeypatch.setattr(sys, "path", ["", str(tmp_path / "other"), *sys.path])
    assert str(tmp_path / "other") not in [*processes.folders()[0], *processes.folders()[1]]
    assert boot.extended(["/a"], ["", "x", str(here), "/b"], [str(here), "/b", "/c"]) == [
        "/b", "/a", "/b", "/c",
    ]  # fmt: skip


def test_a_program_that_embeds_python_finds_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert processes.interpreter() == sys.executable
    monkeypatch.setattr(sys, "executable", "/usr/bin/houdini")
    assert Path(processes.interpreter()).name.startswith("python3")
    monkeypatch.setattr(sys, "base_exec_prefix", "/nowhere")
    with pytest.raises(WavecombError, match=r"no Python was found.*/usr/bin/houdini"):
        processes.interpreter()


# ---- life and death ------------------------------------------------------------------------------

linux = only_where(sys.platform == "linux", "the kernel ends a child with its parent on Linux only")

PARENT = """
import subprocess, sys, threading, time
from wavecomb import processes
def start():
    code = "import time, sys; print(1, flush=True); time.sleep(60)"
    process = processes.start("-c", code, stdout=subprocess.PIPE)
    process.stdout.readline()
    print(process.pid, flush=True)
if sys.argv[1] == "thread":
    thread = threading.Thread(target=start)
    thread.start()
    thread.join()
else:
    start()
time.sleep(60)
"""


def is_running(pid: int) -> bool:
    """Returns whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@linux
@pytest.mark.parametrize("where", ["main", "thread"])
def test_a_process_ends_with_its_parent_and_not_before(where: str) -> None:
    """A child ends with its parent process, but not with the thread that started the child."""
    words = [sys.executable, "-c", PARENT, where]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        time.sleep(0.5)
        assert is_running(child)
        parent.kill()
    until = time.monotonic() + 10
    while is_running(child):
        assert time.monotonic() < until, "it outlived its parent"
        time.sleep(0.02)


@linux
def test_a_process_whose_parent_ended_before_it_looked_ends() -> None:
    words = processes.command("-c", "print('alive')", parent=os.getpid() + 1)
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")


LOOK = "import os; print(os.getpgrp() == os.getpid(), *sorted(os.listdir('/dev/fd'), key=int))"


@linux
def test_a_process_inherits_nothing_and_leads_its_group() -> None:
    read, write = os.pipe()
    other = os.open("/dev/null", os.O_RDONLY)
    try:
        for one in (read, other):
            os.set_inheritable(one, True)
        words = processes.command("-c", LOOK, parent=os.getpid(), keep=[read])
        # Qt starts processes like this: in the same group, with all inheritable descriptors.
        done = subprocess.run(words, close_fds=False, capture_output=True, text=True, timeout=60)
        leads, *numbers = done.stdout.split()
        assert leads == "True"
        assert str(read) in numbers and str(other) not in numbers
    finally:
        for one in (read, write, other):
            os.close(one)


def test_what_does_not_start_is_an_error_from_any_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    import threading

    errors: list[BaseException] = []

    def start() -> None:
        try:
            processes.popen(["/nowhere/python"])
        except OSError as error:
            errors.append(error)

    thread = threading.Thread(target=start)
    thread.start()
    thread.join()
    start()
    assert len(errors) == 2 and all(isinstance(one, FileNotFoundError) for one in errors)


# ---- nobody else does ----------------------------------------------------------------------------

PROGRAMS = {
    "bench/process.py": "perf",
    "bench/machine.py": "git",
    "farm/clusters.py": "Slurm's commands",
    "gui/needs.py": "ldd",
    "run/isolation/sandbox.py": "bwrap",
}
"""Files that start programs other than Python."""

PYTHON = {"processes.py", "boot.py"}
STARTERS = {
    "subprocess": {"Popen", "run", "call", "check_call", "check_output", "getoutput",
                   "getstatusoutput"},
    "os": {"system", "popen", "posix_spawn", "posix_spawnp", "startfile",
           *(f"exec{way}" for way in ("l", "le", "lp", "lpe", "v", "ve", "vp", "vpe")),
           *(f"spawn{way}" for way in ("l", "le", "lp", "lpe", "v", "ve", "vp", "vpe"))},
    "pty": {"spawn"},
    "asyncio": {"create_subprocess_exec", "create_subprocess_shell"},
    "sys": {"executable"},
}  # fmt: skip
CLUSTERS = {"multiprocessing", "ProcessPoolExecutor", "LocalCluster", "Nanny", "SubprocessCluster"}
"""Names that stand for multiprocessing, which no file may use, since its child processes import
from the working folder."""

WORTH_PARSING = re.compile(
    rf"\b({'|'.join(CLUSTERS)}|subprocess|pty|asyncio|QProcess)\b|sys\.executable"
    r"|\bos\.(system|popen|posix|startfile|exec|spawn)|from (os|sys) import"
)


def starts(tree: ast.AST) -> list[str]:
    """Returns the uses of functions that start processes."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in STARTERS.get(node.value.id, ()):
                found.append(f"{node.lineno}: {node.value.id}.{node.attr}")
        elif isinstance(node, ast.ImportFrom) and node.module in STARTERS:
            bad = [one.name for one in node.names if one.name in STARTERS[node.module]]
            found += [f"{node.lineno}: {node.module}.{name}" for name in bad]
    return found


def type_only(text: str) -> str:
    """Removes uses of subprocess.Popen as a type from a text."""
    return text.replace("subprocess.Popen[", "Popen[")


def names_of(tree: ast.AST) -> set[str]:
    """Returns the names that a module uses or imports."""
    found = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            parts = [*(one.name for one in node.names), getattr(node, "module", None) or ""]
            found |= {word for part in parts for word in part.split(".")}
    return found


def test_nobody_else_starts_python() -> None:
    problems, programs = [], set()
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        text = path.read_text(encoding="utf-8")
        if name in PYTHON or not WORTH_PARSING.search(text):
            continue
        tree = ast.parse(type_only(text))
        found, clusters = starts(tree), names_of(tree) & CLUSTERS
        if clusters:
            problems.append(f"{name}: {min(clusters)}")
        if "QProcess(" in text and "processes.command(" not in text:
            problems.append(f"{name}: QProcess without processes.command")
        if found and name in PROGRAMS and not any("sys.executable" in one for one in found):
            programs.add(name)
        else:
            problems += [f"{name}:{one}" for one in found]
    assert not problems, "start Python by wavecomb.processes:\n" + "\n".join(problems)
    assert programs == {name for name in PROGRAMS if (PACKAGE / name).exists()}


def test_the_search_finds_other_ways() -> None:
    text = "import subprocess, sys\nsubprocess.run([sys.executable])\nfrom os import execv\n"
    assert starts(ast.parse(text)) == ["3: os.execv", "2: subprocess.run", "2: sys.executable"]
