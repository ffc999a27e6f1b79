# SPDX-License-Identifier: Apache-2.0
"""Tests farm jobs on Dask clusters, with and without TLS, and on Slurm."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import forks
import pytest
from farm_jobs import cornell_in, processes_of, same, wait_for
from parts import needs

from wavecomb import farm
from wavecomb.errors import WavecombError
from wavecomb.farm.clusters import parse_address, parse_cluster
from wavecomb.farm.folder import Folder

pytestmark = needs("wavecomb._core", "distributed", "cryptography")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def made(stage: Path, place: Path, spp: int = 4) -> Folder:
    return farm.submit(stage, place / "a.exr", tiles="2x2", size=(48, 32), spp=spp, threads=1)


def one_process(stage: Path, place: Path, spp: int = 4) -> Path:
    words = ("--size", "48", "32", "--spp", str(spp), "--threads", "1")
    done = forks.wavecomb("render", stage, "-o", place / "one.exr", *words)
    assert done.returncode == 0, done.stderr
    return place / "one.exr"


# ---- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["10.0.0.1:8786", "tcp://farm:8786", "0.0.0.0:1", "[::]:1", "localhost.example.org:1"]
)
def test_addresses_that_are_open_to_others(text: str) -> None:
    with pytest.raises(WavecombError, match="is neither an address of this machine nor tls://"):
        parse_cluster(f"dask:{text}")


def test_addresses() -> None:
    for text in (
        "",
        "x",
        "127.0.0.1",
        "ucx://127.0.0.1:1",
        "inproc://1/2",
        ":1",
        "a\nb:1",
        "h:1_0",
    ):
        with pytest.raises(WavecombError, match="must be dask:HOST:PORT"):
            parse_address(text)
    with pytest.raises(WavecombError, match="is neither"):
        parse_address("tls://h:99999")
    assert parse_address("[::1]:8786") == "tcp://[::1]:8786"
    assert parse_address("localhost:8786") == "tcp://localhost:8786"
    assert parse_cluster("dask:tls://farm:8786").address == "tls://farm:8786"
    assert parse_cluster("slurm").workers == 4 and parse_cluster("slurm:9").workers == 9
    for text in (
        "slurm:0",
        "slurm:x",
        "local:0",
        "local:1025",
        "dask",
        "none:1",
        "ssh:a",
        "local:²",
    ):
        with pytest.raises(WavecombError, match=f"--on {text}: must be"):
            parse_cluster(text)


# ---- Dask ----------------------------------------------------------------------------------------


class Cluster:
    """A scheduler and workers on loopback.

    Attributes:
        address: Address of the scheduler.
        scheduler: Process of the scheduler.
        workers: Processes of the workers.
    """

    def __init__(self, place: Path, words: list[str], environment: dict[str, str]) -> None:
        self._place = place
        self._words = words
        self._environment = environment
        self._file = place / "scheduler.json"
        self.scheduler = self._start("scheduler", "--port", "0")
        self.workers: list[subprocess.Popen[bytes]] = []
        self.address = wait_for(self._found, 100)

    def _start(self, kind: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-I", "-m", f"distributed.cli.dask_{kind}", *words]
        command += ["--scheduler-file", str(self._file), "--host", "127.0.0.1", "--no-dashboard"]
        with (self._place / f"{kind}.log").open("ab") as log:
            return subprocess.Popen(
                [*command, *self._words], stdout=log, stderr=log, cwd=self._place,
                env=self._environment,
            )  # fmt: skip

    def _found(self) -> str:
        with contextlib.suppress(OSError, ValueError):
            return str(json.loads(self._file.read_text())["address"])
        return ""

    def add_worker(self, *words: str) -> None:
        self.workers.append(self._start("worker", "--nthreads", "1", *words))

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait(10)


@contextlib.contextmanager
def cluster(
    place: Path, workers: int = 2, words: list[str] | None = None, **variables: str
) -> Iterator[Cluster]:
    found = Cluster(place, words or [], {**os.environ, **variables})
    try:
        for _ in range(workers):
            found.add_worker()
        yield found
    finally:
        found.close()


@pytest.mark.slow
def test_by_dask(stage: Path, tmp_path: Path) -> None:
    """The image equals the image of a render in one process. Workers read a changed stage again."""
    here = tmp_path / "s.usda"
    here.write_text(f"#usda 1.0\n( subLayers = [@{stage}@] )\n")
    folder = made(here, tmp_path)
    with cluster(tmp_path) as dask:
        assert dask.address.startswith("tcp://127.0.0.1")
        words = ("farm", "resume", folder.path, "--on", f"dask:{dask.address}")
        done = forks.wavecomb(*words, timeout=150)
        assert done.returncode == 0, done.stderr
        same(tmp_path / "a.exr", one_process(here, tmp_path))
        first = (tmp_path / "a.exr").read_bytes()
        from pxr import Usd, UsdLux

        opened = Usd.Stage.Open(str(here))
        light = next(p for p in opened.Traverse() if p.HasAPI(UsdLux.LightAPI))
        UsdLux.LightAPI(light).GetIntensityAttr().Set(0.25)
        opened.GetRootLayer().Save()
        done = forks.wavecomb(*words, timeout=150)
        assert done.returncode == 0 and "1 files of the stage have changed" in done.stdout
    same(tmp_path / "a.exr", one_process(here, tmp_path))
    assert (tmp_path / "a.exr").read_bytes() != first, "or nothing is tested"


def certificates(place: Path) -> dict[str, str]:
    """Writes new TLS certificates. Returns environment variables with their paths for Dask."""
    from distributed import Security

    place.mkdir()
    found = Security.temporary()
    out = {"DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "True"}
    for name, value in (("ca", found.tls_ca_file), ("key", found.tls_client_key)):
        (place / name).write_text(value)
    out["DASK_DISTRIBUTED__COMM__TLS__CA_FILE"] = str(place / "ca")
    for role in ("CLIENT", "SCHEDULER", "WORKER"):
        out[f"DASK_DISTRIBUTED__COMM__TLS__{role}__CERT"] = str(place / "ca")
        out[f"DASK_DISTRIBUTED__COMM__TLS__{role}__KEY"] = str(place / "key")
    return out


@pytest.mark.slow
def test_by_dask_with_its_own_tls(stage: Path, tmp_path: Path) -> None:
    """A client with other certificates is refused. Ctrl-C stops the rendering workers."""
    mine, others = certificates(tmp_path / "tls"), certificates(tmp_path / "others")
    folder = made(stage, tmp_path, 20_000)
    with cluster(tmp_path, 1, ["--protocol", "tls"], **mine) as dask:
        assert dask.address.startswith("tls://127.0.0.1")
        words = ["farm", "resume", str(folder.path), "--quiet", "--on", f"dask:{dask.address}"]
        command = [sys.executable, "-m", "wavecomb", *words]
        refused = subprocess.run(
            command, env={**os.environ, **others}, capture_output=True, text=True, timeout=100
        )
        assert refused.returncode == 2 and "no scheduler answers" in refused.stderr
        assert refused.stderr.count("\n") == 1, refused.stderr
        client = subprocess.Popen(
            command, env={**os.environ, **mine}, stderr=subprocess.PIPE, text=True
        )
        try:
            wait_for(lambda: list(folder.path.rglob("*.exr")) or client.poll() is not None, 120)
            client.send_signal(signal.SIGINT)
            _, said = client.communicate(timeout=60)
        finally:
            client.kill()
            client.wait(10)
        assert client.returncode == 130 and said.startswith("stopped: 0 of 1 images"), said
        assert "farm resume" in said and said.count("\n") == 1
        before = len(list(folder.path.rglob("*.exr")))
        wait_for(lambda: idle(dask.address, mine), 60)
        assert len(list(folder.path.rglob("*.exr"))) == before, "what was begun is stopped"
        done = subprocess.run(
            command, env={**os.environ, **mine}, capture_output=True, text=True, timeout=200
        )
        assert done.returncode == 0, done.stderr
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 20_000))


IDLE = """
import sys, distributed
client = distributed.Client(sys.argv[1], set_as_default=False)
def cpu(): import psutil; return psutil.Process().cpu_percent(0.5)
print(max(client.run(cpu).values()))
"""


def idle(address: str, variables: dict[str, str]) -> bool:
    """Returns whether all workers of a cluster are idle."""
    done = subprocess.run(
        [sys.executable, "-c", IDLE, address], env={**os.environ, **variables},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    return done.returncode == 0 and float(done.stdout) < 20.0


@pytest.mark.slow
def test_a_scheduler_that_ends(stage: Path, tmp_path: Path) -> None:
    """The client ends with one line, and the job can be resumed elsewhere."""
    folder = made(stage, tmp_path, 8000)
    with cluster(tmp_path, 1) as dask:
        words = ["farm", "resume", str(folder.path), "--quiet", "--on", f"dask:{dask.address}"]
        client = subprocess.Popen(
            [sys.executable, "-m", "wavecomb", *words], stderr=subprocess.PIPE, text=True
        )
        try:
            wait_for(lambda: list(folder.path.rglob("*.exr")) or client.poll() is not None, 120)
            dask.scheduler.kill()
            _, said = client.communicate(timeout=100)
        finally:
            client.kill()
            client.wait(10)
        assert client.returncode == 2 and said.count("\n") == 1, said
        assert "the scheduler is gone" in said and "farm resume" in said
    assert forks.wavecomb("farm", "resume", folder.path, timeout=200).returncode == 0
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 8000))


@pytest.mark.slow
def test_a_cluster_without_workers(stage: Path, tmp_path: Path) -> None:
    folder = made(stage, tmp_path)
    with cluster(tmp_path, 0) as dask:
        words = ["farm", "resume", str(folder.path), "--on", f"dask:{dask.address}"]
        code = "import wavecomb.farm.client as c, sys; c._NOBODY_S = 1.0; "
        code += "from wavecomb.farm import clusters; clusters.DASK_WAIT_S = 2.0; "
        code += "sys.argv[:] = ['wavecomb', *sys.argv[1:]]; from wavecomb.cli import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=100
        )
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert "no workers came in 2 s" in done.stderr


@pytest.mark.slow
def test_one_image_is_of_one_class(stage: Path, tmp_path: Path) -> None:
    """A worker of another machine class gets no task. The farm prefers the machine class that has
    rendered parts.
    """
    folder = made(stage, tmp_path)
    other = "import wavecomb.farm.machine_class as m; m.probe_hash = lambda: 'other'"
    (tmp_path / "other.py").write_text(other)
    assert forks.wavecomb("farm", "task", folder.path, "--tile", "1/4").returncode == 0
    with cluster(tmp_path, 1) as dask:
        for _ in range(2):
            dask.add_worker("--preload", str(tmp_path / "other.py"))
        count = "import sys, distributed as d; c = d.Client(sys.argv[1]); c.wait_for_workers(3)"
        subprocess.run([sys.executable, "-c", count, dask.address], check=True, timeout=100)
        done = forks.wavecomb(
            "farm", "resume", folder.path, "--on", f"dask:{dask.address}", timeout=150
        )
        assert done.returncode == 0, done.stderr
        assert "2 workers are of another class of machines" in done.stderr
    same(tmp_path / "a.exr", one_process(stage, tmp_path))


@pytest.mark.slow
def test_a_full_disk_on_one_worker(stage: Path, tmp_path: Path) -> None:
    """A worker with a full disk gets no more tasks, and the other one renders all."""
    folder = made(stage, tmp_path)
    limit = "import resource\ndef dask_setup(worker):\n"
    limit += "    resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))\n"
    (tmp_path / "limit.py").write_text(limit)
    with cluster(tmp_path, 1) as dask:
        dask.add_worker("--preload", str(tmp_path / "limit.py"))
        words = ("farm", "resume", folder.path, "--on", f"dask:{dask.address}")
        count = "import sys, distributed as d; c = d.Client(sys.argv[1]); c.wait_for_workers(2)"
        subprocess.run([sys.executable, "-c", count, dask.address], check=True, timeout=100)
        done = forks.wavecomb(*words, timeout=150)
        assert done.returncode == 0, done.stderr
        same(tmp_path / "a.exr", one_process(stage, tmp_path))
        (tmp_path / "a.exr").unlink()
        dask.workers[0].kill()
        done = forks.wavecomb(*words, timeout=150)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert "cannot be written: File too large" in done.stderr


# ---- Slurm ---------------------------------------------------------------------------------------

SBATCH = """#!/bin/sh
for word in "$@"; do printf '%s\\n' "$word" >> "$HERE/sbatch.log"; done
while [ "${1#--}" != "$1" ]; do
  case $1 in --array=1-*) count=${1#--array=1-};; esac
  shift
done
for i in $(seq "$count"); do
  SLURM_ARRAY_TASK_ID=$i SLURM_CPUS_PER_TASK=1 setsid sh "$@" > "$HERE/$i.log" 2>&1 < /dev/null &
  echo $! >> "$HERE/pids"
done
echo "4711;cluster"
"""
SQUEUE = """#!/bin/sh
for i in $(cat "$HERE/pids"); do
  case "$(sed 's/.*) //' "/proc/$i/stat" 2> /dev/null)" in "" | Z*) ;; *) echo "4711 R";; esac
