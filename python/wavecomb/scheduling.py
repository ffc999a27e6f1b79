# SPDX-License-Identifier: Apache-2.0
"""The order of shading: policies written in Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from wavecomb.errors import WavecombError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

COLUMNS = ("throughput", "position_key", "texture_key")
"""Columns of a queue that are worked out only for policies that name them."""


class SchedulingPolicy:
    """Gives each queue of hits the order in which it is shaded. Subclass it and pass an object.

    ``order`` sees ids, keys and estimated costs, and writes one 64-bit key per record. Records are
    shaded in ascending order of key, equal keys in order of arrival. No policy can change the
    picture; docs/writing-a-policy.md has an example.

    Attributes:
        name: Shown in statistics.
        columns: Which of ``COLUMNS`` ``order`` reads.

    >>> class CheapestFirst(SchedulingPolicy):
    ...     name = "cheapest-first"
    ...
    ...     def order(self, queue, costs, keys):
    ...         keys[:] = 1000 * costs["material_ns"][queue["material"]]
    >>> wavecomb.render("mixed.usdc", policy=CheapestFirst())  # doctest: +SKIP
    """

    name: str = "python"
    columns: ClassVar[tuple[str, ...]] = ()

    def order(
        self, queue: Mapping[str, Any], costs: Mapping[str, Any], keys: NDArray[np.uint64]
    ) -> bool | None:
        """Fills ``keys``, in place.

        Called once a queue, from any of the render's threads (one at a time), so it must not
        depend on what was called before. An exception ends the render and is raised there.

        Args:
            queue: Arrays of one entry a record, in order of arrival: "program", "material" and
                the ``columns`` asked for; "depth", an int; and arrays by material id:
                "material_texture" (its largest texture, 0xffffffff for none),
                "material_texture_bytes" and "material_graph" (its value graph, likewise).
            costs: "material_ns" and "texture_ns", arrays by id, and "mean_ns": estimated cost of a
                record in nanoseconds, frozen while a pass runs.
            keys: (records,), zeros, to be filled.

        Returns:
            False to keep the order of arrival, and then nothing is sorted; None or True otherwise.
        """
        raise NotImplementedError


def check_policy(policy: Any) -> None:
    """Raises WavecombError, in one line, unless the object can serve as a policy."""
    kind = type(policy).__name__
    if isinstance(policy, type):
        raise WavecombError(f"policy is the class {policy.__name__}: give an object, with ()")
    if not isinstance(getattr(policy, "name", None), str):
        raise WavecombError(f"policy {kind}: name must be a string")
    columns = getattr(policy, "columns", None)
    if isinstance(columns, str) or not isinstance(columns, (tuple, list)):
        raise WavecombError(f"policy {kind}: columns must be a tuple of names")
    for column in columns:
        if column not in COLUMNS:
            raise WavecombError(
                f"policy {kind}: column {column!r} is not known; there are {', '.join(COLUMNS)}"
            )
    if not callable(getattr(policy, "order", None)):
        raise WavecombError(f"policy {kind}: has no method order(queue, costs, keys)")
