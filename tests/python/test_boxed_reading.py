# SPDX-License-Identifier: Apache-2.0
"""Stages are read in a sandbox: the scene is the same, and what goes wrong there is one line."""

from __future__ import annotations

import dataclasses
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from parts import needs, only_where, written_scenes

import wavecomb
from wavecomb.errors import WavecombError
from wavecomb.run.isolate import landlock, seccomp
from wavecomb.scenes import write_scene

pytestmark = [needs("wavecomb._core"), only_where(sys.platform == "linux", "isolation is Linux's")]
with_landlock = pytest.mark.skipif(not landlock.version(), reason="this kernel has no Landlock")
with_seccomp = pytest.mark.skipif(not seccomp.is_known(), reason="this kernel has no seccomp")

SMALL = {
    "triangles": 10_000, "teapot_level": 4, "texture_size": 64, "texture_mb": 0.5, "voxels": 24,
}  # fmt: skip

GOOD = """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 3
)
def Camera "Eye" {
    double3 xformOp:translate.timeSamples = {1: (0, 0, 9), 3: (1, 0, 9)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "Ball" {
    double radius.timeSamples = {1: 1, 2: 2, 3: 2}
}
def Mesh "Still" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
}
def DomeLight "Sky" {
}
"""

DISPLACED = """#usda 1.0
def Mesh "Grid" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "catmullClark"
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    rel material:binding = </M>
}
def Material "M" {
    token outputs:surface.connect = </M/S.outputs:surface>
    token outputs:displacement.connect = </M/S.outputs:displacement>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        float inputs:displacement.connect = </M/T.outputs:r>
        token outputs:surface
        token outputs:displacement
    }
    def Shader "T" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @bump.png@
        float2 inputs:st.connect = </M/R.outputs:result>
        float3 outputs:rgb
        float outputs:r
    }
    def Shader "R" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""


@pytest.fixture
def good(tmp_path: Path) -> Path:
    path = tmp_path / "good.usda"
    path.write_text(GOOD)
    return path


def both(path: Path, **options: Any) -> tuple[Any, Any]:
    """The stage read here, and in a sandbox."""
    return tuple(wavecomb.load(path, isolate=how, **options) for how in (False, True))  # type: ignore[return-value]


def assert_alike(here: Any, there: Any) -> None:
    """All that is known of two stages is the same, but for the time they took."""
    assert here.scene.fingerprint() == there.scene.fingerprint()
    assert here.scene.object_names == there.scene.object_names
    assert here.scene.warnings == there.scene.warnings
    assert here.report.lines() == there.report.lines()
    assert here.report.as_dict() == there.report.as_dict()
    for field in dataclasses.fields(here):
        if field.name in ("scene", "report", "seconds", "outline", "textures"):
            continue
        assert getattr(here, field.name) == getattr(there, field.name), field.name
    assert np.array_equal(here.outline, there.outline)
    assert there.seconds > 0


def assert_same_picture(here: Any, there: Any) -> None:
    one, two = (wavecomb.render(loaded, size=(24, 16), spp=2) for loaded in (here, there))
    for name, layer in one.layers().items():
        assert np.array_equal(layer, two.layers()[name], equal_nan=True), name


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize("name", written_scenes())
def test_every_scene_is_the_same_bit_for_bit(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.usdc"
    write_scene(name, path, **SMALL)
    here, there = both(path)
    assert_alike(here, there)
    assert_same_picture(here, there)


@pytest.mark.usefixtures("forked")
def test_textures_move_points_there(tmp_path: Path) -> None:
    import OpenImageIO as oiio

    pixels = np.random.default_rng(3).random((16, 16, 3), np.float32)
    buffer = oiio.ImageBuf(oiio.ImageSpec(16, 16, 3, "uint8"))
    buffer.set_pixels(oiio.ROI(), pixels)
    buffer.write(str(tmp_path / "bump.png"))
    path = tmp_path / "displaced.usda"
    path.write_text(DISPLACED)
    here, there = both(path, subdivision=3)
    assert here.scene.triangles == 128 and here.scene.textures
    assert here.scene.bounds[1][2] > 0.5
    assert_alike(here, there)


@pytest.mark.usefixtures("forked")
def test_options_arrive(good: Path) -> None:
    from wavecomb.run.boxed.reader import Reader

    assert_alike(*both(good, frame=2.5, camera="Eye", shutter=(-0.5, 0.5), motion_steps=3))
    with Reader(good) as reader:  # one process for all others
        for options in (
            {"mask": ["/Ball"], "purposes": ("default",), "projection": "latlong"},
            {"working_space": "acescg", "lights": "hidden", "exposure": False, "size": (9, 7)},
            {"frame": np.float64(2), "subdivision": np.int64(1), "threads": 1},
        ):
            assert_alike(wavecomb.load(good, isolate=False, **options), reader.load(options))


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
@needs("userfaultfd")
def test_textures_within_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "mixed.usdc"
    write_scene("mixed", path, **{**SMALL, "texture_size": 256, "texture_mb": 8.0})
    whole = wavecomb.load(path, isolate=False)
    here, there = both(path, texture_limit=1)
    assert sum(size for _, size in whole.scene.textures) > 1_000_000
    assert not there.leaves_out_levels
    assert_alike(here, there)
    assert_same_picture(whole, there)


@pytest.mark.usefixtures("forked")
def test_frames_are_the_same_and_share(good: Path) -> None:
    def frames(isolate: bool) -> list[Any]:
        return list(
            wavecomb.render_frames(
                good, "1-3", size=(24, 16), spp=2, camera="/Eye", isolate=isolate
            )
        )

    for (frame, one), (_, two) in zip(frames(False), frames(True), strict=True):
        assert np.array_equal(one.beauty, two.beauty), frame
        assert one.stats["camera"] == two.stats["camera"] == "/Eye"
        assert np.array_equal(one.beauty, wavecomb.render(
            wavecomb.load(good, frame=frame, camera="/Eye", isolate=False, size=(24, 16)),
            size=(24, 16), spp=2,
        ).beauty)  # fmt: skip


@pytest.mark.usefixtures("forked")
def test_views_of_one_scene_are_looked_at_there(tmp_path: Path) -> None:
    from wavecomb.run.sequence import Frames

    path = tmp_path / "views.usda"
    path.write_text(GOOD.replace(".timeSamples = {1: 1, 2: 2, 3: 2}", " = 1"))
    settings = wavecomb.Settings(width=24, height=16, spp=1)
    pictures = {}
    for isolate in (False, True):
        with Frames(path, isolate=isolate, size=(24, 16)) as frames:
            for frame in (1.0, 3.0):
                loaded = frames.load(frame)
                pictures[isolate, frame] = frames.render(settings).beauty
                assert loaded.frame == frame and loaded.seconds > 0
            assert not frames._is_built, "the hierarchy stays where the camera moves"
    for frame in (1.0, 3.0):
        assert np.array_equal(pictures[False, frame], pictures[True, frame])
    assert not np.array_equal(pictures[True, 1.0], pictures[True, 3.0])


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
def test_the_window_reads_there_and_shares_textures(tmp_path: Path) -> None:
    loader = pytest.importorskip("wavecomb.gui.loader")
    path = tmp_path / "mixed.usdc"
    write_scene("mixed", path, **SMALL)
    with pytest.MonkeyPatch.context() as patch:
        own = loader.read(loader.Request(loader.Source(path)))
        usd, first = own.usd, own.stage
        patch.setenv("WAVECOMB_ISOLATE", "1")
        there = loader.read(loader.Request(loader.Source(path))).stage
        assert_alike(first, there)
        assert set(there.textures.images) == set(first.textures.images)
        assert there.textures.ids == first.textures.ids
        layer = loader.copied(usd.GetSessionLayer())
        request = loader.Request(
            loader.Source(path), usd, layer, textures=there.textures, threads=1
        )
        again = loader.read(request).stage
        spare = loader._spare.take()
        assert spare is not None
        spare.close()
    assert_alike(loader.read(request).stage, again)
    assert again.textures.ids == there.textures.ids


@pytest.mark.usefixtures("forked")
def test_progress_is_told(good: Path) -> None:
    told: list[tuple[int, int]] = []
    wavecomb.load(good, isolate=True, progress=lambda done, found: told.append((done, found)))
    here: list[tuple[int, int]] = []
    wavecomb.load(good, isolate=False, progress=lambda done, found: here.append((done, found)))
    assert told == here

    def stop(done: int, found: int) -> None:
        raise LookupError("enough")

    if here:
        with pytest.raises(LookupError, match="enough"):
            wavecomb.load(good, isolate=True, progress=stop)


# ---- who does what -------------------------------------------------------------------------------

COUNTS = """
import os, sys, wavecomb
from wavecomb.run.boxed import process
started = []
real = process.Process.__init__
def count(self):
    started.append(1)
    real(self)
