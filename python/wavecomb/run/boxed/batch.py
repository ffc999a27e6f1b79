# SPDX-License-Identifier: Apache-2.0
"""Small plain meshes, many in one message: one of its own for each took longer than reading it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SMALL = 1 << 12
"""Bytes of an array; larger ones are remembered from frame to frame (``wire``)."""
_MOST = 512
"""Meshes of one message: the other side builds while more are read."""
_NO_GROUP = 0xFFFFFFFF
_PLAIN = frozenset(("positions", "indices", "material", "name", "asset_length"))


class MeshBatch:
    """What is to go into the next call of ``SceneBuilder.add_meshes``.

    Attributes:
        first: Number of its first mesh.
    """

    def __init__(self) -> None:
        self.first = 0
        self._positions: list[NDArray[np.float32]] = []
        self._indices: list[NDArray[np.uint32]] = []
        self._names: list[str] = []
        self._numbers: list[tuple[int, int, int, int]] = []
        self._groups: list[int] = []

    def __len__(self) -> int:
        return len(self._names)

    @property
    def is_full(self) -> bool:
        """Whether it is to be sent before there are more."""
        return len(self._names) >= _MOST

    @staticmethod
    def takes(arguments: Mapping[str, Any]) -> bool:
        """Whether a call of ``add_mesh`` can be part of one of ``add_meshes``."""
        positions, indices = arguments["positions"], arguments["indices"]
        return (
            arguments.keys() <= _PLAIN
            and positions.ndim == 2
            and max(positions.nbytes, indices.nbytes) < _SMALL
            and indices.dtype == np.uint32
            and "material" in arguments
        )

    def add(self, number: int, arguments: Mapping[str, Any]) -> None:
        """Adds a mesh that is good, with its number in the scene."""
        if not self._names:
            self.first = number
        positions, indices = arguments["positions"], arguments["indices"]
        self._positions.append(positions)
        self._indices.append(indices)
        self._names.append(arguments.get("name", ""))
        length = arguments.get("asset_length", 0)
        self._numbers.append((len(positions), len(indices), arguments["material"], length))
        self._groups.append(_NO_GROUP)

    def put_last(self, group: int, mesh: int) -> bool:
        """Puts its last mesh into a group; False where that is another one, or is in one."""
        if not self._names or mesh != self.first + len(self._names) - 1:
            return False
        if self._groups[-1] != _NO_GROUP:
            return False
        self._groups[-1] = group
        return True

    def call(self) -> dict[str, Any]:
        """The arguments of the call."""
        points, triangles, materials, lengths = np.array(self._numbers, np.uint32).T
        return {
            "positions": np.concatenate(self._positions),
            "indices": np.concatenate(self._indices),
            "points": points,
            "triangles": triangles,
            "materials": materials,
            "asset_lengths": lengths,
            "groups": np.array(self._groups, np.uint32),
            "names": self._names,
        }
