# SPDX-License-Identifier: Apache-2.0
"""Style of figures.

Colours are distinguishable for colour-blind readers, the text colour follows the page, and each
line is labelled at its end.
"""

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
from wavecomb.image.files.output_file import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

INK = "#1a1b1e"
"""Colour of text, axes and baselines. In the HTML report it becomes the text colour of the page."""
FAINT = "#8a8d93"
WHISKERS = 4.0
"""Factor by which a logarithmic axis may extend beyond the points to show whiskers."""
INTERVALS = "Whiskers: 95 % intervals"
MAX_PANELS = 12
"""Largest number of panels of a figure; figures with more panels are left out."""
WIDTH = 7.4
"""Width of a figure in inches, equal to a column of text in print."""

# Colours of Okabe and Ito 2008, "Color universal design", without yellow, which is hardly visible
# on white.
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
class CaptionedFigure:
    """Figure with its title and caption.

    Attributes:
        name: Name of the files; unique in a report.
        title: Short title.
        caption: Caption with content and unit, the meaning of whiskers, and the number of runs.
        figure: Matplotlib figure.
    """

    name: str
    title: str
    caption: str
    figure: Figure


@contextmanager
def style() -> Iterator[None]:
    """Applies the style while figures are made and saved."""
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
    """Creates a figure as wide as a column of text (``WIDTH``).

    ``heights`` are the relative heights of the rows. Returns the figure and its axes, row by row.
    """
    made = needed("matplotlib.figure", "a figure").Figure(
        figsize=(WIDTH, height), layout="constrained"
    )
    axes = made.subplots(
        rows, columns, squeeze=False, sharex=share_x, sharey=share_y, height_ratios=heights
    )
    return made, list(axes.ravel())


def policy_colour(policy: str) -> str:
    """Returns the colour of a policy, the same in all figures; bounds are grey."""
    return _POLICY.get(policy, BROWN)


def marker(index: int) -> str:
    """Returns a marker shape, which distinguishes series if colours do not."""
    return MARKERS[index % len(MARKERS)]


def colour(index: int) -> str:
    """Returns the colour of a series that has no fixed colour."""
    return CYCLE[index % len(CYCLE)]


def label_ends(axes: Axes, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Writes the label of each series at its last point, without overlaps."""
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
    """Formats a range of counts, such as "8" or "3 to 8"."""
    low, high = int(min(sizes)), int(max(sizes))
    return str(low) if low == high else f"{low} to {high}"


def fixed(value: float, digits: int) -> str:
    """Formats a number with a fixed number of decimals, without a minus sign for 0."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def clipped(low: float, high: float, values: Sequence[float]) -> tuple[float, float]:
    """Returns limits for a logarithmic axis, which cut off very long whiskers.

    The interval of two or three disturbed runs can span several powers of ten. Long intervals then
    extend beyond the axes, and the points remain distinguishable.

    >>> clipped(1e-9, 1e6, [0.5, 2.0])
    (0.125, 8.0)
    """
    return max(low, min(values) / WHISKERS), min(high, max(values) * WHISKERS)


def plain_logarithm(axis: Axis, subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Labels a logarithmic axis with plain numbers, few enough to be readable."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    low, high = axis.get_view_interval()
    decades = math.log10(high / low)
    if decades < 0.8:
        axis.set_major_locator(MaxNLocator(4))
    else:
        axis.set_major_locator(LogLocator(subs=tuple(subs) if decades < 2.2 else (1.0,)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.6g}"))


def lay_out(drawn: CaptionedFigure) -> None:
    """Computes the layout once, so that saving two formats does not compute it again."""
    drawn.figure.draw_without_rendering()
    drawn.figure.set_layout_engine("none")


def svg(drawn: CaptionedFigure) -> str:
    """Returns the figure as an <svg> element, with the text colour of the page and unique ids."""
    buffer = io.StringIO()
    blank = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    drawn.figure.savefig(buffer, format="svg", metadata=blank)
    text = buffer.getvalue()
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = text.replace(INK, "currentColor")
    # Verdana has the same widths as DejaVu Sans, and is available where DejaVu Sans is not.
    text = text.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
    text = re.sub(r'\b(id="|url\(#|href="#)', rf"\g<1>{drawn.name}-", text)
    # Remove the height of the SVG image: the page determines its width, and its view box the aspect
    # ratio.
    return re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)


def save(drawn: CaptionedFigure, drawing: str, folder: Path) -> None:
    """Writes NAME.svg and NAME.png with a white background, each atomically.

    ``drawing`` is the result of ``svg``.
    """
    with replacing(folder / f"{drawn.name}.svg") as part:
        on_white = drawing.replace("<svg", f'<svg style="background: #fff; color: {INK}"', 1)
        part.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{on_white}\n', encoding="utf-8")
    with replacing(folder / f"{drawn.name}.png") as part:
        drawn.figure.savefig(part, format="png", facecolor="white")
