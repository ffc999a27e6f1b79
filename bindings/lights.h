// SPDX-License-Identifier: Apache-2.0
/// Lights in Python: the values of light_table() as keywords, as dicts, and as they are edited.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <optional>
#include <string>

#include "wavecomb/scene/scene.h"

/// A 4 x 4 array, or nested lists.
using Transform = nanobind::ndarray<nanobind::c_contig, nanobind::device::cpu, nanobind::ro>;

/// SceneBuilder.add_light and add_mesh_light. Throw Error for keywords that are no parameters, and
/// for values of another type.
uint32_t add_light(wavecomb::SceneBuilder& builder, const std::string& kind,
                   const Transform& transform, const nanobind::kwargs& values);
uint32_t add_mesh_light(wavecomb::SceneBuilder& builder, const Transform& transform,
                        const std::string& material_sync, const nanobind::kwargs& values);

/// SceneBuilder.add_light_filter: `sides` (4, 3), `decay` near_start, near_end, far_start, far_end.
uint32_t add_light_filter(wavecomb::SceneBuilder& builder, const Transform& transform,
                          float distance, const std::array<std::array<float, 3>, 4>& sides,
                          const std::array<float, 3>& picture_u,
                          const std::array<float, 3>& picture_v, std::optional<uint32_t> texture,
                          const std::array<float, 4>& decay, float density,
                          std::optional<uint32_t> next);

/// Parameters by name, what refers to sets and places apart. Throws Error for an index that is not
/// there.
nanobind::dict light_dict(const wavecomb::Scene& scene, uint32_t light);

/// Light `light` with other values. Throws Error that names the light and the value.
wavecomb::Light edited_light(const wavecomb::Scene& scene, uint32_t light,
                             const nanobind::dict& values);
