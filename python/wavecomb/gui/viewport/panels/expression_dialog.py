# SPDX-License-Identifier: Apache-2.0
"""Dialog for a light path expression, which is checked while typing and shown as a layer."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from PySide6.QtWidgets import (
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.session import Session
from wavecomb.gui.widgets import choice, named, set_text_colour
from wavecomb.run import expressions
from wavecomb.run.error_messages import describe

OWN = "custom"
"""Entry of the combo box for expressions without a name, which the user types."""


def aovs_with(setup: Setup, name: str, text: str) -> tuple[str, ...]:
    """Returns the AOVs of a setup and an added expression.

    An expression of the same name is replaced.
    """
    layer = expressions.LAYER + name
    others = [aov for aov in setup.aovs if expressions.layer_of(aov) != layer]
    return (*others, f"{expressions.PREFIX}{name}={text}")


def problem_of(setup: Setup, name: str, text: str, groups: Sequence[str]) -> str:
    """Returns the reason why an expression cannot be rendered as a layer, or "" if it can.

    Args:
        setup: Setup of the render.
        name: Name of the layer, without the prefix ``lpe_``.
        text: The expression.
        groups: Light groups of the stage.
    """
    if not text.strip():
        return "Write an expression, such as C<RD>L, or choose a named one."
    try:
        setup.changed(aovs=aovs_with(setup, name, text))
    except Exception as error:
        return describe(error).replace(f"light path expression {name}={text}: ", "")
    unknown = [group for group in re.findall(r"'([^']*)'", text) if group not in groups]
    if unknown:
        there = ", ".join(groups) or "none"
        return f"There is no light group '{unknown[0]}' in the stage; there are: {there}."
    return ""


class ExpressionDialog(QDialog):
    """Dialog that asks for a light path expression and the name of its layer.

    Attributes:
        known: Combo box of the named expressions.
        name: Field for the name of the layer.
        text: Field for the expression.
        note: Label that says what is wrong with the expression.
        show_layer: Button that adds the layer to the render and shows it.
    """

    def __init__(
        self, session: Session, shown: Callable[[str], object], parent: QWidget | None = None
    ) -> None:
        """Creates the dialog. The render does not change until the user accepts.

        Args:
            session: Session whose render gets the new layer.
            shown: Function that is called with the layer's name after the render was restarted.
            parent: Parent of the dialog.
        """
        super().__init__(parent)
        self.setObjectName("expression")
        self.setWindowTitle("Light path expression")
        self._session, self._shown = session, shown
        self.known = choice(
            "expression.known", "Known",
            "Expressions with names in Arnold and Karma; choosing one fills in the fields below",
            [OWN, *expressions.NAMED], self.take,
        )  # fmt: skip
        self.name = named(
            QLineEdit("lpe"), "expression.name", "Name",
            "NAME of the layer lpe_NAME: letters, digits and underscores",
        )  # fmt: skip
        self.text = named(
            QLineEdit(), "expression.text", "Expression",
            "From the camera to the light: C, then scattering events, then the emitter. "
            "C<RD>L is direct diffuse light, C<T.>.* is everything behind glass",
        )  # fmt: skip
        self.text.setPlaceholderText("C<RD>L")
        self.text.setMinimumWidth(theme.em(24))
        self.note = named(QLabel(), "expression.note", "Note", "Problem of the expression")
        self.note.setWordWrap(True)
        self.show_layer = named(
            QPushButton("&Show"), "expression.show", "Show",
            "Adds the layer, which restarts the render, and shows it",
        )  # fmt: skip
        self.show_layer.setDefault(True)
        self.show_layer.clicked.connect(self.accept)
        self.name.textChanged.connect(self._check)
        self.text.textChanged.connect(self._check)
        session.setup_changed.connect(self._check)
        self._lay_out()
        self._check()

    def _lay_out(self) -> None:
        form = QFormLayout()
        for widget in (self.known, self.name, self.text):
            form.addRow(widget.accessibleName(), widget)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.show_layer)
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addWidget(self.note)
        column.addLayout(buttons)

    def take(self, name: str) -> None:
        """Fills the text field with a named expression."""
        if name in expressions.NAMED:
            self.name.setText(name)
            self.text.setText(expressions.NAMED[name])

    def _check(self) -> None:
        scene = self._session.scene
        groups = () if scene is None else tuple(scene.light_groups)
        name, text = self.name.text(), self.text.text()
        problem = problem_of(self._session.setup, name, text, groups)
        self.note.setText(problem or f"The layer {expressions.LAYER}{name} can be made.")
        set_text_colour(self.note, theme.warning() if problem and text.strip() else theme.dim())
        self.show_layer.setEnabled(not problem)

    def accept(self) -> None:
        """Restarts the render with the layer and closes the dialog."""
        name = self.name.text()
        wanted = aovs_with(self._session.setup, name, self.text.text())
        if self._session.change(aovs=wanted):
            self._shown(expressions.LAYER + name)
            super().accept()
