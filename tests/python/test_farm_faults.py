# SPDX-License-Identifier: Apache-2.0
"""Workers, schedulers and clients that are killed or hang, full disks, concurrent clients.

The image is bit-identical to the image of an undisturbed run, or the command ends with one line and
resuming gives that image.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import forks
import pytest
from farm_jobs import cornell_in, left_behind, processes_of, same, wait_for
from parts import needs, not_here

from wavecomb import farm
from wavecomb.errors import WavecombError
from wavecomb.farm.assembly import Outcome
from wavecomb.farm.batches import Batch
from wavecomb.farm.client import Run
from wavecomb.farm.clusters import Cluster
from wavecomb.farm.folder import Folder
from wavecomb.farm.job import Task

pytestmark = [needs("wavecomb._core", "distributed", "cryptography"), pytest.mark.slow]

WAVECOMB = [sys.executable, "-m", "wavecomb"]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def made(stage: Path, place: Path, spp: int, **options: object) -> Folder:
    options = {"tiles": "4x4", "size": (64, 64), "threads": 1, "tries": 100, **options}
    return farm.submit(stage, place / "a.exr", spp=spp, **options)  # type: ignore[arg-type]


def one_process(stage: Path, place: Path, spp: int) -> Path:
    words = ("--size", "64", "64", "--spp", str(spp), "--threads", "1")
    done = forks.wavecomb("render", stage, "-o", place / "one.exr", *words, timeout=300)
    assert done.returncode == 0, done.stderr
    return place / "one.exr"


def client_of(folder: Folder, *words: str) -> subprocess.Popen[str]:
    """Starts `farm resume` with two workers."""
    return subprocess.Popen(
        [*WAVECOMB, "farm", "resume", str(folder.path), "--quiet", "--on", "local:2", *words],
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def descendants(pid: int) -> list[int]:
    """Returns the ids of all descendants of a process."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError):
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            parents[int(entry.name)] = int(fields[1])
    found: list[int] = []
    for one in sorted(parents):
        at = one
        while at in parents and at != pid:
            at = parents[at]
        if at == pid and one != pid:
            found.append(one)
    return found


def parts_of(folder: Folder) -> list[Path]:
    return [file for file in folder.path.glob("parts/*/*.exr") if not file.name.startswith(".")]


# ---- kills and stops -----------------------------------------------------------------------------


def check_end(client: subprocess.Popen[str]) -> None:
    """Waits until a client ends, and checks that it gives a reason in one line if it fails."""
    said = client.communicate(timeout=300)[1]
    assert client.returncode in (0, -signal.SIGKILL) or said.count("\n") == 1, said


def disturb(stage: Path, place: Path, spp: int, count: int, seed: int) -> None:
    """Kills or halts random workers, nannies and clients (which contain the scheduler)."""
    folder, chance, done = made(stage, place, spp), random.Random(seed), 0
    client = client_of(folder)
    try:
        while done < count:
            before = len(parts_of(folder))
            wait_for(lambda: len(parts_of(folder)) > before or client.poll() is not None, 200)  # noqa: B023
            if client.poll() is not None:
                check_end(client)
                if client.returncode == 0:
                    break
                client = client_of(folder)
                continue
            time.sleep(chance.uniform(0.0, 0.3))
            targets = [client.pid] if chance.random() < 0.25 else descendants(client.pid)
            if not targets:
                continue
            number = chance.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP])
            target = chance.choice(targets)
            with contextlib.suppress(ProcessLookupError):
                os.kill(target, number)
                done += 1
                if number == signal.SIGSTOP:
                    time.sleep(chance.uniform(0.1, 1.0))
                    os.kill(target, signal.SIGCONT)
        if client.returncode is None:
            check_end(client)
    finally:
        client.kill()
        client.wait(10)
    last = forks.wavecomb("farm", "resume", folder.path, "--on", "local:2", timeout=300)
    assert last.returncode == 0, last.stderr
    same(place / "a.exr", one_process(stage, place, spp))
    assert not left_behind(place) and not list((folder.path / "parts").iterdir())
    wait_for(lambda: not processes_of(folder.path), 30)
    assert done >= min(3, count), "or nothing was tested"