process.Process.__init__ = count
"""


def script(code: str, *arguments: Any, **environment: str) -> str:
    """What a program prints."""
    variables = {k: v for k, v in os.environ.items() if k != "WAVECOMB_ISOLATE"} | environment
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True,
        env=variables, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "deed",
    [
        "wavecomb.load(sys.argv[1])",
        "wavecomb.render(sys.argv[1], size=(8, 8), spp=1)",
        "list(wavecomb.render_frames(sys.argv[1], '1-2', size=(8, 8), spp=1))",
    ],
)
def test_it_is_so_by_default_and_usd_stays_out(good: Path, deed: str, tmp_path: Path) -> None:
    (tmp_path / "tmp").mkdir()
    usd = "any(name.split('.')[0] in ('pxr', 'OpenImageIO') for name in sys.modules)"
    code = COUNTS + deed + f"\nprint(len(started), {usd})\n"
    code += deed.replace("sys.argv[1]", "sys.argv[1], isolate=False") if "load" in deed else ""
    code += "\nprint(len(started))"
    assert script(code, good, TMPDIR=str(tmp_path / "tmp")) == "1 False\n1\n"
    assert not os.listdir(tmp_path / "tmp")


@pytest.mark.slow
@pytest.mark.parametrize("variable", ["WAVECOMB_ISOLATE", "WAVECOMB_DEBUG"])
def test_it_can_be_left(good: Path, variable: str) -> None:
    code = COUNTS + "wavecomb.load(sys.argv[1])\nprint(len(started), 'pxr' in sys.modules)"
    value = "0" if variable == "WAVECOMB_ISOLATE" else "1"
    assert script(code, good, **{variable: value}) == "0 True\n"


@pytest.mark.slow
@pytest.mark.parametrize("how", ["on", "off"])
def test_commands_start_no_other(good: Path, tmp_path: Path, how: str) -> None:
    """They are in a child, or were asked not to be."""
    code = COUNTS + (
        "import atexit; atexit.register(lambda: print(len(started)))\n"
        "from wavecomb.cli import main\nmain(sys.argv[1:])"
    )
    picture = tmp_path / "a.exr"
    arguments = ["render", good, "-o", picture, "--spp", 1, "--size", 8, 8, "--isolate", how]
    assert script(code, *arguments).endswith("0\n")
    assert picture.exists()


def test_nothing_has_threads_before_the_sandbox_is_entered() -> None:
    """Landlock is for the thread that asks, and for those that it starts later."""
    code = (
        "import os, sys, wavecomb.run.boxed.child\n"
        "heavy = {'numpy', 'pxr', 'wavecomb._core'} & {*sys.modules}\n"
        "print(heavy, os.listdir('/proc/self/task')[1:])"
    )
    assert script(code) == "set() []\n"


# ---- what goes wrong -----------------------------------------------------------------------------

PATCHED = """
import json, sys
start = json.loads(sys.argv[1])
sys.path[:] = start["path"]
from wavecomb.run.boxed import child
real = child.Child.serve
def serve(self):
    import ctypes, os, socket, time
    import numpy as np
    import wavecomb.usd.stage.load as loader
    from wavecomb.errors import WavecombError
    send = self._sender.send
{deed}
    real(self)