done
exit 0
"""
SCANCEL = """#!/bin/sh
echo "$@" >> "$HERE/scancel.log"
for i in $(cat "$HERE/pids"); do kill -TERM -$i 2> /dev/null; done
exit 0
"""


@pytest.fixture
def slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Fake Slurm programs: sbatch runs its script as an array."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name, text in (("sbatch", SBATCH), ("squeue", SQUEUE), ("scancel", SCANCEL)):
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setenv("HERE", str(tmp_path))
    return programs


@pytest.mark.slow
def test_by_slurm(stage: Path, tmp_path: Path, slurm: Path) -> None:
    """The folder name contains shell code. Slurm workers at the end of their time limit are
    replaced.
    """
    place = tmp_path / "a\n#SBATCH --x\ntouch RAN; $(touch RAN)"
    place.mkdir()
    folder = made(stage, place, 20_000)
    words = [sys.executable, "-m", "wavecomb", "farm", "resume", str(folder.path), "--quiet"]
    client = subprocess.Popen(
        [*words, "--on", "slurm:2"], stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    try:
        wait_for(lambda: list(folder.path.rglob("*.exr")) or client.poll() is not None, 120)
        assert client.poll() is None, client.communicate()[1]
        secrets = next(folder.path.glob(".cluster-*"))
        assert stat.S_IMODE(secrets.stat().st_mode) == 0o700
        assert stat.S_IMODE((secrets / "tls.json").stat().st_mode) == 0o600
        for number in (tmp_path / "pids").read_text().split():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(int(number), signal.SIGTERM)
        _, said = client.communicate(timeout=200)
    finally:
        client.kill()
        client.wait(10)
    assert client.returncode == 0, said
    assert "4711" in (tmp_path / "scancel.log").read_text()
    log = (tmp_path / "sbatch.log").read_text()
    assert log.count("--parsable") > 1, "those that ended were replaced"
    assert not list(folder.path.glob(".cluster-*")) and not (tmp_path / "RAN").exists()
    same(place / "a.exr", one_process(stage, tmp_path, 20_000))
    wait_for(lambda: not processes_of(folder.path), 30)


ENDS_WITH_RESULT = """
import os, pathlib, signal
from distributed import Worker
fetch = Worker.get_data
async def get_data(self, comm, keys, who=None, serializers=None):
    try:
        pathlib.Path(os.environ["HERE"], "ended").touch(exist_ok=False)
    except FileExistsError:
        return await fetch(self, comm, keys, who, serializers)
    os.killpg(0, signal.SIGKILL)
