# SPDX-License-Identifier: Apache-2.0
"""Groups statistics of live renders into runs and series. Independent of Qt.

A *look* is one reading of all counters of a render. A *run* is one render with constant settings,
from its start to the next restart. Runs with the same settings and the same image are repetitions,
which form a *series*.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from wavecomb.options import names
from wavecomb.run.stats import COHERENCE, PHASES, SORTING

WORK = names("work", without=("spp",))
"""Settings that change the amount of work and therefore the noise."""

FIELDS = (*names("order", without=("progressive",)), *WORK)
"""Settings whose values distinguish run series. The fields that are not in ``WORK`` leave the image
unchanged."""

MAX_LOOKS = 240
"""Largest number of counter readings in a run. When a run has more readings, every second reading
is dropped to limit memory use."""
MAX_SERIES = 100
SHORTEST_S = 0.25
"""Shortest duration, in seconds, of an abandoned run that is kept. Shorter runs, such as those
during a camera orbit, cannot be compared reliably."""


@dataclass(frozen=True)
class Look:
    """Counter values since the start of a run."""

    seconds: float
    """Wall time of rendering in seconds, not counting pauses."""
    samples: int = 0
    rays: int = 0
    """Number of camera, bounce and shadow rays."""
    records: int = 0
    packet_lanes: int = 0
    phases: Mapping[str, float] = field(default_factory=dict)
    """Thread seconds in each render phase."""
    coherence: Mapping[str, float] = field(default_factory=dict)
    """Number of consecutive hits with one material in the shading queues, and homogeneity of the
    queues, as means since the start of the render. The core reports no counters for these
    values."""


def take_look(stats: Mapping[str, Any]) -> Look:
    """Returns the counter values in a statistics dictionary (docs/statistics.md)."""
    counts = stats.get("counts", {})
    phases = stats.get("phases_s", {})
    coherence = stats.get("coherence", {})
    seconds = stats.get("seconds", {})
    return Look(
        seconds=float(seconds.get("render", 0.0)) - float(seconds.get("held", 0.0)),
        samples=int(counts.get("samples", 0)),
        rays=int(counts.get("rays", 0)) + int(counts.get("shadow_rays", 0)),
        records=int(counts.get("records", 0)),
        packet_lanes=int(counts.get("packet_lanes", 0)),
        phases={name: float(phases.get(name, 0.0)) for name in PHASES},
        coherence={name: float(coherence.get(name, 0.0)) for name in COHERENCE},
    )


@dataclass
class Run:
    """One render, as counter readings (looks) in time order. The first reading is all zeros."""

    looks: list[Look] = field(default_factory=lambda: [Look(0.0)])
    stats: Mapping[str, Any] = field(default_factory=dict)
    """The latest statistics."""
    finished: bool = False

    @property
    def last(self) -> Look:
        """The latest counter reading."""
        return self.looks[-1]

    def add(self, stats: Mapping[str, Any]) -> None:
        """Adds a reading of the counters to the run."""
        look = take_look(stats)
        self.stats = stats
        if look.seconds <= self.last.seconds:
            # Ignore statistics whose render time is not later than that of the previous ones.
            return
        self.looks.append(look)
        if len(self.looks) > MAX_LOOKS:
            self.looks = [*self.looks[:-1:2], look]

    def continues(self, look: Look) -> bool:
        """Returns whether a counter reading can belong to this run.

        Counters of a run never decrease.
        """
        last = self.last
        return not self.finished and look.seconds >= last.seconds and look.samples >= last.samples

    def lane_utilisation(self) -> float:
        """Returns the packet occupancy, records / (packets x lanes).

        The value is 0 before any shading.
        """
        return ratio(self.last.records, self.last.packet_lanes)

    def shading_ns(self) -> float:
        """Returns thread ns per queued hit, over the phases keys, sort, materialize and shade."""
        seconds = sum(self.last.phases.get(name, 0.0) for name in (*SORTING, "shade"))
        return 1e9 * ratio(seconds, self.last.records)

    def run_length(self) -> float:
        """Returns the mean number of consecutive queued hits with one material."""
        return self.last.coherence.get("run_length", 0.0)


@dataclass
class Series:
    """All runs with the same settings and the same image."""

    number: int
    settings: Mapping[str, Any]
    picture: Hashable
    """Key of the scene, edits, camera, size and seed, which determine the amount of work together
    with the settings."""
    changed: str
    """Description of the settings that differ from the previous series."""
    runs: list[Run] = field(default_factory=list)
    recipe: Mapping[str, Any] = field(default_factory=dict)
    """Fields of a setup that must be restored to repeat the runs."""

    @property
    def run(self) -> Run:
        """The newest run."""
        return self.runs[-1]

    @property
    def best(self) -> Run:
        """The longest run of the series, which has the smallest statistical error."""
        return max(self.runs, key=lambda run: run.last.seconds)

    def does_the_work_of(self, other: Series) -> bool:
        """Returns whether two series do the same work, so that their times can be compared."""
        return self.picture == other.picture and all(
            self.settings.get(name) == other.settings.get(name) for name in WORK
        )


class RunLog:
    """Log that groups statistics into runs and runs into series."""

    def __init__(self) -> None:
        self.series: list[Series] = []
        self.pinned: Series | None = None
        self._current: Series | None = None
        self._count = 0

    def add(
        self,
        stats: Mapping[str, Any],
        settings: Mapping[str, Any],
        picture: Hashable,
        finished: bool = False,
        recipe: Mapping[str, Any] | None = None,
    ) -> Series:
        """Adds a reading of the statistics.

        Returns the series of the run that the reading belongs to.

        Args:
            stats: Statistics of the render.
            settings: Values of the fields in ``FIELDS``; unknown fields may be missing.
            picture: Key of the scene, edits, camera, size and seed, which determine the amount of
                work together with the settings.
            finished: Whether the render has ended.
            recipe: Fields of a setup that must be restored to repeat the run.
        """
        known = {name: settings[name] for name in FIELDS if name in settings}
        look = take_look(stats)
        series = self._current
        if series is None or series.settings != known or series.picture != picture:
            self._end_run()
            series = self._series_of(known, picture)
            series.recipe = recipe or known
            series.runs.append(Run())
        elif not series.run.continues(look):
            if series.run.finished and look.samples == series.run.last.samples:
                # Ignore statistics that the viewport sends again after the end of a run.
                return series
            self._end_run()
            if series not in self.series:
                self.series.append(series)
            series.runs.append(Run())
        self._current = series
        series.run.add(stats)
        series.run.finished = finished
        return series

    def finish(self) -> bool:
        """Marks the current run as finished.

        Returns False if there is no current run or if it was already finished.
        """
        if self._current is None or self._current.run.finished:
            return False
        self._current.run.finished = True
        return True

    @property
    def current(self) -> Series | None:
        """Series of the current run, or of the last run if no render is running."""
        return self._current

    @property
    def base(self) -> Series | None:
        """Series with which others are compared: the pinned series, else the first of the image."""
        if self.pinned is not None:
            return self.pinned
        if self._current is None:
            return None
        return next(
            (one for one in self.series if one.does_the_work_of(self._current)), self._current
        )

    def pin(self, series: Series | None) -> None:
        """Pins the series with which other series are compared.

        None means the first series of the image.
        """
        self.pinned = series

    def clear(self) -> None:
        """Removes all runs but the current one."""
        self.pinned = None
        self.series = [self._current] if self._current is not None else []
        for series in self.series:
            series.runs = [series.run]
            series.number, series.changed = 1, ""
        self._count = len(self.series)

    def _series_of(self, settings: Mapping[str, Any], picture: Hashable) -> Series:
        for series in self.series:
            if series.settings == settings and series.picture == picture:
                return series
        before = self._current
        changed = ""
        if before is not None:
            changed = describe(differences(before.settings, settings))
            if before.picture != picture:
                changed = ", ".join(filter(None, ("other picture", changed)))
        self._count += 1
        series = Series(self._count, dict(settings), picture, changed)
        self.series.append(series)
        if len(self.series) > MAX_SERIES:
            oldest = next(one for one in self.series if one is not self.pinned)
            self.series.remove(oldest)
        return series

    def _end_run(self) -> None:
        """Removes the current run if it is unfinished and shorter than ``SHORTEST_S``."""
        series = self._current
        if series is None or series.run.finished or series.run.last.seconds >= SHORTEST_S:
            return
        series.runs.pop()
        if not series.runs and series in self.series:
            self.series.remove(series)
            if self.pinned is series:
                self.pinned = None


def differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the settings in ``after`` that differ from ``before``, in the order of ``FIELDS``."""
    return {
        name: after[name] for name in FIELDS if name in after and before.get(name) != after[name]
    }


