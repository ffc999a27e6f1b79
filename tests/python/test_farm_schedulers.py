# SPDX-License-Identifier: Apache-2.0
"""Jobs by other schedulers: Dask, with and without certificates, and Slurm."""

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
from wavecomb.farm.certificates import NAMES, make_certificates
from wavecomb.farm.dask_engine import Tls, parse_address
from wavecomb.farm.engines import parse_engine
from wavecomb.farm.folder import BUSY, DONE, Folder

pytestmark = needs("wavecomb._core")

DASK = needs("distributed", "cryptography")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def made(stage: Path, place: Path, spp: int = 4) -> Folder:
    return farm.submit(
        stage, place / "a.exr", tiles="2x2", size=(48, 32), spp=spp, threads=1, strict=False
    )


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
    with pytest.raises(WavecombError, match="is neither of this machine nor tls://"):
        parse_engine(f"dask:{text}")


def test_addresses() -> None:
    for text in ("", "x", "127.0.0.1", "ucx://127.0.0.1:1", "inproc://1/2", "tls://h:99999", ":1"):
        with pytest.raises(WavecombError, match="must be dask:HOST:PORT"):
            parse_address(text)
    assert parse_address("[::1]:8786") == "tcp://[::1]:8786"
    assert parse_address("localhost:8786") == "tcp://localhost:8786"
    with pytest.raises(WavecombError, match=r"needs --tls-ca, --tls-cert and --tls-key"):
        parse_engine("dask:tls://farm:8786", Tls(ca="x"))
    for text in ("local", "dask:127.0.0.1:8786"):
        with pytest.raises(WavecombError, match=r"--tls-\.\.\. are for"):
            parse_engine(text, Tls("ca", "cert", "key"))
    assert parse_engine("slurm").count == 4 and parse_engine("slurm:9").count == 9
    for text in ("slurm:0", "slurm:x", "local:0", "dask", "none:1"):
        with pytest.raises(WavecombError, match=f"--on {text}: must be"):
            parse_engine(text)


@DASK
def test_certificates(tmp_path: Path) -> None:
    """Signed by one authority; keys are their owner's alone; nothing is written over."""
    folder = tmp_path / "tls"
    done = forks.wavecomb("farm", "certificates", folder)
    assert done.returncode == 0 and done.stdout.count("wrote") == 7, done.stderr
    from cryptography import x509

    authority = x509.load_pem_x509_certificate((folder / "ca.pem").read_bytes())
    for name in NAMES:
        own = x509.load_pem_x509_certificate((folder / f"{name}.pem").read_bytes())
        own.verify_directly_issued_by(authority)
        assert stat.S_IMODE((folder / f"{name}.key").stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not (folder / "ca.key").exists()
    with pytest.raises(WavecombError, match="is there already"):
        make_certificates(folder)


# ---- Dask ----------------------------------------------------------------------------------------


@contextlib.contextmanager
def cluster(place: Path, tls: Path | None = None, workers: int = 2) -> Iterator[str]:
    """A scheduler and workers on loopback; the scheduler's address."""
    address, running = place / "scheduler.json", []
    environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}

    def start(kind: str, *words: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words]
        command += ["--scheduler-file", str(address), "--host", "127.0.0.1", "--no-dashboard"]
        if tls is not None:
            command += ["--tls-ca-file", str(tls / "ca.pem"), "--protocol", "tls"]
            command += ["--tls-cert", str(tls / f"{kind}.pem")]
            command += ["--tls-key", str(tls / f"{kind}.key")]
        with (place / f"{kind}{len(running)}.log").open("wb") as log:
            running.append(
                subprocess.Popen(command, stdout=log, stderr=log, cwd=place, env=environment)
            )

    try:
        start("scheduler", "--port", "0")
        for _ in range(workers):
            start("worker", "--nthreads", "1", "--no-nanny", "--death-timeout", "60")

        def found() -> str:
            with contextlib.suppress(OSError, ValueError):
                return str(json.loads(address.read_text())["address"])
            return ""

        yield wait_for(found, 60)
    finally:
        for process in reversed(running):
            process.kill()
        for process in running:
            process.wait(10)


@DASK
@pytest.mark.long
def test_by_dask(stage: Path, tmp_path: Path) -> None:
    """A worker on each of the cluster; the bits of one process; no process is left."""
    folder = made(stage, tmp_path)
    with cluster(tmp_path) as address:
        assert address.startswith("tcp://127.0.0.1")
        done = forks.wavecomb("farm", "resume", folder.path, "--on", f"dask:{address}", timeout=150)
        assert done.returncode == 0, done.stderr
        assert "all workers of the cluster" in done.stdout
        wait_for(lambda: not processes_of(folder.path), 30)
        # A worker that may not work on the job: named, and not started for ever.
        (tmp_path / "a.exr").unlink()
        mine = json.loads((folder.path / "class.json").read_text())
        (folder.path / "class.json").write_text(json.dumps({**mine, "isa": "avx9"}))
        done = forks.wavecomb("farm", "resume", folder.path, "--on", f"dask:{address}", timeout=150)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
        assert "is of another class" in done.stderr
    (folder.path / "class.json").write_text(json.dumps(mine))
    assert forks.wavecomb("farm", "resume", folder.path).returncode == 0
    same(tmp_path / "a.exr", one_process(stage, tmp_path))


