# SPDX-License-Identifier: Apache-2.0
"""Suites of runs, read from TOML files. docs/bench.md documents the keys."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from wavecomb.bench.suite_model import (
    RENDERERS,
    WAVECOMB,
    Experiment,
    Golden,
    StageSource,
    Suite,
    with_folder,
)
from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import check_regular, reason
from wavecomb.options import settings


class Table:
    """A TOML table whose keys are removed when they are read, so that unknown keys remain."""

    def __init__(self, path: Path, where: str, values: Mapping[str, Any]) -> None:
        self.path = path
        self.where = where
        self._values = dict(values)
        self._known: list[str] = []

    def error(self, key: str, what: str) -> WavecombError:
        """Returns an error whose message names the file, the table and the key."""
        place = f"{self.where}: {key}" if self.where else key
        return WavecombError(f"{self.path}: {place}: {what}")

    def below(self, where: str, values: Any) -> Table:
        """Returns a nested table."""
        if not isinstance(values, Mapping):
            raise self.error(where, "must be a table")
        return Table(self.path, where, values)

    def take(self, key: str, kind: type, default: Any) -> Any:
        """Takes the value of a key and checks its type."""
        self._known.append(key)
        value = self._values.pop(key, default)
        if value is not default and (
            not isinstance(value, kind) or (kind is int and isinstance(value, bool))
        ):
            names = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
            raise self.error(key, f"must be {names.get(kind, 'a table')}, not {value!r}")
        return value

    def count(self, key: str, default: int, least: int) -> int:
        """Takes an integer of at least ``least``."""
        value = int(self.take(key, int, default))
        if value < least:
            raise self.error(key, f"must be at least {least}, not {value}")
        return value

    def choice(self, key: str, default: str, allowed: tuple[str, ...]) -> str:
        """Takes the value of a key, which must be one of the given words."""
        value = str(self.take(key, str, default))
        if value not in allowed:
            raise self.error(key, f"must be one of {', '.join(allowed)}, not {value!r}")
        return value

    def tables(self, key: str) -> list[tuple[str, Any]]:
        """Takes the value of a key, which must be a table of tables; returns names and tables."""
        return list(self.take(key, dict, {}).items())

    def list_of_tables(self, key: str) -> list[Any]:
        """Takes the value of a key, which must be a list of tables."""
        entries = list(self.take(key, list, []))
        for entry in entries:
            if not isinstance(entry, Mapping):
                raise self.error(key, f"write [[{key}]] tables")
        return entries

    def rest(self) -> dict[str, Any]:
        """Takes all remaining keys."""
        values, self._values = self._values, {}
        return values

    def end(self) -> None:
        """Raises WavecombError if a key remains."""
        for key in self._values:
            raise self.error(key, f"no such key; there are {', '.join(self._known)}")


if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SUITES = Path(__file__).parent / "suites"
DEFAULT_REPETITIONS = 16
IMAGES = ("none", "first", "all")

_NOT_OF_SUITES = ("width", "height", "seed", "adaptive", "noise", "min_spp", "error", "progressive")


@cache
def suite_settings() -> dict[str, str]:
    """Returns the settings that a suite may choose, with their kinds.

    The kind "count" means an integer, "all" or "widest".
    """
    kinds = {"choice": "text", "text": "text", "flag": "flag", "number": "number"}
    own = {name: row for name, row in settings().items() if name not in _NOT_OF_SUITES}
    counts = dict.fromkeys(("threads", "lanes"), "count")
    return {"size": "pair"} | {
        name: counts.get(name, kinds.get(row.kind, "integer")) for name, row in own.items()
    }


def suite_names() -> list[str]:
    """Returns the names of the suites that come with Wavecomb."""
    return sorted(path.stem for path in SUITES.glob("*.toml"))


def find_suite(name: str) -> Path:
    """Returns the file of a suite, given the name of a shipped suite or a path to a .toml file."""
    if name.endswith(".toml"):
        return Path(name)
    path = SUITES / f"{name}.toml"
    if not path.is_file():
        raise WavecombError(
            f"no suite {name!r}: there are {', '.join(suite_names())}, "
            "or give a file whose name ends in .toml"
        )
    return path


def load_suite(path: Path) -> Suite:
    """Reads a suite.

    Raises:
        WavecombError: The suite is invalid. The message names the file and the key.
    """
    try:
        check_regular(path)
        text = path.read_text(encoding="utf-8")
        document = tomllib.loads(text)
    except OSError as error:
        why = "" if error.strerror is None else f"{path}: cannot be read: "
        raise WavecombError(why + reason(error)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise WavecombError(f"{path}: is not TOML: {error}") from error
    top = Table(path, "", document)
    stages = {
        name: _stage(top.below(f"stage.{name}", entry)) for name, entry in top.tables("stage")
    }
    golden = top.below("golden", top.take("golden", dict, {}))
    suite = Suite(
        name=top.take("name", str, path.stem),
        title=top.take("title", str, ""),
        path=path,
        text=text,
        repetitions=top.count("repetitions", DEFAULT_REPETITIONS, 1),
        warm_up=top.count("warm_up", 1, 0),
        seed=top.count("seed", 1, 0),
        golden=Golden(
            golden.count("spp", Golden.spp, 1),
            golden.choice("integrator", Golden.integrator, ("reference", "wavefront")),
            golden.count("seed", Golden.seed, 0),
        ),
        stages=stages,
        experiments=tuple(
            _experiment(top.below(f"experiment {number}", entry), stages)
            for number, entry in enumerate(top.list_of_tables("experiment"), 1)
        ),
    )
    folder = top.take("stages_folder", str, "")
    golden.end()
    top.end()
    if not suite.experiments:
        raise top.error("experiment", "there is none: write at least one [[experiment]]")
    names = [experiment.name for experiment in suite.experiments]
    for name in names:
        if names.count(name) > 1:
            raise top.error("experiment", f"two are named {name!r}; give each its own name")
    return with_folder(suite, path.parent / os.path.expanduser(folder)) if folder else suite


def _stage(table: Table) -> StageSource:
    scene, file = table.take("scene", str, ""), table.take("file", str, "")
    if bool(scene) == bool(file):
        raise table.error("scene", "give either scene = NAME or file = PATH")
    camera = table.take("camera", str, None)
    if file:
        table.end()
        path = table.path.parent / os.path.expanduser(file)
        return StageSource(file=path, camera=camera)
    from wavecomb.scenes import SCENES

    if scene not in SCENES:
        raise table.error("scene", f"no scene {scene!r}; there are {', '.join(SCENES)}")
    options = table.rest()
    for key in options:
        _check_stage_option(table, key)
    return StageSource(scene=scene, options=options, camera=camera)


def _check_stage_option(table: Table, key: str) -> None:
    import dataclasses

    from wavecomb.scenes import SceneOptions

    known = [entry.name for entry in dataclasses.fields(SceneOptions)]
    if key not in known:
        raise table.error(
            key, f"a generated stage has no such option; there are {', '.join(known)}"
        )


def _experiment(table: Table, stages: Mapping[str, StageSource]) -> Experiment:
    name = table.take("name", str, "")
    if not name or not all(c.isalnum() or c in "-_" for c in name):
        raise table.error("name", "give a name of letters, digits, - and _")
    table.where = f"experiment {name}"
    chosen = tuple(table.take("stages", list, list(stages)))
    for stage in chosen:
        if stage not in stages:
            there = ", ".join(stages) or "none"
            raise table.error("stages", f"no stage {stage!r}; the file defines {there}")
    renderers = tuple(table.take("renderers", list, [WAVECOMB]))
    for renderer in renderers:
        if renderer not in RENDERERS:
            raise table.error("renderers", f"no {renderer!r}; there are {', '.join(RENDERERS)}")
    vary = dict(table.take("vary", dict, {}))
    stage_vary = vary.pop("stage", {})
    for key, values in [*vary.items(), *stage_vary.items()]:
        if not isinstance(values, list) or not values:
            raise table.error(f"vary.{key}", "give a list of values")
    for key, values in vary.items():
        for value in values:
            _check_setting(table, f"vary.{key}", key, value)
    for key in stage_vary:
        _check_stage_option(table, key)
        for stage in chosen:
            if not stages[stage].scene:
                raise table.error(f"vary.stage.{key}", f"stage {stage} is a file: has no options")
    cases = [dict(entry) for entry in table.list_of_tables("case")] or [{}]
    case_names = tuple(_case_name(table, entry.pop("name", "")) for entry in cases)
    if len(set(case_names) - {""}) < sum(name != "" for name in case_names):
        raise table.error("case.name", "two cases have the same; give each its own")
    factor = table.take("factor", str, "")
    if factor and factor not in vary and factor not in stage_vary:
        raise table.error("factor", f"{factor!r} is not varied; name a key of vary")
    experiment = Experiment(
        name=name,
        stages=chosen,
        renderers=renderers,
        settings=_settings(table, "settings", table.take("settings", dict, {})),
        vary=vary,
        stage_vary=stage_vary,
        cases=tuple(_settings(table, "case", entry) for entry in cases),
        case_names=case_names,
        skip=tuple(_settings(table, "skip", entry) for entry in table.list_of_tables("skip")),
        factor=factor,
        images=table.choice("images", "none", IMAGES),
        golden=table.take("golden", bool, False),
    )
    table.end()
    return experiment


def _case_name(table: Table, name: Any) -> str:
    if not isinstance(name, str) or not all(c.isalnum() or c in "-_+" for c in name):
        raise table.error("case.name", "give a name of letters, digits, -, _ and +")
    return name


def _settings(table: Table, where: str, values: Mapping[str, Any]) -> dict[str, Any]:
    for key, value in values.items():
        _check_setting(table, f"{where}.{key}", key, value)
    return dict(values)


def _check_setting(table: Table, where: str, key: str, value: Any) -> None:
    kind = suite_settings().get(key)
    whole = isinstance(value, int) and not isinstance(value, bool)
    if kind is None:
        raise table.error(where, f"no setting {key!r}; there are {', '.join(suite_settings())}")
    good = {
        "pair": isinstance(value, list) and len(value) == 2 and all(type(v) is int for v in value),
        "integer": whole,
        "number": whole or isinstance(value, float),
        "text": isinstance(value, str),
        "flag": isinstance(value, bool),
        "count": whole or value in ("all", "widest"),
    }[kind]
    if not good:
        what = {"pair": "[width, height]", "count": 'an integer, "all" or "widest"'}.get(kind, kind)
        raise table.error(where, f"must be {what}, not {value!r}")
