# SPDX-License-Identifier: Apache-2.0
"""The live page: tiles as they arrive, the picture so far, logs; for this machine alone."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import forks
import numpy as np
import pytest
from farm_jobs import cornell_in, work
from parts import needs

from wavecomb import farm
from wavecomb.errors import WavecombError
from wavecomb.farm.folder import BUSY, DONE, TODO, Folder
from wavecomb.farm.rendering import Renderer
from wavecomb.farm.server import Server, parse_address
from wavecomb.farm.so_far import png_so_far, shown_so_far
from wavecomb.picture.image import read_codes

pytestmark = needs("wavecomb._core")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


@pytest.fixture
def job(stage: Path, tmp_path: Path) -> Folder:
    options = {"size": (41, 24), "spp": 4, "tiles": "3x2", "strict": False}
    return farm.submit(stage, tmp_path / "a.exr", **options)


def ask(url: str, name: str = "", host: str | None = None) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of a page below ``url``."""
    found = urlsplit(url)
    line = http.client.HTTPConnection(found.hostname or "", found.port, timeout=20)
    with contextlib.closing(line):
        line.request("GET", found.path + name, headers={} if host is None else {"Host": host})
        answer = line.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()


@pytest.fixture
def page(job: Folder) -> Iterator[str]:
    with Server(job) as server:
        yield server.url


def test_tiles_arrive(job: Folder, page: str, tmp_path: Path) -> None:
    """The page shows the tiles that are there, each with the colours of the picture's PNG."""
    assert ask(page, "picture/0")[0] == 404, "nothing is there yet"
    renderer = Renderer(job, threads=1)
    for entry in job.entries(TODO)[:4]:
        mine = job.claim(entry, "w")
        assert mine is not None
        job.finish(mine, renderer.do(mine.task))
    mine = job.claim(job.entries(TODO)[0], "w")
    assert mine is not None
    job.log(mine.task, "a <line>")
    code, _, text = ask(page, "state")
    assert code == 200
    assert text.count(b'class="done"') == 4 and text.count(b'class="busy"') == 1
    assert b'data-picture="picture/0?4-busy"' in text and b'href="log/000000.0004"' in text
    code, headers, said = ask(page, f"log/{mine.task.id}")
    assert code == 200 and b"a <line>" in said and headers["Content-Type"].startswith("text/plain")
    code, headers, png = ask(page, "picture/0?4-busy")
    assert code == 200 and headers["Content-Type"] == "image/png"
    part = tmp_path / "part.png"
    part.write_bytes(png)
    assert job.give_back(mine)
    work(job)
    whole = tmp_path / "whole.png"
    whole.write_bytes(ask(page, "picture/0")[2])
    seen, wanted = read_codes(part), read_codes(whole)
    for task, (x0, y0, x1, y1) in zip(job.spec.parts_of(0), job.spec.rectangles(0), strict=True):
        block = seen[y0:y1, x0:x1]
        if int(task.part) < 4:
            assert np.array_equal(block, wanted[y0:y1, x0:x1]), task
        else:
            assert len(np.unique(block)) == 1, "what is not there is grey"
    assert wanted.shape == (24, 41, 3) and len(np.unique(wanted)) > 16
    state = json.loads(ask(page, "status.json")[2])
    assert state["state"] == "done" and state["tasks"][DONE] == 7 and not state["tasks"][BUSY]


