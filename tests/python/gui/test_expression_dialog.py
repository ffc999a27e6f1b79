# SPDX-License-Identifier: Apache-2.0
"""Tests light path expressions in the window: checks while typing, saving, and display."""

import numpy as np
import pytest

import wavecomb
from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.panels.display_bar import EXPRESSION
from wavecomb.gui.viewport.panels.expression_dialog import aovs_with, problem_of


def test_what_is_wrong_is_said():
    setup = Setup(width=32, height=32, spp=1)

    def problem(text, name="a", groups=(), how=setup):
        return problem_of(how, name, text, groups)

    assert problem("C<RD>L") == problem("C.*<L.'key'>", groups=("key",)) == ""
    assert "Write an expression" in problem("  ")
    assert problem("C<RQ>L").startswith("at character 4 ('Q')")
    assert problem("C<RD") and problem("C(RD")
    assert "it does not begin with a camera" in problem("<RD>L")
    assert "the name may contain only letters, digits" in problem("CL", name="a b")
    assert problem("C<L.'rim'>", groups=("key", "fill")) == (
        "There is no light group 'rim' in the stage; there are: key, fill."
    )
    with_light = Setup(width=32, height=32, spp=1, transport="light")
    assert problem("C<RD>L", how=with_light) == ""


def test_one_of_the_same_name_makes_way():
    setup = Setup(aovs=("beauty", "lpe:a=CL", "lpe:b=CO", "depth"))
    assert aovs_with(setup, "a", "CB") == ("beauty", "lpe:b=CO", "depth", "lpe:a=CB")


@pytest.mark.slow
def test_typed_checked_and_shown(cornell_window, qtbot):
    window, display = cornell_window, cornell_window.display
    session = window.session
    display.choose_layer(EXPRESSION)
    dialog = display.ask_expression()
    assert dialog.isVisible() and window.viewport.look.layer == "beauty"
    assert not dialog.show_layer.isEnabled()
    dialog.known.setCurrentText("diffuse_direct")
    dialog.take("diffuse_direct")
    assert dialog.text.text() == "C<RD>[LO]" and dialog.show_layer.isEnabled()
    dialog.text.setText("C<RD>[LO")
    assert not dialog.show_layer.isEnabled() and "at " in dialog.note.text()
    dialog.name.setText("direct")
    dialog.text.setText("C<RD>[LO]")
    assert "lpe_direct" in dialog.note.text()
    version = session.version
    dialog.show_layer.click()
    assert session.version > version and not dialog.isVisible()

    def shown(layer):
        frame = session.last_frame
        return frame.final and frame.version == session.version and frame.layer(layer) is not None

    qtbot.waitUntil(lambda: shown("lpe_direct"), timeout=20000)
    assert window.viewport.look.layer == "lpe_direct"
    titles = [display.layer.itemText(i) for i in range(display.layer.count())]
    assert titles[-2:] == ["direct (light path)", "Light path\u2026"]
    frame = session.last_frame
    whole = wavecomb.render(
        session.stage.scene, size=(96, 96), spp=4, aovs=("lpe:direct=C<RD>[LO]",)
    )
    assert np.array_equal(frame.layer("lpe_direct"), whole.aovs["lpe_direct"])
    assert frame.layer("lpe_direct").max() > 0
    display.choose_layer("beauty")
    version = session.version
    display.choose_layer("lpe_direct")
    assert session.version == version, "a layer that is kept needs no new render"
    dialog = display.ask_expression()
    dialog.text.setText("CO")
    dialog.show_layer.click()
    qtbot.waitUntil(lambda: shown("lpe_direct"), timeout=20000)
    assert sum("direct=" in aov for aov in session.setup.aovs) == 1
