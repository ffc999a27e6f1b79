# SPDX-License-Identifier: Apache-2.0
"""Tests standard streams that are closed, full or missing, non-text names, and Ctrl-C."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import forks
import pytest
from parts import only_where

from wavecomb import processes, terminal

pytest.importorskip("wavecomb._core")
pytestmark = only_where(sys.platform == "linux", "/dev/full is Linux's")

STAGE = '#usda 1.0\ndef Sphere "Ball" {}\n'
WAVECOMB = f"'{sys.executable}' -m wavecomb"
SMALL = "--size 8 8 --spp 1"


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    path = tmp_path / "a.usda"
    path.write_text(STAGE)
    return path


def shell(command: str, folder: Path, **options: object) -> subprocess.CompletedProcess[str]:
    """Runs a line of bash. The exit code is the exit code of the first command of a pipe."""
    line = f"{command}; exit ${{PIPESTATUS[0]}}"
    return subprocess.run(
        ["bash", "-c", line], cwd=folder, capture_output=True, text=True, errors="replace",
        timeout=100, env={**os.environ, "WAVECOMB_ISOLATE": "1"}, **options,
    )  # type: ignore[call-overload]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    "to", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-", "> /dev/full", "2> /dev/full",
           "> /dev/full 2>&1", "| head -0", "2>&1 | head -1", "--progress json > /dev/full",
           "--isolate off >&- 2>&-", "--isolate off > /dev/full"],
)  # fmt: skip
def test_an_image_is_written_whatever_becomes_of_messages(
    stage: Path, tmp_path: Path, to: str
) -> None:
    done = shell(f"{WAVECOMB} render a.usda -o a.exr {SMALL} {to}", tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.exr").stat().st_size > 1000
    for bad in ("Traceback", "internal", "Exception ignored", "Errno"):
        assert bad not in done.stdout + done.stderr
    is_told = "full" in to and "2>" not in to
    assert ("messages were lost" in done.stderr) == is_told, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", ["info a.usda", "doctor", "completion bash", "--help"])
def test_a_result_that_is_lost_is_an_error_and_a_reader_that_ends_is_none(
    stage: Path, tmp_path: Path, command: str
) -> None:
    done = shell(f"{WAVECOMB} {command} > /dev/full", tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: standard output: No space left on device")
    assert done.stderr.count("\n") == 1
    done = shell(f"{WAVECOMB} {command} | head -1", tmp_path)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.count("\n") == 1
    done = shell(f"{WAVECOMB} {command} >&-", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_closed_stream_is_not_given_to_a_file(stage: Path, tmp_path: Path) -> None:
    """With closed streams, messages of libraries do not end up in the first file that is opened."""
    words = "render a.usda -o a.exr --stats a.json --isolate off"
    done = shell(f"{WAVECOMB} {words} {SMALL} <&- >&- 2>&-", tmp_path)
    assert done.returncode == 0
    assert (tmp_path / "a.json").read_text().startswith("{")


# ---- control characters --------------------------------------------------------------------------

HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202egnp"


def has_controls(text: str) -> bool:
    return terminal.clean(text) != text


def test_clean() -> None:
    assert terminal.clean("a\tb\nc é \u4e2d") == "a\tb\nc é \u4e2d"
    assert terminal.clean("\r\x1b\x7f\x85\u2028") == "\\x0d\\x1b\\x7f\\x85\\u2028"
    assert terminal.clean(os.fsdecode(b"a\xffb")) == "a\\xffb"


@pytest.mark.slow
@pytest.mark.parametrize("forced", [False, True])
def test_names_in_a_stage_reach_no_terminal_as_they_are(tmp_path: Path, forced: bool) -> None:
    """Control characters of file names are escaped in all output, with or without Rich."""
    name = HOSTILE.replace("/", "")
    inner = name.replace("\x1b", "\\x1b").replace("\x07", "\\x07")
    texture = f"""