def dask_setup(worker):
    worker.handlers["get_data"] = get_data.__get__(worker)
"""


@pytest.mark.slow
def test_a_worker_that_ends_with_a_result(
    stage: Path, tmp_path: Path, slurm: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client does not wait for a lost result that only a new worker could compute again."""
    (tmp_path / "ends.py").write_text(ENDS_WITH_RESULT)
    monkeypatch.setenv("DASK_DISTRIBUTED__WORKER__PRELOAD", str(tmp_path / "ends.py"))
    folder = made(stage, tmp_path)
    # Slurm is asked often for its workers, so that the new worker starts soon.
    code = "import sys; from wavecomb.farm import clusters; clusters._ASK_S = 1.0; "
    code += "sys.argv[:] = ['wavecomb', *sys.argv[1:]]; from wavecomb.cli import main; main()"
    done = forks.code(code, "farm", "resume", folder.path, "--on", "slurm:1", timeout=150)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "ended").exists(), "or nothing is tested"
    same(tmp_path / "a.exr", one_process(stage, tmp_path))


@pytest.mark.slow
def test_slurm_that_refuses(stage: Path, tmp_path: Path, slurm: Path) -> None:
    folder = made(stage, tmp_path)
    words = ("farm", "resume", folder.path, "--on", "slurm")
    (slurm / "sbatch").write_text("#!/bin/sh\necho 'sbatch: error: no partition' >&2\nexit 1\n")
    done = forks.wavecomb(*words)
    assert done.returncode == 2, done.stdout
    assert done.stderr == "error: --on slurm: sbatch: sbatch: error: no partition\n"
    (slurm / "sbatch").write_text("#!/bin/sh\necho hello\n")
    done = forks.wavecomb(*words)
    assert done.returncode == 2 and "sbatch gave no job number: 'hello'" in done.stderr
    (slurm / "sbatch").unlink()
    done = forks.wavecomb(*words)
    assert done.returncode == 2 and "the command sbatch is not installed" in done.stderr
