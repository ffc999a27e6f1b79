// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/walk_data.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/graph/graph.h"
#include "wavecomb/graph/parameters.h"
#include "wavecomb/scene/material_data.h"

namespace wavecomb {

namespace {

/// Free paths that are shorter count as this: an object has no room for more collisions.
constexpr float kLeastFreePath = 1e-6f;

}  // namespace

WalkKind walk_kind(const Material& m, const GraphSet& graphs) {
  const OpenPbr& o = m.openpbr;
  const auto driven = [&](const char* name) {
    return graphs.drives(m.graph, graph_parameter(name));
  };
  const bool is_solid = m.program == ProgramId::kOpenPbr && !o.thin_walled &&
                        o.transmission_weight == 0 && !driven("transmission_weight");
  const bool is_below = o.subsurface_weight > 0 || driven("subsurface_weight");
  const Vec3<float>& r = o.subsurface_radius;
  if (!is_solid || !is_below || std::max({r.x, r.y, r.z}) <= 0) return WalkKind::kNone;
  return driven("subsurface_color") ? WalkKind::kTinted : WalkKind::kWhole;
}

float single_albedo(float color, float anisotropy) {
  const float a = std::clamp(color, 0.f, 1.f);
  const float s = 4.09712f + 4.20863f * a - std::sqrt(9.59217f + a * (41.6808f + 17.7126f * a));
  return std::clamp((1 - s * s) / (1 - anisotropy * s * s), 0.f, 1.f);
}

WalkMedium<float> make_walk_medium(const Material& m, WalkKind kind) {
  const OpenPbr& o = m.openpbr;
  const float g = std::clamp(o.subsurface_anisotropy, -0.95f, 0.95f);
  const auto extinction = [](float radius) { return 1 / std::max(radius, kLeastFreePath); };
  const auto albedo = [&](float color) {
    return kind == WalkKind::kTinted ? 1.f : single_albedo(color, g);
  };
  const Vec3<float>&r = o.subsurface_radius, &c = o.subsurface_color;
  return {{extinction(r.x), extinction(r.y), extinction(r.z)},
          {albedo(c.x), albedo(c.y), albedo(c.z)},
          g,
          0};
}

}  // namespace wavecomb