child.Child.serve = serve
child.main(start)
"""


@pytest.fixture
def does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Makes the process in the sandbox do something else; nothing may be left of it."""
    from wavecomb.run.boxed import process

    forks.close()  # or it would be a child that is left
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))

    def patch(deed: str) -> str:
        code = PATCHED.format(deed="\n".join(f"    {line}" for line in deed.splitlines()))
        monkeypatch.setattr(process, "_START", code)
        return code

    before = set(os.listdir("/proc/self/fd"))
    yield patch
    assert not os.listdir(folder)
    assert len(os.listdir("/proc/self/fd")) <= len(before)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


IN_THE_MIDST = "loader._add_lights = lambda *_: {}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deed", "words"),
    [
        (IN_THE_MIDST.format("ctypes.string_at(0)"), r"a library crashed \(SIGSEGV\) while"),
        (IN_THE_MIDST.format("os._exit(7)"), "ended with code 7: no word"),
        ("os.write(2, b'first\\nlast words\\n'); os._exit(3)", "ended with code 3: last words"),
        ("self._sender._file.write(b'abc'); self._sender._file.flush(); os._exit(0)", "code 0"),
    ],
)
def test_who_dies_there_is_one_line_here(good: Path, does: Any, deed: str, words: str) -> None:
    does(deed)
    with pytest.raises(WavecombError, match=words) as caught:
        wavecomb.load(good, isolate=True)
    assert str(caught.value).startswith(f"{good}: ") and "\n" not in str(caught.value)


