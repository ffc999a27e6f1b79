// SPDX-License-Identifier: Apache-2.0
/// Cameras in Python: the values of camera_table() as keywords, as dicts, and as they are edited.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "wavecomb/scene/scene.h"

/// SceneBuilder.set_camera. Throws Error for keywords that are no parameters, for values of another
/// type, and where one that is needed is missing.
void set_camera(
    wavecomb::SceneBuilder& builder,
    const nanobind::ndarray<nanobind::c_contig, nanobind::device::cpu, nanobind::ro>& transform,
    const nanobind::kwargs& values);

/// Parameters by name, and to_world.
nanobind::dict camera_dict(const wavecomb::Scene& scene);

/// The scene's camera with other values. Throws Error that names the value.
wavecomb::Camera edited_camera(const wavecomb::Scene& scene, const nanobind::dict& values);
