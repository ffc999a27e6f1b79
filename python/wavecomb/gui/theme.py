# SPDX-License-Identifier: Apache-2.0
"""Dark and light themes: palettes, plot colours, and sizes relative to the font."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QFontMetricsF, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication, QToolTip

SYSTEM, DARK, LIGHT = "system", "dark", "light"
CHOICES = (SYSTEM, DARK, LIGHT)

# For each colour scheme, the colours of Qt's palette roles: window, base, alternate base, button,
# text, dimmed text, lines, highlight and link.
_COLOURS = {
    DARK: (
        "#333333", "#202020", "#262626", "#454545", "#e2e2e2", "#939393", "#181818", "#3f74b5",
        "#8ab4e8",
    ),
    LIGHT: (
        "#f2f3f5", "#ffffff", "#f6f7f9", "#e6e8ec", "#1b1d21", "#767c86", "#b9bec7", "#2f6fd6",
        "#1a5cc8",
    ),
}  # fmt: skip
# Colours of plotted curves, which are distinguishable in greyscale and with common colour vision
# deficiencies. They are adapted from Okabe and Ito 2008.
_SERIES = {
    DARK: ("#56b4e9", "#e69f00", "#2fbf8f", "#f0e442", "#d98cc0", "#ff7f50", "#9aa7ff", "#c0c5cc"),
    LIGHT: ("#0072b2", "#c67a00", "#00835f", "#8a7d00", "#a8508a", "#c04a00", "#4a54c4", "#5a6068"),
}


class _Theme(QObject):
    """Object that emits a signal when the colours of the theme change."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.choice = DARK


_theme: _Theme | None = None


def _the() -> _Theme:
    global _theme
    if _theme is None:
        _theme = _Theme()
        QGuiApplication.styleHints().colorSchemeChanged.connect(lambda scheme: _follow())
    return _theme


def _follow() -> None:
    if _the().choice == SYSTEM:
        apply(SYSTEM)


def on_change(call: Callable[[], None]) -> None:
    """Calls a method of a QObject when the theme's colours change, while the object exists."""
    _the().changed.connect(call)


def choice() -> str:
    """Returns the name of the chosen theme: "system", "dark" or "light"."""
    return _the().choice


def is_dark() -> bool:
    """Returns whether the current theme is dark."""
    if _the().choice != SYSTEM:
        return _the().choice == DARK
    return QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark


def apply(chosen: str) -> None:
    """Applies a theme to the application; "system" follows the theme of the desktop."""
    application = QApplication.instance()
    assert isinstance(application, QApplication)
    theme = _the()
    theme.choice = chosen
    if application.style().objectName() != "fusion":
        application.setStyle("Fusion")
    application.setPalette(palette(is_dark()))
    QToolTip.setPalette(application.palette())
    theme.changed.emit()


def _name() -> str:
    return DARK if is_dark() else LIGHT


def palette(dark: bool) -> QPalette:
    """Returns a palette of all colour roles, for enabled and disabled widgets."""
    window, base, alternate, button, text, dim, line, highlight, link = map(
        QColor, _COLOURS[DARK if dark else LIGHT]
    )
    out = QPalette()
    role = QPalette.ColorRole
    for which, colour in (
        (role.Window, window), (role.WindowText, text), (role.Base, base),
        (role.AlternateBase, alternate), (role.Text, text), (role.Button, button),
        (role.ButtonText, text), (role.BrightText, QColor("white")), (role.ToolTipBase, base),
        (role.ToolTipText, text), (role.PlaceholderText, dim), (role.Highlight, highlight),
        (role.HighlightedText, QColor("white")), (role.Link, link),
        (role.Light, button.lighter(115)), (role.Midlight, button.lighter(107)),
        (role.Mid, line), (role.Dark, line), (role.Shadow, QColor("black")),
        (role.Accent, highlight),
    ):  # fmt: skip
        out.setColor(which, colour)
    disabled = QPalette.ColorGroup.Disabled
    for which in (role.WindowText, role.Text, role.ButtonText, role.HighlightedText):
        out.setColor(disabled, which, dim)
    out.setColor(disabled, role.Highlight, line)
    return out


def series(n: int) -> QColor:
    """Returns the colour of the n-th curve.

    Consecutive colours are distinguishable even in greyscale.
    """
    colours = _SERIES[_name()]
    return QColor(colours[n % len(colours)])


def text() -> QColor:
    """Returns the colour of text in plots."""
    return QColor(_COLOURS[_name()][4])


def dim() -> QColor:
    """Returns the colour of less important text."""
    return QColor(_COLOURS[_name()][5])


def grid() -> QColor:
    """Returns the colour of grid lines."""
    colour = QColor(text())
    colour.setAlphaF(0.18)
    return colour


def surface() -> QColor:
    """Returns the background colour of plots and lists."""
    return QColor(_COLOURS[_name()][1])


def surround() -> QColor:
    """Returns the background colour around images, a neutral grey."""
    return QColor("#181818" if is_dark() else "#777777")


def accent() -> QColor:
    """Returns the colour of selections."""
    return QColor(_COLOURS[_name()][7])


def warning() -> QColor:
    """Returns the colour of warnings."""
    return QColor("#e8a33d" if is_dark() else "#9a5b00")


def error() -> QColor:
    """Returns the colour of errors."""
    return QColor("#ff7b72" if is_dark() else "#b3261e")


def em(count: float = 1.0) -> int:
    """Converts a length in font heights to device-independent pixels."""
    return round(QFontMetricsF(QApplication.font()).height() * count)
