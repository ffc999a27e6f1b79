// SPDX-License-Identifier: Apache-2.0
// Volumes that move by their velocity fields: lookup positions and bounds.
#include "lane_testing.h"
#include "volume_testing.h"
#include "wavecomb/medium/description/volume_motion.h"
#include "wavecomb/medium/volume/volume_emission.h"

namespace wavecomb {
namespace {

using namespace volume_testing;

Volume moving(Volume v, const VolumeField& wind, float open, float close) {
  v.velocity = wind;
  v.seconds = {open, close};
  check_volume(v);
  v.motion = std::make_shared<const VolumeMotion>(v);
  return v;
}

/// Makes a density 1 + x on 17 voxels from 0 to 1, in a velocity of (0.5, 0.25, -1) from -4 to 4.
Volume ramp(float open, float close) {
  Volume v;
  v.density = between(make_grid(17, [](int x, int, int) { return 1 + static_cast<float>(x) / 16; }),
                      17, 0, 1);
  const auto wind = make_wind(16, [](int, int, int) { return Vec3<float>(0.5f, 0.25f, -1.f); });
  return moving(v, between(wind, 16, -4, 4), open, close);
}

TEST(VolumeMotion, FieldsAreReadWhereTheyCameFrom) {
  const Volume v = ramp(-0.5f, 1.5f);
  const VolumeRecord r = make_volume_record(v);
  ASSERT_TRUE(r.moves);
  for (const float time : {0.f, 0.25f, 1.f}) {
    const float s = -0.5f + 2 * time;
    EXPECT_FLOAT_EQ(seconds_at<float>(r, time), s);
    for (const float x : {0.05f, 0.5f, 0.95f}) {
      const Vec3<float> p{x + 0.5f * s, 0.5f + 0.25f * s, 0.5f - s};
      const Vec3<float> cell = bricks_point<float>(r.density_cells.to_bricks, p);
      EXPECT_NEAR(density_at<float>(r, cell, s, true), 1 + x, 1e-4f);
      EXPECT_NEAR(glow_at<float>(r, bricks_point<float>(r.glow_cells.to_bricks, p), time, true).x,
                  1 + x, 1e-4f);
    }
  }
}

/// A ray across the moving ramp has transmittance exp(-(1 + x) L) at the position that x has moved
/// to, also outside the grid's original box.
TEST(VolumeMotion, TransmittanceIsThatOfThePlaceAtTheTime) {
  Volume v = ramp(0.f, 2.f);
  v.extinction = {1, 0.5f, 0.25f};
  const VolumeRecord r = make_volume_record(v);
  const VolumeView view{&r, 1, 0, false};
  VolumeCounts counts;
  const Vec3<float> d{0, 1, 0};
  for (const float time : {0.f, 0.5f, 1.f}) {
    const float s = 2 * time;
    const Vec3<float> o{0.5f + 0.5f * s, -3, 0.5f - s};
    double sum = 0, squares = 0;
    constexpr uint32_t kCount = 40000;
    for (uint32_t i = 0; i < kCount; ++i) {
      const auto key = make_sample_key<float>(i * 2654435761u, i, 17);
      const Passage<float> p{SamplerKind::kIndependent, key, 2, o, d, o.x};
      const double x = double{transmittance_through<float>(view, Way<float>(p, VertexSet::kShadow),
                                                           {o, d, 9.f, time}, true, counts)
                                  .y};
      sum += x;
      squares += x * x;
    }
    const double mean = sum / kCount, error = std::sqrt((squares / kCount - mean * mean) / kCount);
    // The ramp is 16 voxel steps long, and falls to 0 within another step at each end.
    EXPECT_NEAR(mean, std::exp(-0.5 * 1.5 * 17. / 16), 4.2 * error + 1e-5) << time;
    EXPECT_LT(error, 3e-3);
  }
}

TEST(VolumeMotion, CellsBoundWhateverComesBy) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<float> value(0.f, 1.f);
  for (const bool is_half : {false, true}) {
    Volume v;
    v.density =
        between(make_grid(33, [&](int, int, int) { return value(rng) < 0.9f ? 0.f : value(rng); }),
                33, 0, 1);
    v.glow = between(make_grid(9, [&](int, int, int) { return value(rng); }, 3), 9, -0.5f, 0.5f);
    const auto wind = make_wind(
        16, [&](int, int, int) { return Vec3<float>(value(rng) - 0.3f, value(rng) - 0.5f, 0.2f); },
        is_half);
    VolumeField field = between(wind, 16, -0.3f, 1.2f);
    field.index_to_object.row[0].y = 0.02f;
    v = moving(v, field, -0.2f, 0.4f);
    const VolumeRecord r = make_volume_record(v);
    double filled = 0, bound = 0;
    std::uniform_real_distribution<float> at(-1.5f, 2.5f);
    for (int i = 0; i < 40000; ++i) {
      const Vec3<float> p{at(rng), at(rng), at(rng)};
      const float time = value(rng);
      const auto within = [&](const PlacedGrid& cells, float* most) {
        const Vec3<float> c = bricks_point<float>(cells.to_bricks, p);
        const uint32_t* size = cells.grid.size;
        if (!(c.x >= 0 && c.y >= 0 && c.z >= 0)) return false;
        const auto x = static_cast<uint32_t>(c.x), y = static_cast<uint32_t>(c.y),
                   z = static_cast<uint32_t>(c.z);
        if (x >= size[0] || y >= size[1] || z >= size[2]) return false;
        *most = cells.grid.most[x + size[0] * (y + size[1] * z)];
        return true;
      };
      float most = 0;
      const bool inside = within(r.density_cells, &most);
      const float density = density_at<float>(r, bricks_point<float>(r.density_cells.to_bricks, p),
                                              seconds_at<float>(r, time), true);
      EXPECT_LE(density, inside ? most * 1.0001f : 0.f);
      filled += density > 0 ? 1 : 0;
      bound += inside && most > 0 ? 1 : 0;
      float brightest = 0;
      const bool glows = within(r.glow_cells, &brightest);
      const float glow =
          glow_at<float>(r, bricks_point<float>(r.glow_cells.to_bricks, p), time, true).z;
      EXPECT_LE(glow, glows ? brightest * 1.0001f : 0.f);
    }
    EXPECT_GT(filled, 100);
    EXPECT_LT(bound, 8000);
  }
}

TEST(VolumeMotion, WhatStandsStillKeepsItsCells) {
  Volume v;
  v.density = between(
      make_grid(33, [](int x, int y, int z) { return static_cast<float>((x ^ y ^ z) & 7); }), 33, 0,
      1);
  const auto calm =
      make_wind(16, [](int x, int, int) { return Vec3<float>(x == 15 ? 1.f : 0.f, 0.f, 0.f); });
  v = moving(v, between(calm, 16, 20, 21), -1, 1);
  const MovedCells& cells = v.motion->density();
  const GridView grid = v.density.grid->view();
  EXPECT_EQ(cells.first, (std::array{0., 0., 0.}));
  EXPECT_EQ(cells.size[0] * cells.size[1] * cells.size[2],
            grid.size[0] * grid.size[1] * grid.size[2]);
  for (size_t i = 0; i < cells.most.size(); ++i) EXPECT_EQ(cells.most[i], grid.most[i]);
}

TEST(VolumeMotion, CellsStayFew) {
  Volume v;
  v.density = between(make_grid(9, [](int, int, int) { return 1.f; }), 9, 0, 1e-3f);
  const auto wind = make_wind(8, [](int, int, int) { return Vec3<float>(3e38f, -3e38f, 1e9f); });
  v = moving(v, between(wind, 8, -1e4f, 1e4f), -1, 1);
  EXPECT_LE(v.motion->density().most.size(), size_t{1} << 22);
  EXPECT_GT(*std::ranges::max_element(v.motion->density().most), 0.f);
}

TEST(VolumeMotion, PlacesOfOneVolumeShareItAndBadOnesAreRefused) {
  const Volume v = ramp(0, 1);
  SceneBuilder b;
  for (const float x : {0.f, 3.f}) {
    Volume placed = v;
    placed.motion = nullptr;
    placed.to_world = translate(x, 0, 0);
    b.add_volume(placed);
  }
  const auto scene = b.build();
  EXPECT_TRUE(scene->view().has_motion);
  EXPECT_EQ(scene->volumes()[0].motion, scene->volumes()[1].motion);
  EXPECT_GT(scene->bounds().hi.x, 4.4f);
  Volume bad = v;
  bad.seconds = {0, kInf};
  EXPECT_THROW(check_volume(bad), Error);
  bad = make_box({0, 0, 0}, {1, 1, 1}, {1, 1, 1});
  bad.velocity = v.velocity;
  EXPECT_THROW(check_volume(bad), Error);
  bad = v;
  bad.velocity = v.density;
  EXPECT_THROW(check_volume(bad), Error);
  Volume still = v;
  still.seconds = {0, 0};
  EXPECT_FALSE(still.moves());
}

}  // namespace
}  // namespace wavecomb
