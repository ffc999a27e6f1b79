# SPDX-License-Identifier: Apache-2.0
"""A page of pairs of pictures that are wiped, with maps of their differences and figures."""

from __future__ import annotations

import os
from collections.abc import Sequence

from wavecomb.picture.compare import Comparison
from wavecomb.picture.compare_folders import Folders, PairResult
from wavecomb.picture.heatmap import Kind, heat_map
from wavecomb.picture.image import display
from wavecomb.picture.pages import Cell, Pair, document, figure_text, pair_section, table
from wavecomb.picture.thumbnails import Look, fitted

MOST_PAIRS = 60
"""Pairs whose pictures are in a page: those that differ most. All are in its table."""
_HEAD = ("picture", "", "differ", "RMSE", "relMSE", "largest", "at")


def compare_page(
    results: Sequence[PairResult],
    look: Look,
    *,
    sources: tuple[str, str],
    folders: Folders | None = None,
    tolerance: float | None = None,
    kind: Kind = "absolute",
    width: int = 1600,
) -> str:
    """HTML that needs nothing else.

    Args:
        results: What came of each pair.
        look: How pictures are shown.
        sources: Names of A and of B, the reference.
        folders: What was compared, where it is more than two files.
        tolerance: Within which pictures pass.
        kind: Of the maps.
        width: Of the pictures in the page at most, pixels.
    """
    ranked = [one for one in results if one.result is not None and not one.passed(tolerance)]
    ranked.sort(key=lambda one: -_rmse(one))
    if folders is None:
        ranked = list(results)
    shown = {one.name: f"pair-{k}" for k, one in enumerate(ranked[:MOST_PAIRS])}
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
            facts += f", {missing} {'picture has' if missing == 1 else 'pictures have'} no other"
    title = f"{_short(sources)[0]} and {_short(sources)[1]}"
    return document(title, facts, overview + "".join(sections))


def _short(sources: tuple[str, str]) -> tuple[str, str]:
    """Names of A and B that tell them apart."""
    names = [os.path.basename(os.path.normpath(one)) for one in sources]
    if names[0] != names[1]:
        return names[0], names[1]
    parents = [os.path.basename(os.path.dirname(os.path.abspath(one))) for one in sources]
    if parents[0] != parents[1]:
        return f"{parents[0]}/{names[0]}", f"{parents[1]}/{names[1]}"
    return "A", "B"


def _rmse(one: PairResult) -> float:
    return 0.0 if one.result is None else one.result.rmse


def _pair(one: PairResult, look: Look, kind: Kind, width: int) -> Pair:
    a, b = (fitted(look.codes(file), width, 4 * width) for file in (one.a, one.b))
    assert one.result is not None
    difference = None
    if not one.result.equal:
        made = heat_map(one.a, one.b, kind, exposure=look.exposure)
        difference = fitted(display(made), max(width, a.shape[1]), 8 * width)
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
    folders: Folders,
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
