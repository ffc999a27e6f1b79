# SPDX-License-Identifier: Apache-2.0
"""The process in the sandbox that reads stages for another: ``reader`` starts it.

Nothing of NumPy or USD is imported before it is in the sandbox, which wants one thread.
"""

from __future__ import annotations

import fcntl
import os
import select
import socket
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavecomb.load_options import LoadOptions
from wavecomb.run.isolate import box, memory, patience, trail
from wavecomb.run.isolate.broker import Outputs

if TYPE_CHECKING:
    from wavecomb.run.boxed.wire import Message
    from wavecomb.run.frame_reader import FrameReader
    from wavecomb.usd.stage.loaded import LoadedStage
    from wavecomb.usd.stage.report import LoadReport


def main(start: Mapping[str, Any]) -> None:
    """Reads what it is asked for, until nobody asks any more.

    ``start``: descriptors of the channel, of the page of ``trail``, and of a pipe whose other end
    closes when who asks is no more; the folder for temporary files.
    """
    trail.follow(start["page"])
    _die_with(start["life"])
    if start["temporary"] is not None:
        os.environ["TMPDIR"] = start["temporary"]
    memory.limit(None)
    box.enter(Outputs(), temporary=start["temporary"])
    # While who asks makes up its mind.

    Child(socket.socket(fileno=start["channel"])).serve()
    # Nothing is worth to be tidied up here.
    os._exit(0)


def _die_with(life: int) -> None:
    """Lets the kernel end this process when the other end of a pipe closes.

    By SIGIO, which needs no thread of Python's: one may be kept waiting as long as C++ computes.
    """
    fcntl.fcntl(life, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(life, fcntl.F_SETFL, fcntl.fcntl(life, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([life], [], [], 0)[0]:
        os._exit(2)


class Child:
    """Answers on a channel."""

    def __init__(self, channel: socket.socket) -> None:
        from wavecomb.run.boxed.wire import Receiver, Sender

        self._receiver = Receiver(channel)
        self._sender = Sender(channel)
        self._held: Any = None
        self._frames: FrameReader | None = None

    def serve(self) -> None:
        """Answers one message after another."""
        from wavecomb.run.boxed.errors import of_error

        jobs = {"peek": self._peek, "load": self._load, "open": self._open, "look": self._look,
                "frame": self._frame}  # fmt: skip
        patience.on_end = self._end
        while (message := self._receiver.receive()) is not None:
            try:
                limits = message.body.get("limits")
                if limits is not None:
                    patience.limit_s = limits["load"]
                    if limits["memory"] is not None:
                        memory.limit(limits["memory"])
                jobs[message.kind](message)
            except Exception as error:
                self._sender.send("error", of_error(error))

    def _end(self, line: str) -> None:
        """Says why composing ended, which cannot be stopped otherwise."""
        self._sender.send("error", {"type": "WavecombError", "text": line})
        os._exit(0)

    def _peek(self, message: Message) -> None:
        from wavecomb.run.boxed import plain
        from wavecomb.usd.stage.peek import peek_products

        # Who keeps the stage saves reading its layers again.
        choices, self._held = peek_products(**message.body["with"])
        self._sender.send("choices", {"choices": [plain.of_choice(choice) for choice in choices]})

    def _load(self, message: Message) -> None:
        from wavecomb.run.boxed import plain
        from wavecomb.run.boxed.record import RemoteScene, RemoteStore
        from wavecomb.usd.stage.load import load_stage
        from wavecomb.usd.stage.opening import open_stage

        body, options = message.body, dict(message.body["options"])
        if body.get("cache") is not None:
            store = body["store"].get("limit_bytes")
            options["reuse"] = plain.read_cache(
                body["cache"],
                RemoteScene(body["shared"]),
                None if store is None else RemoteStore(store, self._sender),
            )
        source: Any = body["path"]
        said: LoadReport | None = None
        if body.get("overrides") is not None or body.get("outline"):
            from pxr import Sdf

            from wavecomb.usd.stage.diagnostics import captured
            from wavecomb.usd.stage.report import LoadReport

            layer = Sdf.Layer.CreateAnonymous("overrides.usda")
            layer.ImportFromString(body.get("overrides") or "#usda 1.0")
            said = LoadReport()
            with captured(said):
                variants = options.pop("variants", None)
                source = open_stage(_path(source), variants, overrides=layer)
        loaded = load_stage(source, **options, **self._factories(body, options))
        if said is not None:
            loaded.report.absorb(said)
        self._held = None
        outline = self._outline(source, options.get("frame")) if body.get("outline") else None
        self._answer(loaded, outline)

    def _outline(self, stage: Any, frame: float | None) -> dict[str, Any]:
        """The outline of a stage, which is looked at no more, as plain data."""
        from wavecomb.run.boxed.outline import of_outline
        from wavecomb.usd.stage.diagnostics import captured
        from wavecomb.usd.stage.outline_of import outline_of
        from wavecomb.usd.stage.report import LoadReport
        from wavecomb.usd.stage.times import time_code

        with captured(LoadReport()):
            return of_outline(outline_of(stage, time_code(stage, frame)))

    def _factories(self, body: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
        """Arguments of ``load_stage`` that send what it reads."""
        from wavecomb.run.boxed.record import RecordingBuilder, RemoteStore

        def store(report: LoadReport) -> Any:
            if body["store"].get("note"):
                report.note(body["store"]["note"])
            limit = body["store"].get("limit_bytes")
            return None if limit is None else RemoteStore(limit, self._sender)

        def progress(done: int, found: int) -> None:
            self._sender.send("progress", {"done": done, "found": found})

        return {
            "builder_factory": lambda: RecordingBuilder(
                self._sender, body["scene"], options.get("threads", 0)
            ),
            "store_factory": store,
            "progress": progress if body["progress"] else None,
        }

    def _answer(self, loaded: LoadedStage, outline: dict[str, Any] | None = None) -> None:
        from wavecomb.run.boxed import plain

        cache = loaded.textures
        self._sender.send(
            "stage",
            {
                "stage": plain.of_stage(loaded),
                "cache": None if cache is None else plain.of_cache(cache),
                "tree": outline,
            },
        )
        self._sender.end_frame()

    def _open(self, message: Message) -> None:
        from wavecomb.run.frame_reader import FrameReader

        body = message.body
        self._frames = FrameReader(_path(body["path"]), LoadOptions.of(None, body["with"]))
        self._sender.send("opened", {})

    def _look(self, message: Message) -> None:
        from wavecomb.run.boxed import plain

        assert self._frames is not None
        body = message.body
        seen = self._frames.look(LoadOptions.of(None, body["options"]))
        found = None if seen is None else plain.of_seen(seen.as_dict())
        self._sender.send("seen", {"seen": found})

    def _frame(self, message: Message) -> None:
        assert self._frames is not None
        body = message.body
        options = body["options"]
        loaded = self._frames.read(LoadOptions.of(None, options), **self._factories(body, options))
        self._answer(loaded)


def _path(name: str) -> Any:
    from pathlib import Path

    return Path(name)
