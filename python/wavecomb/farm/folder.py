# SPDX-License-Identifier: Apache-2.0
"""Folder of a farm job.

The folder holds ``job.json``, ``parts/IMAGE/TILE.exr`` for each rendered tile of an unfinished
image, ``parts/IMAGE/plan.learned`` for results of the image's pilot renders, and
``images/IMAGE.json`` for each finished image. The files of the job's folder are the only record of
progress.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.job import Job, Task
from wavecomb.image.files.output_file import replacing

JOB_FILE = "job.json"
LEARNED_FILE = "guide.learned"


class Folder:
    """Folder of a farm job.

    Attributes:
        path: Absolute path.
        job: Job described by the folder.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Reads the job. Raises WavecombError if the folder holds no job."""
        self.path = Path(os.path.abspath(path))
        file = self.path / JOB_FILE
        try:
            text = file.read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            raise WavecombError(
                f"{os.fspath(path)}: is no folder of a job; `wavecomb farm submit` makes one"
            ) from None
        try:
            value = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise WavecombError(f"{file}: is damaged: {error}; submit the job again") from None
        self.job = Job.of(value, str(file))

    @classmethod
    def create(cls, path: str | os.PathLike[str], job: Job, learned: bytes | None = None) -> Folder:
        """Creates the folder of a job. Raises WavecombError if the path exists."""
        folder = Path(path)
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise WavecombError(
                f"{os.fspath(path)}: already exists: `wavecomb farm resume` continues a job, "
                "and --job names another folder"
            ) from None
        if learned is not None:
            from wavecomb.run.guiding_file import save_learned

            save_learned(folder / LEARNED_FILE, learned)
        write_json(folder / JOB_FILE, job.as_json())
        return cls(folder)

    def replace(self, job: Job) -> None:
        """Replaces the description of the job."""
        write_json(self.path / JOB_FILE, job.as_json())
        self.job = job

    def part(self, task: Task) -> Path:
        """Returns the file of a rendered tile."""
        return self.parts(task.image) / f"{task.tile:06d}.exr"

    def plan(self, image: int) -> Path:
        """Returns the file with the results of an image's pilot renders, for all of its tiles."""
        return self.parts(image) / "plan.learned"

    def parts(self, image: int) -> Path:
        """Returns the folder of an image's rendered tiles."""
        return self.path / "parts" / f"{image:06d}"

    def record(self, image: int) -> Path:
        """Returns the file with the hashes of a finished image's files."""
        return self.path / "images" / f"{image:06d}.json"

    def learned(self) -> bytes | None:
        """Returns the guiding field for all images, or None.

        Raises WavecombError if the file of the field is damaged.
        """
        if self.job.learned is None:
            return None
        from wavecomb.run.guiding_file import load_learned

        return load_learned(self.path / LEARNED_FILE)


def write_json(path: Path, value: Any) -> None:
    """Writes a small JSON file atomically."""
    with replacing(path) as part:
        part.write_text(json.dumps(value, allow_nan=False) + "\n", encoding="utf-8")
