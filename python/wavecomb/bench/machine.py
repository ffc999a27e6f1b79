# SPDX-License-Identifier: Apache-2.0
"""Hardware, software and load of the machine that runs a benchmark suite."""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import statistics
import subprocess
import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path
from typing import Any

SPIN_BYTES = 8 << 20
_PACKAGES = ("numpy", "usd-core", "openimageio", "tbb", "click", "rich", "mitsuba", "bpy")
_SYS_CPU = Path("/sys/devices/system/cpu")


@dataclass(frozen=True)
class Limits:
    """Properties of a machine that limit the values of settings in a suite.

    Attributes:
        threads: Number of usable cores.
        lanes: Largest SIMD width of this build.
        cache_bytes: Cache sizes {"L2": ..., "L3": ...} in bytes; L3 is the sum over all cores.
    """

    threads: int
    lanes: int
    cache_bytes: Mapping[str, int]


def now() -> str:
    """Returns the UTC time in ISO 8601, to the second."""
    return datetime.now(timezone.utc).replace(microsecond=0).isoformat()


def cores() -> list[int]:
    """Returns the cores that this process may use."""
    try:
        return sorted(os.sched_getaffinity(0))
    except AttributeError:
        return list(range(os.cpu_count() or 1))


def limits() -> Limits:
    """Returns the limits of this machine."""
    from wavecomb import _core

    return Limits(len(cores()), max(_core.lane_widths()), cache_bytes())


def cache_bytes() -> dict[str, int]:
    """Returns the sizes of the data caches in bytes.

    The sizes of L1D and L2 are per core, and L3 is the sum over all cores. Caches of unknown size
    are left out of the result.
    """
    sizes: dict[str, int] = {}
    for index in sorted(_SYS_CPU.glob("cpu0/cache/index*")):
        kind, level = _read(index / "type"), _read(index / "level")
        size = re.fullmatch(r"(\d+)([KM]?)", _read(index / "size"))
        if kind in ("Data", "Unified") and size:
            name = "L1D" if level == "1" else f"L{level}"
            sizes[name] = int(size[1]) * {"": 1, "K": 1 << 10, "M": 1 << 20}[size[2]]
    return sizes


def machine_state() -> dict[str, Any]:
    """Describes hardware and software of the machine, without names of the machine or its user."""
    from wavecomb.run import stats

    return {
        **stats.machine(),
        "kernel": platform.release(),
        "isa": stats.machine()["build"].get("isa", ""),
        "caches_bytes": cache_bytes(),
        "frequency_mhz": frequency_mhz(),
        "governor": _read(_SYS_CPU / "cpu0/cpufreq/scaling_governor") or None,
        "memory_free_bytes": _memory_free(),
        "load_before": list(load_average()),
        "versions": _versions(),
        **source_state(),
        "native_sha256": native_digest(),
        "time": now(),
    }


def source_state() -> dict[str, Any]:
    """Returns the commit of the checkout and whether its files were changed.

    Both values are None outside a checkout.
    """
    here = Path(__file__).resolve().parent

    def git(*arguments: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", *arguments], cwd=here, capture_output=True, text=True, check=False
            )
        except OSError:
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    status = git("status", "--porcelain", "--untracked-files=no")
    return {"commit": git("rev-parse", "HEAD"), "dirty": None if status is None else bool(status)}


def native_digest() -> str:
    """Returns the SHA-256 of the native module, which distinguishes results of different builds."""
    from wavecomb import _core

    return hashlib.sha256(Path(str(_core.__file__)).read_bytes()).hexdigest()


def frequency_mhz() -> float | None:
    """Returns the mean of the current core frequencies that the kernel reports, in MHz, or None."""
    values = [
        float(line.partition(":")[2])
        for line in _read(Path("/proc/cpuinfo")).splitlines()
        if line.startswith("cpu MHz")
    ]
    return round(sum(values) / len(values), 1) if values else None


def load_average() -> tuple[float, float, float]:
    """Returns the load averages of 1, 5 and 15 minutes."""
    try:
        return os.getloadavg()
    except OSError:
        return (0.0, 0.0, 0.0)


