# SPDX-License-Identifier: Apache-2.0
"""Tests that a live render denoises only complete frames, without late or noisy results."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.live import LATE
from wavecomb.gui.viewport.navigate import orbit
from wavecomb.gui.viewport.previews import Filler, Pace, by_first_hit, enlarged


class SlowDenoiser:
    """A denoiser whose first result comes late, and whose pixels hold the sample count of its
    input.
    """

    def __init__(self):
        self.inputs = []
        self.hold = threading.Event()

    def __call__(self, frame):
        self.inputs.append(frame)
        if len(self.inputs) == 1:
            self.hold.wait(20.0)
        time.sleep(0.05)
        return frame, np.full(frame.beauty.shape, frame.samples_done, np.float32)


@pytest.mark.slow
def test_a_slow_denoiser_never_shows_incomplete_or_late_images(
    new_session, qtbot, cornell, monkeypatch, final
):
    denoiser = SlowDenoiser()
    monkeypatch.setattr("wavecomb.gui.viewport.live.denoised_frame", denoiser)
    session = new_session(width=160, height=160, spp=64, denoise=True)
    shown = []
    session.frame.connect(shown.append)
    session.open(cornell)
    qtbot.waitUntil(lambda: bool(denoiser.inputs), timeout=20000)
    first = denoiser.inputs[0]
    qtbot.waitUntil(lambda: session.last_frame.samples_done > LATE * first.samples_done)
    denoiser.hold.set()
    last = final(session)
    total = last.samples_done
    qtbot.waitUntil(
        lambda: (
            session.last_frame.denoised is not None and session.last_frame.denoised.min() == total
        ),
        timeout=20000,
    )
    assert all(frame.is_complete and frame.layers["samples"].min() > 0 for frame in denoiser.inputs)
    by_denoiser = [f for f in shown if f.denoised is not None and np.ptp(f.denoised) == 0]
    assert all(f.denoised.flat[0] != first.samples_done for f in by_denoiser), "late, so dropped"
    ages = [f.denoised.flat[0] for f in by_denoiser]
    assert ages == sorted(ages)
    assert len(denoiser.inputs) < 12, "the denoiser does not take the time of the render"


@pytest.mark.slow
def test_movements_show_no_noise(new_session, qtbot, cornell, final):
    def roughness(image):
        return np.abs(np.diff(np.clip(image, 0.0, 1.0), axis=1)).mean() / image.mean()

    session = new_session(width=240, height=240, spp=1)
    session.open(cornell)
    raw = roughness(final(session).beauty)
    shown = []
    session.frame.connect(shown.append)

    def has_moved():
        session.set_camera(orbit(session.pose, np.zeros(3), 0.01, 0.0, "Y"), moving=True)
        return len(shown) >= 6

    qtbot.waitUntil(has_moved, timeout=20000)
    previews = [frame for frame in shown if frame.status.get("preview")]
    assert len(previews) >= 4, "the whole image starts only if the window does not respond"
    # At the size on the screen; edges of a much reduced image, as on a busy machine, are steep.
    sizes = [enlarged(frame.beauty, 240, 240) for frame in previews]
    assert max(map(roughness, sizes)) < 0.3 * raw
    final(session)
    assert session.last_frame.scale == 1 and roughness(session.last_frame.beauty) > 0.8 * raw


def test_incomplete_frames_have_light_of_the_reduced_image_and_albedo_of_first_hits():
    setup = Setup(width=8, height=4, denoise=True)
    small = {"guide_albedo": np.full((2, 4, 3), 0.45, np.float32)}
    preview = Frame(np.full((2, 4, 3), 2.0, np.float32), small, None, {}, 1, 2, False, setup)
    samples = np.zeros((4, 8), np.uint32)
    samples[0, 0] = 1
    albedo = np.full((4, 8, 3), 0.45, np.float32)
    albedo[0] = 0.2
    noisy = np.random.default_rng(1).exponential(1.0, (4, 8, 3)).astype(np.float32)
    whole = Frame(noisy, {"samples": samples}, None, {"samples_done": 1}, 1, 1, False, setup)
    found = Filler(preview, albedo).fill(whole)
    assert not whole.is_complete
    assert found.beauty[0] == pytest.approx(2.0 * (0.2 + 0.05) / (0.45 + 0.05))
    assert found.beauty[1:] == pytest.approx(2.0) and np.array_equal(found.denoised, found.beauty)
    plain = Filler(preview).fill(whole)
    assert np.array_equal(plain.beauty[0, 0], noisy[0, 0]) and (plain.beauty[1:] == 2.0).all()
    complete = replace(whole, layers={"samples": np.ones((4, 8), np.uint32)})
    assert Filler(preview, albedo).fill(complete) is complete
    assert Filler(None).fill(whole) is whole
    region = replace(whole, setup=setup.changed(region=(0, 0, 1, 1)))
    assert region.is_complete


def test_enlarging_keeps_ramps():
    ramp = np.linspace(0.0, 1.0, 5, dtype=np.float32)[None, :, None].repeat(3, 0)
    large = enlarged(ramp, 20, 12)
    assert large.shape == (12, 20, 1)
    assert (np.diff(large[0, :, 0]) >= 0.0).all() and np.ptp(large, axis=0).max() == 0.0


def test_first_hits_have_no_noise_and_the_brightness_of_the_beauty():
    random = np.random.default_rng(1)
    beauty = random.exponential(0.5, (32, 32, 3)).astype(np.float32)
    normal = np.zeros((32, 32, 3), np.float32)
    normal[:16, :, 2] = 1.0
    lit = by_first_hit(beauty, np.full_like(beauty, 0.5), normal, np.array([0.0, 0.0, 1.0]))
    assert np.ptp(lit[:16]) == 0.0
    assert lit[0, 0, 0] == pytest.approx(np.minimum(beauty[:16], 4.0).mean(), rel=1e-5)
    assert np.array_equal(lit[16:], beauty[16:]), "the background stays"


def test_the_pace_of_previews_separates_constant_time_from_pixels():
    pace, pixels = Pace(), 960 * 540
    scales = []
    for _ in range(30):
        scale = pace.scale(pixels, 0.083)
        scales.append(scale)
        small = pixels // scale**2
        pace.learn(small, 0.025 + small / 800_000)
    assert set(scales[10:]) == {4}, scales  # 4: 66 ms; 3: 97 ms
    for _ in range(30):
        pace.learn(pixels // 16, 1.0)
    assert pace.scale(pixels, 0.083) == 12, "the machine became slow"


class RecordingRenderer:
    """Wrapper of the core's renderer that records the settings of each render."""

    def __init__(self, scene, threads):
        from wavecomb import _core

        self._core = _core.Renderer(scene, threads)
        self.renders = []

    def render(self, settings, **options):
        self.renders.append(settings)
        return self._core.render(settings, **options)

    def __getattr__(self, name):
        return getattr(self._core, name)