def test_kills_and_stops(stage: Path, tmp_path: Path) -> None:
    """Kills a worker or its nanny, and then the client."""
    disturb(stage, tmp_path, 2000, 2, 5)


@pytest.mark.long
def test_twenty_kills_and_stops(stage: Path, tmp_path: Path) -> None:
    disturb(stage, tmp_path, 20_000, 20, 7)


def test_a_stage_that_kills_its_workers(stage: Path, tmp_path: Path) -> None:
    """After all retries, one line names the failed image, and the client ends."""
    folder = made(stage, tmp_path, 400_000, tiles="1x1", tries=2)
    client = client_of(folder)
    killed: set[int] = set()
    try:
        until = time.monotonic() + 200
        while client.poll() is None and time.monotonic() < until:
            for pid in descendants(client.pid):
                if is_worker(pid) and pid not in killed:
                    killed.add(pid)
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.2)
        said = client.communicate(timeout=60)[1]
    finally:
        client.kill()
        client.wait(10)
    assert client.returncode == 2 and said.count("\n") == 1, said
    assert "failed: the image: its worker ended 2 times" in said
    assert len(killed) == 2


def test_a_worker_that_hangs(stage: Path, tmp_path: Path) -> None:
    """The worker is restarted, and another worker renders its task."""
    folder = made(stage, tmp_path, 2000, hang_s=8.0)
    client = client_of(folder)
    try:
        wait_for(lambda: parts_of(folder) or client.poll() is not None, 200)
        workers = [pid for pid in descendants(client.pid) if is_worker(pid)]
        os.kill(workers[0], signal.SIGSTOP)
        code = client.wait(200)
        said = client.communicate()[1]
    finally:
        client.kill()
        client.wait(10)
    assert code == 0, said
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 2000))


def is_worker(pid: int) -> bool:
    """Returns whether a process was started by a nanny and has loaded USD, so that it renders."""
    with contextlib.suppress(OSError):
        place = Path("/proc") / str(pid)
        spawned = b"spawn_main" in (place / "cmdline").read_bytes()
        return spawned and b"libusd" in (place / "maps").read_bytes()
    return False


def test_a_render_that_makes_no_progress(stage: Path, tmp_path: Path) -> None:
    """The watchdog ends a worker whose render makes no progress although its event loop runs."""
    folder = made(stage, tmp_path, 4)
    code = (
        "import os, sys, time; from wavecomb.farm.tasks import FarmPlugin, progress\n"
        "plugin = FarmPlugin(None, 1.0)\n"
        "import threading; threading.Thread(target=plugin._watch, daemon=True).start()\n"
        "time.sleep(2.2); print('idle', flush=True)\n"
        "with progress:\n"
        "  for _ in range(8): progress.note(); time.sleep(0.3)\n"
        "  print('busy', flush=True); time.sleep(60)\n"
    )
    started = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stdout) == (1, "idle\nbusy\n"), done.stderr
    assert time.monotonic() - started < 60 and folder.job.hang_s == 1800


def test_ctrl_c_keeps_what_is_done(stage: Path, tmp_path: Path) -> None:
    folder = made(stage, tmp_path, 4000)
    client = client_of(folder)
    try:
        wait_for(lambda: parts_of(folder) or client.poll() is not None, 200)
        client.send_signal(signal.SIGINT)
        said = client.communicate(timeout=60)[1]
    finally:
        client.kill()
        client.wait(10)
    assert client.returncode == 130 and said.count("\n") == 1, said
    assert said.startswith("stopped: 0 of 1 images are written") and "farm resume" in said
    kept = {file: file.stat().st_mtime_ns for file in parts_of(folder)}
    assert kept
    client = client_of(folder)
    try:
        wait_for(lambda: len(parts_of(folder)) > len(kept) or client.poll() is not None, 200)
        again = {file: file.stat().st_mtime_ns for file in kept if file.exists()}
        assert again.items() <= kept.items(), "finished tiles are not rendered again"
        assert client.wait(200) == 0
    finally:
        client.kill()
        client.wait(10)
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 4000))


