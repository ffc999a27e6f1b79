# SPDX-License-Identifier: Apache-2.0
"""How figures look: colours that all can tell apart, ink that follows the page, direct labels."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.extras import needed
from wavecomb.picture.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

INK = "#1a1b1e"
"""The colour of text, axes and what is compared with; in the report the page's own."""
FAINT = "#8a8d93"
WHISKERS = 4.0
"""How far a logarithmic axis goes beyond the points, as a factor."""
INTERVALS = "Whiskers: 95 % intervals"
MOST_PANELS = 12
"""Figures with more panels are left out."""
WIDTH = 7.4
"""Width of a figure in inches: a column of text in print."""

# Okabe and Ito 2008, "Color universal design"; without yellow, which paper does not show.
BLUE, SKY, ORANGE, RED = "#0072b2", "#56b4e9", "#e69f00", "#d55e00"
GREEN, PURPLE, BROWN = "#009e73", "#cc79a7", "#8c6d1f"
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, BROWN)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_POLICY = {
    **{"none": INK, "program": BLUE, "material": ORANGE, "texture": GREEN},
    **{"texture-locality": SKY, "cost-benefit": RED, "adaptive": PURPLE},
    **{"random-runs": FAINT, "oracle": FAINT, "oracle-best": FAINT, "oracle-worst": FAINT},
}
_STYLE = Path(__file__).parent / "report.mplstyle"


@dataclass(frozen=True)
class Drawn:
    """A figure with its words.

    Attributes:
        name: Of its files; unique in a report.
        title: Short.
        caption: What is shown, in which unit, what whiskers are, how many runs.
        figure: Matplotlib's.
    """

    name: str
    title: str
    caption: str
    figure: Figure


@contextmanager
def style() -> Iterator[None]:
    """Applies the style of figures while they are made and saved."""
    with needed("matplotlib.style", "a figure").context(_STYLE):
        yield


def figure(
    rows: int,
    columns: int,
    height: float,
    *,
    heights: Sequence[float] | None = None,
    share_x: bool = False,
    share_y: bool = False,
) -> tuple[Figure, list[Axes]]:
    """A figure of the column's width and its axes, row by row; ``heights`` is of rows."""
    made = needed("matplotlib.figure", "a figure").Figure(
        figsize=(WIDTH, height), layout="constrained"
    )
    axes = made.subplots(
        rows, columns, squeeze=False, sharex=share_x, sharey=share_y, height_ratios=heights
    )
    return made, list(axes.ravel())


def policy_colour(policy: str) -> str:
    """The colour of a policy, the same in all figures; the bounds are grey."""
    return _POLICY.get(policy, BROWN)


def marker(index: int) -> str:
    """Shapes tell series apart where colours do not."""
    return MARKERS[index % len(MARKERS)]


def colour(index: int) -> str:
    """The colour of a series without one of its own."""
    return CYCLE[index % len(CYCLE)]


def label_ends(axes: Axes, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Names series at their last points, (x, y, text, colour), apart from one another."""
    figure_ = axes.get_figure()
    assert figure_ is not None
    point = figure_.dpi / 72.0
    placed: list[tuple[float, float]] = []
    for x, y, text, shade in sorted(ends, key=lambda end: end[1]):
        pixel_x, pixel_y = (float(v) for v in axes.transData.transform((x, y)))
        target = pixel_y
        for other_x, other_y in placed:
            if abs(other_x - pixel_x) < 60.0 * point:
                target = max(target, other_y + 10.5 * point)
        placed.append((pixel_x, target))
        moved = (target - pixel_y) / point
        axes.annotate(
            text,
            (x, y),
            xytext=(8, moved),
            textcoords="offset points",
            va="center",
            color=shade,
            fontsize=8,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": shade,
                "linewidth": 0.4,
                "relpos": (0.0, 0.5),
                "shrinkA": 1,
                "shrinkB": 3,
            }
            if moved > 2.0
            else None,
        )


def count_words(sizes: Any) -> str:
    """How many: "8", or "3 to 8"."""
    low, high = int(min(sizes)), int(max(sizes))
    return str(low) if low == high else f"{low} to {high}"


def fixed(value: float, digits: int) -> str:
    """A figure with so many decimals; no minus before 0."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def clipped(low: float, high: float, values: Sequence[float]) -> tuple[float, float]:
    """Limits of a logarithmic axis on which no whisker is much longer than what is compared.

    Intervals of two or three disturbed runs can span decades; they run out of the axes then, and
    points can still be told apart.

    >>> clipped(1e-9, 1e6, [0.5, 2.0])
    (0.125, 8.0)
    """
    return max(low, min(values) / WHISKERS), min(high, max(values) * WHISKERS)


def plain_logarithm(axis: Axis, subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Numbers as people write them on a logarithmic axis, few enough to be read."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    low, high = axis.get_view_interval()
    decades = math.log10(high / low)
    if decades < 0.8:
        axis.set_major_locator(MaxNLocator(4))
    else:
        axis.set_major_locator(LogLocator(subs=tuple(subs) if decades < 2.2 else (1.0,)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.6g}"))


def lay_out(drawn: Drawn) -> None:
    """Finds places for everything once, so that saving in two formats does not find them again."""
    drawn.figure.draw_without_rendering()
    drawn.figure.set_layout_engine("none")


def svg(drawn: Drawn) -> str:
    """The figure as an <svg> element for a page: ink in the page's colour, ids of its own."""
    buffer = io.StringIO()
    blank = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    drawn.figure.savefig(buffer, format="svg", metadata=blank)
    text = buffer.getvalue()
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = text.replace(INK, "currentColor")
    # Verdana has the widths of DejaVu Sans, and is there where the other is not.
    text = text.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
    text = re.sub(r'\b(id="|url\(#|href="#)', rf"\g<1>{drawn.name}-", text)
    # The page sets the width; the view box keeps the shape.
    return re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)


def save(drawn: Drawn, drawing: str, folder: Path) -> None:
    """Writes NAME.svg, given as ``svg`` made it, and NAME.png, on white, whole or not at all."""
    with replacing(folder / f"{drawn.name}.svg") as part:
        on_white = drawing.replace("<svg", f'<svg style="background: #fff; color: {INK}"', 1)
        part.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{on_white}\n', encoding="utf-8")
    with replacing(folder / f"{drawn.name}.png") as part:
        drawn.figure.savefig(part, format="png", facecolor="white")
