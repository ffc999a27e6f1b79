# SPDX-License-Identifier: Apache-2.0
"""Fuzzes the loader and the renderer with thousands of broken inputs: ``make fuzz MINUTES=10``.

A case is determined by its kind, the seed and a number (``fuzz_cases``). Workers (``fuzz_worker``)
load and render cases one after another, without a sandbox, so that crashes of libraries are seen. A
case that crashes its worker or exceeds the time limit is then given to ``wavecomb render``, as a
user would run it. The command must print one clear line and exit with code 2 within the limit.

    python tests/python/fuzz_stages.py                       # 2,000 cases of seed 1, a table
    python tests/python/fuzz_stages.py --minutes 10          # as many as fit, a summary for docs
    python tests/python/fuzz_stages.py --only "usdc bits" --keep out/fuzz
    python tests/python/fuzz_stages.py --case "usdc bits/17" --keep out/fuzz
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from fuzz_cases import KINDS, make_case, plan
from fuzz_inputs import BY_COMMAND, words_for
from fuzz_seeds import stage_text

GOOD = ("rendered", "warned", "refused", "contained")
"""Acceptable outcomes. All other outcomes are faults."""

WORKER_BYTES = 3 << 30
LIMIT_S = 10.0


@dataclass(frozen=True)
class Verdict:
    """Result of a case.

    Attributes:
        kind: One of ``KINDS``.
        number: Number of the case within its kind.
        outcome: rendered, warned, refused or contained (a library crashed, and the user got one
            line); wrong or hang, which are faults.
        said: Message of the loader, or description of the fault.
        seconds: Time of the worker or of the command.
        death: Reason why the worker ended, if it ended.
    """

    kind: str
    number: int
    outcome: str
    said: str
    seconds: float
    death: str = ""

    @property
    def name(self) -> str:
        """Parses the argument of --case and returns it."""
        return f"{self.kind}/{self.number}"


class Watch:
    """Limit on the CPU time of a process and its children.

    Since the limit is on CPU time, a busy machine that halts processes for a while causes no false
    hangs. A longer limit on wall-clock time detects a process that waits forever.
    """

    PATIENCE = 12

    def __init__(self, pid: int, limit_s: float) -> None:
        self._pid = pid
        self._limit_s = limit_s
        self._last, self._cpu = time.monotonic(), self._cpu_s()
        self._busy_s = self._idle_s = 0.0

    def is_over(self) -> bool:
        """Returns whether the process exceeds a limit. The caller calls this function about ten
        times per second.
        """
        now, cpu = time.monotonic(), self._cpu_s()
        passed, computed = now - self._last, max(0.0, cpu - self._cpu)
        self._busy_s += min(passed, computed)
        # A gap of a second or more means that this process was halted, and that the supervised
        # process was halted as well.
        self._idle_s += passed if passed < 1.0 else 0.0
        self._last, self._cpu = now, cpu
        return self._busy_s > self._limit_s or self._idle_s > self.PATIENCE * self._limit_s

    def _cpu_s(self) -> float:
        pids, total = [self._pid], 0.0
        for pid in pids:
            with contextlib.suppress(OSError):
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
                pids += map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
        return total


class Worker:
    """Worker process that reads cases, restarted after it ended."""

    def __init__(self, limit_s: float, folder: Path) -> None:
        self._folder = folder
        self._limit_s = limit_s
        self._process: subprocess.Popen[str] | None = None

    def judge(self, stage: Path) -> tuple[str, str, str]:
        """Returns (outcome, message, reason why the worker ended). The outcome is "died" or "hang"
        if the worker does not answer.
        """
        process = self._started()
        assert process.stdin is not None
        process.stdin.write(f"{stage}\n")
        process.stdin.flush()
        answer = self._answer(process, self._limit_s)
        if isinstance(answer, dict):
            if "ended" in answer:
                self.close()
            return answer["outcome"], answer["said"], ""
        self.close()
        if answer == "hang":
            return "hang", f"no answer within {self._limit_s:g} s", "stopped"
        code = process.returncode
        return "died", "", signal.Signals(-code).name if code < 0 else f"code {code}"

    def start(self) -> None:
        """Starts the process if it is not running."""
        self._started()

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None:
            script = Path(__file__).with_name("fuzz_worker.py")
            sound = self._folder / "sound.usda"
            sound.write_text(stage_text())
            self._process = subprocess.Popen(
                [sys.executable, str(script), str(WORKER_BYTES), str(sound)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=environment(self._folder),
                cwd=self._folder / "work",
            )
            assert isinstance(self._answer(self._process, 60.0), dict), "the worker does not start"
        return self._process

    @staticmethod
    def _answer(process: subprocess.Popen[str], limit_s: float) -> dict[str, Any] | str:
        assert process.stdout is not None
        watch = Watch(process.pid, limit_s)
        while not select.select([process.stdout], [], [], 0.1)[0]:
            if watch.is_over():
                process.kill()
                process.wait()
                return "hang"
        line = process.stdout.readline()
        if not line:
            process.wait()
            return "died"
        return json.loads(line)

    def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is not None:
            assert process.stdin is not None and process.stdout is not None
            process.kill()
            process.wait()
            process.stdin.close()
            process.stdout.close()


PLACES = ("home", "work", "tmp")
"""Folders that worker processes use in addition to the folders of the cases."""


def environment(place: Path) -> dict[str, str]:
    """Returns environment variables that keep the files of a process below a folder."""
    for name in PLACES:
        (place / name).mkdir(exist_ok=True)
    own = {"HOME": "home", "XDG_CACHE_HOME": "home", "TMPDIR": "tmp"}
    return os.environ | {name: str(place / folder) for name, folder in own.items()}


def strays(place: Path, before: set[Path], case: Path) -> list[str]:
    """Returns the new files in a folder, except the files of the case."""
    now = {path for path in place.rglob("*") if not path.is_relative_to(case)}
    return sorted(str(path) for path in now - before if "tmp" not in path.parts[-2:])


def command_line(case: Path, limit_s: float, *, named: bool = False) -> tuple[str, str]:
    """Runs ``wavecomb`` on a case as a user would. Returns (outcome, said).

    ``named`` says whether the stage itself names its image files.
    """
    words = words_for(case)
    out = Path(words[words.index("-o") + 1])
    if named:
        words = ["render", case.name, "--spp", "1", "--quiet"]
    command = [sys.executable, "-m", "wavecomb", *words]
    with tempfile.TemporaryFile("w+", errors="replace") as stderr:
        done = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            env=environment(case.parents[1]),
            cwd=case.parent,
        )
        watch = Watch(done.pid, limit_s)
        while done.poll() is None:
            time.sleep(0.05)
            if watch.is_over():
                done.kill()
                done.wait()
                return "hang", f"wavecomb {words[0]}: no end within {limit_s:g} s"
        stderr.seek(0)
        text = stderr.read()
    lines = text.splitlines()
    errors = [line for line in lines if line.startswith("error: ")]
    others = [line for line in lines if not line.startswith(("error: ", "warning: "))]
    if others or done.returncode not in (0, 2) or len(errors) != (done.returncode == 2):
        return "wrong", f"wavecomb {words[0]}: code {done.returncode}: {text}"
    if named:
        return ("refused" if errors else "rendered"), "; ".join(lines)
    if out.exists() != (done.returncode == 0):
        return "wrong", f"wavecomb {words[0]}: code {done.returncode}, and its file: {out.exists()}"
    return "contained", errors[0] if errors else "; ".join(lines)


def check(
    worker: Worker, kind: str, number: int, seed: int, folder: Path, limit_s: float
) -> Verdict:
    """Makes a case in an empty folder and checks it."""
    case = make_case(kind, seed, number, folder)
    worker.start()
    before = set(folder.parent.rglob("*"))
    start = time.monotonic()
    if kind in BY_COMMAND:
        outcome, said, death = *command_line(case, limit_s, named=True), ""
    else:
        outcome, said, death = worker.judge(case)
    if death:
        start = time.monotonic()
        outcome, said = command_line(case, limit_s)
    if stray := strays(folder.parent, before, folder):
        outcome, said = "wrong", f"outside of its folder: {', '.join(stray)}"
    return Verdict(kind, number, outcome, said, time.monotonic() - start, death)


def run(
    cases: Iterable[tuple[str, int]],
    *,
    seed: int = 1,
    jobs: int = 2,
    limit_s: float = LIMIT_S,
    keep: Path | None = None,
    until: float = math.inf,
) -> list[Verdict]:
    """Checks cases with several workers until a deadline. Copies faulty cases to ``keep``."""
    queue: SimpleQueue[tuple[int, tuple[str, int]]] = SimpleQueue()
    for case in enumerate(cases):
        queue.put(case)
    found: dict[int, Verdict] = {}

    def work() -> None:
        place = tempfile.TemporaryDirectory(prefix="wavecomb-fuzz-")
        worker = Worker(limit_s, Path(place.name))
        try:
            while time.monotonic() < until:
                try:
                    index, (kind, number) = queue.get_nowait()
                except Empty:
                    return
                with tempfile.TemporaryDirectory(dir=place.name) as name:
                    verdict = check(worker, kind, number, seed, Path(name), limit_s)
                    found[index] = verdict
                    if len(found) % 500 == 0:
                        print(f"{len(found)} cases", file=sys.stderr, flush=True)
                    if keep is not None and verdict.outcome not in GOOD:
                        target = keep / f"{seed}-{kind.replace(' ', '-')}-{number}"
                        shutil.copytree(name, target, dirs_exist_ok=True)
                        (target / "said.txt").write_text(f"{verdict}\n{verdict.said}\n")
        finally:
            worker.close()
            place.cleanup()

    with ThreadPoolExecutor(jobs) as pool:
        for future in [pool.submit(work) for _ in range(jobs)]:
            future.result()
    return [found[index] for index in sorted(found)]


def table(verdicts: list[Verdict]) -> str:
    """Returns outcomes by kind as a Markdown table."""
    columns = ("rendered", "warned", "refused", "contained", "wrong", "hang")
    lines = [
        f"| kind | cases | {' | '.join(columns)} | slowest s |",
        "| --- |" + " --- |" * (len(columns) + 2),
    ]
    kinds = list(dict.fromkeys(verdict.kind for verdict in verdicts))
    for kind in [*kinds, "all"]:
        mine = [verdict for verdict in verdicts if kind in (verdict.kind, "all")]
        counts = Counter(verdict.outcome for verdict in mine)
        slowest = max(verdict.seconds for verdict in mine)
        figures = " | ".join(str(counts[column] or "") for column in columns)
        lines.append(f"| {kind} | {len(mine)} | {figures} | {slowest:.1f} |")
    return "\n".join(lines)


GROUPS = {
    "usda": ".usda", "usdc": ".usdc", "usdz": ".usdz", "png": "PNG", "jpg": "JPEG", "exr": "EXR",
    "hdr": "Radiance", "ies": "IES", "mtlx": ".mtlx", "ply": "PLY", "obj": "OBJ",
    "checkpoint": "checkpoints", "merge": "pictures to merge", "costs": "cost profiles",
    "product": "names of products",
}  # fmt: skip


def summary(verdicts: list[Verdict], seed: int) -> str:
    """Returns the table of docs/testing.md: totals by group of kinds, with the commit."""
    columns = ("rendered", "warned", "refused", "contained", "wrong", "hang")
    heads = ("read", "with warnings", "refused", "contained crash", "wrong", "hang")
    rows: dict[str, Counter[str]] = {}
    for verdict in verdicts:
        name = GROUPS.get(verdict.kind.split()[0], verdict.kind)
        rows.setdefault(name, Counter())[verdict.outcome] += 1
    rows["all"] = sum(rows.values(), Counter())
    git = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    lines = [
        f"{len(verdicts)} cases of seed {seed} at {commit or 'no commit'}:\n",
        f"| what is broken | cases | {' | '.join(heads)} |",
        "| --- |" + " --- |" * (len(heads) + 1),
    ]
    for name, counts in rows.items():
        figures = " | ".join(str(counts[column] or "") for column in columns)
        lines.append(f"| {name} | {counts.total()} | {figures} |")
    return "\n".join(lines)


def main() -> int:
    """Runs the command. Returns 1 if there are faults."""
    parser = argparse.ArgumentParser(description="Fuzzes the loader.")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--minutes", type=float, help="as many cases as fit, instead of --cases")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", action="append", choices=KINDS, help="kinds; default: all")
    parser.add_argument("--case", action="append", metavar="KIND/NUMBER", help="only these")
    parser.add_argument(
        "--limit", type=float, default=LIMIT_S, help="seconds that a case may compute"
    )
    parser.add_argument("--keep", type=Path, help="folder for the files of faults (--case: of all)")
    parser.add_argument("--details", type=Path, help="JSON of all verdicts")
    options = parser.parse_args()
    cases = plan(options.cases if options.minutes is None else 1_000_000)
    if options.only:
        cases = [case for case in cases if case[0] in options.only]
    if options.case:
        cases = [(name.rpartition("/")[0], int(name.rpartition("/")[2])) for name in options.case]
        for kind, number in cases if options.keep else ():
            folder = options.keep / f"{options.seed}-{kind.replace(' ', '-')}-{number}"
            folder.mkdir(parents=True, exist_ok=True)
            print(make_case(kind, options.seed, number, folder))
    start = time.monotonic()
    verdicts = run(
        cases,
        seed=options.seed,
        jobs=options.jobs,
        limit_s=options.limit,
        keep=options.keep,
        until=math.inf if options.minutes is None else start + 60.0 * options.minutes,
    )
    print(table(verdicts))
    print("\n" + summary(verdicts, options.seed))
    print(f"\n{len(verdicts)} cases in {time.monotonic() - start:.0f} s")
    for verdict in verdicts:
        if verdict.outcome not in GOOD or options.case:
            print(f"\n{verdict.name}: {verdict.outcome} {verdict.death}\n{verdict.said}")
    deaths = Counter(f"{verdict.kind}: {verdict.death}" for verdict in verdicts if verdict.death)
    if deaths:
        print("\nworkers that ended:", ", ".join(f"{n} x {what}" for what, n in deaths.items()))
    if options.details:
        options.details.write_text(json.dumps([vars(verdict) for verdict in verdicts], indent=1))
    return int(any(verdict.outcome not in GOOD for verdict in verdicts))


if __name__ == "__main__":
    sys.exit(main())
