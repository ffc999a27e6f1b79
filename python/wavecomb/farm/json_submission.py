# SPDX-License-Identifier: Apache-2.0
"""Submits a farm job for another program, with JSON on standard input and output.

The input {"stage": FILE, "output": FILE, "options": {...}} holds arguments of
``wavecomb.farm.submit``. The output is {"job": FOLDER} or {"error": LINE}.
"""

from __future__ import annotations

import json
import sys


def answer(text: str) -> str:
    """Submits the job that ``text`` describes and returns the output as JSON."""
    from wavecomb.farm.api import submit
    from wavecomb.run.error_messages import describe

    try:
        told = json.loads(text)
        options = dict(told["options"])
        for name in ("region", "size"):
            if options.get(name) is not None:
                options[name] = tuple(options[name])
        folder = submit(told["stage"], told["output"], **options)
    except Exception as error:  # the calling program displays the error message
        return json.dumps({"error": describe(error)})
    return json.dumps({"job": str(folder.path)})


if __name__ == "__main__":
    print(answer(sys.stdin.read()))
