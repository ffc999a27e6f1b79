# SPDX-License-Identifier: Apache-2.0
"""Tests the scheduling panel by keys and clicks during real renders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt, QThreadPool
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QPushButton, QToolButton

from wavecomb import _core
from wavecomb.gui.scheduling.choices import Choice, fields_of, lane_choices
from wavecomb.gui.scheduling.panel import SchedulingPanel
from wavecomb.gui.viewport import picture_light

MINE = """
import wavecomb

class DearestFirst(wavecomb.SchedulingPolicy):
    name = "dearest-first"

    def order(self, queue, costs, keys):
        keys[:] = 1e9 - 1e3 * costs["material_ns"][queue["material"]]
"""


@pytest.fixture
def panel(session: Any, qtbot: Any) -> SchedulingPanel:
    made = SchedulingPanel(session)
    qtbot.addWidget(made)
    made.resize(420, 900)
    made.show()
    qtbot.waitExposed(made)
    session.restart()
    settle(made, session, qtbot)
    assert made.light.verdict.kind == "first"
    return made


def settle(panel: SchedulingPanel, session: Any, qtbot: Any) -> None:
    """Waits for the end of the render and for the indicator."""

    def is_over() -> bool:
        frame = session.last_frame
        return frame.final and frame.version == session.version and frame.scale == 1

    qtbot.waitUntil(is_over, timeout=30000)
    QThreadPool.globalInstance().waitForDone()
    qtbot.waitUntil(lambda: panel.light.verdict.kind != "waiting", timeout=5000)
    qtbot.wait(10)


def choose(panel: SchedulingPanel, name: str, text: str) -> None:
    """Opens a list and chooses a line with the keyboard."""
    box = panel.findChild(QComboBox, name)
    index = box.findText(text)
    assert index >= 0, (name, text)
    panel.ensureWidgetVisible(box)
    QTest.mouseClick(box, Qt.MouseButton.LeftButton)
    view = box.view()
    QTest.keyClick(view, Qt.Key.Key_Home)
    for _ in range(index):
        QTest.keyClick(view, Qt.Key.Key_Down)
    QTest.keyClick(view, Qt.Key.Key_Return)


def type_number(panel: SchedulingPanel, name: str, text: str) -> None:
    """Types a number and Enter."""
    box = panel.findChild(QAbstractSpinBox, name)
    panel.ensureWidgetVisible(box)
    box.setFocus()
    box.selectAll()
    QTest.keyClicks(box, text)
    QTest.keyClick(box, Qt.Key.Key_Return)


def click(panel: SchedulingPanel, name: str, kind: Any = QPushButton) -> None:
    """Clicks a button."""
    button = panel.findChild(kind, name)
    panel.ensureWidgetVisible(button)
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def expect_same(panel: SchedulingPanel, session: Any, qtbot: Any, count: int) -> None:
    """Asserts that the image is unchanged after at least ``count`` comparisons."""
    settle(panel, session, qtbot)
    assert panel.light.verdict.kind == "same", panel.light.verdict
    assert panel.light.book.checked >= count


def test_each_control_changes_the_setup_and_restarts(
    panel: SchedulingPanel, session: Any, qtbot: Any
) -> None:
    messages: list[str] = []
    session.failed.connect(messages.append)
    before = session.last_frame.beauty.tobytes()
    values: dict[str, Any] = {
        "policy": "texture-locality", "ray_order": "morton", "shadow_order": "direction",
        "lanes": 1, "wave_size": 256, "materialize": "on", "traversal": "single",
        "integrator": "reference", "costs": "model",
    }  # fmt: skip
    assert values.keys() == {
        one.field for one in fields_of("order", ("progressive",)) if isinstance(one, Choice)
    }
    for field, value in values.items():
        version = session.version
        choose(panel, field, str(value))
        assert getattr(session.setup, field) == value
        assert session.version > version, f"{field} restarts the render"
    for field, text, value in (("threads", "1", 1), ("cost_weight", "0.5", 0.5)):
        version = session.version
        type_number(panel, field, text)
        assert getattr(session.setup, field) == value and session.version > version
    expect_same(panel, session, qtbot, 1)
    assert session.last_frame.beauty.tobytes() == before
    assert "texture-locality" in panel.light.verdict.text
    assert session.state == "finished" and not messages


@pytest.mark.slow
def test_every_policy_in_turn_gives_the_same_bits(
    panel: SchedulingPanel, session: Any, qtbot: Any
) -> None:
    session.change(policy="material")
    seen: dict[str, bytes] = {}

    def keep(frame: Any) -> None:
        if frame.final and frame.scale == 1:
            seen[frame.setup.policy] = frame.beauty.tobytes()

    session.frame.connect(keep)
    with qtbot.waitSignal(panel.rounds.ended, timeout=60000) as ended:
        click(panel, "try_every_policy")
        button = panel.findChild(QPushButton, "try_every_policy")
        assert "stop" in button.text()
    assert ended.args == [True] and "stop" not in button.text()
    assert set(seen) == set(_core.policies()) and len(set(seen.values())) == 1
    assert session.setup.policy == "material", "put back"
    expect_same(panel, session, qtbot, len(seen) - 1)


def test_the_rounds_end_where_somebody_takes_over(
    panel: SchedulingPanel, session: Any, qtbot: Any
) -> None:
    with qtbot.waitSignal(panel.rounds.ended, timeout=20000) as ended:
        click(panel, "try_every_policy")
        choose(panel, "lanes", "1")
    assert ended.args == [False] and session.setup.lanes == 1


def test_the_light_sees_another_picture(
    panel: SchedulingPanel, session: Any, qtbot: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(picture_light, "picture_key", lambda setup, revision: ("one",))
    session.restart()
    settle(panel, session, qtbot)
    session.change(seed=5, policy="none")
    qtbot.waitUntil(lambda: panel.light.verdict.kind == "different", timeout=20000)
    assert "none" in panel.light.verdict.text


def test_pictures_of_other_work_are_not_compared(
    panel: SchedulingPanel, session: Any, qtbot: Any
) -> None:
    choose(panel, "roulette", "off")
    settle(panel, session, qtbot)
    assert panel.light.verdict.kind == "first"
    choose(panel, "roulette", "cost-aware")
    assert "but Costs" in panel._promise.text()
    choose(panel, "costs", "measured")
    settle(panel, session, qtbot)
    assert panel.light.verdict.kind == "none"
    type_number(panel, "time_limit", "30")
    assert "clock" in panel._promise.text()


def test_presets_and_reset(panel: SchedulingPanel, session: Any, qtbot: Any) -> None:
    choose(panel, "preset", "Reference: none, 1 lane")
    setup = session.setup
    assert (setup.policy, setup.lanes, setup.ray_order) == ("none", 1, "slot")
    box = panel.findChild(QComboBox, "preset")
    assert box.currentText() == "Reference: none, 1 lane"
    expect_same(panel, session, qtbot, 1)
    choose(panel, "lanes", "auto")
    assert box.currentText() == "Lanes only: none, widest"
    choose(panel, "policy", "material")
    assert box.currentIndex() == -1, "an own choice"
    choose(panel, "roulette", "off")
    choose(panel, "light_selection", "power")
    assert session.setup.light_selection == "power"
    click(panel, "reset")
    setup = session.setup
    assert (setup.policy, setup.roulette) == ("code", "auto")
    assert setup.light_selection == "auto"
    assert box.currentText() == "Default" and session.setup.width == 96


def test_shows_what_was_set_elsewhere(panel: SchedulingPanel, session: Any) -> None:
    version = session.version
    session.change(policy="texture", wave_size=1000, threads=2)
    assert session.version == version + 1, "showing a value changes nothing"
    assert panel.findChild(QComboBox, "policy").currentText() == "texture"
    assert panel.findChild(QComboBox, "wave_size").currentText() == "1\u202f000"
    assert panel.findChild(QAbstractSpinBox, "threads").value() == 2


@pytest.mark.slow
def test_adaptive_sampling(panel: SchedulingPanel, session: Any, qtbot: Any) -> None:
    messages: list[str] = []
    session.failed.connect(messages.append)
    type_number(panel, "spp", "32")
    assert session.setup.spp == 32
    noise = panel.findChild(QAbstractSpinBox, "noise")
    assert not noise.isEnabled()
    choose(panel, "adaptive_mode", "noise")
    assert session.setup.noise == 0.02 and session.setup.adaptive == 0 and noise.isEnabled()
    type_number(panel, "noise", "0.5")
    assert session.setup.noise == 0.5
    choose(panel, "adaptive_mode", "pixel")
    assert session.setup.noise == 0 and session.setup.adaptive == 0.02
    settle(panel, session, qtbot)
    assert panel.light.verdict.kind == "first"
    choose(panel, "policy", "none")
    expect_same(panel, session, qtbot, 1)
    choose(panel, "adaptive_mode", "noise")
    assert session.setup.noise == 0.5 and session.setup.adaptive == 0, "the target as it was"
    type_number(panel, "min_spp", "64")
    assert messages and "min_spp" in messages[-1], "more than there may be"
    assert panel.findChild(QAbstractSpinBox, "min_spp").value() == session.setup.min_spp == 16
    choose(panel, "adaptive_mode", "off")
    assert session.setup.noise == session.setup.adaptive == 0


def test_own_policy(panel: SchedulingPanel, session: Any, qtbot: Any, tmp_path: Path) -> None:
    messages: list[str] = []
    session.failed.connect(messages.append)
    file = tmp_path / "mine.py"
    file.write_text(MINE)
    panel.load_policy(str(file))
    assert panel.findChild(QComboBox, "policy").currentText() == "dearest-first"
    expect_same(panel, session, qtbot, 1)
    assert "dearest-first" in panel.light.verdict.text
    file.write_text(MINE.replace('costs["material_ns"]', 'costs["ns"]'))
    click(panel, "reload_policy", QToolButton)
    qtbot.waitUntil(lambda: bool(messages), timeout=20000)
    assert f"{file}, line 8: KeyError: 'ns'" in messages[0] and "\n" not in messages[0]
    file.write_text("class (")
    click(panel, "reload_policy", QToolButton)
    assert "SyntaxError" in messages[1]
    file.write_text(MINE)
    click(panel, "reload_policy", QToolButton)
    expect_same(panel, session, qtbot, 2)
    assert session.setup.own_policy.name == "dearest-first 3" and len(messages) == 2
    choose(panel, "policy", "program")
    assert session.setup.own_policy is None and session.setup.policy == "program"


def test_costs_from_a_file(
    panel: SchedulingPanel, session: Any, qtbot: Any, tmp_path: Path
) -> None:
    messages: list[str] = []
    session.failed.connect(messages.append)
    file = tmp_path / "costs.json"
    file.write_text("{}")
    panel.load_profile(str(file))
    assert "is not a cost profile" in messages[0] and session.setup.profile is None
    from wavecomb.run.cost_profile import save_costs

    save_costs(file, {"materials": {"/World/Looks/White": 50.0}, "textures": {}})
    panel.load_profile(str(file))
    assert session.setup.profile["materials"] == {"/World/Looks/White": 50.0}
    assert panel.findChild(QComboBox, "costs").currentText() == "costs.json"
    expect_same(panel, session, qtbot, 1)


def test_all_controls_say_what_they_do(panel: SchedulingPanel) -> None:
    for kind in (QComboBox, QAbstractSpinBox, QPushButton, QToolButton):
        for widget in panel.findChildren(kind):
            if widget.objectName().startswith("qt_"):
                continue
            assert widget.toolTip() and widget.objectName(), widget
            assert widget.accessibleName() or widget.text(), widget.objectName()
            assert widget.focusPolicy() != Qt.FocusPolicy.NoFocus
    box = panel.findChild(QComboBox, "policy")
    tips = [box.itemData(i, Qt.ItemDataRole.ToolTipRole) for i in range(box.count())]
    assert all(tips) and len(set(tips)) == len(_core.policies())
    lanes = panel.findChild(QComboBox, "lanes")
    assert [lanes.itemData(i) for i in range(lanes.count())] == list(lane_choices())
