// SPDX-License-Identifier: Apache-2.0
/// Conversion of camera parameters between Python and the core. camera_table() lists the
/// parameters.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "wavecomb/scene/scene.h"

/// Implements SceneBuilder.set_camera. Throws Error for unknown keywords, values of a wrong type,
/// and missing required values.
void set_camera(
    wavecomb::SceneBuilder& builder,
    const nanobind::ndarray<nanobind::c_contig, nanobind::device::cpu, nanobind::ro>& transform,
    const nanobind::kwargs& values);

/// Returns a dict with all parameters of the scene's camera and its transform `to_world`.
nanobind::dict camera_dict(const wavecomb::Scene& scene);

/// Returns a copy of the scene's camera with changed values. Throws an `Error` that names the
/// parameter if a value is invalid.
wavecomb::Camera edited_camera(const wavecomb::Scene& scene, const nanobind::dict& values);
