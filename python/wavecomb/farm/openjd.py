# SPDX-License-Identifier: Apache-2.0
"""Export of jobs as templates of Open Job Description, built with its data model.

File names of the job become values of template parameters. The scheduler never expands braces in
parameter values, so braces and line breaks in file names are safe.
"""

from __future__ import annotations

import json
import os
from typing import Any

from wavecomb import processes
from wavecomb.errors import WavecombError
from wavecomb.extras import needed
from wavecomb.farm.folder import Folder
from wavecomb.image.files.output_file import replacing

_NOTICE_S = 30


def template(folder: Folder) -> dict[str, Any]:
    """Returns a template with two steps: a task for each tile, then the assembly of all images.

    Raises:
        WavecombError: The data model rejects a name of the job, or images differ in tile count.
    """
    model = needed("openjd.model", "farm export", "farm")
    job = folder.job
    counts = {job.tile_count(image) for image in range(len(job.images))}
    if len(counts) > 1:
        raise WavecombError(f"{folder.path}: images of different sizes have different tiles")
    count = counts.pop()
    cancel = {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": _NOTICE_S}

    def action(*arguments: str) -> dict[str, Any]:
        words = ["-I", "-m", "wavecomb", "farm", *arguments]
        return {"command": "{{Param.Python}}", "args": words, "cancelation": cancel}

    ranges = [("Image", f"1-{len(job.images)}"), ("Tile", f"1-{count}")]
    value = {
        "specificationVersion": "jobtemplate-2023-09",
        "name": "Wavecomb render",
        "parameterDefinitions": [
            # The job folder has the type STRING, since a parameter of type PATH must be inside the
            # folder of the job template.
            {"name": "Job", "type": "STRING", "default": str(folder.path)},
            {"name": "Python", "type": "STRING", "default": processes.interpreter()},
        ],
        "steps": [
            {
                "name": "Render",
                "parameterSpace": {
                    "taskParameterDefinitions": [
                        {"name": name, "type": "INT", "range": found} for name, found in ranges
                    ]
                },
                "script": {
                    "actions": {
                        "onRun": action(
                            "task", "{{Param.Job}}", "--image", "{{Task.Param.Image}}", "--tile",
                            "{{Task.Param.Tile}}/" + str(count),
                        )
                    }
                },
            },
            {
                "name": "Assemble",
                "dependencies": [{"dependsOn": "Render"}],
                "script": {"actions": {"onRun": action("assemble", "{{Param.Job}}")}},
            },
        ],
    }  # fmt: skip
    try:
        found: dict[str, Any] = model.model_to_object(
            model=model.decode_job_template(template=value)
        )
    except model.DecodeValidationError as error:
        why = " ".join(str(error).split())
        raise WavecombError(
            f"{folder.path}: Open Job Description refuses this job: {why}"
        ) from None
    return found


def write_template(path: str | os.PathLike[str], folder: Folder) -> None:
    """Writes the template as JSON for `openjd run`."""
    text = json.dumps(template(folder), indent=2)
    with replacing(path) as part:
        part.write_text(text + "\n", encoding="utf-8")
