# SPDX-License-Identifier: Apache-2.0
"""The folder of a job, which is all that there is of it: whoever sees the folder can work on it.

    job.json        what the job is
    class.json      machines that may work on it (classes.py); the first worker writes it
    assets.json     files that its stage needs, with their hashes
    files/          these files, where they travel with the job
    hashes/HOST.json    what a machine knows of its files
    todo/TASK.TRY            tasks to be done
    busy/TASK.TRY.WORKER     tasks that a worker has
    done/TASK, failed/TASK   tasks that are done, or failed too often
    results/TASK.json        what came of a task
    logs/TASK.log, logs/WORKER.log
    workers/WORKER.json      who works, touched every few seconds
    copies/TASK.TRY.WORKER   tasks of slow workers that another has begun, too
    parts/                   tiles and checkpoints
    cancel                   whoever works is to stop

The state of a task is the folder that its name is in, and it changes by renaming: of several who
rename one name, one succeeds. So there are no locks, and whoever is killed leaves a state that is
one of these.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.files import read_json, write_json
from wavecomb.farm.spec import Spec, Task

TODO, BUSY, DONE, FAILED = "todo", "busy", "done", "failed"
STATES = (TODO, BUSY, DONE, FAILED)
LEARNED = "field.learned"
"""A file of what guides all pictures."""
_FOLDERS = (*STATES, "copies", "results", "logs", "workers", "parts")


class ShareLost(OSError):
    """The folder is not there at the moment: what was to be said of a task is to be said later."""


@dataclass(frozen=True)
class Entry:
    """A task in a folder of those that are to be done, or that somebody has.

    Attributes:
        task: The task.
        attempt: 1 for the first try.
        worker: Who has it; empty: nobody.
    """

    task: Task
    attempt: int
    worker: str = ""

    @property
    def name(self) -> str:
        """Of its file."""
        return f"{self.task.id}.{self.attempt}" + (f".{self.worker}" if self.worker else "")

    @classmethod
    def of(cls, name: str) -> Entry | None:
        """What a file's name says; None: it is of something else."""
        words = name.split(".", 3)
        if len(words) < 3 or not words[2].isdecimal():
            return None
        try:
            task = Task.of(".".join(words[:2]))
        except WavecombError:
            return None
        return cls(task, int(words[2]), words[3] if len(words) > 3 else "")


