# SPDX-License-Identifier: Apache-2.0
"""Submits a job that another program describes: JSON on standard input, JSON on standard output.

{"stage": FILE, "output": FILE, "options": {...}}: arguments of ``wavecomb.farm.submit``. The answer
is {"job": FOLDER} or {"error": LINE}.
"""

from __future__ import annotations

import json
import sys


def answer(text: str) -> str:
    """What is said to a description of a job."""
    from wavecomb.farm.api import submit
    from wavecomb.run.faults import describe

    try:
        told = json.loads(text)
        options = dict(told["options"])
        if options.get("region") is not None:
            options["region"] = tuple(options["region"])
        if options.get("size") is not None:
            options["size"] = tuple(options["size"])
        folder = submit(told["stage"], told["output"], **options)
    except Exception as error:  # whoever asked shows it
        return json.dumps({"error": describe(error)})
    return json.dumps({"job": str(folder.path)})


if __name__ == "__main__":
    print(answer(sys.stdin.read()))
