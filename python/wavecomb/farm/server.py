# SPDX-License-Identifier: Apache-2.0
"""Serves the live page of a job, on this machine alone.

The page has a name that nobody can guess, so other users of the machine, and pages of other sites
in the same browser, do not see it; and names of other hosts are refused, whatever they resolve to.
"""

from __future__ import annotations

import contextlib
import ipaddress
import json
import re
import secrets
import socket
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.farm.folder import Folder
from wavecomb.farm.page import live_page, live_state
from wavecomb.farm.state import status

_TIMEOUT_S = 20.0
"""For a browser to ask, and to take what it asked for."""
_MOST_LOG = 200_000
"""Letters of a log, from its end."""
_HOSTS = re.compile(r"(localhost|127(\.\d{1,3}){3}|\[::1\])(:\d{1,5})?")


def parse_address(text: str) -> tuple[str, int]:
    """Host and port of "8080", "127.0.0.1:8080" or "localhost:8080"; port 0: any that is free.

    Raises:
        WavecombError: It is none, or is not of this machine alone.
    """
    host, colon, number = text.rpartition(":")
    host = (host if colon else "127.0.0.1").strip("[]")
    if not number.isdecimal() or int(number) > 65535:
        raise WavecombError(f"--page {text}: must be a port, or HOST:PORT of this machine")
    is_loopback = host == "localhost"
    with contextlib.suppress(ValueError):
        is_loopback = is_loopback or ipaddress.ip_address(host).is_loopback
    if not is_loopback:
        raise WavecombError(
            f"--page {text}: the page is for this machine alone: give a port; from elsewhere "
            "`ssh -L PORT:127.0.0.1:PORT` leads to it"
        )
    return "127.0.0.1" if host == "localhost" else host, int(number)


class Server:
    """Answers while it is entered.

    Attributes:
        url: Of the page.
    """

    def __init__(self, folder: Folder, host: str = "127.0.0.1", port: int = 0) -> None:
        """Listens; does not answer yet.

        Args:
            folder: The job's.
            host: Of ``parse_address``.
            port: Likewise; 0: any that is free.

        Raises:
            WavecombError: Somebody else listens there.
        """
        if not ipaddress.ip_address(host).is_loopback:
            raise WavecombError(f"--page {host}: the page is for this machine alone")
        self._secret = secrets.token_urlsafe(16)
        handler = type("Handler", (_Handler,), {"folder": folder, "secret": self._secret})
        kind = _Server6 if ":" in host else _Server
        try:
            self._server = kind((host, port), handler)
        except OSError as error:
            raise WavecombError(f"--page {port}: cannot listen there: {error.strerror}") from None
        shown = f"[{host}]" if ":" in host else host
        self.url = f"http://{shown}:{self._server.server_address[1]}/{self._secret}/"

    def __enter__(self) -> Server:
        threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.2}, daemon=True
        ).start()
        return self

    def __exit__(self, *error: object) -> None:
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    # Whoever is still answered when the command ends is not waited for.
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away is nobody's concern."""


class _Server6(_Server):
    address_family = socket.AF_INET6


class _Handler(BaseHTTPRequestHandler):
    """Answers GET below the secret name."""

    folder: Folder
    secret: str
    timeout = _TIMEOUT_S
    server_version = "Wavecomb"
    sys_version = ""

    def do_GET(self) -> None:
        """The page and what it asks for."""
        if not _HOSTS.fullmatch(self.headers.get("Host", "")):
            self._answer(403, "text/plain", b"this page is for this machine alone\n")
            return
        _, _, rest = self.path.partition("/")
        secret, slash, name = rest.partition("?")[0].partition("/")
        if not (slash and secrets.compare_digest(secret.encode(), self.secret.encode())):
            self._answer(404, "text/plain", b"not found\n")
            return
        try:
            self._say(name)
        except (OSError, WavecombError) as error:
            if isinstance(error, ConnectionError):
                return
            with contextlib.suppress(OSError):
                self._answer(404, "text/plain", f"{error}\n".encode())

    def _say(self, name: str) -> None:
        kind, _, which = name.partition("/")
        if name == "":
            nonce = secrets.token_urlsafe(16)
            text = live_page(status(self.folder, tasks=False), nonce)
            self._answer(200, "text/html; charset=utf-8", text.encode(), nonce)
        elif name == "state":
            state = status(self.folder)
            text = live_state(state, int(self.folder.spec.tiles[0]))
            self._answer(200, "text/html; charset=utf-8", text.encode())
        elif name == "status.json":
            self._answer(200, "application/json", json.dumps(status(self.folder)).encode())
        elif kind == "picture" and which.isdecimal():
            if int(which) >= len(self.folder.spec.pictures):
                raise WavecombError("there is no such picture")
            from wavecomb.farm.so_far import png_so_far

            self._answer(200, "image/png", png_so_far(self.folder, int(which)))
        elif kind == "log" and re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*", which):
            text = self.folder.logs(which)[-_MOST_LOG:] or "nothing was said yet\n"
            self._answer(200, "text/plain; charset=utf-8", text.encode())
        else:
            raise WavecombError("not found")

    def _answer(self, code: int, kind: str, data: bytes, nonce: str = "") -> None:
        self.send_response(code)
        script = f"'nonce-{nonce}'" if nonce else "'none'"
        for key, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(data))),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Content-Security-Policy",
             f"default-src 'none'; img-src 'self'; connect-src 'self'; script-src {script}; "
             "style-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'"),
        ):  # fmt: skip
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing on the terminal."""
