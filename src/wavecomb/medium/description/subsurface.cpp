// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/medium/description/subsurface.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "wavecomb/graph/graph.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

namespace {

/// Lower limit of mean free paths, which bounds the number of collisions inside an object.
constexpr float kMinFreePath = 1e-6f;
/// Lower limit of the colour channels. Random walks select a channel in proportion to its colour.
constexpr float kMinColor = 0.05f;
/// Correction of the parameter s in van de Hulst's approximation, divided by s (1 - s). The
/// correction is a polynomial in s and in the mean cosine, fitted to colours computed by adding and
/// doubling (tests/python/test_walks.py). The error of the fit is at most 0.4 % of the colour.
constexpr float kOffSimilarity[4][5] = {{0.0153f, -0.0261f, -0.1611f, 0.0637f, 0.1811f},
                                        {-0.0526f, 0.3743f, 0.5764f, -0.9722f, -0.4419f},
                                        {0.0812f, -0.9642f, -0.2726f, 1.9433f, 0.3053f},
                                        {-0.0106f, 0.4946f, -0.1385f, -1.0529f, -0.0112f}};

}  // namespace

SubsurfaceKind subsurface_kind(const Material& m, const GraphSet& graphs) {
  const OpenPbr& o = m.openpbr;
  const auto driven = [&](const char* name) {
    return graphs.drives(m.graph, graph_parameter(name));
  };
  const bool is_solid = has_trait(m.program, program_trait::kSubsurface) && !o.thin_walled &&
                        o.transmission_weight == 0 && !driven("transmission_weight");
  const bool is_below = o.subsurface_weight > 0 || driven("subsurface_weight");
  const Vec3<float>& r = o.subsurface_radius;
  if (!is_solid || !is_below || std::max({r.x, r.y, r.z}) <= 0) return SubsurfaceKind::kNone;
  return driven("subsurface_color") ? SubsurfaceKind::kTinted : SubsurfaceKind::kWhole;
}

float single_albedo(float color, float anisotropy) {
  const float a = std::clamp(color, 0.f, 1.f), g = anisotropy;
  const float s0 = 4.09712f + 4.20863f * a - std::sqrt(9.59217f + a * (41.6808f + 17.7126f * a));
  float off = 0;
  for (size_t i = std::size(kOffSimilarity); i-- > 0;) {
    float of_g = 0;
    for (size_t j = std::size(kOffSimilarity[i]); j-- > 0;) of_g = of_g * g + kOffSimilarity[i][j];
    off = off * s0 + of_g;
  }
  const float s = std::clamp(s0 + s0 * (1 - s0) * off, 0.f, 1.f);
  return std::clamp((1 - s * s) / (1 - anisotropy * s * s), 0.f, 1.f);
}

double diffusion_length(double albedo, double anisotropy) {
  const double lost = 1 - anisotropy * albedo, even = albedo * (1 - anisotropy) / lost;
  const double left = even > 0 ? std::pow(even, 2.44294 - 0.0215813 * even + 0.578637 / even) : 0;
  return std::clamp(1 / std::sqrt(std::max(1 - left, 1e-12)) / lost, 1.02, 100.0);
}

SubsurfaceMedium<float> make_subsurface_medium(const Material& m, SubsurfaceKind kind) {
  const OpenPbr& o = m.openpbr;
  const float g = std::clamp(o.subsurface_anisotropy, -0.95f, 0.95f);
  const auto extinction = [](float radius) { return 1 / std::max(radius, kMinFreePath); };
  const auto albedo = [&](float color) {
    return kind == SubsurfaceKind::kTinted ? 1.f : single_albedo(color, g);
  };
  const Vec3<float>&r = o.subsurface_radius, &c = o.subsurface_color;
  const auto each = [](const Vec3<float>& of, const auto& f) {
    return Vec3<float>(f(of.x), f(of.y), f(of.z));
  };
  const Vec3<float> albedos = each(c, albedo);
  const Vec3<float> diffusion =
      each(albedos, [&](float a) { return static_cast<float>(diffusion_length(a, g)); });
  return {each(r, extinction),
          albedos,
          g,
          each(c, [](float x) { return std::max(x, kMinColor); }),
          diffusion,
          each(diffusion, [](float nu) {
            return static_cast<float>(std::log((double{nu} + 1) / (double{nu} - 1)));
          })};
}

}  // namespace wavecomb
