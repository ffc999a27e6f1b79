# SPDX-License-Identifier: Apache-2.0
"""Has stages read in a sandbox, and builds their scenes here."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb import _core
from wavecomb.errors import WavecombError
from wavecomb.machine import give_back_memory
from wavecomb.run.boxed import plain
from wavecomb.run.boxed.errors import read_error
from wavecomb.run.boxed.process import Process
from wavecomb.run.boxed.replay import Replay
from wavecomb.run.boxed.wire import Message, Receiver, Refused, Sender
from wavecomb.run.isolate.memory import MEGABYTE, machine_limit
from wavecomb.usd.looks.texture_cache import TextureCache
from wavecomb.usd.looks.texture_store import texture_store
from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.loaded import LoadedStage
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.stage.outline import Outline

Progress = Callable[[int, int], Any]


class Reader:
    """A process in the sandbox that reads one stage, as often as it is asked.

    Errors are those that reading it in this process raises, and a WavecombError of one line where
    the process crashes, or sends what it should not. It ends with ``close``, or with this process.

    Contract: one thread at a time.

    Attributes:
        outline: Of the stage that was loaded last, where that was asked for.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        load_limit: float | None = None,
        memory_limit: float | None = None,
        process: Process | None = None,
    ) -> None:
        """Starts it.

        Args:
            path: The stage's file.
            load_limit: As of ``wavecomb.load``.
            memory_limit: Likewise.
            process: One that was started before.
        """
        if memory_limit is not None and not math.isfinite(memory_limit):
            raise WavecombError(f"memory limit {memory_limit:g} MB: must be a number")
        self._path = Path(path)
        self._limits: dict[str, Any] | None = {"load": load_limit, "memory": memory_limit}
        self._process = Process() if process is None else process
        self._most = machine_limit() if memory_limit is None else int(memory_limit * MEGABYTE)
        self._sender = Sender(self._process.channel)
        self._receiver = Receiver(self._process.channel, self._most)
        self._scenes: dict[int, _core.Scene] = {}
        self._store: _core.TextureStore | None = None
        self._count = 0
        self._is_closed = False
        self.outline: Outline | None = None

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the process."""
        self._is_closed = True
        self._process.close()
        self._sender.close()
        self._receiver.close()

    def peek(self, **asked: str) -> list[RenderChoice]:
        """What render settings ask for; the arguments are those of ``peek_products``."""
        answer = self._ask("peek", {"with": {"file": os.fspath(self._path), **asked}}, "choices")
        return self._checked(lambda: _choices(answer))

    def load(
        self,
        options: Mapping[str, Any],
        *,
        progress: Progress | None = None,
        overrides: str | None = None,
        reuse: TextureCache | None = None,
        outline: bool = False,
    ) -> LoadedStage:
        """The stage with its scene.

        Args:
            options: Fields of ``LoadOptions``, and ``editable`` of ``load_stage``.
            progress: As of ``load_stage``.
            overrides: What the session layer holds, as .usda.
            reuse: Textures to share; the answer has some only for ``editable``.
            outline: Have ``outline`` made, too.
        """
        body: dict[str, Any] = {
            "path": os.fspath(self._path), "overrides": overrides, "outline": outline,
        }  # fmt: skip
        if reuse is not None:
            self._scenes = {0: reuse.scene}
            self._store = reuse.store
            body |= {"cache": plain.of_cache(reuse), "shared": 0}
        return self._stage("load", body, options, progress)

    def open(self, options: Mapping[str, Any]) -> None:
        """Opens the stage, for frames of it; options: of ``LoadOptions``."""
        self._ask("open", {"path": os.fspath(self._path), "with": options}, "opened")

    def look(self, options: Mapping[str, Any]) -> dict[str, Any] | None:
        """What ``FrameReader.look`` sees, as a dict."""
        answer = self._ask("look", {"options": options}, "seen")
        return self._checked(lambda: plain.read_seen(answer.body.get("seen"), answer.arrays))

    def frame(self, options: Mapping[str, Any], progress: Progress | None = None) -> LoadedStage:
        """The stage at a frame."""
        return self._stage("frame", {}, options, progress)

    def _stage(
        self, kind: str, body: dict[str, Any], options: Mapping[str, Any], progress: Any
    ) -> LoadedStage:
        """Asks for a stage, and builds the scene as it comes."""
        started = time.perf_counter()
        limit, said = options.get("texture_limit"), LoadReport()
        self._store = _store(limit, self._store, said)
        self._count += 1
        store = {
            "limit_bytes": None if self._store is None else self._store.limit_bytes,
            "note": said.notes[0].what if said.notes else None,
        }
        body |= {
            "options": dict(options), "store": store, "scene": self._count,
            "progress": progress is not None,
        }  # fmt: skip
        builder = _core.SceneBuilder(int(options.get("threads") or 0), self._store)
        replay = Replay(
            builder, scenes=self._scenes, store=self._store, give_back=self._receiver.give_back
        )

        def take(message: Message) -> bool:
            if message.kind == "call":
                replay.make(message)
            elif message.kind == "waiting":
                replay.wait(message)
            elif message.kind == "progress" and progress is not None:
                progress(*_counts(message))
            else:
                return False
            if message.kind != "call":
                self._receiver.give_back(message.size)
            return True

        answer = self._ask(kind, body, "stage", take)
        scene = self._built(builder)
        self._scenes = {self._count: scene}
        loaded = self._checked(lambda: self._loaded(answer, scene, options))
        if body.get("outline"):
            self.outline = self._checked(lambda: _outline(answer))
        self._receiver.end_frame()
        give_back_memory()
        return replace(loaded, seconds=time.perf_counter() - started)

    def _built(self, builder: _core.SceneBuilder) -> _core.Scene:
        try:
            return builder.build()
        except ValueError as error:
            raise WavecombError(f"{self._path}: {error}") from error
        except MemoryError:
            raise WavecombError(f"{self._path}: out of memory while it was read") from None

    def _loaded(
        self, answer: Message, scene: _core.Scene, options: Mapping[str, Any]
    ) -> LoadedStage:
        working_space = str(options.get("working_space", "rec709"))
        loaded = plain.read_stage(
            answer.body.get("stage"), answer.arrays, scene, self._path, working_space
        )
        cache = answer.body.get("cache")
        if cache is None:
            return loaded
        count = len(scene.textures)
        return replace(loaded, textures=plain.read_cache(cache, scene, self._store, count))

    def checked(self, make: Callable[[], Any]) -> Any:
        """What is made of an outline; one that USD does not take is refused.

        Raises:
            WavecombError: It is.
        """
        try:
            return make()
        except ValueError as error:
            raise self._refusal(Refused(str(error))) from None

    def _checked(self, read: Callable[[], Any]) -> Any:
        """What is read of an answer; no answer but the one that was to come is taken."""
        try:
            return read()
        except Refused as error:
            raise self._refusal(error) from None

    def _refusal(self, error: Refused) -> WavecombError:
        self._process.is_idle = False
        self.close()
        return WavecombError(
            f"{self._path}: refused: the process that reads it sent {error}; either the file has "
            "taken that process over, or this is a fault of Wavecomb's (isolate=False does without)"
        )

    def _ask(
        self,
        kind: str,
        body: Mapping[str, Any],
        wanted: str,
        take: Callable[[Message], bool] = lambda message: False,
    ) -> Message:
        """Sends a message, and gives the one that answers it; ``take`` is given those before."""
        if self._limits is not None:
            body = {**body, "limits": self._limits}
        if self._is_closed:
            raise WavecombError(f"{self._path}: is read no more, after what went wrong before")
        self._process.is_idle = False
        try:
            self._sender.send(kind, body)
            self._limits = None
            answer: Message | Exception | None = None
            while answer is None and (message := self._receiver.receive()) is not None:
                if message.kind == wanted:
                    answer = message
                elif message.kind == "error":
                    answer = read_error(message.body)
                elif not take(message):
                    raise Refused(f"a message {message.kind[:32]!r}")
        except Refused as error:
            raise self._ended(error) from None
        except MemoryError:
            self.close()
            raise WavecombError(self._out_of_memory()) from None
        except OSError as error:
            if isinstance(error, ConnectionError):
                raise self._ended(None) from None
            self.close()
            raise
        except BaseException:
            self.close()
            raise
        if answer is None:
            raise self._ended(None)
        self._process.is_idle = True
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _ended(self, error: Refused | None) -> WavecombError:
        """What to say where the process ended, or sent what is no message.

        One that crashes while it writes ends in the midst of a message.
        """
        if error is not None and not str(error).startswith("a message that ends"):
            return self._refusal(error)
        line = self._process.obituary()
        self.close()
        return WavecombError(f"{self._path}: {line}")

    def _out_of_memory(self) -> str:
        limit = "" if self._most is None else f"; the limit is {self._most / MEGABYTE:.0f} MB"
        return f"{self._path}: out of memory while it was read{limit}"


def _outline(answer: Message) -> Outline:
    from wavecomb.run.boxed.outline import read_outline

    return read_outline(answer.body.get("tree"), answer.arrays)


def _choices(answer: Message) -> list[RenderChoice]:
    found = answer.body.get("choices")
    if not isinstance(found, list) or not found:
        raise Refused("no choice of render settings")
    return [plain.read_choice(value) for value in found]


def _counts(message: Message) -> tuple[int, int]:
    done, found = message.body.get("done"), message.body.get("found")
    if type(done) is not int or type(found) is not int:
        raise Refused("progress that is none")
    return done, found


def _store(
    limit: Any, before: _core.TextureStore | None, report: LoadReport
) -> _core.TextureStore | None:
    """What keeps textures within the limit; of a limit that is none, who reads will say so."""
    if not isinstance(limit, (int, float)) or not limit > 0 or math.isnan(limit):
        return None
    scene: Any = None
    reuse = None if before is None else TextureCache(scene, {}, {}, before)
    return texture_store(limit, reuse, report)
