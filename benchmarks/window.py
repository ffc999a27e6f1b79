#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measure the responsiveness of the window.

Prints for each stage:

- seconds to load the stage, and seconds from then until the first image and until the first
  complete image are on the screen;
- images per second and CPU seconds per image while the camera orbits, the scale of these images and
  their noise (mean difference to a median of 3 x 3 pixels, relative to the mean);
- seconds and CPU seconds from the last movement of the camera to an image at full size;
- milliseconds from a request to stop until the render engine is idle (median and maximum of ten);
- the longest time during which the window did not respond.

Works without a display.
"""

import argparse
import math
import os
import statistics
import sys
import tempfile
import time

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


def noise_of(image):
    """Return the mean difference of an image to its 3 x 3 median filter, relative to its mean."""
    import numpy as np

    tone = np.sqrt(np.clip(image.mean(axis=2), 0.0, 1.0))
    around = np.lib.stride_tricks.sliding_window_view(tone, (3, 3))
    return float(np.abs(tone[1:-1, 1:-1] - np.median(around, axis=(2, 3))).mean() / tone.mean())


class Run:
    """Measurements of one window with one stage."""

    def __init__(self, application, stage, options, scratch):
        from PySide6.QtCore import QSettings

        from wavecomb.gui.main_window import MainWindow
        from wavecomb.gui.setup import Setup

        settings = QSettings(os.path.join(scratch, "window.ini"), QSettings.Format.IniFormat)
        self.application = application
        self.window = MainWindow(
            Setup(width=options.size[0], height=options.size[1], spp=1 << 16), settings
        )
        self.window.resize(1400, 860)
        self.window.show()
        self.session, self.viewport = self.window.session, self.window.viewport
        self.last, self.gap = time.perf_counter(), 0.0
        self.stage, self.seconds = stage, options.seconds

    def beat(self):
        """Process window events and record how long they took."""
        self.application.processEvents()
        now = time.perf_counter()
        self.gap = max(self.gap, now - self.last)
        time.sleep(0.001)
        self.last = time.perf_counter()

    def until(self, met, seconds=120.0):
        """Wait until a condition is met; return the time at that moment."""
        end = time.perf_counter() + seconds
        while not met():
            if time.perf_counter() > end:
                raise SystemExit(f"{self.stage}: nothing happened for {seconds:.0f} s")
            self.beat()
        return time.perf_counter()

    def measure(self):
        """Return all results by name."""
        begun = time.perf_counter()
        opened, moving = [], []
        self.session.opened.connect(lambda stage: opened.append(time.perf_counter()))
        self.viewport.shown.connect(lambda frame, look: moving.append(frame.scale))
        self.window.open(self.stage)
        first = self.until(lambda: self.viewport.frame_shown is not None)
        whole = self.until(
            lambda: (
                self.viewport.frame_shown.scale == 1
                and self.viewport.frame_shown.layers["samples"].min() > 0
            )
        )
        self.until(lambda: time.perf_counter() > whole + 1.0)
        self.gap = 0.0
        moving.clear()
        start, cpu = time.perf_counter(), time.process_time()
        while time.perf_counter() < start + self.seconds:
            # Move the camera every 0.01 s, which is the typical interval of mouse events. The
            # camera orbits back and forth, so that it stays inside a room.
            step = 0.005 * math.cos(4.0 * (time.perf_counter() - start))
            self.viewport.orbit(step, 0.0, moving=True)
            due = time.perf_counter() + 0.01
            while time.perf_counter() < due:
                self.beat()
        shown = list(moving)
        cpu = (time.process_time() - cpu) / max(len(shown), 1)
        rate = len(shown) / (time.perf_counter() - start)
        noise = noise_of(self.viewport.frame_shown.beauty)
        moved, back_cpu = time.perf_counter(), time.process_time()
        back = self.until(lambda: self.viewport.frame_shown.scale == 1) - moved
        back_cpu = time.process_time() - back_cpu
        stops = [self.stop() for _ in range(10)]
        return {
            "load_s": opened[0] - begun,
            "first_picture_s": first - opened[0],
            "whole_picture_s": whole - opened[0],
            "moving_pictures_per_s": rate,
            "moving_scale": statistics.median(shown or [0]),
            "moving_cpu_s_per_picture": cpu,
            "moving_noise": noise,
            "full_size_after_s": back,
            "full_size_after_cpu_s": back_cpu,
            "stop_ms": 1e3 * statistics.median(stops),
            "stop_most_ms": 1e3 * max(stops),
            "gap_ms": 1e3 * self.gap,
        }

    def stop(self):
        """Measure the seconds from a stop request until the render engine is idle."""
        engine = self.session._engine
        self.session.restart()
        end = time.perf_counter() + 0.4
        self.until(lambda: time.perf_counter() > end)
        begun = time.perf_counter()
        self.session.stop()
        while engine.is_busy():
            time.sleep(0.0005)
        seconds = time.perf_counter() - begun
        self.last = time.perf_counter()
        return seconds


def main():
    """Measure each stage in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stages", nargs="+")
    parser.add_argument("--size", nargs=2, type=int, default=(960, 540))
    parser.add_argument("--seconds", type=float, default=3.0, help="duration of the orbit")
    parser.add_argument("--scale", type=int, help="fix the reduction during the orbit")
    options = parser.parse_args()
    if options.scale:
        from wavecomb.gui.viewport import previews

        previews.reduced_scale = lambda *_: options.scale
    from wavecomb.gui import theme
    from wavecomb.gui.app import make_application

    application = make_application()
    theme.apply("dark")
    for stage in options.stages:
        with tempfile.TemporaryDirectory() as scratch:
            run = Run(application, stage, options, scratch)
            figures = run.measure()
            run.window.close()
        sys.stdout.write(f"{os.path.basename(stage)}\n")
        for name, value in figures.items():
            sys.stdout.write(f"  {name:24}{value:.3g}\n")


if __name__ == "__main__":
    main()
