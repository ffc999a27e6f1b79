// SPDX-License-Identifier: Apache-2.0
/// Conversion of light parameters between Python and the core. light_table() lists the parameters.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <optional>
#include <string>

#include "wavecomb/scene/scene.h"

/// Transform from Python: an array of shape (4, 4) or nested lists.
using Transform = nanobind::ndarray<nanobind::c_contig, nanobind::device::cpu, nanobind::ro>;

/// Implement SceneBuilder.add_light and SceneBuilder.add_mesh_light. Both functions throw `Error`
/// for unknown keywords and for values of a wrong type.
uint32_t add_light(wavecomb::SceneBuilder& builder, const std::string& kind,
                   const Transform& transform, const nanobind::kwargs& values);
uint32_t add_mesh_light(wavecomb::SceneBuilder& builder, const Transform& transform,
                        const std::string& material_sync, const nanobind::kwargs& values);

/// Implements SceneBuilder.add_light_filter. `sides` has 4 rows of 3 numbers. `decay` contains the
/// distances near_start, near_end, far_start and far_end.
uint32_t add_light_filter(wavecomb::SceneBuilder& builder, const Transform& transform,
                          float distance, const std::array<std::array<float, 3>, 4>& sides,
                          const std::array<float, 3>& picture_u,
                          const std::array<float, 3>& picture_v, std::optional<uint32_t> texture,
                          const std::array<float, 4>& decay, float density,
                          std::optional<uint32_t> next);

/// Returns the parameters of a light by name, without references to geometry sets and without
/// transforms. Throws Error if the index is out of range.
nanobind::dict light_dict(const wavecomb::Scene& scene, uint32_t light);

/// Returns a copy of a light with changed values. Throws an `Error` that names the light and the
/// parameter if a value is invalid.
wavecomb::Light edited_light(const wavecomb::Scene& scene, uint32_t light,
                             const nanobind::dict& values);
