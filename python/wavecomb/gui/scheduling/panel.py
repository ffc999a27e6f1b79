# SPDX-License-Identifier: Apache-2.0
"""Scheduling panel: settings for the order and amount of work, which can change during a render."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scheduling import choices
from wavecomb.gui.scheduling.policy_file import OwnPolicy, first_line, load_policies
from wavecomb.gui.scheduling.render_rounds import Rounds
from wavecomb.gui.scheduling.setting_controls import (
    ChoiceBox,
    Control,
    add_row,
    control_of,
    show_control,
)
from wavecomb.gui.scheduling.work_group import WorkGroup
from wavecomb.gui.viewport.picture_light import PictureLight
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.gui.widgets import ask_file, named, tool
from wavecomb.run.error_messages import describe

_POLICY_FILTER = "Python (*.py);;All files (*)"
_PROFILE_FILTER = "Cost profile (*.json);;All files (*)"


class SchedulingPanel(QScrollArea):
    """Panel of the session's scheduling settings.

    The panel itself stores only the list of loaded policies.
    """

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._policies: list[OwnPolicy] = []
        self._policy_file: str | None = None
        self._loads: dict[str, int] = {}
        self._controls: dict[str, Control] = {}
        self.light = PictureLight(session)
        self.rounds = Rounds(session, self)
        self._work = WorkGroup(session)
        inner = QWidget()
        column = QVBoxLayout(inner)
        column.addLayout(self._presets_row())
        column.addWidget(self._order_group())
        column.addWidget(self._work)
        column.addStretch(1)
        self.setWidget(inner)
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self.setObjectName("scheduling_panel")
        self.setAccessibleName("Scheduling")
        self.setMinimumWidth(inner.minimumSizeHint().width() + theme.em(1.2))
        session.setup_changed.connect(self._show)
        self.rounds.moved.connect(self._show_rounds)
        self.rounds.ended.connect(self._end_rounds)
        self._show(session.setup)

    def shutdown(self) -> None:
        """Ends the thread of the indicator that compares image bits."""
        self.light.shutdown()

    # ---- construction
    # --------------------------------------------------------------------------------

    def _presets_row(self) -> QHBoxLayout:
        row = QHBoxLayout()
        self._preset = named(QComboBox(), "preset", "Preset", "Sets the group below.")
        self._preset.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self._preset.setMinimumContentsLength(12)
        self._preset.setPlaceholderText("Own choice")
        for name, (tip, values) in choices.presets().items():
            self._preset.addItem(name, values)
            index = self._preset.count() - 1
            self._preset.setItemData(index, tip, Qt.ItemDataRole.ToolTipRole)
        self._preset.activated.connect(
            lambda index: self._session.change(**self._preset.itemData(index))
        )
        tip = "Resets this panel to the default settings."
        reset = named(QPushButton("Reset"), "reset", "Reset", tip)
        reset.clicked.connect(self._reset)
        row.addWidget(self._preset, 1)
        row.addWidget(reset)
        return row

    def _order_group(self) -> QGroupBox:
        group = QGroupBox("Order of work")
        form = QFormLayout(group)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._promise = QLabel()
        self._promise.setWordWrap(True)
        self._promise.setObjectName("promise")
        form.addRow(self._promise)
        form.addRow(self.light)
        self._try = named(
            QPushButton("Try every policy"), "try_every_policy", "Try every policy",
            "Renders the picture with each policy in turn and compares the bits; then restores "
            "the policy. Press again to stop.",
        )  # fmt: skip
        self._try.clicked.connect(self._try_every_policy)
        form.addRow(self._try)
        buttons: dict[str, tuple[tuple[str, str, str, Any], ...]] = {
            "policy": (
                ("load_policy", "Load…", "Load a custom policy: a Python file that "
                 "defines a subclass of wavecomb.SchedulingPolicy.", self._ask_policy),
                ("reload_policy", "↻", "Reload the file after an edit.",
                 self._reload_policy),
            ),
            "costs": (
                ("load_profile", "File…", "Start with the costs of an earlier render: "
                 "the file written by --costs FILE.json.", self._ask_profile),
            ),
        }  # fmt: skip
        for one in choices.fields_of("order", without=("progressive",)):
            control = self._controls[one.field] = control_of(one, self._choose)
            field = QWidget()
            row = QHBoxLayout(field)
            row.setContentsMargins(0, 0, 0, 0)
            row.addWidget(control, 1)
            for name, text, tip, call in buttons.get(one.field, ()):
                button = tool(name, text, tip)
                button.setAccessibleName(tip.partition(":")[0].partition(",")[0])
                button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
                button.clicked.connect(call)
                row.addWidget(button)
            add_row(form, one.label, control, field)
        return group

    # ---- actions
    # -------------------------------------------------------------------------------------

    def _choose(self, field: str, value: Any) -> None:
        if field == "policy":
            own = value if isinstance(value, OwnPolicy) else None
            values = {"own_policy": own} if own else {"own_policy": None, "policy": value}
        elif field == "costs":
            values = {"profile": value} if isinstance(value, dict) else {
                "profile": None, "costs": value
            }  # fmt: skip
        else:
            values = {field: value}
        if not self._session.change(**values):
            self._show(self._session.setup)

    def _show(self, setup: Setup) -> None:
        for field, control in self._controls.items():
            value = getattr(setup, field)
            if field == "policy" and setup.own_policy is not None:
                value = setup.own_policy
            if field == "costs" and setup.profile is not None:
                value = setup.profile
            show_control(control, value)
        self._promise.setText(choices.promise(setup))
        reload_button = self.findChild(QToolButton, "reload_policy")
        assert reload_button is not None
        reload_button.setEnabled(self._policy_file is not None)
        presets = list(choices.presets().values())
        self._preset.setCurrentIndex(
            next(
                (
                    i
                    for i, (_, values) in enumerate(presets)
                    if all(_same(getattr(setup, name), v) for name, v in values.items())
                ),
                -1,
            )
        )

    def _box(self, name: str) -> ChoiceBox:
        box = self._controls[name]
        assert isinstance(box, ChoiceBox)
        return box

    def _reset(self) -> None:
        names = (*choices.ORDER_FIELDS, *choices.WORK_FIELDS, "own_policy", "profile")
        self._session.change(**choices.defaults(names))

    # ---- policies and profiles from files -------------------------------------------------------

    def _ask_policy(self) -> None:
        start = self._policy_file or ""
        ask_file(self, "Load a policy", _POLICY_FILTER, self.load_policy, start=start)

    def load_policy(self, path: str) -> None:
        """Adds the policies in a Python file to the menu and selects the first of them.

        Errors are shown in the message bar.
        """
        try:
            policies = load_policies(path)
        except Exception as error:
            self._session.failed.emit(describe(error))
            return
        self._policy_file = path
        box = self._box("policy")
        for policy in policies:
            count = self._loads[policy.name] = self._loads.get(policy.name, 0) + 1
            # An edited policy counts as a different policy, so its runs form a separate series.
            name = policy.name if count == 1 else f"{policy.name} {count}"
            own = OwnPolicy(policy, path, name)
            box.add(own, name, f"{first_line(policy)} ({Path(path).name})")
            self._policies.append(own)
        self._choose("policy", self._policies[-len(policies)])

    def _reload_policy(self) -> None:
        if self._policy_file is not None:
            self.load_policy(self._policy_file)

    def _ask_profile(self) -> None:
        ask_file(self, "Load costs", _PROFILE_FILTER, self.load_profile)

    def load_profile(self, path: str) -> None:
        """Loads a file of shading costs, with which later renders start.

        Errors are shown in the message bar.
        """
        from wavecomb.run.cost_profile import load_costs

        try:
            profile = load_costs(path)
        except Exception as error:
            self._session.failed.emit(describe(error))
            return
        self._box("costs").add(profile, Path(path).name, f"From {path}, then measured.")
        self._choose("costs", profile)

    # ---- trying all policies
    # -------------------------------------------------------------------------

    def _try_every_policy(self) -> None:
        if self.rounds.running:
            self.rounds.stop()
            return
        now = self._session.setup
        first = {"policy": now.policy, "own_policy": now.own_policy}
        others = [{"policy": name, "own_policy": None} for name in choices.choice("policy").values]
        self.rounds.start([first, *(one for one in others if one != first)])

    def _show_rounds(self, done: int, count: int) -> None:
        self._try.setText(f"Trying {min(done + 1, count)} of {count}: stop")

    def _end_rounds(self, whole: bool) -> None:
        self._try.setText("Try every policy")


def _same(a: Any, b: Any) -> bool:
    return a is b or (type(a) is type(b) and a == b)