def busy_seconds() -> float | None:
    """Returns the CPU seconds that all processes have used since boot, or None if unknown."""
    fields = _read(Path("/proc/stat")).partition("\n")[0].split()
    if len(fields) < 9 or fields[0] != "cpu":
        return None
    user, nice, system, _, _, irq, softirq, steal = (int(value) for value in fields[1:9])
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def spin(threads: int) -> float:
    """Measures the seconds of a fixed workload that runs on ``threads`` threads at once.

    Returns the smaller of two measured times.
    """
    block = bytes(SPIN_BYTES)

    def work() -> None:
        hashlib.sha256(block).digest()  # hashlib releases the GIL, so that threads run in parallel

    def once() -> float:
        crowd = [threading.Thread(target=work) for _ in range(threads)]
        started = time.perf_counter()
        for thread in crowd:
            thread.start()
        for thread in crowd:
            thread.join()
        return time.perf_counter() - started

    return min(once(), once())


def _versions() -> dict[str, str]:
    from wavecomb.version import version

    found = {"wavecomb": version(), "python": platform.python_version()}
    for name in _PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def _memory_free() -> int | None:
    match = re.search(r"MemAvailable:\s+(\d+) kB", _read(Path("/proc/meminfo")))
    return int(match[1]) * 1024 if match else None


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return ""


# ---- Whether a machine was quiet enough for reliable timings


MAX_OTHERS = 0.05
"""Largest fraction of all cores' time that other processes take during an undisturbed run."""
MAX_SPIN = 1.10
"""Largest time of the spin (a fixed CPU workload) of an undisturbed run, relative to its time on
the idle machine."""
MAX_NOISY_RUNS = 0.2
MAX_VARIATION = 0.10


def spin_reference(spins: Sequence[float]) -> float:
    """Returns the time that the spin, a fixed CPU workload, takes on the idle machine.

    The time is estimated by the lower quartile of all measurements, since noise only adds time.
    """
    ordered = sorted(spins)
    return ordered[len(ordered) // 4] if ordered else 0.0


def is_noisy(others_share: float | None, spin_s: float, reference_s: float) -> bool:
    """Returns whether a run was disturbed.

    >>> is_noisy(0.01, 0.0102, 0.0100), is_noisy(0.20, 0.0100, 0.0100), is_noisy(0.0, 0.02, 0.01)
    (False, True, True)
    """
    if others_share is not None and others_share > MAX_OTHERS:
        return True
    return reference_s > 0.0 and spin_s > MAX_SPIN * reference_s


@dataclass(frozen=True)
class Noise:
    """Noise of the machine during the execution of a suite.

    Attributes:
        runs: Number of runs.
        noisy_runs: Number of disturbed runs.
        variation: Coefficient of variation of render_s, as the median over all configurations with
            at least three runs; None without such configurations.
        noisy: Whether the timings need a warning.
        lines: Reasons for the warning.
    """

    runs: int
    noisy_runs: int
    variation: float | None
    noisy: bool
    lines: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Returns the fields as a dictionary for machine.json."""
        return {
            "noisy": self.noisy,
            "runs": self.runs,
            "noisy_runs": self.noisy_runs,
            "variation": self.variation,
            "lines": list(self.lines),
        }


def judge(rows: Iterable[Mapping[str, Any]]) -> Noise:
    """Computes the noise of successful runs, given the rows of all runs in runs.csv."""
    good = [row for row in rows if row["status"] == "ok"]
    disturbed = sum(bool(row["noisy"]) for row in good)
    times: dict[str, list[float]] = defaultdict(list)
    for row in good:
        if row["render_s"] is not None:
            times[row["config"]].append(float(row["render_s"]))
    each = [
        statistics.stdev(values) / statistics.fmean(values)
        for values in times.values()
        if len(values) >= 3 and statistics.fmean(values) > 0.0
    ]
    variation = statistics.median(each) if each else None
    lines = []
    if good and disturbed > MAX_NOISY_RUNS * len(good):
        lines.append(
            f"{disturbed} of {len(good)} runs were disturbed: other processes took over "
            f"{MAX_OTHERS:.0%} of the cores, or the calibration spin was over "
            f"{MAX_SPIN - 1:.0%} slower than at its best"
        )
    if variation is not None and variation > MAX_VARIATION:
        lines.append(
            f"equal runs vary by {variation:.0%} (coefficient of variation of the render time, "
            f"median over configurations; {MAX_VARIATION:.0%} is the limit)"
        )
    return Noise(len(good), disturbed, variation, bool(lines), tuple(lines))
