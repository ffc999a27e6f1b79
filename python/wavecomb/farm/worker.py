# SPDX-License-Identifier: Apache-2.0
"""Process that hosts Dask workers, as ``dask worker`` does, with certificates from a private file.

Dask's command would import modules from the working folder, and would read a file name with a line
break as a certificate.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

TLS_FILE = "tls.json"


def write_certificates(place: Path, security: Any) -> None:
    """Writes the certificates of a ``Security`` for ``main``, readable only by their owner."""
    values = {
        "ca-file": security.tls_ca_file,
        "worker": {"cert": security.tls_worker_cert, "key": security.tls_worker_key},
    }
    with os.fdopen(
        os.open(place / TLS_FILE, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w"
    ) as f:
        json.dump(values, f)


def main(words: Sequence[str]) -> None:
    """Hosts workers until the scheduler ends.

    Args:
        words: The private folder, the scheduler's address, and options of ``dask worker``.
    """
    import dask

    place, *rest = words
    with open(os.path.join(place, TLS_FILE), encoding="utf-8") as file:
        dask.config.set({"distributed.comm.tls": json.load(file)})
    dask.config.set({"temporary-directory": place, "distributed.worker.daemon": False})
    from distributed.cli.dask_worker import main as dask_worker

    dask_worker(rest)


if __name__ == "__main__":
    main(sys.argv[1:])
