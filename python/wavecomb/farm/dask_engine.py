# SPDX-License-Identifier: Apache-2.0
"""Workers of a Dask cluster, each of which runs one worker of the job.

Dask only starts them: the folder hands out tasks, so a scheduler that fails loses nothing. Who can
reach a Dask scheduler runs code on its workers and clients, so addresses are of this machine, or
encrypted with certificates on both sides.
"""

from __future__ import annotations

import contextlib
import ipaddress
import json
import time
from dataclasses import dataclass
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.extras import needed
from wavecomb.farm.elsewhere import Elsewhere
from wavecomb.farm.folder import Folder

_CONNECT_S = 10.0
_NOBODY_S = 60.0
"""For a first worker of the cluster to come, or for one to come back."""
_MOST_STARTS = 3
"""On each worker of the cluster."""


@dataclass(frozen=True)
class Tls:
    """Files of certificates: who signed them, one's own, its key."""

    ca: str | None = None
    cert: str | None = None
    key: str | None = None

    def check(self, address: str) -> None:
        """Raises WavecombError where they do not fit to the address of a scheduler."""
        given = [self.ca, self.cert, self.key]
        if address.startswith("tls://"):
            if None in given:
                raise WavecombError(
                    f"--on dask:{address}: needs --tls-ca, --tls-cert and --tls-key; `wavecomb "
                    "farm certificates` makes them"
                )
        elif any(given):
            raise WavecombError(f"--on dask:{address}: --tls-... are for tls:// addresses")


def parse_address(text: str) -> str:
    """The address of a scheduler, with its kind.

    >>> parse_address("127.0.0.1:8786"), parse_address("tls://farm:8786")
    ('tcp://127.0.0.1:8786', 'tls://farm:8786')

    Raises:
        WavecombError: It is none, or would be neither encrypted nor of this machine alone.
    """
    kind, found, rest = text.partition("://")
    kind, rest = (kind, rest) if found else ("tcp", text)
    host, _, port = rest.rpartition(":")
    if kind not in ("tcp", "tls") or not host or not port.isdecimal() or int(port) > 65535:
        raise WavecombError(f"--on dask:{text}: must be dask:HOST:PORT or dask:tls://HOST:PORT")
    host_name, is_loopback = host.strip("[]"), host == "localhost"
    with contextlib.suppress(ValueError):
        is_loopback = is_loopback or ipaddress.ip_address(host_name).is_loopback
    if kind == "tcp" and not is_loopback:
        raise WavecombError(
            f"--on dask:{text}: is neither of this machine nor tls://: whoever reaches a Dask "
            "scheduler runs code; `wavecomb farm certificates` makes what tls:// needs"
        )
    return f"{kind}://{rest}"


class Dask(Elsewhere):
    """Workers of a cluster."""

    def __init__(self, folder: Folder, address: str, tls: Tls, threads: int) -> None:
        """Asks nobody yet.

        Args:
            folder: The job's.
            address: Of ``parse_address``.
            tls: Certificates.
            threads: Of each; 0: as many as the worker of the cluster has.
        """
        super().__init__(folder)
        self._address = address
        self._tls = tls
        self._threads = threads
        self._client: Any = None
        self._tasks: dict[str, Any] = {}
        self._starts: dict[str, int] = {}
        self._alone_since: float | None = None

    def begin(self) -> None:
        """Connects."""
        distributed = needed("distributed", "--on dask", "farm")
        security = None
        if self._address.startswith("tls://"):
            security = distributed.Security(
                tls_ca_file=self._tls.ca, tls_client_cert=self._tls.cert,
                tls_client_key=self._tls.key, require_encryption=True,
            )  # fmt: skip
        try:
            self._client = distributed.Client(
                self._address, security=security, timeout=_CONNECT_S, set_as_default=False
            )
        except (OSError, TimeoutError, ValueError) as error:
            why = " ".join(str(error.__cause__ or error).split()) or type(error).__name__
            raise WavecombError(f"--on dask:{self._address}: no scheduler answers: {why}") from None

    def tend(self) -> bool:
        """Starts workers of the job on those of the cluster that have none."""
        present = self._present()
        for name in list(self._tasks):
            if self._tasks[name].status in ("finished", "error", "cancelled", "lost"):
                self._note(self._tasks.pop(name))
            elif name not in present:
                del self._tasks[name]  # its worker is no more
        if not self._folder.is_cancelled() and not self.errors:
            for name, facts in present.items():
                started = self._starts.get(name, 0)
                again = started < _MOST_STARTS and not (started and self._folder.is_over())
                if name not in self._tasks and again:
                    self._start(name, int(facts.get("nthreads") or 1))
        if self._tasks:
            self._alone_since = None
            return True
        if self.errors or (present and all(self._starts.get(n, 0) for n in present)):
            return False
        now = time.monotonic()
        self._alone_since = now if self._alone_since is None else self._alone_since
        if now - self._alone_since > _NOBODY_S:
            self.errors.append(f"--on dask:{self._address}: the cluster has no workers")
            return False
        return True

    def _present(self) -> dict[str, Any]:
        """Workers of the cluster; none where the scheduler does not answer."""
        with contextlib.suppress(Exception):
            return dict(self._client.scheduler_info(n_workers=-1)["workers"])
        return {}

    def _start(self, name: str, threads: int) -> None:
        from wavecomb.farm.dask_task import work

        options = ["--threads", str(self._threads or threads)]
        text = json.dumps({"job": str(self._folder.path), "options": options})
        self._starts[name] = self._starts.get(name, 0) + 1
        self._tasks[name] = self._client.submit(
            work, text, workers=[name], allow_other_workers=False, pure=False, retries=0
        )

    def _note(self, task: Any) -> None:
        """What a worker said that could not work."""
        if task.status == "finished":
            with contextlib.suppress(Exception):
                told = json.loads(task.result(timeout=_CONNECT_S))
                if told["code"] == 2 and told["said"]:
                    self.errors.append(str(told["said"]).removeprefix("error: "))
        elif task.status == "error":
            with contextlib.suppress(Exception):
                error = task.exception(timeout=_CONNECT_S)
                self.errors.append(f"a worker of the cluster said: {' '.join(str(error).split())}")

    def end(self) -> None:
        """Disconnects."""
        if self._client is not None:
            with contextlib.suppress(Exception):
                self._client.close(timeout=5.0)