@DASK
@pytest.mark.slow
def test_by_dask_with_certificates(stage: Path, tmp_path: Path) -> None:
    """Who has none does not get in. Ctrl-C stops workers, which keep what they have."""
    tls, others = tmp_path / "tls", tmp_path / "others"
    make_certificates(tls)
    make_certificates(others)
    folder = made(stage, tmp_path, 2000)

    def words(certificates: Path) -> list[str]:
        return [
            "farm", "resume", str(folder.path), "--quiet", "--on", f"dask:{address}",
            "--tls-ca", str(certificates / "ca.pem"),
            "--tls-cert", str(certificates / "client.pem"),
            "--tls-key", str(certificates / "client.key"),
        ]  # fmt: skip

    with cluster(tmp_path, tls, workers=1) as address:
        assert address.startswith("tls://127.0.0.1")
        done = forks.wavecomb(*words(others))
        assert done.returncode == 2 and "no scheduler answers" in done.stderr, done.stderr
        assert done.stderr.count("\n") == 1
        client = subprocess.Popen(
            [sys.executable, "-m", "wavecomb", *words(tls)], stderr=subprocess.PIPE, text=True
        )
        try:
            wait_for(lambda: folder.ids(BUSY) or client.poll() is not None)
            wait_for(lambda: processes_of(folder.path, "farm.child") or client.poll() is not None)
            client.send_signal(signal.SIGINT)
            _, said = client.communicate(timeout=90)
        finally:
            client.kill()
            client.wait(10)
        assert client.returncode == 130 and "stopped: " in said, said
        wait_for(lambda: not processes_of(folder.path, "farm\0worker"), 30)
        assert not folder.ids(BUSY) and not (folder.path / "cancel").exists()
        done = forks.wavecomb(*words(tls), timeout=150)
        assert done.returncode == 0, done.stderr
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 2000))


@DASK
@pytest.mark.long
def test_a_client_that_goes_away(stage: Path, tmp_path: Path) -> None:
    """Its workers go on without it."""
    folder = made(stage, tmp_path, 2000)
    words = [sys.executable, "-m", "wavecomb", "farm", "resume", str(folder.path), "--quiet"]
    with cluster(tmp_path) as address:
        client = subprocess.Popen([*words, "--on", f"dask:{address}"])
        try:
            wait_for(lambda: folder.ids(BUSY) or client.poll() is not None)
        finally:
            client.kill()
            client.wait(10)
        wait_for(lambda: farm.status(folder)["state"] == "done", 120)
        wait_for(lambda: not processes_of(folder.path), 30)
    same(tmp_path / "a.exr", one_process(stage, tmp_path, 2000))


# ---- Slurm ---------------------------------------------------------------------------------------

SBATCH = """#!/bin/sh
echo "$@" >> "$HERE/sbatch.log"
for i in 1 2; do
  SLURM_ARRAY_TASK_ID=$i SLURM_CPUS_PER_TASK=1 setsid bash "$2" > "$HERE/$i.log" 2>&1 < /dev/null &
  echo $! >> "$HERE/pids"
done
echo "4711;cluster"
"""
SQUEUE = """#!/bin/sh
for i in $(cat "$HERE/pids"); do kill -0 $i 2> /dev/null && echo "4711 R"; done
exit 0
"""
SCANCEL = """#!/bin/sh
echo "$@" >> "$HERE/scancel.log"
for i in $(cat "$HERE/pids"); do kill -TERM $i 2> /dev/null; done
exit 0
"""


@pytest.mark.slow
def test_by_slurm(stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands for Slurm here starts the script as an array of two."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name, text in (("sbatch", SBATCH), ("squeue", SQUEUE), ("scancel", SCANCEL)):
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setenv("HERE", str(tmp_path))
    folder = made(stage, tmp_path)
    done = forks.wavecomb("farm", "resume", folder.path, "--on", "slurm:2", timeout=150)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "5 tasks for 2 workers" in done.stdout
    script = folder.path / "slurm.sh"
    assert (tmp_path / "sbatch.log").read_text() == f"--parsable {script}\n"
    assert "--array=1-2" in script.read_text()
    assert (tmp_path / "scancel.log").read_text() == "4711\n"
    assert len(folder.ids(DONE)) == 5
    same(tmp_path / "a.exr", one_process(stage, tmp_path))
    wait_for(lambda: not processes_of(folder.path), 30)
    (programs / "sbatch").write_text("#!/bin/sh\necho 'sbatch: error: no partition' >&2\nexit 1\n")
    (tmp_path / "a.exr").unlink()
    done = forks.wavecomb("farm", "resume", folder.path, "--on", "slurm")
    assert done.returncode == 2, done.stdout
    assert done.stderr == "error: --on slurm: sbatch: sbatch: error: no partition\n"
    (programs / "sbatch").unlink()
    done = forks.wavecomb("farm", "resume", folder.path, "--on", "slurm")
    assert done.returncode == 2 and "the command sbatch is not here" in done.stderr