# ---- two clients, disks --------------------------------------------------------------------------


def test_two_clients_on_one_job(stage: Path, tmp_path: Path) -> None:
    folder = made(stage, tmp_path, 1000)
    clients = [client_of(folder), client_of(folder)]
    try:
        for client in clients:
            said = client.communicate(timeout=300)[1]
            assert client.returncode == 0, said
    finally:
        for client in clients:
            client.kill()
            client.wait(10)
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 1000))
    assert not left_behind(tmp_path) and farm.status(folder).state == "done"


FULL = """
mount -t tmpfs -o size=400k none "$1" || exit 77
cd "$1"
"$PYTHON" -m wavecomb farm submit "$STAGE" -o a.exr --size 64 64 --spp 300 --threads 1 \\
  --tiles 2x2 --on none || exit 1
dd if=/dev/zero of=filler bs=1k 2> /dev/null
"$PYTHON" -m wavecomb farm resume a.farm --on local:2 --quiet
echo "CODE $?"
rm filler
"$PYTHON" -m wavecomb farm resume a.farm --on local:2 --quiet || exit 1
cp a.exr "$OUT"
"""


def test_a_disk_that_is_full(stage: Path, tmp_path: Path) -> None:
    """One line names the file, no partial file is left, and a retry with space gives the image."""
    disk, out = tmp_path / "disk", tmp_path / "out.exr"
    disk.mkdir()
    try:
        done = subprocess.run(
            ["unshare", "-Urm", "sh", "-c", FULL, "sh", str(disk)],
            env={**os.environ, "STAGE": str(stage), "OUT": str(out), "PYTHON": sys.executable},
            capture_output=True, text=True, timeout=280,
        )  # fmt: skip
    except FileNotFoundError:
        not_here("there is no unshare")
    if done.returncode == 77 or "unshare" in done.stderr:
        not_here("file systems cannot be mounted in a namespace")
    assert done.returncode == 0 and "CODE 2" in done.stdout, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1 and "No space left" in done.stderr, done.stderr
    same(out, one_process(stage, tmp_path, 300))


class _Future:
    """A fake future of a finished task."""

    def __init__(self, result: dict[str, object]) -> None:
        self.status, self.key, self._result = "finished", "x", result

    def result(self) -> dict[str, object]:
        return self._result


class _Client:
    """A fake client of a scheduler with two workers, one of which has a full disk."""

    status = "running"

    def __init__(self) -> None:
        self.amounts = {"one": 1, "two": 1}

    def scheduler_info(self, n_workers: int) -> dict[str, object]:
        return {
            "workers": {
                name: {"resources": {"wavecomb-x": amount}} for name, amount in self.amounts.items()
            }
        }

    def processing(self, workers: list[str]) -> dict[str, tuple[str, ...]]:
        return {workers[0]: ()}


def test_a_full_disk_on_one_worker(stage: Path, tmp_path: Path) -> None:
    """The tile goes to another worker. Without another worker, the command names the reason."""
    folder, client = made(stage, tmp_path, 1), _Client()
    run = Run(
        folder, Cluster(client, "--on x"), Outcome(16, 1), show=lambda out: None,
        warn=lambda line: None, is_stopped=lambda: False,
    )  # fmt: skip
    run._machine, run._checks[0], run._missing[0] = "wavecomb-x", 0, set(range(16))
    full = {"done": [], "failed": [], "full": "p.exr: cannot be written: No space left",
            "warnings": [], "seconds": 0.1, "worker": "one"}  # fmt: skip
    future = _Future(full)
    run._flying[future] = Batch([Task(0, 3)])
    client.amounts["one"] = 0
    run._fetch(future)
    run._take(*run._ended.get(timeout=1))
    assert [batch.tiles for batch in run._ready] == [[Task(0, 3)]] and not run._out.failed
    run._workers.query()
    assert run._capacity() == 1
    run._check()
    client.amounts["two"] = 0
    run._workers._next_query = 0.0
    run._workers.query()
    with pytest.raises(WavecombError, match="No space left"):
        run._check()
