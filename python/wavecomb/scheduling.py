# SPDX-License-Identifier: Apache-2.0
"""Base class for scheduling policies that are written in Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from wavecomb.errors import WavecombError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

COLUMNS = ("throughput", "position_key", "texture_key")
"""Optional columns of a queue of hits; they are computed only for policies that list them."""


class SchedulingPolicy:
    """Base class of scheduling policies, which choose the order in which queued hits are shaded.

    Pass an instance of a subclass to ``wavecomb.render``. The method ``order`` reads material ids
    and estimated costs, and writes one 64-bit key per record (a queued hit). Records are shaded in
    ascending order of keys; records with equal keys keep their order of arrival. A policy cannot
    change the image. An example is in docs/writing-a-policy.md.

    Attributes:
        name: Name of the policy in statistics.
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

        The renderer calls this method once per queue, on any thread, but never concurrently. The
        result must not depend on previous calls. If this method raises an exception, the render
        ends and raises the exception.

        Args:
            queue: Arrays by name. "program", "material" and the requested ``columns`` have one
                entry per record, in order of arrival. "depth" is an int. "material_texture"
                (largest texture, 0xffffffff for none), "material_texture_bytes" and
                "material_graph" (value graph, 0xffffffff for none) have one entry per material id.
            costs: Estimated costs of shading a record in nanoseconds, constant during a pass:
                "material_ns" by material id, "texture_ns" by texture id, and "mean_ns", the mean
                over measured records.
            keys: (records,) array of zeros that this method overwrites.

        Returns:
            False to keep the order of arrival without sorting; None or True to sort by the keys.
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