def test_who_dies_while_settings_are_looked_at(good: Path, does: Any) -> None:
    does("import wavecomb.usd.stage.peek as peek\npeek.read_choices = lambda *_: os.abort()")
    with pytest.raises(WavecombError, match=r"a library crashed \(SIGABRT\) while opening"):
        wavecomb.render(good, isolate=True, size=(4, 4), spp=1)


class Stranger:
    """In place of a ``Process``: sends what it likes."""

    def __init__(self, *messages: tuple[str, dict[str, Any]] | bytes) -> None:
        from wavecomb.run.boxed.wire import Sender

        self.channel, self._its = socket.socketpair()
        self.is_idle, self.is_closed = True, False
        sender = Sender(self._its)
        for message in messages:
            if isinstance(message, bytes):
                self._its.sendall(message)
            else:
                sender.send(*message)

    def obituary(self) -> str:
        return "it is no more"

    def close(self) -> None:
        self.is_closed = True
        self.channel.close()
        self._its.close()


GROUP = {"call": "add_group", "with": {}}
STAGE = {"report": {}, "camera_path": None}


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([("call", {"call": "build", "with": {}})], "a call 'build', which there is none"),
        ([("call", {**GROUP, "id": 9})], "a call add_group that comes to 1, not to 9"),
        ([("call", {**GROUP, "id": 1}), ("call", {**GROUP, "id": 1})], "a call .* comes to 2"),
        ([("run", {"code": "print()"})], "a message 'run'"),
        ([("waiting", {"bytes": -1})], "something for a size"),
        ([("progress", {"done": "all", "found": 1})], "progress that is none"),
        ([("error", {"type": 3, "text": ""})], "an error that is none"),
        ([("error", {"type": "WavecombError", "text": "x" * 9999})], "an error that is none"),
        ([("stage", {"stage": None, "cache": None})], "something for values by name"),
        ([("stage", {"stage": {}, "cache": None})], "data without report"),
        ([("stage", {"stage": STAGE, "cache": None})], "data without cameras"),
        ([("stage", {"stage": {"lights": [7]}, "cache": None})], "something for a text"),
        ([b"\xff" * 64], "a head of"),
        ([b"\2\0\0\0{]"], "a head that is no JSON"),
    ],
)
def test_what_it_should_not_send_is_refused(good: Path, messages: Any, words: str) -> None:
    from wavecomb.run.boxed.reader import Reader

    stranger: Any = Stranger(*messages)
    reader = Reader(good, process=stranger)
    words = f"good.usda: refused: the process that reads it sent {words}"
    with pytest.raises(WavecombError, match=words) as caught:
        reader.load({}, progress=lambda done, found: None)
    assert "\n" not in str(caught.value) and stranger.is_closed


