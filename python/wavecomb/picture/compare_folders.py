# SPDX-License-Identifier: Apache-2.0
"""Says how the pictures of two folders, or of two sequences, differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.picture.collect import is_many, pictures_of
from wavecomb.picture.compare import Comparison, compare


@dataclass(frozen=True)
class PairResult:
    """Two pictures of one name.

    Attributes:
        name: Below the folders, or the frame.
        a: File.
        b: The reference.
        result: How they differ; None: they cannot be compared.
        problem: Why not; "" where they can.
    """

    name: str
    a: str
    b: str
    result: Comparison | None
    problem: str = ""

    def passed(self, tolerance: float | None) -> bool:
        """Whether they are equal, or within a tolerance."""
        if self.result is None:
            return False
        within = tolerance is not None and self.result.within(tolerance)
        return self.result.equal or within


@dataclass(frozen=True)
class Folders:
    """What there is to compare.

    Attributes:
        pairs: Name -> files of A and of B.
        only_a: Names that only A has.
        only_b: Names that only B has.
    """

    pairs: dict[str, tuple[str, str]]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]

    def compared(self) -> Iterator[PairResult]:
        """Each pair in turn; what cannot be read or compared is a result, too."""
        for name, (a, b) in self.pairs.items():
            try:
                yield PairResult(name, a, b, compare(a, b))
            except (OSError, ValueError) as error:
                yield PairResult(name, a, b, None, " ".join(str(error).split()))


def pair_up(a: str, b: str) -> Folders:
    """Pictures of two folders by their names below them, of two sequences by their frames.

    Args:
        a: A folder, or a name with a place for the frame.
        b: The reference, likewise.

    Raises:
        WavecombError: One is not there, or they have no name in common.
    """
    for one, other in ((a, b), (b, a)):
        if not is_many(one):
            raise WavecombError(f"{one} is one picture, and {other} stands for many")
    in_a, in_b = pictures_of(a), pictures_of(b)
    pairs = {name: (file, in_b[name]) for name, file in in_a.items() if name in in_b}
    if not pairs:
        raise WavecombError(f"{a} and {b} have no picture of one name, or of one frame")
    only_a = tuple(name for name in in_a if name not in in_b)
    only_b = tuple(name for name in in_b if name not in in_a)
    return Folders(pairs, only_a, only_b)


def as_plain(pair: PairResult, tolerance: float | None) -> dict[str, Any]:
    """A pair for JSON."""
    found = {} if pair.result is None else pair.result.to_dict()
    passed = pair.passed(tolerance)
    return {"name": pair.name, "a": pair.a, "b": pair.b, "passed": passed,
            "problem": pair.problem or None, **found}  # fmt: skip
