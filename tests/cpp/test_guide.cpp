// SPDX-License-Identifier: Apache-2.0
/// Tests of the guiding field: equal-area map of directions, tables, cells, and lookup.
#include "wavecomb/guiding/lookup.h"

#include "bsdf_testing.h"
#include "lane_testing.h"
#include "wavecomb/core/error.h"
#include "wavecomb/guiding/field/field.h"
#include "wavecomb/guiding/mixing_fractions.h"
#include "wavecomb/guiding/region_directions.h"
#include "wavecomb/guiding/roulette.h"
#include "wavecomb/guiding/sampling_table.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

using namespace lane_testing;
using bsdf_testing::kPiD;
using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;

const GuidingGrid kUnitGrid({0.f, 0.f, 0.f}, {1.f, 1.f, 1.f});

/// Makes a training bounce in direction w from the point (x, y, z) of a surface that faces `axis`.
TrainingRecord bounce(float x, float y, float z, uint8_t axis, const Vec3<float>& w,
                      float value = 1) {
  return {{x, y, z}, {w.x, w.y, w.z}, 0.f, 0, axis, value, 1.f, 1.f, 0.f, 1.f};
}

/// Makes bounces that are distributed over the unit cube. Bounces on surfaces that face axis k have
/// directions around axis k, with less spread in the right half of the cube.
std::vector<TrainingRecord> many_bounces(uint32_t count, uint32_t seed) {
  Random random(seed);
  std::vector<TrainingRecord> records;
  for (uint32_t i = 0; i < count; ++i) {
    const auto axis = static_cast<uint8_t>(random.bits() % kGuidingAxes);
    float w[3] = {random() - 0.5f, random() - 0.5f, random() - 0.5f};
    const float x = random();
    w[axis / 2] += (axis % 2 == 0 ? 1.f : -1.f) * (x < 0.5f ? 0.6f : 3.f);
    records.push_back(bounce(x, random(), random(), axis, normalize(Vec3<float>{w[0], w[1], w[2]}),
                             0.5f + random()));
  }
  return records;
}

TEST(Guide, FieldIsTheSameOnAnyNumberOfThreads) {
  const std::vector<TrainingRecord> records = many_bounces(40000, 11);
  for (const bool first : {true, false}) {
    std::vector<GuidingFieldArrays> built;
    for (const uint32_t threads : {1u, 3u})
      with_threads(threads, [&] {
        built.push_back(GuidingField(kUnitGrid, records, 1, first, true, SIZE_MAX).parts());
      });
    ASSERT_GT(built[0].bsdf_share.size(), 50u);
    EXPECT_EQ(built[0].entries, built[1].entries);
    EXPECT_EQ(built[0].cells, built[1].cells);
    EXPECT_EQ(built[0].tables, built[1].tables);
    EXPECT_EQ(built[0].bsdf_share, built[1].bsdf_share);
    for (size_t i = 0; i < built[0].spheres.size(); ++i) {
      EXPECT_EQ(built[0].spheres[i].inverse_distance, built[1].spheres[i].inverse_distance);
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_EQ(built[0].spheres[i].centre[axis], built[1].spheres[i].centre[axis]);
    }
  }
}

TEST(Guide, OctahedralMapKeepsAreas) {
  chi_square::Battery battery("octahedral map");
  chi_square::Case c{
      "sphere", bsdf_testing::direction_charts(), [](const Place&) { return 1 / (4 * kPiD); }, {}};
  c.draw = [](Random& random, bool) {
    const float u = random(), v = random();
    return Draw::at(bsdf_testing::place_of(octahedral_direction(u, v)));
  };
  battery.run(c);
  battery.judge();
  Random random(3);
  for (int i = 0; i < 20000; ++i) {
    const float u = random(), v = random();
    const Vec3<float> w = octahedral_direction(u, v);
    ASSERT_NEAR(length(w), 1, 1e-5);
    const Vec2<float> back = octahedral_point(w);
    ASSERT_NEAR(back.x, u, 2e-3) << v;
    ASSERT_NEAR(back.y, v, 2e-3) << u;
  }
  // Tests corners, where the octahedral map folds.
  for (const float u : {0.f, 0.5f, kOneMinusEpsilon})
    for (const float v : {0.f, 0.5f, kOneMinusEpsilon})
      EXPECT_NEAR(length(octahedral_direction(u, v)), 1, 1e-5);
}

