# SPDX-License-Identifier: Apache-2.0
"""Tests motion blur of volumes by velocity fields: closed forms, schedules and stages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs, only_where
from test_usd_volumes import field, grid, the_volume, volume
from voxels import bricks

import wavecomb
from wavecomb import _core, vdb

pytestmark = needs("wavecomb._core")
with_vdb = only_where(vdb.is_there(), "this build is without OpenVDB")

SIZE = 24
SPEED = np.array([0.6, 0.0, 0.0])


def grid_of(voxels: Any, low: Any, high: Any, **more: Any) -> Any:
    """Returns voxels between two corners."""
    low, high = np.array(low, float), np.array(high, float)
    place = np.diag([*((high - low) / (np.array(voxels.shape[:3]) - 1)), 1.0])
    place[3, :3] = low
    return _core.VolumeGrid(*bricks(voxels), place, **more)


def wind(speed: Any = SPEED) -> Any:
    """Returns a constant velocity field."""
    values = np.broadcast_to(np.float32(speed), (8, 8, 8, 3)).copy()
    return grid_of(values, (-4, -4, -4), (4, 4, 4), is_signed=True)


def picture(builder: Any, spp: int, **more: Any) -> Any:
    """Renders along -z in front of a wall of radiance 1, with an orthographic camera."""
    wall = builder.add_material("emissive", emission=(1.0, 1.0, 1.0))
    corners = np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], np.float32)
    mesh = builder.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), material=wall)
    builder.add_to_group(0, mesh)
    camera = np.eye(4)
    camera[3, 2] = 4
    builder.set_camera(camera, projection="orthographic", window=(-1, 1, -1, 1))
    settings = _core.Settings(
        width=SIZE, height=SIZE, spp=spp, max_depth=1, filter="box", filter_width=1.0, **more
    )
    return np.asarray(_core.render(builder.build(), settings, None, None, None).beauty, float)


def seen_through_a_slab(x: Any, seconds: tuple[float, float], sigma: float, edge: float) -> Any:
    """Returns the mean of exp(-sigma d(x - v t) L) over the shutter.

    The density d of a slab [-edge, edge] falls linearly to 0 within a voxel.
    """
    voxel = 2 * edge / 15
    times = np.linspace(*seconds, 801)
    at = np.abs(np.asarray(x)[..., None] - SPEED[0] * times)
    density = np.clip(1 - (at - edge) / voxel, 0, 1)
    length = 2 * edge + voxel
    return np.exp(-sigma * density * length).mean(axis=-1)


@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_the_opacity_of_a_slab_that_moves_evenly(kind: Any) -> None:
    """Compares columns of the image, also outside of the grid's bounds at the frame."""
    builder = _core.SceneBuilder()
    edge, sigma, seconds = 0.3, 2.0, (-0.5, 1.0)
    place = np.eye(4)
    values = np.ones((16, 16, 16), kind)
    builder.add_volume(
        place, density=grid_of(values, (-edge,) * 3, (edge,) * 3), extinction=(sigma,) * 3,
        albedo=(0, 0, 0), velocity=wind(), seconds=seconds,
    )  # fmt: skip
    seen = picture(builder, 1024)[..., 0]
    rows = seen[SIZE // 2 - 3 : SIZE // 2 + 3]
    sub = np.linspace(-1, 1, SIZE * 50 + 1)
    sub = 0.5 * (sub[1:] + sub[:-1])
    exact = seen_through_a_slab(sub, seconds, sigma, edge).reshape(SIZE, 50).mean(axis=1)
    error = rows.std(axis=0, ddof=1) / np.sqrt(len(rows)) + 1e-3
    assert np.all(np.abs(rows.mean(axis=0) - exact) < 5 * error)
    assert abs(rows.mean() - exact.mean()) < 2e-3
    assert exact[-4] < 0.95 and rows.mean(axis=0)[-4] < 0.96


def test_light_moves_with_it() -> None:
    """For emission alone, the image contains the total emission at the moved position."""
    ends = []
    for seconds in ((0.0, 0.0), (0.5, 0.5)):
        builder = _core.SceneBuilder()
        values = np.zeros((8, 8, 8, 3), np.float32)
        values[3:5, 3:5, 3:5] = (1.0, 2.0, 3.0)
        builder.add_volume(
            np.eye(4), density=grid_of(np.ones((8, 8, 8), np.float32), (-0.5,) * 3, (0.5,) * 3),
            extinction=(0, 0, 0), emission=(1, 1, 1), velocity=wind((1.0, 0.5, 0.0)),
            emission_grid=grid_of(values, (-0.4,) * 3, (0.4,) * 3), seconds=seconds,
        )  # fmt: skip
        ends.append(picture(builder, 256)[..., :3] - 1.0)
    assert np.allclose(ends[0].sum(axis=(0, 1)), ends[1].sum(axis=(0, 1)), rtol=0.01)
    for axis, moved in ((1, 0.5), (0, -0.25)):
        places = np.linspace(-1, 1, SIZE, endpoint=False) + 1 / SIZE
        middles = [(one.sum(axis=(1 - axis, 2)) * places).sum() / one.sum() for one in ends]
        assert middles[1] - middles[0] == pytest.approx(moved, abs=0.01)


def swirl() -> Any:
    """Returns smoke whose density, colour and emission move by different velocities."""
    rng = np.random.default_rng(5)
    density = np.where(rng.random((16, 16, 16)) < 0.5, 0.0, rng.random((16, 16, 16)) * 6.0)
    builder = _core.SceneBuilder()
    builder.add_volume(
        np.eye(4), density=grid_of(density.astype(np.float16), (-0.5,) * 3, (0.5,) * 3),
        color=grid_of(rng.random((8, 8, 8, 3)).astype(np.float32), (-0.5,) * 3, (0.5,) * 3),
        albedo=(0.9, 0.8, 0.7), extinction=(2.0, 1.0, 0.5), anisotropy=0.4,
        emission=(0.1, 0.0, 0.2), seconds=(-0.2, 0.3),
        velocity=grid_of(
            rng.uniform(-1, 1, (8, 8, 8, 3)).astype(np.float16), (-0.6,) * 3, (0.6,) * 3,
            is_signed=True,
        ),
    )  # fmt: skip
    builder.add_light("dome", np.eye(4), color=(0.5, 0.6, 0.7))
    camera = np.eye(4)
    camera[3, 2] = 3
    builder.set_camera(camera, window=(-0.25, 0.25, -0.25, 0.25))
    return builder.build()


def test_one_picture_whatever_renders_it() -> None:
    scene = swirl()

    def beauty(**changes: Any) -> Any:
        base = {"width": 20, "height": 14, "spp": 8, "max_depth": 6, "costs": "model"}
        settings = _core.Settings(**{**base, **changes})
        return _core.render(scene, settings, None, None, None).beauty

    whole = beauty()
    for changes in (
        {"integrator": "reference"},
        {"lanes": 1, "threads": 1},
        {"wave_size": 64, "policy": "material"},
        {"ray_order": "morton", "materialize": "on"},
    ):
        np.testing.assert_array_equal(beauty(**changes), whole)
    part = beauty(region=(5, 3, 15, 11), crop=True)
    np.testing.assert_array_equal(part, whole[3:11, 5:15])


def test_a_render_goes_on_bit_for_bit() -> None:
    """Resumed passes and adaptive sampling also work with motion."""
    scene = swirl()
    once = wavecomb.render(scene, size=(16, 12), spp=16)
    parts = wavecomb.render(scene, size=(16, 12), spp=16, progressive=True)
    assert np.array_equal(once.beauty, parts.beauty)
    noisy = wavecomb.render(scene, size=(16, 12), spp=64, noise=0.1)
    assert np.array_equal(
        noisy.beauty, wavecomb.render(scene, size=(16, 12), spp=64, noise=0.1, threads=1).beauty
    )


# Stages

HEAD = """#usda 1.0
( timeCodesPerSecond = 48 )
"""


def stage(fields: str, more: str = "") -> str:
    return HEAD + volume(fields, more)


@with_vdb
@pytest.mark.parametrize("name", ["velocity", "vel", "v"])
def test_velocities_are_per_second(tmp_path: Path, name: str) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(0.5), grid(-2.0, 3, name=name)])
    text = stage(field() + field(name))
    found, _, report = the_volume(tmp_path, text, frame=1, shutter=(-0.25, 0.5))
    assert found["seconds"] == pytest.approx((-0.25 / 48, 0.5 / 48))
    assert found["velocity"]["signed"] and (found["velocity"]["values"] == -2).all()
    assert "not supported" not in report
    for options in ({"motion_blur": False}, {"shutter": (0.0, 0.0)}):
        still, _, _ = the_volume(tmp_path, text, frame=1, **options)
        assert still["velocity"] is None