class Folder:
    """A job's folder.

    Attributes:
        path: Absolute.
        spec: What the job is.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Opens it.

        Raises:
            WavecombError: It is none.
        """
        self.path = Path(os.path.abspath(path))
        file = self.path / "job.json"
        if not file.is_file():
            raise WavecombError(
                f"{os.fspath(path)}: is no folder of a job; `farm submit` makes one"
            )
        self.spec = Spec.of(read_json(file), str(file))

    @property
    def learned(self) -> Path:
        """What guides all pictures, where a job is given that."""
        return self.path / LEARNED

    @classmethod
    def create(
        cls,
        path: str | os.PathLike[str],
        spec: Spec,
        files: Mapping[str, Any],
        fill: Callable[[Path], object] = lambda path: None,
    ) -> Folder:
        """Makes the folder, whole or not at all.

        Args:
            path: That is not there yet.
            spec: The job.
            files: Further files: name -> JSON.
            fill: Writes what else belongs into it.

        Raises:
            WavecombError: Something is there.
            OSError: It cannot be made.
        """
        target = Path(os.path.abspath(path))
        if target.exists():
            raise WavecombError(
                f"--job {os.fspath(path)}: is there already: `wavecomb farm resume` goes on with "
                "it; remove it, or give another name"
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            for name in _FOLDERS:
                (part / name).mkdir(parents=True)
            for task in spec.tasks():
                (part / TODO / Entry(task, 1).name).touch()
            for name, value in files.items():
                write_json(part / name, value)
            fill(part)
            write_json(part / "job.json", spec.as_json())
            os.rename(part, target)
        finally:
            shutil.rmtree(part, ignore_errors=True)
        return cls(target)

    # ---- what is there --------------------------------------------------------------------------

    def entries(self, state: str) -> list[Entry]:
        """Tasks of ``TODO`` or ``BUSY``, in the order of their names."""
        found = map(Entry.of, sorted(os.listdir(self.path / state)))
        return [entry for entry in found if entry is not None]

    def ids(self, state: str) -> set[str]:
        """Ids of tasks in any state."""
        names = os.listdir(self.path / state)
        if state in (DONE, FAILED):
            return {name for name in names if not name.startswith(".")}
        return {entry.task.id for entry in map(Entry.of, names) if entry is not None}

    def counts(self) -> Counter[str]:
        """How many tasks are in each state."""
        return Counter({state: len(self.ids(state)) for state in STATES})

    def is_over(self) -> bool:
        """Whether nothing is left to do that can be done."""
        if self.entries(BUSY):
            return False
        failed = {Task.of(name).picture for name in self.ids(FAILED)}
        return all(
            entry.task.is_join and entry.task.picture in failed for entry in self.entries(TODO)
        )

    def is_there(self) -> bool:
        """Whether the folder can be seen: a share may be gone for a while."""
        return (self.path / "job.json").exists()

    def is_cancelled(self) -> bool:
        """Whether whoever works is to stop."""
        return (self.path / "cancel").exists()

    def result(self, task: Task) -> dict[str, Any]:
        """What came of a task; empty: nobody knows."""
        try:
            found = read_json(self.path / "results" / f"{task.id}.json")
        except (OSError, WavecombError):
            return {}
        return found if isinstance(found, dict) else {}

    def part(self, task: Task) -> Path:
        """The file of a tile."""
        return self.path / "parts" / f"{task.id}.npz"

    def checkpoint(self, task: Task) -> Path:
        """The file that a task goes on from."""
        return self.path / "parts" / f"{task.id}.ckpt"

    # ---- a worker's steps -----------------------------------------------------------------------

    def claim(self, entry: Entry, worker: str) -> Entry | None:
        """Takes a task; None: another was quicker."""
        mine = Entry(entry.task, entry.attempt, worker)
        if not self._move(TODO, entry.name, BUSY, mine.name):
            return None
        with contextlib.suppress(OSError):
            os.utime(self.path / BUSY / mine.name)  # when it was begun
        return mine

    def finish(self, mine: Entry, result: Mapping[str, Any]) -> bool:
        """Says that a task is done; False: it was taken away, and counts for another."""
        if not self._move(BUSY, mine.name, DONE, mine.task.id):
            return False
        self._done(mine.task, result)
        return True

    def finish_copy(self, task: Task, result: Mapping[str, Any]) -> bool:
        """Says that a task is done that another has, or had; False: that one was quicker."""
        for state in (BUSY, TODO, BUSY):
            for entry in self.entries(state):
                if entry.task == task and self._move(state, entry.name, DONE, task.id):
                    self._done(task, result)
                    return True
        if self._move(FAILED, task.id, DONE, task.id):
            self._done(task, result)
            return True
        return False

    def _done(self, task: Task, result: Mapping[str, Any]) -> None:
        """What is known of a task that is done; what nobody needs any more goes."""
        with contextlib.suppress(OSError):
            write_json(self.path / "results" / f"{task.id}.json", dict(result))
        with contextlib.suppress(OSError):
            self.checkpoint(task).unlink()
        if task.is_join:
            self.remove_parts(task.picture)

    def remove_parts(self, picture: int) -> None:
        """Removes the tiles of a picture."""
        for part in self.spec.parts_of(picture):
            with contextlib.suppress(OSError):
                self.part(part).unlink()

    def has(self, mine: Entry) -> bool:
        """Whether a task is still that of its worker; True where nobody can tell now."""
        return (self.path / BUSY / mine.name).exists() or not self.is_there()

    def is_done(self, task: Task) -> bool:
        """Whether somebody did a task."""
        return (self.path / DONE / task.id).exists()

    def give_back(self, mine: Entry) -> bool:
        """Lets another go on with it; that is no try of the task."""
        return self._move(BUSY, mine.name, TODO, Entry(mine.task, mine.attempt).name)

    def fail(self, mine: Entry, error: str, *, is_final: bool = False) -> bool:
        """Says that a try failed: the task is tried again, unless it was the last one.

        Args:
            mine: The task.
            error: Why, one line.
            is_final: Whether trying again would bring the same.
        """
        text = f"try {mine.attempt} failed on {mine.worker}: {error}"
        self.log(mine.task, text)
        if is_final or mine.attempt >= self.spec.tries:
            result = {"error": error, "tries": mine.attempt, "worker": mine.worker}
            with contextlib.suppress(OSError):
                write_json(self.path / "results" / f"{mine.task.id}.json", result)
            return self._move(BUSY, mine.name, FAILED, mine.task.id)
        return self._move(BUSY, mine.name, TODO, Entry(mine.task, mine.attempt + 1).name)

    def put_back(self, state: str, task: Task) -> bool:
        """Has a task done again that was done or has failed."""
        with contextlib.suppress(FileNotFoundError):
            (self.path / "results" / f"{task.id}.json").unlink()
        return self._move(state, task.id, TODO, Entry(task, 1).name)

    def _move(self, state: str, name: str, to: str, new: str) -> bool:
        try:
            os.rename(self.path / state / name, self.path / to / new)
        except FileNotFoundError:
            if not self.is_there():
                raise ShareLost(f"{self.path}: is not there") from None
            return False
        return True

    # ---- logs -----------------------------------------------------------------------------------

    def log(self, task: Task, line: str) -> None:
        """Adds a line to the log of a task. A disk that is full does not stop the work."""
        text = f"{time.strftime('%Y-%m-%d %H:%M:%S')} {' '.join(line.split())}\n"
        with contextlib.suppress(OSError):
            number = os.open(
                self.path / "logs" / f"{task.id}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666
            )
            try:
                os.write(number, text.encode(errors="replace"))
            finally:
                os.close(number)

    def logs(self, name: str) -> str:
        """The log of a task or of a worker; empty: there is none."""
        try:
            return (self.path / "logs" / f"{name}.log").read_text(errors="replace")
        except FileNotFoundError:
            return ""

    def assets(self) -> list[dict[str, Any]]:
        """Files that the stage needs, as ``farm assets --json`` lists them."""
        with contextlib.suppress(FileNotFoundError):
            found = read_json(self.path / "assets.json")
            if isinstance(found, dict) and isinstance(found.get("files"), list):
                return list(found["files"])
        return []


def say(value: Any) -> str:
    """A value as a line of JSON."""
    return json.dumps(value, allow_nan=False)
