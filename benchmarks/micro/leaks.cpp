// SPDX-License-Identifier: Apache-2.0
// Counts rays that escape from closed rooms, with and without Embree's robust mode.
//
//      micro_leaks MILLIONS     traces that many million rays per ray kind and room
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>

#include "embree_modes.h"
#include "scene_testing.h"

namespace wavecomb::micro {
namespace {

using namespace scene_testing;

Soup soup_of(const MeshData& mesh) {
  return {{mesh.positions.begin(), mesh.positions.end()},
          {mesh.indices.begin(), mesh.indices.end()}};
}

/// Makes a closed tube along x with `n` sides. Each side consists of two long triangles, which
/// share vertices with the neighbouring sides.
Soup tube(uint32_t n, float half_length, float radius) {
  Soup s;
  for (uint32_t i = 0; i < n; ++i)
    for (const float side : {-1.f, 1.f}) {
      const float turn = 6.2831853f * float(i) / float(n);
      const float p[3] = {side * half_length, radius * std::cos(turn), radius * std::sin(turn)};
      s.positions.insert(s.positions.end(), p, p + 3);
    }
  const float ends[6] = {-half_length, 0, 0, half_length, 0, 0};
  s.positions.insert(s.positions.end(), ends, ends + 6);
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t a = 2 * i, b = 2 * ((i + 1) % n), end = 2 * n;
    for (uint32_t k : {a, a + 1, b, b, a + 1, b + 1, a, b, end, a + 1, b + 1, end + 1})
      s.indices.push_back(k);
  }
  return s;
}

/// Rotates all triangles, so that no wall is parallel to an axis.
Soup turned(Soup s) {
  for (size_t i = 0; i + 2 < s.positions.size(); i += 3) {
    float* p = &s.positions[i];
    const float x = 0.8f * p[0] - 0.6f * p[1], y = 0.6f * p[0] + 0.8f * p[1];
    const float w = 0.28f * y - 0.96f * p[2], z = 0.96f * y + 0.28f * p[2];
    p[0] = x, p[1] = w, p[2] = z;
  }
  return s;
}

void leaks(double millions) {
  struct Room {
    const char* name;
    Soup soup;
    /// Fraction of the requested rays that are traced in this room. The fraction is below 1 in
    /// rooms of long triangles, whose overlapping bounds make Embree slow.
    double share = 1;
  };
  const Room rooms[] = {{"box", soup_of(box({-1, -1, -1}, {1, 1, 1}))},
                        {"box, turned", turned(soup_of(box({-1, -1, -1}, {1, 1, 1})))},
                        {"tube, 1000 x 1, 64 sides", tube(64, 500, 0.5f), 0.2},
                        {"the same, turned", turned(tube(64, 500, 0.5f)), 0.02},
                        {"sphere", soup_of(sphere(32, true)), 0.2}};
  for (const Room& room : rooms)
    for (const bool aimed : {false, true}) {
      constexpr Mode kAsked[] = {{.name = "robust 16", .filter = false},
                                 {.name = "robust 1", .filter = false, .width = 1},
                                 {.name = "fast 16", .robust = false, .filter = false},
                                 {.name = "fast 1", .robust = false, .filter = false, .width = 1}};
      std::vector<std::unique_ptr<Built>> built;
      for (const Mode& m : kAsked)
        built.push_back(std::make_unique<Built>(std::vector<Soup>{room.soup}, m));
      std::minstd_rand random(7);
      const auto uniform = [&] { return static_cast<float>(random() >> 7) * 0x1p-24f; };
      const auto& s = room.soup;
      const size_t triangles = s.indices.size() / 3;
      /// Computes a random point of a triangle, which is on an edge if `edge` is true.
      const auto point = [&](bool edge, float* out) {
        const uint32_t* i = &s.indices[3 * (random() % triangles)];
        float a = uniform(), b = edge ? 0.f : uniform();
        if (a + b > 1) a = 1 - a, b = 1 - b;
        for (int k = 0; k < 3; ++k)
          out[k] = (1 - a - b) * s.positions[3 * i[0] + k] + a * s.positions[3 * i[1] + k] +
                   b * s.positions[3 * i[2] + k];
      };
      uint64_t total = 0, out[4] = {};
      constexpr size_t kBatch = 1 << 16;
      for (; double(total) < room.share * millions * 1e6; total += kBatch) {
        Rays rays;
        for (auto& c : rays.column) c.resize(kBatch);
        for (size_t i = 0; i < kBatch; ++i) {
          float p[3], q[3];
          point(false, p);
          point(aimed, q);
          for (int k = 0; k < 3; ++k) {
            // The room is convex and contains the origin, so the point is inside.
            p[k] *= 0.9f * uniform();
            rays.column[k][i] = p[k];
            rays.column[3 + k][i] = q[k] - p[k];
          }
        }
        for (size_t k = 0; k < built.size(); ++k)
          out[k] += kBatch - built[k]->trace(rays.span(), false);
      }
      std::printf("%-34s %-18s %6.1f M rays:", room.name, aimed ? "aimed at edges" : "at surfaces",
                  double(total) * 1e-6);
      for (size_t k = 0; k < built.size(); ++k)
        std::printf("  %s: %llu", kAsked[k].name, static_cast<unsigned long long>(out[k]));
      std::printf("\n");
      std::fflush(stdout);
    }
}

}  // namespace
}  // namespace wavecomb::micro

int main(int argc, char** argv) {
  const double millions = argc > 1 ? std::atof(argv[1]) : 0;
  if (!(millions > 0)) {
    std::fprintf(stderr, "usage: micro_leaks MILLIONS\n");
    return 2;
  }
  wavecomb::micro::leaks(millions);
  return 0;
}
