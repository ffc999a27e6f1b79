// SPDX-License-Identifier: Apache-2.0
/// Checks of scene values, for SceneBuilder and for edits. All checks throw Error with one line
/// that names the object. Checks of lights are in light/description/light_table.h.
#pragma once

#include <cmath>
#include <string>

#include "wavecomb/light/description/light.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

inline bool finite(const Vec3<float>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline bool finite(const Affine& m) {
  return finite(m.row[0]) && finite(m.row[1]) && finite(m.row[2]) && finite(m.t);
}
/// Returns whether a transform is finite and has an inverse in single precision.
inline bool is_invertible(const Affine& m) {
  const float det = m.determinant();
  return finite(m) && std::isfinite(det) && std::abs(det) > 1e-35f;
}

/// Returns "mesh '/World/Box'", or "mesh" for an empty name.
std::string quoted(const std::string& kind, const std::string& name);

/// Checks a material. `texture_count` and `graph_count` are the numbers of textures and graphs in
/// the scene.
void check_material(const Material& material, size_t texture_count, size_t graph_count);
void check_profile(const IesProfile& profile);
/// Checks a light filter. `textures` and `filters` are the numbers of textures and light filters
/// added so far.
void check_filter(const LightFilter& filter, size_t textures, size_t filters);

}  // namespace wavecomb
