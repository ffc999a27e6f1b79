# SPDX-License-Identifier: Apache-2.0
"""What befalls a farm: workers that are killed, hang or are slow, disks that are full or gone."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import forks
import pytest
from farm_jobs import cornell_in, left_behind, processes_of, same, wait_for, work
from parts import needs, not_here

from wavecomb import farm
from wavecomb.errors import WavecombError
from wavecomb.farm.copies import Copies
from wavecomb.farm.files import read_json, write_json
from wavecomb.farm.folder import BUSY, DONE, TODO, Folder, ShareLost
from wavecomb.farm.leases import Beat
from wavecomb.farm.patience import Patience
from wavecomb.farm.rendering import Renderer, Stopped

pytestmark = needs("wavecomb._core")

WAVECOMB = [sys.executable, "-m", "wavecomb"]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def changed(folder: Folder, **fields: Any) -> Folder:
    """A job whose fields are others."""
    write_json(folder.path / "job.json", {**read_json(folder.path / "job.json"), **fields})
    return Folder(folder.path)


def one_process(stage: Path, folder: Path, size: tuple[int, int], spp: int) -> Path:
    """The picture of one process."""
    words = ["--size", *map(str, size), "--spp", str(spp), "--threads", "1"]
    one = forks.wavecomb("render", stage, "-o", folder / "one.exr", *words, timeout=400)
    assert one.returncode == 0, one.stderr
    return folder / "one.exr"


# ---- killed --------------------------------------------------------------------------------------


def kill(stage: Path, place: Path, *, engines: int, kills: int, spp: int) -> None:
    """Kills workers and renderers at random moments, and each engine at last."""
    options: dict[str, Any] = {"size": (64, 48), "spp": spp, "threads": 1}
    folder = farm.submit(stage, place / "a.exr", tiles="2x2", strict=False, **options)
    changed(folder, tries=100, every=0.05)
    tasks, parts, chance = folder.spec.tasks(), folder.path / "parts", random.Random(7)

    def begun() -> int:
        return sum(folder.logs(task.id).count("begins on") for task in tasks)

    killed = 0
    for turn in range(engines):
        before = begun()
        words = [*WAVECOMB, "farm", "resume", str(folder.path)]
        engine = subprocess.Popen([*words, "--on", "local:2", "--quiet"])
        try:
            wait_for(lambda: begun() > before or engine.poll() is not None)  # noqa: B023
            wait_for(lambda: list(parts.glob("*.ckpt")) or engine.poll() is not None)  # noqa: B023
            wanted = kills * (turn + 1) // engines
            until = time.monotonic() + 60
            while killed < wanted and engine.poll() is None and time.monotonic() < until:
                what = "farm.child" if killed % 2 == 0 else "farm\0worker"
                mine = [pid for pid in processes_of(folder.path, what) if pid != engine.pid]
                time.sleep(chance.uniform(0.0, 0.3))
                if mine and engine.poll() is None:
                    with_luck = chance.choice(mine)
                    try:
                        os.kill(with_luck, signal.SIGKILL)
                        killed += 1
                    except ProcessLookupError:
                        pass
        finally:
            # All that it started go with it.
            engine.kill()
            engine.wait(30)
        wait_for(lambda: not processes_of(folder.path))
    done = forks.wavecomb("farm", "resume", folder.path, "--on", "local:2", timeout=400)
    assert done.returncode == 0, done.stderr
    same(place / "a.exr", one_process(stage, place, (64, 48), spp))
    assert os.listdir(parts) == [] and not left_behind(place)
    logs = "".join(folder.logs(task.id) for task in tasks)
    assert "its worker ended" in logs and "goes on after" in logs, "or nothing was tested"
    assert killed >= min(kills, 2)


@pytest.mark.slow
def test_workers_are_killed(stage: Path, tmp_path: Path) -> None:
    """SIGKILL at random moments of whoever works: the picture is that of one process."""
    kill(stage, tmp_path, engines=2, kills=3, spp=1000)


@pytest.mark.long
def test_workers_are_killed_often(stage: Path, tmp_path: Path) -> None:
    """20 workers and renderers, 5 engines."""
    kill(stage, tmp_path, engines=5, kills=20, spp=6000)


# ---- slow ----------------------------------------------------------------------------------------


def held(stage: Path, place: Path, **fields: Any) -> tuple[Folder, Any]:
    """A job of which one task is left, which a worker took long ago; that task."""
    options = {"size": (32, 16), "spp": 1, "tiles": "2x1", "strict": False}
    folder = changed(farm.submit(stage, place / "a.exr", **options), **fields)
    renderer, slow = Renderer(folder, threads=1), Beat(folder, {}, "slow")
    first, second = folder.entries(TODO)[:2]
    mine = folder.claim(first, "quick")
    assert mine is not None
    folder.finish(mine, {**renderer.do(mine.task), "wall_s": 0.5})
    mine = folder.claim(second, slow.name)
    assert mine is not None
    past = time.time() - 20
    os.utime(folder.path / BUSY / mine.name, (past, past))
    return folder, mine


def test_a_copy_of_a_slow_task(stage: Path, tmp_path: Path) -> None:
    """Once, by one other; who comes second is told so, and changes nothing."""
    folder, slow = held(stage, tmp_path)
    two, three = Beat(folder, {}, "two"), Beat(folder, {}, "three")
    copies = {beat.name: Copies(folder, beat.name, beat.now) for beat in (two, three)}
    mine = copies["two"].next()
    assert mine is not None and mine.task == slow.task
    assert copies["three"].next() is None, "another has a copy"
    assert Copies(folder, "slow", two.now).next() is None, "it is its own"
    renderer = Renderer(folder, threads=1)
    assert folder.finish_copy(mine.task, renderer.do(mine.task, copy=True))
    copies["two"].end(mine)
    assert folder.ids(DONE) == {"000000.0000", "000000.0001"} and not folder.ids(BUSY)
    assert not folder.has(slow) and not folder.finish(slow, {}) and not folder.fail(slow, "x")
    assert not folder.finish_copy(mine.task, {}), "two copies count once"
    with pytest.raises(Stopped):
        renderer.do(slow.task)
    work(folder)
    assert os.listdir(folder.path / "parts") == [] == os.listdir(folder.path / "copies")


def test_what_is_no_slow_task(stage: Path, tmp_path: Path) -> None:
    folder, slow = held(stage, tmp_path, slow=60.0)
    clock = Beat(folder, {}, "two").now
    assert Copies(folder, "two", clock).next() is None, "20 s are not 60 times 0.5 s"
    folder = changed(folder, slow=0)
    assert Copies(folder, "two", clock).next() is None, "nobody wants copies"
    folder = changed(folder, slow=3.0)
    progress = {"task": slow.task.id, "samples_done": 99, "samples_total": 100}
    facts = read_json(folder.path / "workers" / "slow.json")
    write_json(
        folder.path / "workers" / "slow.json",
        {**facts, "task": slow.task.id, "progress": progress},
    )
    assert Copies(folder, "two", clock).next() is None, "it is nearly done"
    progress["samples_done"] = 50
    write_json(
        folder.path / "workers" / "slow.json",
        {**facts, "task": slow.task.id, "progress": progress},
    )
    # One whose worker is no more does not count.
    (folder.path / "copies" / f"{slow.task.id}.1.dead").touch()
    Beat(folder, {}, "dead").end("x")
    mine = Copies(folder, "two", clock).next()
    assert mine is not None and os.listdir(folder.path / "copies") == [mine.name]


def throttle(pid: int, over: threading.Event) -> None:
    """Lets a process run a tenth of the time."""
    while not over.is_set():
        for number, seconds in ((signal.SIGSTOP, 0.45), (signal.SIGCONT, 0.05)):
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                return
            time.sleep(seconds)
    os.kill(pid, signal.SIGCONT)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hangs", pytest.param("slow", marks=pytest.mark.long)])
def test_a_worker_that_is_slow(stage: Path, tmp_path: Path, kind: str) -> None:
    """Its task is done elsewhere; nothing is lost, done twice or torn, also when it wakes up."""
    options: dict[str, Any] = {"size": (64, 64), "spp": 300, "threads": 1}
    folder = farm.submit(stage, tmp_path / "a.exr", tiles="2x2", strict=False, **options)
    folder = changed(folder, lease_s=600.0, hang_s=120.0, slow=1.5)
    words = [*WAVECOMB, "farm", "worker", str(folder.path), "--quiet"]
    over = threading.Event()
    slow = subprocess.Popen(words)
    try:
        wait_for(lambda: folder.ids(DONE) and folder.ids(BUSY))
        if kind == "hangs":
            os.kill(slow.pid, signal.SIGSTOP)
            for child in processes_of(folder.path, "farm.child"):
                os.kill(child, signal.SIGSTOP)
        else:
            child = processes_of(folder.path, "farm.child")[0]
            threading.Thread(target=throttle, args=(child, over), daemon=True).start()
        quick = forks.wavecomb("farm", "worker", folder.path, timeout=100)
        assert quick.returncode == 0, quick.stderr
        assert farm.status(folder)["state"] == "done"
        over.set()
        for pid in (*processes_of(folder.path, "farm.child"), slow.pid):
            os.kill(pid, signal.SIGCONT)
        assert slow.wait(60) == 0
    finally:
        over.set()
        slow.kill()
        slow.wait(10)
    same(tmp_path / "a.exr", one_process(stage, tmp_path, (64, 64), 300))
    assert os.listdir(folder.path / "parts") == [] and not left_behind(tmp_path)
    if kind == "hangs":
        assert "begun here, too" in quick.stdout


@pytest.mark.slow
def test_an_engine_does_not_wait_for_who_hangs(stage: Path, tmp_path: Path) -> None:
    """It ends soon after all is done, and takes its workers with it."""
    folder = farm.submit(
        stage, tmp_path / "a.exr", tiles="2x2", size=(64, 64), spp=300, threads=1, strict=False
    )
    folder = changed(folder, lease_s=600.0, slow=1.5)
    words = [*WAVECOMB, "farm", "resume", str(folder.path), "--on", "local:2", "--quiet"]
    engine = subprocess.Popen(words)
    try:
        wait_for(lambda: folder.ids(DONE) and len(folder.ids(BUSY)) > 1)
        os.kill(processes_of(folder.path, "farm\0worker")[0], signal.SIGSTOP)
        assert engine.wait(100) == 0
    finally:
        engine.kill()
        engine.wait(10)
    wait_for(lambda: not processes_of(folder.path), 10)
    assert (tmp_path / "a.exr").exists() and not left_behind(tmp_path)


# ---- disks ---------------------------------------------------------------------------------------


def test_what_is_said_while_the_folder_is_gone(stage: Path, tmp_path: Path) -> None:
    """Is not taken for an answer: the task stays whose it was."""
    folder, mine = held(stage, tmp_path)
    away = folder.path.with_name("away")
    folder.path.rename(away)
    for act in (
        lambda: folder.finish(mine, {}),
        lambda: folder.give_back(mine),
        lambda: folder.fail(mine, "x"),
    ):
        with pytest.raises(ShareLost):
            act()
    assert folder.has(mine) and not folder.is_there()
    away.rename(folder.path)
    assert folder.finish(mine, {})


@pytest.mark.slow
def test_a_share_that_is_gone_for_a_while(stage: Path, tmp_path: Path) -> None:
    """Workers and their engine wait for it, and go on; no try is counted."""
    share = tmp_path / "share"
    share.mkdir()
    folder = farm.submit(
        stage, share / "a.exr", tiles="2x2", size=(64, 64), spp=200, threads=1, strict=False
    )
    changed(folder, tries=1, every=0.2)
    words = [*WAVECOMB, "farm", "resume", str(folder.path), "--on", "local:2", "--quiet"]
    engine = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    try:
        for _ in range(2):
            wait_for(lambda: folder.ids(BUSY) or engine.poll() is not None)
            time.sleep(0.3)
            share.rename(tmp_path / "away")
            time.sleep(1.5)
            (tmp_path / "away").rename(share)
            time.sleep(0.5)
        _, said = engine.communicate(timeout=100)
    finally:
        engine.kill()
        engine.wait(10)
    assert engine.returncode == 0, said
    same(share / "a.exr", one_process(stage, tmp_path, (64, 64), 200))
    assert not left_behind(share)


@pytest.mark.slow
def test_files_that_may_not_grow(stage: Path, tmp_path: Path) -> None:
    """As on a disk that is full: named after a while, no task fails by it, nothing is torn."""
    folder = farm.submit(
        stage, tmp_path / "a.exr", size=(96, 96), spp=1, tiles="2x1", threads=1, strict=False
    )
    limited = "import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (30000,) * 2)"
    limited += "; import wavecomb.farm.worker as w; w._MOST_FULL = 1"
    limited += "; sys.argv[:] = ['wavecomb', *sys.argv[1:]]; from wavecomb.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", limited, "farm", "worker", str(folder.path)],
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert "npz: cannot be written: File too large" in done.stderr
    assert not (tmp_path / "a.exr").exists() and not left_behind(tmp_path)
    assert [entry.attempt for entry in folder.entries(TODO)] == [1, 1, 1]
    assert forks.wavecomb("farm", "resume", folder.path).returncode == 0
    assert (tmp_path / "a.exr").exists()


FULL = """
mount -t tmpfs -o size=600k none "$1" || exit 77
cd "$1"; shift
"$@" farm submit "$STAGE" -o a.exr --size 96 96 --spp 300 --threads 1 --no-strict \\
  --on none || exit 1
