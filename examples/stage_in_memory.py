#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renders a stage in memory, before and after an edit that is not saved anywhere."""

from __future__ import annotations

from pxr import UsdGeom

import wavecomb

stage = wavecomb.scenes.cornell()
wavecomb.render(stage, size=(320, 320), spp=16).save("box.png")

block = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Objects/TallBlock"))
block.AddTranslateOp().Set((0.0, 100.0, 0.0))
wavecomb.render(stage, size=(320, 320), spp=16).save("block-in-the-air.png")
