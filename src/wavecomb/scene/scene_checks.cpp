// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/scene_checks.h"

#include <span>

#include "wavecomb/core/encoding/number_text.h"
#include "wavecomb/core/error.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/material/description/material_table.h"

namespace wavecomb {

std::string quoted(const std::string& kind, const std::string& name) {
  return kind + (name.empty() ? "" : " '" + name + "'");
}

namespace {

/// Throws Error if a program-specific parameter is out of range. Infinite and NaN values are
/// checked in `check_material`.
void check_specific(const std::string& of, const ProgramParameter& p, float value) {
  if (value < p.least || value > p.most)
    throw Error(of + ": " + p.name + " is " + text(double{value}) + "; it must be from " +
                text(double{p.least}) + " to " + text(double{p.most}));
}

}  // namespace

void check_material(const Material& material, size_t texture_count, size_t graph_count) {
  const auto name = quoted("material", material.name);
  for (uint32_t s = 0; s < kInputCount; ++s) {
    const TextureUse& use = material.textures[s];
    if (use.texture == kNoTexture) continue;
    if (use.texture >= texture_count)
      throw Error(name + " reads texture " + std::to_string(use.texture) +
                  ", which was never added; add textures before materials");
    for (const std::span<const float> values :
         {std::span<const float>(use.scale), std::span<const float>(use.bias),
          std::span<const float>(use.uv)})
      for (float x : values)
        if (!std::isfinite(x))
          throw Error(name +
                      " reads a texture through a number that is not finite; fix its scale, bias "
                      "or transform");
    if (use.channel > 4)
      throw Error(name + " reads a texture channel that is not r, g, b, a or rgb");
  }
  for (const uint32_t graph : {material.graph, material.opacity_graph, material.emission_graph})
    if (graph != kNoGraph && graph >= graph_count)
      throw Error(name + " has a graph that was never added; add graphs before materials");
  const OpenPbr& o = material.openpbr;
  bool valid = std::isfinite(o.transmission_depth) &&
               std::isfinite(o.transmission_scatter_anisotropy) && std::isfinite(o.nested_priority);
  const auto check_color = [&](const Vec3<float>& v) {
    if (!finite(v)) throw Error(name + " has a colour that is not finite; give finite numbers");
  };
  const auto check = [&](const auto& value) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, float>)
      valid = valid && std::isfinite(value);
    else
      check_color(value);
  };
  for_each_parameter<float>(material, [&](const MaterialParameter& p, float value) {
    check(value);
    if (p.own()) check_specific(name, p.own()->info(), value);
  });
  for_each_parameter<Vec3<float>>(
      material, [&](const MaterialParameter&, const Vec3<float>& value) { check(value); });
  check(o.transmission_color);
  check(o.subsurface_radius);
  check(o.transmission_scatter);
  std::apply([&](const auto&... input) { (check(input), ...); },
             static_cast<const OpenPbrInputs<float>&>(o).fields());
  if (!valid) throw Error(name + " has a parameter that is not finite; give finite numbers");
  if (material.ior <= 0) throw Error(name + " has an ior of 0 or less; give a positive one");
}

void check_profile(const IesProfile& p) {
  const auto ascending = [](const std::vector<float>& x) {
    for (size_t i = 0; i + 1 < x.size(); ++i)
      if (!(x[i] <= x[i + 1])) return false;
    return true;
  };
  if (p.vertical.size() < 2 || p.horizontal.empty() || !ascending(p.vertical) ||
      !ascending(p.horizontal) || !(p.vertical.front() >= 0) || !(p.vertical.back() <= 180) ||
      !(p.vertical.back() > p.vertical.front()))
    throw Error(
        "an IES profile needs two or more vertical angles in [0, 180], and at least one "
        "horizontal angle, each list ascending");
  if (p.horizontal.size() > 1 && (p.horizontal.front() != 0 || p.horizontal.back() != 360))
    throw Error("the horizontal angles of an IES profile must go from 0 to 360");
  if (p.candela.size() != p.vertical.size() * p.horizontal.size())
    throw Error("an IES profile needs a value for each pair of angles");
  for (const float x : p.candela)
    if (!std::isfinite(x) || x < 0)
      throw Error("an IES profile has a value that is negative or not finite");
}

void check_filter(const LightFilter& f, size_t textures, size_t filters) {
  const auto valid = [](const auto&... values) { return (std::isfinite(values) && ...); };
  bool is_finite = finite(f.to_world) &&
                   valid(f.distance, f.near_start, f.near_end, f.far_start, f.far_end, f.density);
  for (const Vec3<float>& line :
       {f.sides[0], f.sides[1], f.sides[2], f.sides[3], f.picture_u, f.picture_v})
    is_finite = is_finite && valid(line.x, line.y, line.z);
  if (!is_finite) throw Error("a light filter has a value that is not finite; give finite numbers");
  if (f.texture != kNoTexture && f.texture >= textures)
    throw Error("a light filter's texture was never added; add textures before filters");
  if (f.next != kNoFilter && f.next >= filters)
    throw Error("the next filter of a light filter was never added; add it first");
}

}  // namespace wavecomb