def Material "M" {{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        token outputs:surface
    }}
    def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./{name}.png@
        float3 outputs:rgb
    }}
}}
def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rel material:binding = </M>
}}
def Camera "C" {{
    token projection = "{inner}"
}}
"""
    stage = tmp_path / f"{name}.usda"
    stage.write_text(STAGE + texture)
    env = {**os.environ, **({"FORCE_COLOR": "1", "COLUMNS": "200"} if forced else {})}
    for words in (
        ("render", stage, "-o", tmp_path / f"{name}.exr", *SMALL.split()),
        ("info", stage),
        ("info", tmp_path / f"no{name}.usda"),
        ("render", stage, f"--{name}"),
        (name,),
        ("compare", f"{name}.exr", f"{name}.exr"),
    ):
        done = forks.wavecomb(*words, cwd=tmp_path, env=env)
        said = done.stdout + done.stderr
        for bad in ("\x1b]", "\x07", "\x1b[2J", "\x9b", "\u202e", "Traceback"):
            assert bad not in said, (words, said)
        assert forced or not has_controls(said), (words, said)
        assert "\\x1b" in said or "no camera" in said


FORGED = "A\nwrote faked.exr"
FORGED_STAGE = """#usda 1.0
def Material "M" {
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "A\\nwrote faked.exr"
        token outputs:surface
    }
}
def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rel material:binding = </M>
}
def Shader "T" {
    asset inputs:file = @./t.<UDIM>.png@
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("forced", [False, True])
def test_no_name_forges_a_line(tmp_path: Path, forced: bool) -> None:
    """Newlines in file names and in a stage's text do not start new lines in the output."""
    folder = tmp_path / f"folder {FORGED}"
    folder.mkdir()
    stage = folder / "a.usda"
    stage.write_text(FORGED_STAGE)
    (tmp_path / f"{FORGED}.usda").write_text(FORGED_STAGE)
    env = {**os.environ, **({"FORCE_COLOR": "1", "COLUMNS": "400"} if forced else {})}
    small = SMALL.split()
    job = f"job {FORGED}"
    for code, *words in (
        (0, "render", stage, "-o", f"{FORGED}.exr", *small),
        (0, "render", stage, "-o", f"{FORGED}.####.exr", "--frames", "1", *small),
        (0, "render", f"{FORGED}.usda", "-o", "a.exr", "--png", f"{FORGED}.png", *small),
        (0, "info", stage),
        (0, "info", f"{FORGED}.usda"),
        (2, "info", f"no{FORGED}.usda"),
        (2, "render", stage, "-o", f"{FORGED}.gif", *small),
        (2, "render", stage, f"--{FORGED}"),
        (2, FORGED),
        (0, "compare", f"{FORGED}.exr", f"{FORGED}.exr"),
        (0, "sheet", f"{FORGED}.exr", "a.exr", "-o", f"{FORGED}-sheet.png"),
        (0, "scene", "cornell", "-o", f"{FORGED}-scene.usda"),
        (2, "farm", "submit", stage, "-o", "b.exr", "--on", "none", *small),
        (0, "farm", "submit", stage, "-o", f"{FORGED}.exr", "--on", "none", "--no-strict",
         "--job", job, *small),
        (0, "farm", "status", job),
    ):  # fmt: skip
        done = forks.wavecomb(*words, cwd=tmp_path, env=env)
        said = done.stdout + done.stderr
        assert done.returncode == code, (words, said)
        for line in re.sub("\x1b\\[[0-9;?]*[A-Za-z]", "", said).splitlines():
            assert not line.strip().startswith("wrote faked"), (words, said)
        is_error_or_figure = code == 2 or words[0] == "compare"
        assert is_error_or_figure or "\\nwrote faked" in said, (words, said)


def test_each_message_is_printed_as_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    terminal.say("a\nb", "c\x1b")
    terminal.say("d\r\n", err=True)
    out, err = capsys.readouterr()
    assert (out, err) == ("a\\nb\nc\\x1b\n", "d\\x0d\\n\n")


SEVERAL_LINES = (
    "json.dumps(", "context.get_help()", "template.source_template", "error.format_message()",
    "f'Wavecomb {version()} {_GREETING}'",
)  # fmt: skip
"""Arguments of click.echo that may have several lines: JSON, help, and code for completion."""


def test_commands_print_messages_by_say() -> None:
    package = Path(terminal.__file__).parent
    problems = []
    for path in sorted(package.rglob("*.py")):
        text = path.read_text("utf-8")
        if "echo(" not in text and "print(" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            called, printed = ast.unparse(node.func), ast.unparse(node.args[0])
            if called == "click.echo" and not printed.startswith(SEVERAL_LINES):
                problems.append(f"{path.relative_to(package)}: {printed}")
            if called == "print" and path.name not in ("json_submission.py", "flip_process.py"):
                problems.append(f"{path.relative_to(package)}: {printed}")
    assert not problems, "print messages by terminal.say:\n" + "\n".join(problems)


def test_lines_above_a_bar_are_clean() -> None:
    import io

    from wavecomb.run.progress import ProgressBar

    out = io.StringIO()
    console = terminal.console(file=out, force_terminal=True, width=200)
    before = sys.stderr
    with ProgressBar(console, "a"):
        print(f"warning: {HOSTILE}", file=sys.stderr)
    assert sys.stderr is before
    assert "\\x1b]0;owned\\x07\\x1b[2J" in out.getvalue()
    assert "\x1b]0" not in out.getvalue() and "\x9b" not in out.getvalue()


# ---- Ctrl-C --------------------------------------------------------------------------------------

INTERRUPTED = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class At:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, At())
from wavecomb.cli import main
main(sys.argv[2:])
"""


PLANTED = """
import os, signal, sys
class At:
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["INTERRUPTED_AT"]:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
if sys.orig_argv[-1] == "--version":
    sys.meta_path.insert(0, At())
