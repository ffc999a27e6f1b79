# SPDX-License-Identifier: Apache-2.0
"""Interface of scheduling policies that are written in Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from wavecomb.errors import WavecombError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

COLUMNS = ("throughput", "position_key", "texture_key")
"""Optional queue columns, which are computed only for policies that name them."""


class SchedulingPolicy:
    """Base of policies, which define the order in which the hits of a queue are shaded.

    Pass an object of a subclass to ``wavecomb.render``. ``order`` receives ids, keys and estimated
    costs, and writes one 64-bit key per record. Records are shaded in ascending key order, with
    equal keys in order of arrival. No policy can change the image; docs/writing-a-policy.md has an
    example.

    Attributes:
        name: Name in statistics.
        columns: Members of ``COLUMNS`` that ``order`` reads.

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
        """Fills ``keys`` in place.

        The render calls this method once per queue, from any thread (one at a time), so the result
        must not depend on previous calls. An exception ends the render and is raised by the render
        function.

        Args:
            queue: Arrays with one entry per record, in order of arrival: "program", "material" and
                the requested ``columns``; "depth", an int; and arrays by material id:
                "material_texture" (its largest texture, 0xffffffff for none),
                "material_texture_bytes" and "material_graph" (its value graph, 0xffffffff for
                none).
            costs: "material_ns" and "texture_ns", arrays by id, and "mean_ns": estimated cost of a
                record in nanoseconds, constant during a pass.
            keys: (records,) zeros to be overwritten.

        Returns:
            False keeps the order of arrival without sorting; None or True sorts by the keys.
        """
        raise NotImplementedError


def check_policy(policy: Any) -> None:
    """Raises WavecombError with a one-line message unless the object is a valid policy."""
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