@pytest.mark.parametrize("beauty_only", [False, True])
def test_one_render_of_first_hits_brings_the_image_back_to_full_size(
    new_session, qtbot, cornell, monkeypatch, final, beauty_only
):
    monkeypatch.setattr("wavecomb.gui.viewport.session.make_renderer", RecordingRenderer)
    monkeypatch.setattr(Pace, "scale", lambda *_: 4)
    session = new_session(width=160, height=120, spp=2)
    session.beauty_only = beauty_only
    session._settle.setInterval(1_000_000)  # Only the test ends the movement.
    session.open(cornell)
    final(session)
    shown = []
    session.frame.connect(shown.append)
    session.set_camera(orbit(session.pose, np.zeros(3), 0.01, 0.0, "Y"), moving=True)
    qtbot.waitUntil(lambda: any(frame.scale == 4 for frame in shown), timeout=20000)
    renders = session.renderer.renders
    before = len(renders)
    session.settle()
    final(session)
    first_hits, whole = renders[before:]
    assert (first_hits.width, first_hits.height, first_hits.spp) == (160, 120, 1)
    assert first_hits.max_depth == 0, "the reduced image is not rendered again"
    assert (first_hits.aovs == ["guide_albedo"]) == beauty_only
    assert whole.spp == 2 and whole.max_depth > 0
    back = next(frame for frame in shown if frame.scale == 1)
    assert back.status["preview"] and (back.layer("depth") is None) == beauty_only
    assert (back.beauty > 0.0).any(axis=2).mean() > 0.9, "has the light of the reduced image"


def test_a_movement_that_ends_before_its_image_stops_the_older_image(
    new_session, qtbot, cornell, monkeypatch, final
):
    monkeypatch.setattr("wavecomb.gui.viewport.session.make_renderer", RecordingRenderer)
    monkeypatch.setattr(Pace, "scale", lambda *_: 4)
    session = new_session(width=160, height=120, spp=2)
    session._settle.setInterval(1_000_000)
    session.open(cornell)
    final(session)
    renders = session.renderer.renders
    before = len(renders)
    for angle in (0.01, 0.02, 0.03):
        session.set_camera(orbit(session.pose, np.zeros(3), angle, 0.0, "Y"), moving=True)
    session.settle()
    final(session)
    sizes = [settings.width for settings in renders[before:]]
    assert sizes[-3:] == [40, 160, 160] and len(sizes) <= 4, sizes
