# SPDX-License-Identifier: Apache-2.0
"""Compares the images of two folders or sequences, and writes an HTML page with the results."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.image.compare.comparison import Comparison, compare
from wavecomb.image.compare.heatmap import Kind, heat_map
from wavecomb.image.files.image import display
from wavecomb.image.files.output_file import kind_of
from wavecomb.image.pages import Cell, Pair, document, figure_text, pair_section, table
from wavecomb.image.thumbnails import DisplayOptions, fit_image
from wavecomb.run.frame_names import frame_text, has_place, matching

ENDINGS = (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr")
"""File extensions of the images that a folder comparison includes."""


def is_many(source: str) -> bool:
    """Returns whether a name stands for several images: a folder, or a frame placeholder.

    An existing file whose name contains a placeholder counts as a single file.
    """
    return os.path.isdir(source) or (has_place(source) and not os.path.exists(source))


def images_of(source: str) -> dict[str, str]:
    """Returns files by name: the frames of a sequence in order, or all images in a folder tree.

    Args:
        source: A folder, or a name with a frame placeholder, such as ``out/shot.####.exr``.

    Raises:
        WavecombError: The source contains no images.
    """
    try:
        if os.path.isdir(source):
            found = {name: os.path.join(source, name) for name in _below(source)}
        else:
            found = {frame_text(frame): file for frame, file in matching(source).items()}
    except OSError as error:
        raise WavecombError(f"{source}: {error.strerror or error}") from error
    if not found:
        what = "image in it" if os.path.isdir(source) else "such file"
        raise WavecombError(f"{source}: there is no {what}")
    return found


def _below(folder: str) -> list[str]:
    names = []
    for path in Path(folder).rglob("*"):
        relative = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in relative.parts)
        if path.suffix.lower() in ENDINGS and path.is_file() and not is_hidden:
            names.append(relative.as_posix())
    return sorted(names, key=natural)


def collect(sources: Iterable[str]) -> dict[str, str]:
    """Returns all images in folders, sequences and files by name, in the given order.

    Raises:
        WavecombError: A source does not exist.
    """
    found: dict[str, str] = {}
    for source in sources:
        if is_many(source):
            found.update(images_of(source))
        elif os.path.isfile(source):
            found[os.path.basename(source) if len(found) else source] = source
        else:
            kind = kind_of(source)
            why = "no such file" if kind is None else f"is {kind}, not a regular file"
            raise WavecombError(f"{source}: {why}")
    return found


def natural(name: str) -> list[tuple[int, int, str]]:
    """Returns a key that sorts names with numbers by the values of the numbers.

    >>> sorted(["a10.exr", "a9.exr"], key=natural)
    ['a9.exr', 'a10.exr']
    """
    parts = re.split(r"(\d+)", name)
    return [(1, int(part), "") if k % 2 else (0, 0, part) for k, part in enumerate(parts)]


@dataclass(frozen=True)
class PairResult:
    """Comparison of two images with the same name.

    Attributes:
        name: Path of both images inside their folders, or the frame number.
        a: File of image A.
        b: File of the reference image B.
        result: Differences of the images; None if the images cannot be compared.
        problem: Reason why the images cannot be compared, or "".
    """

    name: str
    a: str
    b: str
    result: Comparison | None
    problem: str = ""

    def passed(self, tolerance: float | None) -> bool:
        """Returns whether the images are bit-identical, or differ by at most a tolerance."""
        if self.result is None:
            return False
        within = tolerance is not None and self.result.within(tolerance)
        return self.result.equal or within


@dataclass(frozen=True)
class FolderPair:
    """Images of two folders or sequences, paired by name.

    Attributes:
        pairs: Files of A and B for each name that both sides have.
        only_a: Names of images that only A has.
        only_b: Names of images that only B has.
    """

    pairs: dict[str, tuple[str, str]]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]

    def compared(self) -> Iterator[PairResult]:
        """Compares the pairs one after another.

        For an unreadable image, the result contains the problem.
        """
        for name, (a, b) in self.pairs.items():
            try:
                yield PairResult(name, a, b, compare(a, b))
            except (OSError, ValueError) as error:
                yield PairResult(name, a, b, None, " ".join(str(error).split()))


def pair_up(a: str, b: str) -> FolderPair:
    """Pairs the images of two folders by path, or of two sequences by frame.

    Args:
        a: A folder, or a file name with a frame placeholder.
        b: Folder, or file name with a frame placeholder, of the reference images.

    Raises:
        WavecombError: A source does not exist, or the two sources have no name in common.
    """
    for one, other in ((a, b), (b, a)):
        if not is_many(one):
            raise WavecombError(f"{one} is one image, but {other} names several")
    in_a, in_b = images_of(a), images_of(b)
    pairs = {name: (file, in_b[name]) for name, file in in_a.items() if name in in_b}
    if not pairs:
        raise WavecombError(f"{a} and {b} have no images with the same name or frame")
    only_a = tuple(name for name in in_a if name not in in_b)
    only_b = tuple(name for name in in_b if name not in in_a)
    return FolderPair(pairs, only_a, only_b)


def as_plain(pair: PairResult, tolerance: float | None) -> dict[str, Any]:
    """Returns the result of a pair as a dictionary that can be written as JSON."""
    found = {} if pair.result is None else pair.result.to_dict()
    passed = pair.passed(tolerance)
    return {"name": pair.name, "a": pair.a, "b": pair.b, "passed": passed,
            "problem": pair.problem or None, **found}  # fmt: skip


# ---- Page with pairs of images under a wipe line, difference maps and figures --------------------


MAX_PAIRS = 60
"""Maximum number of pairs whose images are in a page. The pairs that differ most are chosen; the
table lists all pairs."""
_HEAD = ("picture", "", "differ", "RMSE", "relMSE", "largest", "at")


def compare_page(
    results: Sequence[PairResult],
    look: DisplayOptions,
    *,
    sources: tuple[str, str],
    folders: FolderPair | None = None,
    tolerance: float | None = None,
    kind: Kind = "absolute",
    width: int = 1600,
) -> str:
    """Returns a self-contained HTML page with comparisons.

    Args:
        results: Results of comparing the pairs.
        look: Display options for the images in the page.
        sources: Names of the folders or files A and B, of which B is the reference.
        folders: The compared folders; None if two files were compared.
        tolerance: Largest channel difference at which a pair passes.
        kind: Kind of the difference maps, as for ``heat_map``.
        width: Largest width, in pixels, of images in the page.
    """
    ranked = [one for one in results if one.result is not None and not one.passed(tolerance)]
    ranked.sort(key=lambda one: -_rmse(one))
    if folders is None:
        ranked = list(results)
    shown = {one.name: f"pair-{k}" for k, one in enumerate(ranked[:MAX_PAIRS])}
    sections = [
        pair_section(_pair(one, look, kind, width), shown[one.name], _short(sources))
        for one in results
        if one.name in shown
    ]
    overview = "" if folders is None else _overview(results, folders, shown, tolerance)
    good = sum(one.passed(tolerance) for one in results)
    facts = f"A: {sources[0]}; B, the reference: {sources[1]}"
    if folders is not None:
        missing = len(folders.only_a) + len(folders.only_b)
        facts += f"; {good} of {len(results)} pairs pass"
        if missing:
            facts += f", {missing} {'image has' if missing == 1 else 'images have'} no counterpart"
    title = f"{_short(sources)[0]} and {_short(sources)[1]}"
    return document(title, facts, overview + "".join(sections))


def _short(sources: tuple[str, str]) -> tuple[str, str]:
    """Returns different short names for A and B, with the parent folder if necessary."""
    names = [os.path.basename(os.path.normpath(one)) for one in sources]
    if names[0] != names[1]:
        return names[0], names[1]
    parents = [os.path.basename(os.path.dirname(os.path.abspath(one))) for one in sources]
    if parents[0] != parents[1]:
        return f"{parents[0]}/{names[0]}", f"{parents[1]}/{names[1]}"
    return "A", "B"


def _rmse(one: PairResult) -> float:
    return 0.0 if one.result is None else one.result.rmse


def _pair(one: PairResult, look: DisplayOptions, kind: Kind, width: int) -> Pair:
    a, b = (fit_image(look.codes(file), width, 4 * width) for file in (one.a, one.b))
    assert one.result is not None
    difference = None
    if not one.result.equal:
        made = heat_map(one.a, one.b, kind, exposure=look.exposure)
        difference = fit_image(display(made), max(width, a.shape[1]), 8 * width)
    return Pair(one.name, _facts(one.result), a, b, difference)


def _facts(found: Comparison) -> list[str]:
    if found.equal:
        return ["Equal, bit for bit."]
    share = 100.0 * found.pixels_different / (found.width * found.height)
    lines = [
        f"{found.pixels_different} pixels differ ({share:.3g} %); RMSE {found.rmse:.4g}, "
        f"relMSE {found.rel_mse:.4g}, largest {found.max_abs:.4g}"
        + (f", of luminance at {found.luminance_max_at}" if found.luminance_max_at else "")
    ]
    differ = [name for name, entry in found.layers.items() if not entry["equal"]]
    if differ:
        lines.append(f"Layers that differ: {', '.join(differ)}")
    for label, names in (("A", found.only_a), ("B", found.only_b)):
        if names:
            lines.append(f"Layers of {label} alone: {', '.join(names)}")
    return lines


def _overview(
    results: Sequence[PairResult],
    folders: FolderPair,
    shown: dict[str, str],
    tolerance: float | None,
) -> str:
    rows: list[list[Cell | str]] = []
    for one in results:
        found, name = one.result, Cell(one.name, shown.get(one.name, ""))
        if found is None:
            rows.append([name, Cell(one.problem, mark="bad word"), *[""] * 5])
            continue
        word = "equal" if found.equal else "within" if one.passed(tolerance) else "different"
        mark = "good word" if one.passed(tolerance) else "bad word"
        where = "" if found.luminance_max_at is None else str(found.luminance_max_at)
        figures = (found.rmse, found.rel_mse, found.max_abs)
        share = 100.0 * found.pixels_different / (found.width * found.height)
        rows.append(
            [name, Cell(word, mark=mark), f"{share:.3g} %", *map(figure_text, figures), where]
        )
    for label, names in (("A", folders.only_a), ("B", folders.only_b)):
        rows += [[name, Cell(f"only in {label}", mark="bad word"), *[""] * 5] for name in names]
    return table(_HEAD, rows)