def test_large_pictures_are_shown_smaller(job: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each second, third ... pixel, wherever tiles begin, of tiles as of the file."""
    renderer = Renderer(job, threads=1)
    for entry in job.entries(TODO)[:-1]:
        mine = job.claim(entry, "w")
        assert mine is not None
        job.finish(mine, renderer.do(mine.task))
    every = shown_so_far(job, 0)
    assert every.shape == (24, 41, 3)
    for most in (20, 14, 7):
        step = -(-41 // most)
        assert np.array_equal(shown_so_far(job, 0, most), every[::step, ::step])
    work(job)
    assert shown_so_far(job, 0, 14).tobytes() == shown_so_far(job, 0)[::3, ::3].tobytes()


def test_the_png_of_a_job_is_shown_as_it_is(stage: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    job = farm.submit(stage, tmp_path / "a.exr", png=str(file), size=(8, 8), spp=1, strict=False)
    with pytest.raises(WavecombError, match="nothing of the picture"):
        png_so_far(job, 0)
    work(job)
    assert png_so_far(job, 0) == file.read_bytes()


def test_a_page_that_needs_nothing_else(page: str) -> None:
    html5lib = pytest.importorskip("html5lib")
    code, headers, text = ask(page)
    assert code == 200
    html5lib.HTMLParser(strict=True).parse(text.decode())
    assert b"http://" not in text and b"https://" not in text
    rules = headers["Content-Security-Policy"]
    assert "default-src 'none'" in rules and "frame-ancestors 'none'" in rules
    nonce = rules.partition("'nonce-")[2].partition("'")[0]
    assert nonce and f'nonce="{nonce}"'.encode() in text
    assert headers["Cache-Control"] == "no-store"


def test_who_does_not_know_the_name_sees_nothing(page: str) -> None:
    root = page[: page.rindex("/", 0, -1) + 1]
    for name in ("", "state", "picture/0", "x/state", "log/000000.0000"):
        assert ask(root, name)[0] == 404
    for name in ("log/../job.json", "log/..%2Fjob.json", "log/.hidden", "picture/9", "job.json"):
        assert ask(page, name)[0] == 404, name
    for host in ("example.org", "example.org:80", "127.0.0.1.example.org", ""):
        assert ask(page, "", host)[0] == 403, host
    assert ask(page, "", "localhost")[0] == 200


@pytest.mark.parametrize(
    "text", ["0.0.0.0:80", "192.168.1.2:80", "example.org:80", ":80", "[::]:80", "x", "99999", ""]
)
def test_it_listens_nowhere_else(text: str) -> None:
    with pytest.raises(WavecombError, match="--page"):
        Server(None, *parse_address(text))  # type: ignore[arg-type]
    assert parse_address("8080") == ("127.0.0.1", 8080)
    assert parse_address("localhost:1") == ("127.0.0.1", 1)
    assert parse_address("[::1]:2") == ("::1", 2)


def test_a_port_that_is_taken(job: Folder) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(WavecombError, match="cannot listen there: Address already in use"):
            Server(job, port=other.getsockname()[1])


def test_browsers_that_go_away(job: Folder, page: str, capfd: pytest.CaptureFixture[str]) -> None:
    """In the midst of a question or an answer: nobody is disturbed, and nothing is said."""
    found = urlsplit(page)
    for text in (
        b"",
        b"GET ",
        f"GET {found.path}state HTTP/1.1\r\nHost: localhost\r\n\r\n".encode(),
    ):
        for _ in range(5):
            with socket.create_connection((found.hostname, found.port), timeout=20) as line:
                line.sendall(text)
    assert ask(page, "state")[0] == 200
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_the_command_serves_it_while_it_works(stage: Path, tmp_path: Path) -> None:
    refused = forks.wavecomb(
        "farm", "submit", str(stage), "-o", str(tmp_path / "a.exr"), "--page", "0.0.0.0:80"
    )
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1, refused.stderr
    assert "for this machine alone" in refused.stderr and not (tmp_path / "a.farm").exists()
    job = farm.submit(
        stage, tmp_path / "a.exr", size=(48, 48), spp=64, tiles="4x4", threads=1, strict=False
    )
    words = [sys.executable, "-m", "wavecomb", "farm", "resume", str(job.path), "--page", "--json"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as command:
        try:
            assert command.stderr is not None
            said, _, url = command.stderr.readline().strip().partition(" ")
            assert said == "page"
            workers, until = 0, time.monotonic() + 60
            with contextlib.suppress(ConnectionError):
                while time.monotonic() < until:
                    state = json.loads(ask(url, "status.json")[2])
                    workers = max(workers, len(state["workers"]))
                    if 0 < state["tasks"][DONE] < 16:
                        assert ask(url, "picture/0")[2].startswith(b"\x89PNG")
                        break
                    time.sleep(0.02)
            assert workers == 1 and state["tasks"][DONE] > 0
            out, err = command.communicate(timeout=100)
        finally:
            command.kill()
    assert command.returncode == 0 and json.loads(out)["state"] == "done", err
    with pytest.raises(OSError):
        ask(url, "state")