/// Mapping directions to the sphere's centre and back gives the same directions. A chi-square test
/// checks the Jacobian: uniform directions from the centre have this density when seen from the
/// shading point.
TEST(Guide, SphereMovesDirections) {
  Random random(12);
  chi_square::Battery battery("sphere");
  for (int round = 0; round < 8; ++round) {
    const float far = round == 0 ? 0.f : 2 * random();
    const Vec3<float> centre{random(), random(), random()},
        p = centre + octahedral_direction<float>(random(), random()) * far;
    const Vec3<float> offset = sphere_offset<float>(p, centre, 0.5f);
    EXPECT_NEAR(length(offset), std::min(0.5f * far, kMaxOffset), 1e-6);
    for (int i = 0; i < 2000; ++i) {
      const Vec3<float> w = octahedral_direction<float>(random(), random());
      const CentreDirection<float> seen = direction_from_centre<float>(offset, w);
      ASSERT_NEAR(length(seen.w), 1, 1e-5);
      // Test that the point on the sphere lies in direction w from the shading point.
      ASSERT_NEAR(length(cross(seen.w - offset, w)), 0, 1e-5);
      ASSERT_GT(dot(seen.w - offset, w), 0);
      ASSERT_NEAR(length(direction_from_point<float>(offset, seen.w) - w), 0, 1e-5);
    }
    chi_square::Case c{"offset " + std::to_string(length(offset)),
                       bsdf_testing::direction_charts(),
                       [=](const Place& at) {
                         const auto w = bsdf_testing::direction_at(at);
                         return double{direction_from_centre<float>(offset, w).factor} / (4 * kPiD);
                       },
                       {}};
    c.draw = [=](Random& source, bool) {
      const float u = source(), v = source();
      return Draw::at(bsdf_testing::place_of(
          direction_from_point<float>(offset, octahedral_direction<float>(u, v))));
    };
    battery.run(c);
  }
  battery.judge();
  // Test coordinates that are NaN or infinite, or that overflow.
  for (const float x : {kNan, kInf, 3e38f}) {
    const Vec3<float> o = sphere_offset<float>({x, 0.f, 0.f}, {0.f, 0.f, 0.f}, 3e38f);
    EXPECT_TRUE(length(o) < 0.71f || std::isnan(x)) << x;
  }
}

