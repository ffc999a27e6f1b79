# SPDX-License-Identifier: Apache-2.0
"""Writes a job that another program describes: JSON on standard input, JSON on standard output.

{"stage": FILE, "output": FILE, "options": {...}}: arguments of ``wavecomb.farm.submit``. The answer
is {"job": FOLDER} or {"error": LINE}.
"""

from __future__ import annotations

import json
import sys


def answer(text: str) -> str:
    """Writes the job that ``text`` describes; the answer."""
    from wavecomb.farm.api import submit
    from wavecomb.run.faults import describe

    try:
        told = json.loads(text)
        options = dict(told["options"])
        for name in ("region", "size"):
            if options.get(name) is not None:
                options[name] = tuple(options[name])
        folder = submit(told["stage"], told["output"], **options)
    except Exception as error:  # the caller shows it
        return json.dumps({"error": describe(error)})
    return json.dumps({"job": str(folder.path)})


if __name__ == "__main__":
    print(answer(sys.stdin.read()))
