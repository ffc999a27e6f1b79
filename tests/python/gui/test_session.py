# SPDX-License-Identifier: Apache-2.0
"""Stages, settings and edits of the live render, without widgets."""

import numpy as np


def test_opens_and_renders(session, cornell):
    frame = session.last_frame
    assert session.stage.stage_path == cornell
    assert frame.beauty.shape == (96, 96, 3) and frame.scale == 1
    assert frame.layers["samples"].min() == 4
    assert np.isfinite(frame.beauty).all() and frame.beauty.max() > 0.1
