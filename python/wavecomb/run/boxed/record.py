# SPDX-License-Identifier: Apache-2.0
"""A scene builder, in the sandbox, whose scene is built by who asked for it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from wavecomb import _core
from wavecomb.run.boxed.batch import MeshBatch
from wavecomb.run.boxed.calls import CALLS
from wavecomb.run.boxed.wire import Sender
from wavecomb.usd.looks.texture import Prepared

_NOTHING = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)
_SHAPES = ("add_mesh", "add_curves", "add_points", "add_splats", "replace_mesh")


class RemoteScene:
    """Stands for a scene that was built by who asked for it.

    Attributes:
        number: How many were built before it.
    """

    def __init__(self, number: int) -> None:
        self.number = number


class RemoteStore:
    """Stands for its ``TextureStore``."""

    def __init__(self, limit_bytes: int, sender: Sender) -> None:
        self.limit_bytes = limit_bytes
        self._sender = sender

    def set_waiting(self, size: int) -> None:
        """As that of ``TextureStore``."""
        self._sender.send("waiting", {"bytes": size}, flush=False)


class RecordingBuilder:
    """Takes the calls of ``_core.SceneBuilder`` and sends them on.

    Ids count up, so nobody has to wait for an answer. Shapes that are no good raise what they would
    raise there: a builder of its own looks at them, and forgets them.

    Attributes:
        read_again: Gives the pixels of a texture by its id, for displacement.
    """

    def __init__(self, sender: Sender, scene: int, threads: int = 0) -> None:
        self._sender = sender
        self._scene = scene
        self._threads = threads
        self._counts: Counter[str] = Counter(groups=1)
        self._checker = _core.SceneBuilder(1)
        self._tiles: dict[int, tuple[Any, ...]] = {}
        self._batch = MeshBatch()
        self.read_again: Callable[[int], Prepared] | None = None

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in CALLS:
            raise AttributeError(name)
        call = CALLS[name]
        order = [*call.first, *call.more]

        def record(*values: Any, **named: Any) -> int | None:
            arguments = {**dict(zip(order, values, strict=False)), **named}
            return self._record(name, arguments)

        return record

    def add_mesh(self, positions: Any, indices: Any, **named: Any) -> int:
        """As that of ``SceneBuilder``; small plain ones go over many at a time."""
        arguments = {"positions": positions, "indices": indices, **named}
        if not MeshBatch.takes(arguments):
            number = self._record("add_mesh", arguments)
            assert number is not None
            return number
        if self._problem("add_mesh", arguments) is not None:
            self._record("add_mesh", arguments)  # raises it
        if self._batch.is_full:
            self._send_batch()
        number = self._counts["meshes"]
        self._counts["meshes"] += 1
        self._batch.add(number, arguments)
        return number

    def add_to_group(self, group: int, mesh: int) -> None:
        """As that of ``SceneBuilder``."""
        if not self._batch.put_last(group, mesh):
            self._record("add_to_group", {"group": group, "mesh": mesh})

    def _send_batch(self) -> None:
        """Sends the meshes that wait: before any other call, so that the order stays."""
        if len(self._batch):
            batch, self._batch = self._batch, MeshBatch()
            body = {"call": "add_meshes", "with": batch.call(), "id": batch.first}
            self._sender.send("call", body, flush=False)

    def share_texture(self, scene: RemoteScene, texture: int) -> int:
        """A texture of an earlier scene."""
        number = self._record("share_texture", {"scene": scene.number, "texture": texture})
        assert number is not None
        return number

    def _record(self, name: str, arguments: dict[str, Any]) -> int | None:
        self._send_batch()
        call = CALLS[name]
        error = self._problem(name, arguments) if name in _SHAPES else None
        body: dict[str, Any] = {"call": name, "with": arguments}
        number: int | None = None
        if error is not None:
            body["fails"] = True
        elif call.counts:
            number = body["id"] = self._counts[call.counts]
            self._counts[call.counts] += 1
            if name == "add_tiles":
                self._tiles[number] = tuple(arguments[key] for key in call.first)
        self._sender.send("call", body, flush=False, remember=call.keeps)
        if error is not None:
            raise error
        return number

    def _problem(self, name: str, arguments: dict[str, Any]) -> ValueError | None:
        """What a builder says of a shape."""
        light = arguments.get("mesh_light")
        if light is not None and light < self._counts["mesh lights"]:
            arguments = {**arguments, "mesh_light": None}
        try:
            number = getattr(self._checker, name)(**arguments)
        except ValueError as error:
            return error
        self._checker.replace_mesh(arguments["mesh"] if number is None else number, *_NOTHING)
        return None

    def make_surfaces(self, descriptions: list[dict[str, Any]], threads: int = 0) -> list[Any]:
        """As that of ``SceneBuilder``, with textures that are read again."""
        maker = _core.SceneBuilder(threads or self._threads)
        made: dict[int, int] = {}
        local = [self._with_textures(one, maker, made) for one in descriptions]
        return maker.make_surfaces(local, threads)

    def _with_textures(
        self, description: dict[str, Any], maker: _core.SceneBuilder, made: dict[int, int]
    ) -> dict[str, Any]:
        moves = description.get("displacements")
        if moves is None:
            return description
        local = [
            {**move, "texture": self._texture(move["texture"], maker, made)}
            if isinstance(move, dict)
            else move
            for move in moves
        ]
        return {**description, "displacements": local}

    def _texture(self, number: int, maker: _core.SceneBuilder, made: dict[int, int]) -> int:
        if number not in made:
            if number in self._tiles:
                name, tiles, missing = self._tiles[number]
                parts = [(at, self._texture(part, maker, made)) for at, part in tiles]
                made[number] = maker.add_tiles(name, parts, missing)
            else:
                assert self.read_again is not None
                again = self.read_again(number)
                made[number] = maker.add_texture(
                    again.pixels, srgb=again.srgb, wrap_s=again.wrap_s, wrap_t=again.wrap_t,
                    name=again.name,
                )  # fmt: skip
        return made[number]

    def build(self) -> RemoteScene:
        """What stands for the scene."""
        self._send_batch()
        return RemoteScene(self._scene)
