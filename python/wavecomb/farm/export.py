# SPDX-License-Identifier: Apache-2.0
"""Jobs for other schedulers: they start workers, and the job folder does the rest.

The folder hands out tasks, so a scheduler needs to know none of them: it starts as many workers as
it has machines for, and starts one again where it was preempted.
"""

from __future__ import annotations

import json
import os
import shlex
from typing import Any

from wavecomb import processes
from wavecomb.farm.folder import Folder
from wavecomb.picture.files import replacing


def worker_words(folder: Folder) -> list[str]:
    """The command of a worker, for any machine that has this Python and the folder."""
    return processes.command("wavecomb", "farm", "worker", str(folder.path))


def openjd(folder: Folder, workers: int) -> dict[str, Any]:
    """A template of Open Job Description 2023-09: a step of workers, and one that looks at the end.

    Each worker is a task. A worker that comes when nothing is left ends at once.
    """
    command, *arguments = worker_words(folder)
    name = f"Wavecomb {os.path.basename(folder.spec.stage)}"[:64]
    finish = processes.command("wavecomb", "farm", "resume", str(folder.path), "--on", "local:1")
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "name": name,
        "steps": [
            {
                "name": "Render",
                "parameterSpace": {
                    "taskParameterDefinitions": [
                        {"name": "Worker", "type": "INT", "range": f"1-{workers}"}
                    ]
                },
                "script": {
                    "actions": {
                        "onRun": {
                            "command": command, "args": arguments,
                            "cancelation": {
                                "mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": 60,
                            },
                        }
                    }
                },
            },
            {
                "name": "Finish",
                "dependencies": [{"dependsOn": "Render"}],
                "script": {"actions": {"onRun": {"command": finish[0], "args": finish[1:]}}},
            },
        ],
    }  # fmt: skip


def write_openjd(path: str, folder: Folder, workers: int) -> None:
    """Writes ``openjd`` as JSON, which `openjd run` takes."""
    with replacing(path) as part:
        part.write_text(json.dumps(openjd(folder, workers), indent=2) + "\n", encoding="utf-8")


def slurm(folder: Folder, workers: int) -> str:
    """A script for `sbatch`: an array of workers, each started again where it was preempted."""
    name = f"wavecomb-{os.path.basename(folder.spec.stage)}"
    log = folder.path / "logs" / "slurm-%A-%a.log"
    return "\n".join(
        [
            "#!/bin/bash",
            f"#SBATCH --job-name={shlex.quote(name)}",
            f"#SBATCH --array=1-{workers}",
            "#SBATCH --requeue",
            "#SBATCH --open-mode=append",
            # SIGTERM a minute before the end: the worker keeps what it has.
            "#SBATCH --signal=TERM@60",
            f"#SBATCH --output={log}",
            "set -eu",
            'threads="${SLURM_CPUS_PER_TASK:-0}"',
            'echo "worker ${SLURM_ARRAY_TASK_ID:?is set by sbatch --array} on $(hostname)"',
            f'exec {shlex.join(worker_words(folder))} --threads "$threads"',
            "",
        ]
    )


def write_slurm(path: str, folder: Folder, workers: int) -> None:
    """Writes ``slurm``."""
    with replacing(path) as part:
        part.write_text(slurm(folder, workers), encoding="utf-8")
