# SPDX-License-Identifier: Apache-2.0
"""Makes the calls that came from a sandbox, on a builder of the core."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from wavecomb import _core
from wavecomb.errors import WavecombError
from wavecomb.run.boxed.calls import CALLS, GRIDS
from wavecomb.run.boxed.wire import Message, Refused


class Replay:
    """Builds one scene."""

    def __init__(
        self,
        builder: _core.SceneBuilder,
        *,
        scenes: Mapping[int, _core.Scene],
        store: _core.TextureStore | None = None,
        give_back: Callable[[int], None] = lambda size: None,
    ) -> None:
        """Begins with nothing.

        Args:
            builder: Is told.
            scenes: Whose textures may be shared, by number.
            store: That of the builder.
            give_back: Is told how many bytes of arrays the builder did not keep.
        """
        self._builder = builder
        self._scenes = scenes
        self._store = store
        self._give_back = give_back
        self._grids: list[_core.VolumeGrid] = []

    def make(self, message: Message) -> None:
        """Makes one call.

        Raises:
            Refused: There is no such call, or it comes to something else than it was to.
            WavecombError: There is no room for a texture.
            _core.Error: What the builder says.
        """
        body = message.body
        name, arguments = body.get("call"), body.get("with")
        if not isinstance(name, str) or name not in CALLS:
            raise Refused(f"a call {str(name)[:64]!r}, which there is none of")
        if not isinstance(arguments, dict) or body.keys() - {"call", "with", "id", "fails"}:
            raise Refused(f"a call {name} of another form")
        call = CALLS[name]
        values = call.read(arguments, message.arrays)
        if "scene" in values:
            values["scene"] = self._scene(values["scene"])
        fails = body.get("fails", False)
        try:
            number = self._called(name, values)
        except TypeError:
            raise Refused(f"a call {name} with other arguments") from None
        except ValueError as error:
            if fails is True:
                return
            if name == "add_texture":  # no room for it
                raise WavecombError(str(error)) from None
            raise
        if fails is not False or number != body.get("id"):
            raise Refused(f"a call {name} that comes to {number}, not to {body.get('id')!r:.32}")
        if not call.keeps and (self._store is not None or name != "add_texture"):
            self._give_back(sum(array.nbytes for array in message.arrays))

    def _called(self, name: str, values: dict[str, Any]) -> Any:
        """What a call comes to; grids of volumes are kept here, by their numbers."""
        if name == "make_volume_grid":
            self._grids.append(_core.VolumeGrid(**values))
            return len(self._grids) - 1
        if name == "add_volume":
            values = {**values, **{use: self._grid(values.get(use)) for use in GRIDS}}
        return getattr(self._builder, name)(**values)

    def _grid(self, number: int | None) -> _core.VolumeGrid | None:
        if number is None:
            return None
        if number >= len(self._grids):
            raise Refused(f"grid {number} of a volume, which is not there")
        return self._grids[number]

    def wait(self, message: Message) -> None:
        """Notes what lies ready in the sandbox to become textures."""
        size = message.body.get("bytes")
        if type(size) is not int or not 0 <= size < 1 << 63:
            raise Refused("something for a size")
        if self._store is not None:
            self._store.set_waiting(size)

    def _scene(self, number: int) -> _core.Scene:
        scene = self._scenes.get(number)
        if scene is None:
            raise Refused(f"textures of scene {number}, which is not there")
        return scene