def test_errors_of_names_that_are_not_known_run_nothing(good: Path) -> None:
    from wavecomb.run.boxed.reader import Reader

    for kind, raised in (
        ("SystemExit", RuntimeError), ("KeyboardInterrupt", RuntimeError), ("exit", RuntimeError),
        ("ErrorException", RuntimeError), ("ValueError", ValueError), ("MemoryError", MemoryError),
    ):  # fmt: skip
        stranger: Any = Stranger(("error", {"type": kind, "text": "words"}))
        with pytest.raises(raised, match="words"), Reader(good, process=stranger) as reader:
            reader.load({})


@pytest.mark.slow
def test_errors_are_of_the_same_types(good: Path, tmp_path: Path) -> None:
    from wavecomb.run.boxed.reader import Reader

    wrong: list[tuple[type[Exception], dict[str, Any]]] = [
        (WavecombError, {"camera": "/Nope"}),
        (WavecombError, {"frame": float("nan")}),
        (WavecombError, {"subdivision": "much"}),
        (WavecombError, {"texture_limit": -1}),
        (WavecombError, {"variants": {"a": "b"}}),
        (WavecombError, {"size": (0, 1)}),
        (WavecombError, {"frame": "soon"}),
        (AttributeError, {"variants": 3}),
    ]
    with Reader(good) as reader:  # it lives on
        for kind, options in wrong:
            with pytest.raises(kind) as here:
                wavecomb.load(good, isolate=False, **options)
            with pytest.raises(kind) as there:
                reader.load(options)
            assert str(here.value) == str(there.value) and type(there.value) is kind
        assert reader.load({}).scene.mesh_count == 2
    for isolate in (False, True):
        with pytest.raises(WavecombError, match="no such file"):
            wavecomb.load(tmp_path / "none.usda", isolate=isolate)
    with pytest.raises(WavecombError, match="after what went wrong before"):
        reader.load({})


@with_landlock
@with_seccomp
def test_it_reads_what_the_stage_names_and_has_no_network(good: Path, does: Any) -> None:
    secret = good.parent.parent / f"secret-{good.parent.name}"
    secret.write_text("a key")
    does(
        f"""
def tries(deed):
    try:
        deed()
        return "done"
    except OSError as error:
        return type(error).__name__
def spy(builder, file):
    raise WavecombError(" ".join([
        tries(lambda: open({str(secret)!r})), tries(lambda: open({str(good)!r})),
        tries(lambda: open({str(good)!r}, "a")), tries(socket.socket),
        tries(lambda: os.execv("/bin/true", ["true"])),
        tries(lambda: open(os.environ["TMPDIR"] + "/x", "w")),
    ]))
loader._build = spy
"""
    )
    with pytest.raises(WavecombError) as caught:
        wavecomb.load(good, isolate=True)
    secret.unlink()
    assert str(caught.value) == "PermissionError done" + 3 * " PermissionError" + " done"