_WORDS = {
    "lanes": "lanes",
    "wave_size": "wave",
    "threads": "threads",
    "ray_order": "rays",
    "shadow_order": "shadow rays",
    "integrator": "",
    "cost_weight": "cost weight",
    "roulette_depth": "roulette from",
    "light_selection": "lights",
    "light_weights": "light shares",
    "allocate": "samples by",
    "learn_memory": "MB of learning",
    "adaptive": "pixel error",
    "min_spp": "min spp",
    "time_limit": "seconds",
    "policy": "",
}
_NUMBERS_FIRST = ("lanes", "threads")
_AUTOMATIC = {"lanes": "widest lanes", "wave_size": "wave auto", "threads": "all threads"}
_OFF = ("adaptive", "noise", "time_limit")


def describe(settings: Mapping[str, Any]) -> str:
    """Describes settings in a few words, for labels.

    >>> describe({"policy": "material", "lanes": 1, "wave_size": 0, "ray_order": "slot"})
    'material, 1 lane, wave auto, rays slot'
    """
    parts = []
    for name, value in settings.items():
        word = _WORDS.get(name, name)
        if value == 0 and name in _AUTOMATIC:
            parts.append(_AUTOMATIC[name])
        elif value == 0 and name in _OFF:
            parts.append(f"no {word or name}")
        elif name in _NUMBERS_FIRST:
            parts.append(f"{value} {word[:-1] if value == 1 else word}")
        else:
            text = f"{value:g}" if isinstance(value, float) else str(value)
            parts.append(f"{word} {text}".strip())
    return ", ".join(parts)


def labels(series: Sequence[Series]) -> list[str]:
    """Returns a label for each series. A label lists the settings that differ between series.

    The label begins with the policy, because policies are compared most often. Equal labels are
    distinguished by numbers.
    """
    varying = [
        name
        for name in FIELDS
        if len({repr(one.settings.get(name)) for one in series}) > 1 or name == "policy"
    ]
    texts = [
        describe({name: one.settings[name] for name in varying if name in one.settings})
        for one in series
    ]
    return [
        text if texts.count(text) == 1 else f"{text} #{one.number}".strip()
        for text, one in zip(texts, series, strict=True)
    ]


def ratio(above: float, below: float) -> float:
    """Returns the quotient of two numbers, or 0 for a divisor of 0."""
    return above / below if below > 0 else 0.0


def last_of(series: Iterable[Series], count: int, keep: Series | None = None) -> list[Series]:
    """Returns the newest ``count`` series. If ``keep`` is in the log, it is included."""
    every = list(series)
    newest = every[-count:]
    if keep is not None and keep in every and keep not in newest:
        newest = [keep, *newest[1:]]
    return newest
