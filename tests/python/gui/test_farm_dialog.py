# SPDX-License-Identifier: Apache-2.0
"""Tests that Render > Send to a farm submits and monitors a job with the window's state."""

import json

import pytest
from pxr import Sdf

from wavecomb.errors import WavecombError
from wavecomb.farm import Folder, status
from wavecomb.gui.farm_job import describe
from wavecomb.image.files.image import read_layers


def test_a_job_is_what_is_shown(cornell_window, tmp_path):
    window = cornell_window
    session = window.session
    session.change(width=40, height=32, spp=3, max_depth=4, region=(1, 2, 30, 20))
    camera = session.pose.path
    told = describe(session, window.scene.edits.edits, str(tmp_path / "a.exr"))
    assert told["stage"] == str(session.path)
    options = told["options"]
    assert options["size"] == [40, 32] and options["spp"] == 3 and options["max_depth"] == 4
    assert options["region"] == [1, 2, 30, 20] and options["camera"] == camera
    json.dumps(told)
    with pytest.raises(WavecombError, match=r"ends in \.exr"):
        describe(session, None, "a.png")
    session.use_camera(None)
    with pytest.raises(WavecombError, match="the view is free"):
        describe(session, None, str(tmp_path / "a.exr"))


@pytest.mark.slow
def test_sent_and_watched(cornell_window, qtbot, tmp_path):
    """The job includes the edits, and the dialog shows its progress."""
    window = cornell_window
    edits = window.scene.edits
    light = next(prim for prim in edits.edits.stage.Traverse() if prim.GetTypeName() == "RectLight")
    key = (str(light.GetPath()), "inputs:intensity")
    before = light.GetAttribute("inputs:intensity").Get()
    edits.edits.stage.SetEditTarget(edits.edits.stage.GetSessionLayer())
    light.GetAttribute("inputs:intensity").Set(before * 2)
    assert edits.edits.lines(), key
    window.actions_by_name["farm"].trigger()
    dialog = window._dialog
    output = tmp_path / "a.exr"
    dialog.output.setText(str(output))
    dialog.engine.setText("local:1")
    dialog.tiles.setText("2x1")
    dialog.begin()
    assert not dialog.send.isEnabled() and dialog.stop.isEnabled()
    qtbot.waitUntil(lambda: dialog.send.isEnabled() or dialog.folder is not None, timeout=60000)
    assert dialog.folder is not None, dialog.state.text()
    qtbot.waitUntil(lambda: dialog.send.isEnabled(), timeout=100000)
    assert ": done" in dialog.state.text(), dialog.state.text()
    assert dialog.bar.value() == dialog.bar.maximum() == 2
    folder = Folder(dialog.folder)
    assert status(folder).state == "done" and folder.job.tiles == (2, 1)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "a.edits.usda"))
    assert layer and folder.job.stage == layer.realPath
    assert read_layers(output)["beauty"].shape == (96, 96, 3)
    # The dialog reports what cannot be sent.
    dialog.begin()
    qtbot.waitUntil(lambda: dialog.send.isEnabled(), timeout=60000)
    assert "already exists" in dialog.state.text()
    dialog.close()


def test_nothing_to_send(window):
    window.actions_by_name["farm"].trigger()
    assert window._dialog is None and "there is no stage" in window.message.text()