/// A small lamp is near a region of a wall. Seen from different points of this region, directions
/// to the lamp differ by 50 degrees.
TEST(Guide, SpheresKnowHowFarLightIs) {
  Random random(13);
  const Vec3<float> lamp{0.5f, 0.5f, 0.5f};
  std::vector<TrainingRecord> records;
  const auto guiding = [&] { return Vec3<float>{0.25f + 0.5f * random(), 0.f, 0.5f}; };
  for (int i = 0; i < 2000; ++i) {
    const Vec3<float> p = guiding(), d = lamp - p;
    records.push_back(bounce(p.x, p.y, p.z, 2, normalize(d)));
    // The recorded distance is twice the distance to the lamp, as for light from farther away that
    // arrives through a hole at the position of the lamp.
    records.back().inverse_distance = 0.5f / length(d);
  }
  const GuidingField field(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  ASSERT_EQ(field.facts().regions, 1u);
  const ParallaxSphere& sphere = field.parts().spheres[0];
  EXPECT_NEAR(sphere.centre[0], 0.5f, 0.02f);
  EXPECT_NEAR(1 / sphere.inverse_distance, 0.5f, 0.2f);
  for (TrainingRecord& r : records) r.inverse_distance = 0;
  const GuidingField blind(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  EXPECT_EQ(blind.parts().spheres[0].inverse_distance, 0);
  double known = 0, taken_for_far = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3<float> p = guiding(), w = normalize(lamp - p);
    const auto log_pdf = [&](const GuidingField& f) {
      const GuidingView view = f.view();
      const auto found = look_up_guiding<float>(view, p, 2u, 0u, true);
      return std::log(double{guiding_pdf<float>(view, found, w, true)}) / 200;
    };
    known += log_pdf(field);
    taken_for_far += log_pdf(blind);
  }
  EXPECT_GT(known, taken_for_far + std::log(2.0));
}

/// Blurring bins keeps their sum, fills holes near observed directions, and does not change bins
/// far away.
TEST(Guide, DirectionsAreBlurred) {
  Random random(14);
  for (int round = 0; round < 50; ++round) {
    DirectionBins bins{};
    const auto seen = static_cast<uint32_t>(random() * kGuidingBins);
    bins[seen] = 3;
    const DirectionBins blurred = smoothed(bins);
    double sum = 0;
    for (uint32_t b = 0; b < kGuidingBins; ++b) {
      sum += blurred[b];
      const float cosine = dot(bin_direction(b), bin_direction(seen));
      if (cosine > std::cos(0.15f)) {
        EXPECT_GT(blurred[b], 0.02) << b;
      }
      if (cosine < std::cos(0.3f)) {
        EXPECT_EQ(blurred[b], 0) << b;
      }
    }
    EXPECT_NEAR(sum, 3, 1e-12);
    EXPECT_GT(blurred[seen], 0.2);
  }
}

TEST(Guide, TablesHoldWhatTheyAreGiven) {
  Random random(5);
  for (int round = 0; round < 20; ++round) {
    std::array<double, kGuidingBins> weights{};
    double sum = 0;
    for (double& w : weights) {
      w = round % 4 == 0 || random() < 0.3f ? 0 : std::pow(double{random()}, round);
      sum += w;
    }
    std::array<uint32_t, kGuidingWords> table;
    write_guiding_table(weights, table);
    uint64_t all = 0;
    for (uint32_t row = 0; row < kGuidingSide; ++row) {
      uint32_t start = 0;
      for (uint32_t column = 0; column < kGuidingSide; ++column) {
        const uint32_t word = table[kGuidingSide + row * kGuidingSide + column];
        EXPECT_EQ(word & 0xffffu, start);
        EXPECT_GE(word >> 16, 1u);
        start += word >> 16;
        const double p = double(table[row] >> 16) * double(word >> 16) * 0x1p-32;
        all += uint64_t{table[row] >> 16} * (word >> 16);
        if (sum > 0) {
          EXPECT_NEAR(p, weights[row * kGuidingSide + column] / sum, 1e-3) << round;
        }
      }
      EXPECT_EQ(start, 1u << 16);
    }
    EXPECT_EQ(all, uint64_t{1} << 32);
  }
}

TEST(Guide, SamplesFollowTheirDensity) {
  const auto records = many_bounces(60000, 1);
  const GuidingField field(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  const GuidingView view = field.view();
  chi_square::Battery battery("guide");
  for (const float x : {0.2f, 0.9f})
    for (uint32_t axis = 0; axis < kGuidingAxes; ++axis) {
      const auto guiding = look_up_guiding<float>(view, {x, 0.3f, 0.6f}, axis, 0, true);
      ASSERT_TRUE(guiding.guided);
      // Integrates over the equal-area square, where the density is constant per bin.
      chi_square::Case c{"axis " + std::to_string(axis),
                         {{0, 1, 0, 1, kGuidingSide, kGuidingSide}},
                         [=](const Place& p) {
                           const Vec3<float> w = octahedral_direction(static_cast<float>(p.x),
                                                                      static_cast<float>(p.y));
                           return 4 * kPiD * double{guiding_pdf<float>(view, guiding, w, true)};
                         },
                         {}};
      c.is_smooth = false;
      c.draw = [=](Random& random, bool) {
        const float u = random(), v = random();
        const Vec2<float> at = octahedral_point(sample_guiding<float>(view, guiding, u, v, true));
        return Draw::at({0, at.x, at.y});
      };
      battery.run(c);
    }
  battery.judge();
}

/// The field reproduces the distribution of light: cells on the right have narrower lobes.
TEST(Guide, CellsKnowTheirOwnLight) {
  const auto records = many_bounces(200000, 2);
  const GuidingField field(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  EXPECT_EQ(field.facts().records, records.size());
  EXPECT_GT(field.facts().cells, 64u);
  EXPECT_GT(field.facts().guided_regions, 300u);
  const auto pdf = [&](float x, uint32_t axis, const Vec3<float>& w) {
    const auto guiding = look_up_guiding<float>(field.view(), {x, 0.4f, 0.7f}, axis, 0, true);
    return guiding_pdf<float>(field.view(), guiding, w, true);
  };
  const Vec3<float> right = normalize(Vec3<float>{1.f, 0.1f, 0.1f}), left = -right;
  EXPECT_GT(pdf(0.9f, 0, right), 2 * pdf(0.1f, 0, right));
  EXPECT_GT(pdf(0.1f, 0, right), 10 * pdf(0.1f, 0, left));
  EXPECT_GT(pdf(0.1f, 1, left), 10 * pdf(0.1f, 1, right));
}

TEST(Guide, FewBouncesLeanOnWhatIsAround) {
  std::vector<TrainingRecord> records = many_bounces(20000, 3);
  // A corner region has hardly any training samples.
  std::erase_if(records, [](const TrainingRecord& r) {
    return r.p[0] < 0.25f && r.p[1] < 0.25f && r.p[2] < 0.25f;
  });
  const GuidingField field(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  const auto guiding = look_up_guiding<float>(field.view(), {0.1f, 0.1f, 0.1f}, 0, 0, true);
  EXPECT_TRUE(guiding.guided);
  // Looks up positions outside of the bounds, and NaN positions.
  for (const float x : {-5.f, 9.f, kNan, kInf})
    look_up_guiding<float>(field.view(), {x, x, x}, 3, 0, true);
  const GuidingField empty(kUnitGrid, {}, 1, true, true, size_t{64} << 20);
  EXPECT_EQ(empty.view().grid, nullptr);
  EXPECT_FALSE(look_up_guiding<float>(empty.view(), {0.5f, 0.5f, 0.5f}, 0, 0, true).guided);
}

/// Compares the survival factor of a region with the formula. Bounces without contribution count,
/// too.
TEST(Guide, BouncesAreWeighed) {
  std::vector<TrainingRecord> records;
  for (int i = 0; i < 1000; ++i) records.push_back(bounce(0.5f, 0.5f, 0.5f, 2, {0.f, 1.f, 0.f}, 4));
  GuidingField field(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  const uint64_t at = bounce_position_key(kUnitGrid, {0.5f, 0.5f, 0.5f}, 2);
  std::vector<BounceSample> training_samples(3000, {at, 0.f, 0.f, 2.f});
  training_samples.insert(training_samples.end(), 1000, {at, 4.f, 16.f, 6.f});
  // Training samples of surfaces that face another axis must not count.
  training_samples.insert(training_samples.end(), 10,
                          {bounce_position_key(kUnitGrid, {0.1f, 0.1f, 0.9f}, 3), 9.f, 81.f, 1});
  field.compute_survival(training_samples, {27, 0.5});
  // The 4000 bounces have a mean squared contribution of 16 / 4 and a mean cost of 12 / 4; the
  // survival factor includes a safety factor of 1.5.
  const auto guiding = look_up_guiding<float>(field.view(), {0.5f, 0.5f, 0.5f}, 2, 0, true);
  EXPECT_NEAR(guiding.survival, 1.5 * std::sqrt(4. / 3 * 27 / 0.5), 1e-4);
  EXPECT_EQ(efficient_survival<float>(guiding, 0.f), kMinSurvival);
  EXPECT_FLOAT_EQ(efficient_survival<float>(guiding, 0.05f), 0.05f * guiding.survival);
  EXPECT_EQ(efficient_survival<float>(guiding, 9.f), 1.f);
}

TEST(Guide, MemoryIsBounded) {
  const auto records = many_bounces(100000, 4);
  const GuidingField large(kUnitGrid, records, 1, true, true, size_t{64} << 20),
      small(kUnitGrid, records, 1, true, true, 200 << 10);
  EXPECT_LE(small.bytes(), size_t{200} << 10);
  EXPECT_GT(large.bytes(), 2 * small.bytes());
  EXPECT_GT(small.facts().guided_regions, 5u);
}

/// The chosen guiding fraction has the smallest second moment.
TEST(Guide, SharesFollowMoments) {
  ShareMoments bad, valid, none;
  Random random(8);
  for (int i = 0; i < 4000; ++i) {
    TrainingRecord r{};
    r.pdf = r.bsdf_pdf = 0.3f;
    r.guiding_pdf = 3.f * random() + 2.f;
    valid.add(share_ratios(r), 1);
    r.guiding_pdf = 0.01f;
    bad.add(share_ratios(r), 1);
    r.guiding_pdf = 0;
    none.add(share_ratios(r), 1);
  }
  EXPECT_EQ(kBsdfShares[valid.best()], kBsdfShares[0]);
  EXPECT_EQ(kBsdfShares[bad.best()], 1.f);
  EXPECT_EQ(none.count, 0);
  EXPECT_EQ(kBsdfShares[none.best()], 1.f);
  // Regions in which the guiding field does not reduce noise are not guided.
  std::vector<TrainingRecord> records = many_bounces(50000, 9);
  for (TrainingRecord& r : records) r.guiding_pdf = 1e-3f;
  const GuidingField field(kUnitGrid, records, 1, false, true, size_t{64} << 20);
  EXPECT_EQ(field.facts().guided_regions, 0u);
  EXPECT_EQ(field.facts().moment_ratio, 1);
  for (TrainingRecord& r : records) r.guiding_pdf = 10.f;
  const GuidingField better(kUnitGrid, records, 1, false, true, size_t{64} << 20);
  // With `guides` false, the field only stores the survival factors.
  const GuidingField told(kUnitGrid, records, 1, false, false, size_t{64} << 20);
  EXPECT_EQ(told.facts().guided_regions, 0u);
  EXPECT_EQ(told.facts().regions, better.facts().regions);
  EXPECT_EQ(better.facts().guided_regions, better.facts().regions);
  EXPECT_LT(better.facts().moment_ratio, 0.2);
  EXPECT_NEAR(better.facts().guided_share, 0.75, 1e-6);
}

/// A guiding field that is restored from its arrays is equal to the original. The constructor
/// throws Error for arrays with invalid indices or values.
TEST(Guide, IsMadeOfItsPartsAgain) {
  const auto records = many_bounces(80000, 11);
  // The grid is so large that all samples fall into few top-level entries, which are divided.
  const GuidingGrid wide({0.f, 0.f, 0.f}, {20.f, 20.f, 20.f});
  const GuidingField field(wide, records, 3, true, true, size_t{64} << 20);
  const GuidingFieldArrays& parts = field.parts();
  const GuidingField again(wide, parts, field.facts(), 3);
  EXPECT_EQ(again.bytes(), field.bytes());
  ASSERT_GT(parts.entries.size(), kGuidingTopCells);
  const Vec3<float> p{0.7f, 0.2f, 0.4f}, w = normalize(Vec3<float>{0.3f, 0.9f, 0.1f});
  const auto density = [&](const GuidingField& f) {
    const GuidingView view = f.view();
    return guiding_pdf<float>(view, look_up_guiding<float>(view, p, 2u, 0u, true), w, true);
  };
  EXPECT_EQ(density(again), density(field));
  const auto expect_refused = [&](const char* what, const auto& damage, size_t materials = 3) {
    GuidingFieldArrays bad = parts;
    damage(bad);
    EXPECT_THROW(GuidingField(wide, bad, {}, materials), Error) << what;
  };
  const auto entry = [&](uint32_t value) {
    return [=](GuidingFieldArrays& bad) { bad.entries[kGuidingTopCells] = value; };
  };
  expect_refused("materials", [](GuidingFieldArrays&) {}, 4);
  expect_refused("a cell", entry(kGuidingCell | static_cast<uint32_t>(parts.cells.size())));
  expect_refused("a brick beyond", entry(static_cast<uint32_t>(parts.entries.size())));
  expect_refused("a brick of its own", entry(kGuidingTopCells));
  expect_refused("no brick", entry(kGuidingTopCells + 1));
  expect_refused("cut", [](GuidingFieldArrays& bad) { bad.entries.pop_back(); });
  expect_refused("none", [](GuidingFieldArrays& bad) { bad = {}; });
  expect_refused("a region", [](GuidingFieldArrays& bad) { bad.cells[0] = 1u << 30; });
  expect_refused("a table", [](GuidingFieldArrays& bad) { bad.tables.resize(kGuidingWords); });
  expect_refused("numbers", [](GuidingFieldArrays& bad) { bad.tables[5] ^= 1u; });
  expect_refused("a share", [](GuidingFieldArrays& bad) { bad.bsdf_share[0] = 0; });
  expect_refused("no number", [](GuidingFieldArrays& bad) { bad.material_share[0] = NAN; });
  expect_refused("spheres", [](GuidingFieldArrays& bad) { bad.spheres.pop_back(); });
  expect_refused("a place", [](GuidingFieldArrays& bad) { bad.spheres[0].centre[1] = NAN; });
  expect_refused("a radius", [](GuidingFieldArrays& bad) { bad.spheres[0].inverse_distance = -1; });
  expect_refused("survival", [](GuidingFieldArrays& bad) { bad.survival.pop_back(); });
}

TEST(Guide, FacesTheirLargestComponent) {
  EXPECT_EQ(guiding_axis<float>({0.9f, 0.1f, -0.2f}), 0u);
  EXPECT_EQ(guiding_axis<float>({-0.9f, 0.1f, -0.2f}), 1u);
  EXPECT_EQ(guiding_axis<float>({0.1f, 0.8f, -0.2f}), 2u);
  EXPECT_EQ(guiding_axis<float>({0.1f, -0.8f, -0.2f}), 3u);
  EXPECT_EQ(guiding_axis<float>({0.1f, 0.2f, 0.3f}), 4u);
  EXPECT_EQ(guiding_axis<float>({0.1f, 0.2f, -0.3f}), 5u);
}

TEST(Guide, Lanes) {
  auto records = many_bounces(60000, 6);
  for (TrainingRecord& r : records) r.inverse_distance = 3.f * r.value;
  const GuidingField field(kUnitGrid, records, 1, true, true, size_t{64} << 20);
  const GuidingView view = field.view();
  const auto u = padded({0.f, 0.5f, kOneMinusEpsilon, 0x1p-24f}, 2000, 0.f, kOneMinusEpsilon, 1);
  const auto v = padded({0.5f, 0.f, kOneMinusEpsilon, 0.25f}, 2000, 0.f, kOneMinusEpsilon, 2);
  const auto each = [&](auto component, const char* what) {
    expect_lanes_agree(
        u, v,
        [&]<typename F>(const F& a, const F& b) {
          const Vec3<F> p{a, b, F(a * b)};
          const Vec3<F> w = octahedral_direction<F>(b, a);
          const GuidingLookup<F> guiding =
              look_up_guiding<F>(view, p, guiding_axis<F>(w), UInt<F>(0u), Mask<F>(true));
          return component.template operator()<F>(guiding, w, a, b);
        },
        what);
  };
  each([&]<typename F>(const GuidingLookup<F>& guiding, const Vec3<F>&, const F&,
                       const F&) { return F(Int<F>(guiding.region)); },
       "region");
  each([&]<typename F>(const GuidingLookup<F>& guiding, const Vec3<F>& w, const F&,
                       const F&) { return guiding_pdf<F>(view, guiding, w, guiding.guided); },
       "pdf");
  each(
      [&]<typename F>(const GuidingLookup<F>& guiding, const Vec3<F>&, const F& a, const F& b) {
        const Vec3<F> w = sample_guiding<F>(view, guiding, a, b, guiding.guided);
        return F(w.x + 2.f * w.y + 4.f * w.z);
      },
      "sample");
}

}  // namespace
}  // namespace wavecomb