@pytest.mark.slow
def test_memory_is_limited_on_both_sides(good: Path, does: Any) -> None:
    does("loader.survey = lambda *_: np.ones(10**9)")
    with pytest.raises(WavecombError, match=r"good\.usda: out of memory.*limit is 600 MB"):
        wavecomb.load(good, isolate=True, memory_limit=600)
    # More than may be held here, of what takes little there.
    does(
        "array = np.broadcast_to(np.float32(0), (50_000_000, 3))\n"
        "send('call', {'call': 'add_mesh', 'with': {'positions': array, 'indices': array}})"
    )
    with pytest.raises(WavecombError, match=r"good\.usda: out of memory.*limit is 400 MB"):
        wavecomb.load(good, isolate=True, memory_limit=400)
    does(
        "for i in range(1, 10**9):\n"
        "    send('call', {'call': 'add_group', 'with': {'name': 'x' * 10**6}, 'id': i})"
    )
    with pytest.raises(WavecombError, match=r"good\.usda: out of memory.*limit is 300 MB"):
        wavecomb.load(good, isolate=True, memory_limit=300)
    with pytest.raises(WavecombError, match="memory limit nan MB"):
        wavecomb.load(good, isolate=True, memory_limit=float("nan"))


WAITS = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
import sys, wavecomb
from wavecomb.run.boxed import process
process._START = sys.argv[2]
real = process.Process.__init__
def say(self):
    real(self)
    print(self._process.pid, flush=True)
process.Process.__init__ = say
wavecomb.load(sys.argv[1], isolate=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "is_deaf"), [(signal.SIGINT, False), (signal.SIGKILL, False), (signal.SIGKILL, True)]
)
def test_no_process_outlives_who_asked(good: Path, does: Any, number: int, is_deaf: bool) -> None:
    """Also where it computes in C++ that lets no thread of Python's run."""
    wait = "ctypes.PyDLL(None).pause()" if is_deaf else "time.sleep(60)"
    code = does(IN_THE_MIDST.format(wait))
    process = subprocess.Popen(
        [sys.executable, "-c", WAITS, str(good), code], stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    child = int(process.stdout.readline())
    stat = Path(f"/proc/{child}/stat")
    end = time.monotonic() + 30
    while "S" not in stat.read_text().rpartition(")")[2][:3] or time.monotonic() > end:
        time.sleep(0.05)
    time.sleep(1.0)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == -number, err
    assert ("KeyboardInterrupt" in err) == (number == signal.SIGINT)
    end = time.monotonic() + 10
    while stat.exists() and time.monotonic() < end:
        if stat.read_text().rpartition(")")[2].split()[0] == "Z":
            break  # a machine whose first process reaps nobody keeps the entry
        time.sleep(0.05)
    assert not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z"
    if number == signal.SIGKILL:  # nobody was left to clean up
        for left in Path(os.environ["TMPDIR"]).iterdir():
            left.rmdir()


@pytest.mark.slow
def test_what_libraries_print_there_is_passed_on(good: Path, does: Any) -> None:
    deed = "os.write(2, b'libpng error: CRC\\nsomething else\\n')"
    code = does(deed)
    run = "import sys, wavecomb\nfrom wavecomb.run.boxed import process\n"
    run += "process._START = sys.argv[2]\nwavecomb.load(sys.argv[1])"
    assert script(run, good, code) == "something else\n"


def test_a_program_that_holds_python_within_finds_one(monkeypatch: pytest.MonkeyPatch) -> None:
    from wavecomb.run.boxed import process

    assert process.interpreter() == sys.executable
    monkeypatch.setattr(sys, "executable", "/usr/bin/houdini")
    assert Path(process.interpreter()).name.startswith("python3")
    monkeypatch.setattr(sys, "base_exec_prefix", "/nowhere")
    with pytest.raises(WavecombError, match="isolate=False"):
        process.interpreter()