@with_vdb
def test_arnolds_scale(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(0.5), grid(1.0, 3, name="v")])
    for scale, seconds in (("0.5", (0.0, 0.5 / 48)), ("0", None)):
        more = f"float primvars:arnold:velocity_scale = {scale}"
        text = stage(field() + field("v"), more)
        found, _, _ = the_volume(tmp_path, text, frame=1, shutter=(0, 1))
        if seconds is None:
            assert found["velocity"] is None
        else:
            assert found["seconds"] == pytest.approx(seconds)


@with_vdb
def test_what_does_not_move_is_said(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(0.5), *(grid(1.0, name=f"vel_{a}") for a in "xyz")])
    three = "".join(field(f"vel_{axis}") for axis in "xyz")
    _, _, report = the_volume(tmp_path, stage(field() + three), frame=1, shutter=(0, 1))
    assert "velocities of volumes in three grids" in report
    bad = grid(1.0, 3, name="v")
    bad["values"][0, 0, 0, 0] = np.inf
    vdb.write(tmp_path / "a.vdb", [grid(0.5), bad])
    with pytest.raises(wavecomb.WavecombError, match="infinite or NaN"):
        the_volume(tmp_path, stage(field() + field("v")), frame=1, shutter=(0, 1))


@with_vdb
def test_motion_blur_changes_the_image(tmp_path: Path) -> None:
    vdb.write(tmp_path / "a.vdb", [grid(3.0), grid(20.0, 3, name="v")])
    path = tmp_path / "s.usda"
    path.write_text(stage(field() + field("v")))
    pictures = []
    for blur in (True, False):
        loaded = wavecomb.load(path, frame=1, shutter=(-1, 1), motion_blur=blur)
        pictures.append(wavecomb.render(loaded, size=(16, 16), spp=16).beauty)
    assert not np.array_equal(*pictures)
