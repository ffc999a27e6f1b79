# SPDX-License-Identifier: Apache-2.0
"""Tests that every user of the core's table of camera parameters picks up new rows."""

from __future__ import annotations

import importlib
import importlib.util
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from added_rows import add_rows

from wavecomb import _core as core
from wavecomb import core_table
from wavecomb.core_table import CameraParameter, camera_defaults, camera_parameters

ROOT = Path(__file__).parents[2]
WINDOW = (-1.0, 1.0, -1.0, 1.0)

ADDED = (
    CameraParameter("squint", "How far it is shut.", "number", 0.25, 0.0, ()),
    CameraParameter("mood", "What it is like.", "choice", "calm", None, ("calm", "shaky")),
    CameraParameter("frame_of", "What is left out.", "four", (0.0, 0.0, 0.0, 0.0), None, ()),
    CameraParameter("mirrors", "What it looks into.", "planes", [], None, ()),
)


@pytest.fixture
def with_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adds rows to the table, as if the core had them."""
    add_rows(monkeypatch, camera_parameters, ADDED)


def _scene(**values: Any) -> core.Scene:
    builder = core.SceneBuilder()
    builder.set_camera(np.eye(4), **{"window": WINDOW, **values})
    return builder.build()


OTHER: dict[str, Any] = {
    "number": 0.5,
    "four": (-2.0, 2.0, -1.0, 1.0),
    "planes": [[0.0, 0.0, 1.0, 2.0]],
}
"""A non-default value for each kind of camera parameter."""
OF_NAME: dict[str, Any] = {
    "aperture_blades": 5.0,
    "lens_map": [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 1.0, 1.0]],
}
"""Non-default values of camera parameters that accept a smaller range than their kind."""


def _other(row: CameraParameter) -> Any:
    if row.name in OF_NAME:
        return OF_NAME[row.name]
    return row.choices[-2] if row.kind == "choice" else OTHER[row.kind]


def test_rows_are_the_cores() -> None:
    camera = _scene().camera
    assert list(camera) == ["to_world", *camera_parameters()]
    for name, row in camera_parameters().items():
        if row.default is not None:
            assert camera[name] == (
                pytest.approx(row.default) if row.kind == "number" else row.default
            )
        assert row.help.endswith("."), name
        for choice in row.choices:
            assert _scene(**{name: choice}, far_clip=9).camera[name] == choice
    assert set(camera_defaults()) == set(camera_parameters()) - {"window"}


@pytest.mark.parametrize("name", list(camera_parameters()))
def test_each_row_is_set_kept_edited_and_told_apart(name: str) -> None:
    value = _other(camera_parameters()[name])
    standard, other = _scene(), _scene(**{name: value})
    want = pytest.approx(value) if isinstance(value, float) else value
    assert other.camera[name] == want != standard.camera[name]
    edited = core.Renderer(standard)
    edited.edit(camera={name: value})
    assert edited.scene.camera == other.camera
    digests = [dict(scene.fingerprint())["camera"] for scene in (standard, other, edited.scene)]
    assert digests[0] != digests[1] == digests[2]


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"lens_radius": -1.0}, "the camera's lens_radius is -1; it must be 0 or more"),
        ({"pixel_aspect": 0}, "the camera's pixel_aspect is 0; it must be above 0"),
        ({"exposure": float("inf")}, "the camera's exposure is not finite; give finite numbers"),
        ({"far_clip": float("nan")}, "the camera's far_clip is not finite; give finite numbers"),
        (
            {"window": (0, 1, 0, float("inf"))},
            "the camera's window is not finite; give finite numbers",
        ),
        ({"near_clip": 3, "far_clip": 3}, "the camera's clipping range must end beyond its start"),
        ({"lens_radius": 1, "focus_distance": 0}, "the camera's lens needs a focus distance "
         "above 0"),
        ({"near_clip": "here"}, "the camera: near_clip must be a number"),
        ({"projection": 2}, "the camera: projection must be a name"),
        ({"window": (0, 1)}, "the camera: window must be 4 numbers"),
        ({"clip_planes": [(1, 2)]}, "the camera: clip_planes must be 4 numbers for each plane"),
        ({"motion": np.eye(3)}, "the camera: motion must be 4 x 4 numbers for each step"),
    ],
)  # fmt: skip
def test_values_that_are_none_are_refused(values: dict[str, Any], line: str) -> None:
    with pytest.raises(core.Error) as caught:
        _scene(**values)
    assert str(caught.value) == line
    with pytest.raises(core.Error) as caught:
        core.Renderer(_scene()).edit(camera=values)
    assert str(caught.value) == line


def test_what_is_missing_or_unknown_is_named() -> None:
    with pytest.raises(core.Error, match="the camera has no window; give one"):
        core.SceneBuilder().set_camera(np.eye(4))
    with pytest.raises(core.Error, match=r"the camera has no parameter 'fov'.*'near_clip'"):
        _scene(fov=30)


def test_lists_that_stand_elsewhere_are_the_tables() -> None:
    from wavecomb.load_options import PROJECTIONS
    from wavecomb.usd.render_settings.reader import CONFORMS

    assert camera_parameters()["projection"].choices == PROJECTIONS
    assert camera_parameters()["conform"].choices == CONFORMS


def test_the_stub_is_the_tables() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "update_stub"), "--check"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_an_added_row_is_in_the_stub(with_rows: None) -> None:
    stub = runpy.run_path(str(ROOT / "tools" / "update_stub"))
    text = stub["updated"](stub["STUB"].read_text())
    assert "        # How far it is shut.\n        squint: float = 0.25,\n" in text
    assert '        mood: Literal["calm", "shaky"] = "calm",\n' in text
    assert "        frame_of: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),\n" in text


def test_an_added_row_is_kept_by_poses_of_the_window(with_rows: None) -> None:
    from wavecomb.gui.viewport import navigate
    from wavecomb.gui.viewport.navigate import pose_of_scene

    camera = {**_scene(pixel_aspect=2).camera, "squint": 0.5}
    pose = navigate.orbit(pose_of_scene(camera, "/Cam"), np.zeros(3), 0.1, 0.0, "Y")
    options = pose.options()
    assert (options["squint"], options["mood"], options["pixel_aspect"]) == (0.5, "calm", 2.0)
    assert options.keys() == {"transform", *core_table.camera_parameters()}


def test_an_added_row_is_taken_back_by_a_frame_without_it(with_rows: None) -> None:
    reader = importlib.import_module("wavecomb.run.frame_reader")
    assert reader.camera_defaults()["squint"] == 0.25