"""
SCRIPT = f"#!{sys.executable}\nimport sys\nfrom wavecomb.cli import main\nsys.exit(main())\n"


def interrupted_at(
    module: str, folder: Path, words: list[object], **options: object
) -> subprocess.CompletedProcess[str]:
    """Runs a command that receives Ctrl-C while importing a module."""
    (folder / "sitecustomize.py").write_text(PLANTED)
    env = {**os.environ, "PYTHONPATH": str(folder), "INTERRUPTED_AT": module}
    return subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, timeout=100, env=env,
        **options,
    )  # type: ignore[call-overload]  # fmt: skip


@pytest.mark.parametrize("start", ["module", "script", "process"])
@pytest.mark.parametrize("module", ["wavecomb.isa", "wavecomb.errors", "wavecomb.cli", "click"])
def test_ctrl_c_while_the_package_is_imported(tmp_path: Path, start: str, module: str) -> None:
    script = tmp_path / "bin" / "wavecomb"
    script.parent.mkdir()
    script.write_text(SCRIPT)
    words = {
        "module": [sys.executable, "-m", "wavecomb", "--version"],
        "script": [sys.executable, script, "--version"],
        # Isolated processes ignore PYTHONPATH; the flag is left out here to plant the file.
        "process": [word for word in processes.command("wavecomb", "--version") if word != "-I"],
    }[start]
    done = interrupted_at(module, tmp_path, words)
    assert done.returncode in (-signal.SIGINT, 130), done
    assert done.stderr in ("", "stopped\n") and not done.stdout


def test_an_ignored_ctrl_c_stays_ignored(tmp_path: Path) -> None:
    done = interrupted_at(
        "wavecomb.isa", tmp_path, [sys.executable, "-m", "wavecomb", "--version"],
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout.startswith("wavecomb ")


@pytest.mark.parametrize("name", ["tool.py", "wavecomb.py", "wavecombs"])
def test_the_library_leaves_handlers_alone(tmp_path: Path, name: str) -> None:
    script = tmp_path / name
    script.write_text(
        "import signal, sys\n"
        "sys.path.pop(0)\n"
        "import wavecomb.api\n"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler\n"
    )
    for words in ([script], [script, "wavecomb"], ["-c", script.read_text(), "wavecomb"]):
        done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=100)
        assert done.returncode == 0, done.stderr


IN_ALL = ("click", "wavecomb.cli.group", "wavecomb.run.error_messages", "wavecomb.cli.render")
LATER = ("numpy", "wavecomb._core", "pxr.Usd", "OpenImageIO", "wavecomb.cli.summary")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("isolate", "module"),
    [*(("on", module) for module in IN_ALL), *(("off", module) for module in IN_ALL + LATER)],
)
def test_ctrl_c_while_modules_are_imported(
    stage: Path, tmp_path: Path, isolate: str, module: str
) -> None:
    words = ["render", str(stage), "-o", str(tmp_path / "a.exr"), *SMALL.split()]
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, *words, "--isolate", isolate],
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert "Traceback" not in done.stderr and "internal" not in done.stderr
    if (tmp_path / "a.exr").exists():  # a library swallowed the signal, or the render had ended
        assert done.returncode in (0, 130)
    else:
        assert done.returncode == 130 and "stopped" in done.stderr, done.stderr
