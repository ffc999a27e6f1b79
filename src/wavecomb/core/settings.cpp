// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/settings.h"

#include <cmath>
#include <cstdio>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

void check_range(const char* option, double value, double lo, double hi) {
  if (value >= lo && value <= hi) return;
  const auto text = [](double v) {
    if (v == std::floor(v) && std::abs(v) < 1e15) return std::to_string(static_cast<long long>(v));
    char digits[32];
    std::snprintf(digits, sizeof(digits), "%g", v);
    return std::string(digits);
  };
  throw Error(std::string(option) + " is " + text(value) + "; it must be from " + text(lo) +
              " to " + text(hi));
}

}  // namespace

void Settings::check() const {
  check_range("width", width, 1, kMaxSize);
  check_range("height", height, 1, kMaxSize);
  check_range("width x height", static_cast<double>(width) * height, 1, kMaxPixels);
  if (region) {
    const auto text = [](uint32_t v) { return std::to_string(v); };
    const Region& r = *region;
    const std::string given =
        "region " + text(r.x0) + " " + text(r.y0) + " " + text(r.x1) + " " + text(r.y1);
    if (r.x0 >= r.x1 || r.y0 >= r.y1)
      throw Error(given + " has no pixels; give X0 Y0 X1 Y1 with X0 < X1 and Y0 < Y1");
    if (r.x1 > width || r.y1 > height)
      throw Error(given + " is not within the picture; X1 is at most " + text(width) +
                  " and Y1 at most " + text(height));
  }
  check_range("spp", spp, 1, 1 << 20);
  check_range("max_depth", max_depth, 0, 4096);
  check_range("filter_width", used_filter_width(), 0.01f, 32);
  check_range("roulette_depth", roulette_depth, 0, 4096);
  check_range("clamp_indirect", clamp_indirect, 0, 1e30f);
  check_range("adaptive", adaptive, 0, 1e6f);
  check_range("noise", noise, 0, 1);
  if (adaptive > 0 && noise > 0)
    throw Error("adaptive and noise are both given; choose one to end the render by");
  check_range("min_spp", min_spp, 1, 1 << 20);
  if (is_adaptive() && min_spp > spp)
    throw Error("min_spp is " + std::to_string(min_spp) + "; it must not be above spp, which is " +
                std::to_string(spp));
  check_range("time_limit", time_limit, 0, 1e9f);
  check_range("cost_weight", cost_weight, 0, 1);
  check_range("threads", threads, 0, 1024);
  if (wave_size != 0) check_range("wave_size", wave_size, 64, 1 << 20);
  if (lanes != 0 && lanes != 1 && lanes != 4 && lanes != 8 && lanes != 16)
    throw Error("lanes is " + std::to_string(lanes) + "; it must be 1, 4, 8, 16 or auto (0)");
}

}  // namespace wavecomb