"$@" farm resume a.farm --on local:1 &
engine=$!
for i in $(seq 600); do [ -n "$(ls a.farm/busy)" ] && break; sleep 0.1; done
dd if=/dev/zero of=filler bs=1k 2> /dev/null
for i in $(seq 600); do [ -n "$(ls a.farm/todo)" ] && echo WAITED && break; sleep 0.1; done
rm filler
wait $engine || exit 1
cp a.exr "$OUT"
"""


@pytest.mark.slow
def test_a_disk_that_is_full(stage: Path, tmp_path: Path) -> None:
    """Workers wait for room; no task fails by it."""
    disk, out = tmp_path / "disk", tmp_path / "out.exr"
    disk.mkdir()
    try:
        done = subprocess.run(
            ["unshare", "-Urm", "sh", "-c", FULL, "sh", str(disk), *WAVECOMB],
            env={**os.environ, "STAGE": str(stage), "OUT": str(out)},
            capture_output=True, text=True, timeout=150,
        )  # fmt: skip
    except FileNotFoundError:
        not_here("there is no unshare")
    if done.returncode == 77 or "unshare" in done.stderr:
        not_here("file systems cannot be mounted in a namespace")
    assert done.returncode == 0 and "WAITED" in done.stdout, done.stdout + done.stderr
    same(out, one_process(stage, tmp_path, (96, 96), 300))


def test_patience(stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a disk that is there and fails, or that does not come back, it has an end."""
    folder = farm.submit(stage, tmp_path / "a.exr", size=(8, 8), spp=1, strict=False)
    monkeypatch.setattr("time.sleep", lambda seconds: None)
    waits = Patience(folder, "w", lambda: False, lambda line: None)

    def fails() -> bool:
        raise OSError("the disk says no")

    for _ in range(2):
        for _ in range(5):
            waits.bear(OSError("once"))
        waits.calm()
    with pytest.raises(WavecombError, match="w: the disk says no"):
        waits.insist(fails)
    monkeypatch.setattr("wavecomb.farm.patience.LOST_S", 0.05)
    folder.path.rename(tmp_path / "away")
    with pytest.raises(WavecombError, match=r"a\.farm was not there for 0 s"):
        waits.insist(lambda: folder.put_back(DONE, folder.spec.tasks()[0]))
    stopped = Patience(folder, "w", lambda: True, lambda line: None)
    assert not stopped.insist(lambda: folder.put_back(DONE, folder.spec.tasks()[0]))
