#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Changes a material, a light, an object and the camera, and renders again without reloading."""

from __future__ import annotations

import numpy as np

import wavecomb

renderer = wavecomb.Renderer(wavecomb.scenes.cornell(), size=(320, 320))
renderer.render(spp=16).save("red.png")

renderer.edit(materials={"/World/Looks/Red": {"base_color": (0.05, 0.1, 0.6)}})
renderer.render(spp=16).save("blue.png")

(name,) = renderer.lights
aside = np.array(renderer.scene.light(0)["transform"])
aside[3, 0] += 120.0  # the last row of a matrix is its translation, as in USD
renderer.edit(lights={name: {"transform": aside, "color": (20.0, 16.0, 9.0)}})

lifted = np.eye(4)
lifted[3, 1] = 60.0
renderer.edit(moves={"/World/Objects/TallBlock": lifted})

closer = np.array(renderer.scene.camera["to_world"])
closer[3, 2] += 150.0
renderer.edit(camera={"transform": closer})
renderer.render(spp=16).save("closer.png")
