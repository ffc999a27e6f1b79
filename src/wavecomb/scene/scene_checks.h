// SPDX-License-Identifier: Apache-2.0
/// What values of a scene may be: for SceneBuilder and for edits. All throw Error with one line
/// that names the object. Of lights: scene/light_table.h.
#pragma once

#include <cmath>
#include <string>

#include "wavecomb/scene/light_data.h"
#include "wavecomb/scene/material_data.h"

namespace wavecomb {

inline bool finite(const Vec3<float>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline bool finite(const Affine& m) {
  return finite(m.row[0]) && finite(m.row[1]) && finite(m.row[2]) && finite(m.t);
}

/// "mesh '/World/Box'", or "mesh" where it has no name.
std::string quoted(const std::string& kind, const std::string& name);

/// `texture_count`, `graph_count`: textures and graphs that there are.
void check_material(const Material& material, size_t texture_count, size_t graph_count);
void check_profile(const IesProfile& profile);
/// `textures`, `filters`: how many were added.
void check_filter(const LightFilter& filter, size_t textures, size_t filters);

}  // namespace wavecomb
