// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/description/light_builder.h"

#include "lane_testing.h"
#include "light_testing.h"
#include "wavecomb/core/error.h"
#include "wavecomb/light/sampling/light_sample.inl"

namespace wavecomb {
namespace {

using namespace light_testing;
using lane_testing::kInf;
using lane_testing::kNan;

const LightRecord& only(const Lights& lights) {
  EXPECT_EQ(lights.set.records.size(), 1u);
  return lights.set.records[0];
}
void expect_vec(const float (&v)[3], float x, float y, float z) {
  EXPECT_NEAR(v[0], x, 1e-5);
  EXPECT_NEAR(v[1], y, 1e-5);
  EXPECT_NEAR(v[2], z, 1e-5);
}

TEST(LightBuilder, RectInItsOwnSpace) {
  Light light = make_light(LightKind::kRect);
  light.width = 4;
  light.height = 2;
  const Lights lights({light});
  const LightRecord& r = only(lights);
  // Seen from the front (from -z, +y up), +x is to the left: the corner is at the lower left.
  expect_vec(r.p, 2, -1, 0);
  expect_vec(r.u, -4, 0, 0);
  expect_vec(r.v, 0, 2, 0);
  expect_vec(r.n, 0, 0, -1);
  EXPECT_FLOAT_EQ(r.area, 8);
  expect_vec(r.radiance, 2, 3, 4);
  EXPECT_FLOAT_EQ(r.selection_pdf, 1);
}

TEST(LightBuilder, FlatLightsShineToTheImageOfMinusZ) {
  for (const LightKind kind : {LightKind::kRect, LightKind::kDisk}) {
    expect_vec(only(Lights({make_light(kind, scale(-1, 1, 1))})).n, 0, 0, -1);
    expect_vec(only(Lights({make_light(kind, scale(1, 1, -1))})).n, 0, 0, 1);
    expect_vec(only(Lights({make_light(kind, rotate(90, 0))})).n, 0, 1, 0);
    // A shear parallel to the plane of the light does not change the light.
    const Affine shear{{{1, 0, 5}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};
    expect_vec(only(Lights({make_light(kind, shear)})).n, 0, 0, -1);
  }
}

TEST(LightBuilder, AreasInWorldSpace) {
  const Affine m = translate(1, 2, 3) * rotate(30, 50) * scale(2, 3, 5);
  EXPECT_NEAR(only(Lights({make_light(LightKind::kRect, m)})).area, 6, 1e-5);
  EXPECT_NEAR(only(Lights({make_light(LightKind::kDisk, m)})).area, kPiD * 0.25 * 6, 1e-5);
  const Lights sphere({make_light(LightKind::kSphere, m)});
  EXPECT_NEAR(only(sphere).radius, 0.5 * std::cbrt(30.0), 1e-5);
  expect_vec(only(sphere).p, 1, 2, 3);
}

TEST(LightBuilder, NormalizedLightsKeepTheirPower) {
  for (const LightKind kind : {LightKind::kRect, LightKind::kDisk, LightKind::kSphere}) {
    double first = 0;
    for (const float size : {1e-3f, 0.1f, 1.f, 7.f, 1e4f}) {
      Light light = make_light(kind, rotate(20, 40) * scale(size, 2 * size, -size));
      light.normalize = true;
      const Lights lights({light});
      const double power = lights.set.total_power;
      if (first == 0) first = power;
      EXPECT_NEAR(power / first, 1, 1e-5);
      EXPECT_NEAR(static_cast<double>(only(lights).radiance[0]) * only(lights).area, 2, 1e-4);
    }
  }
  // A small normalised sphere light approaches a point light of intensity pi r^2 L.
  Light light = make_light(LightKind::kSphere);
  light.normalize = true;
  light.radius = 1e-3f;
  const float small = only(Lights({light})).radiance[0] * static_cast<float>(kPiD * 1e-6);
  light.radius = 0;
  EXPECT_NEAR(only(Lights({light})).radiance[0], small, 1e-5);
  EXPECT_EQ(only(Lights({light})).radius, 0);
}

TEST(LightBuilder, DistantConventions) {
  Light light = make_light(LightKind::kDistant, rotate(-90, 0));
  for (const float angle : {0.1f, 0.53f, 10.f, 90.f, 180.f}) {
    light.angle = angle;
    light.normalize = true;
    const double half = angle / 2 * kPiD / 180;
    const Lights lights({light});
    const LightRecord& r = only(lights);
    EXPECT_NEAR(r.radiance[0] * kPiD * std::sin(half) * std::sin(half), 2, 1e-4);  // irradiance 2
    EXPECT_NEAR(r.one_minus_cos / (2 * std::pow(std::sin(half / 2), 2)), 1, 1e-6);
    expect_vec(r.n, 0, -1, 0);
    light.normalize = false;
    EXPECT_EQ(only(Lights({light})).radiance[0], 2);
  }
  light.angle = 0;
  light.normalize = true;
  EXPECT_EQ(only(Lights({light})).one_minus_cos, 0);
  EXPECT_EQ(only(Lights({light})).radiance[0], 2);
  light.angle = 270;
  const double s2 = std::pow(std::sin(135 * kPiD / 180), 2);
  EXPECT_NEAR(only(Lights({light})).radiance[0] * kPiD * (2 - s2), 2, 1e-4);
}

TEST(LightBuilder, DomeAxesAreOrthonormal) {
  for (const Affine& m : {Affine{}, rotate(30, 70), translate(5, 6, 7) * scale(2, 3, -4),
                          scale(1, 1, 0), scale(0, 0, 0)}) {
    const Lights lights({make_light(LightKind::kDome, m)});
    const LightRecord& r = only(lights);
    const Vec3<float> u(r.u[0], r.u[1], r.u[2]), v(r.v[0], r.v[1], r.v[2]),
        n(r.n[0], r.n[1], r.n[2]);
    EXPECT_NEAR(dot(u, u), 1, 1e-6);
    EXPECT_NEAR(dot(v, v), 1, 1e-6);
    EXPECT_NEAR(dot(n, n), 1, 1e-6);
    EXPECT_NEAR(dot(u, v), 0, 1e-6);
    EXPECT_NEAR(dot(u, n), 0, 1e-6);
    EXPECT_NEAR(dot(v, n), 0, 1e-6);
  }
}

TEST(LightBuilder, InfiniteLightsFirstThenTrianglesLast) {
  const std::vector<Light> input = {make_light(LightKind::kRect), make_light(LightKind::kDome),
                                    make_light(LightKind::kSphere), make_light(LightKind::kDistant),
                                    make_light(LightKind::kDisk)};
  const std::vector<EmissiveTriangle> triangles(3, make_triangle({0, 0, 0}, {1, 0, 0}, {0, 2, 0}));
  const Lights lights(input, triangles);
  EXPECT_EQ(lights.set.infinite_count, 2u);
  EXPECT_EQ(lights.set.first_triangle(), 5u);
  ASSERT_EQ(lights.set.size(), 8u);
  EXPECT_EQ(lights.set.of_input, (std::vector<uint32_t>{2, 0, 3, 1, 4}));
  for (size_t i = 0; i < input.size(); ++i) {
    EXPECT_EQ(lights.set.records[lights.set.of_input[i]].kind,
              static_cast<uint32_t>(input[i].kind));
  }
  expect_vec(lights.set.triangles[0].m, 0, 0, 1);
  double sum = 0;
  for (size_t i = 0; i < lights.set.size(); ++i) sum += double{lights.set.selection_pdf(i)};
  EXPECT_EQ(sum, 1);  // multiples of 2^-24
}

TEST(LightBuilder, ProbabilitiesFollowPower) {
  Light bright = make_light(LightKind::kRect), dim = bright, black = bright;
  dim.color = {2e-9f, 3e-9f, 4e-9f};
  black.color = {0, 0, 0};
  bright.width = 3;
  const Lights lights({black, dim, bright, make_light(LightKind::kRect)});
  EXPECT_EQ(lights.set.records[0].selection_pdf, 0);
  EXPECT_GT(lights.set.records[1].selection_pdf, 1e-3f);  // minimum probability
  EXPECT_NEAR(lights.set.records[2].selection_pdf, 0.75, 0.01);
  EXPECT_NEAR(lights.set.records[3].selection_pdf, 0.25, 0.01);
}

TEST(LightBuilder, PickPdfIsExact) {
  // Counts selections for every possible value of the random number, with no other light, with a
  // weak light, and with a strong light.
  for (const auto& [n, records, color] : {std::tuple{1u, 0u, 1.f},
                                          {2u, 0u, 1.f},
                                          {3u, 1u, 1e-9f},
                                          {7u, 2u, 1e4f},
                                          {64u, 5u, 10.f},
                                          {1000u, 0u, 1.f},
                                          {70001u, 3u, 1e5f},
                                          {70001u, 2000u, 1.f}}) {
    std::vector<EmissiveTriangle> triangles(n, make_triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
    std::mt19937 rng(n);
    for (auto& t : triangles)
      t.mean_scale = rng() % 5 == 0 ? 0.f : std::exp(static_cast<float>(rng() % 1000) / 100.f);
    triangles[0].mean_scale = 1;
    std::vector<Light> others(records, make_light(LightKind::kRect));
    for (Light& light : others) light.color = {color, color, rng() % 7 == 0 ? 0 : color};
    if (records > 1) others[1].color = {0, 0, 0};
    const Lights lights(others, triangles);
    const LightView view = lights.view();
    ASSERT_EQ(view.count, n + records);
    std::vector<uint32_t> hits(view.count, 0);
    using F = FloatP<16>;
    for (uint32_t k = 0; k < 1u << 24; k += 16) {
      const F u = F(Int<F>(UInt<F>(k) + lane_index<F>())) * 0x1p-24f;
      uint32_t out[16];
      store(out, detail::light_by_power<F>(view, u, Mask<F>(true)));
      for (const uint32_t i : out) {
        ASSERT_LT(i, view.count);
        ++hits[i];
      }
    }
    for (uint32_t i = 0; i < view.count; ++i) {
      ASSERT_EQ(static_cast<float>(hits[i]) * 0x1p-24f, lights.set.selection_pdf(i))
          << i << " of " << n << " triangles and " << records;
      const bool lit = i < records ? others[i].color.x > 0 : triangles[i - records].mean_scale > 0;
      ASSERT_EQ(hits[i] > 0, lit);
    }
  }
}

TEST(LightBuilder, PickTableOfMillions) {
  for (const size_t n : {size_t{1500000}, size_t{kMaxPowerLights}}) {
    std::vector<double> weights(n, 1);
    weights[7] = 1e12;
    weights[8] = 0;
    weights[9] = 1e-300;
    for (const size_t first_triangle : {size_t{0}, size_t{8}, n}) {
      std::vector<uint32_t> bins, numbers;
      build_power_table(weights, first_triangle, bins, numbers);
      EXPECT_EQ(numbers[8], 0u);
      EXPECT_GT(numbers[9], 0u);
      if (n < 1u << 21) {
        EXPECT_GT(numbers[7], 1u << 22);
      }
      EXPECT_GT(*std::min_element(numbers.begin() + 10, numbers.end()), 0u);
      uint64_t sum = 0;
      for (const uint32_t x : numbers) sum += x;
      EXPECT_EQ(sum, 1u << 24);
      EXPECT_LE(bins.size(), size_t{1} << 24);
    }
  }
}

TEST(LightBuilder, FewStrongLightsHaveASmallTable) {
  // The selection table stays small for a dome and a million triangles.
  std::vector<double> weights(1000001, 1);
  weights[0] = 1e6;
  std::vector<uint32_t> bins, numbers;
  const PowerTable table = build_power_table(weights, 1, bins, numbers);
  // The dome has half of the power, and 1 % of the probability is distributed equally among all
  // lights. The tolerance is the size of one table bin.
  EXPECT_NEAR(numbers[0], 0.99 * 0x1p24 / 2, 1 << 14);
  EXPECT_EQ(table.split, numbers[0]);
  EXPECT_LE(table.triangle_bins, 1024u);
}

/// The density of dome samples is positive wherever the bilinearly filtered image is positive.
TEST(DomeDistribution, PositiveWhereverTheBilinearImageIs) {
  std::mt19937 rng(3);
  const uint32_t sizes[][2] = {{1, 1},   {2, 1},      {8, 4},      {17, 9},
                               {64, 32}, {1500, 700}, {2048, 1024}};
  for (const auto& size : sizes)
    for (int n = 0; n < 3; ++n) {
      const uint32_t w = size[0], h = size[1];
      std::vector<float> rgb(size_t{w} * h * 3, 0.f);
      for (int k = 0; k < 2; ++k) rgb[rng() % rgb.size()] = k ? 1e-6f : 1e5f;
      rgb[rng() % rgb.size()] = -50.f;
      Lights lights;
      const uint32_t texture = lights.add_texture(w, h, rgb);
      const Distribution2D d = build_dome_distribution(lights.views[texture], {1, 1, 1});
      ASSERT_GT(d.width, 0u);
      ASSERT_LE(d.width, 1024u);
      ASSERT_LE(d.height, 512u);
      uint64_t row_counts = 0;
      for (uint32_t y = 0; y < d.height; ++y) {
        row_counts += detail::interval_at<float>(d, d.height, d.height, y, true).count;
        uint64_t counts = 0;
        for (uint32_t x = 0; x < d.width; ++x)
          counts += detail::interval_at<float>(d, y, d.width, x, true).count;
        ASSERT_EQ(counts, Distribution2D::kCounts);
      }
      ASSERT_EQ(row_counts, Distribution2D::kCounts);
      Light light = make_light(LightKind::kDome);
      light.texture = texture;
      lights.build({light});
      for (uint32_t y = 0; y < h; ++y)
        for (uint32_t x = 0; x < w; ++x) {
          const float* texel = &rgb[3 * (size_t{y} * w + x)];
          if (!(texel[0] > 0 || texel[1] > 0 || texel[2] > 0)) continue;
          for (int k = 0; k < 100; ++k) {
            const double s = (x + 0.5 + (static_cast<double>(rng() % 1000) / 500 - 1) * 0.999) / w;
            const double down =
                (y + 0.5 + (static_cast<double>(rng() % 1000) / 500 - 1) * 0.999) / h;
            if (down <= 0.001 || down >= 0.999) continue;
            const auto sf = static_cast<float>(s - std::floor(s)), df = static_cast<float>(down);
            const auto c = detail::dome_radiance<float>(
                detail::LightReader<float>(lights.set.records[0], true), lights.views[texture], sf,
                1.f - df, true);
            if (c.x + c.y + c.z <= 1e-9f) continue;
            const auto cx =
                std::min(static_cast<uint32_t>(sf * static_cast<float>(d.width)), d.width - 1);
            const auto cy =
                std::min(static_cast<uint32_t>(df * static_cast<float>(d.height)), d.height - 1);
            ASSERT_GT(detail::interval_at<float>(d, d.height, d.height, cy, true).count, 0u);
            ASSERT_GT(detail::interval_at<float>(d, cy, d.width, cx, true).count, 0u)
                << w << " x " << h;
          }
        }
    }
}

const uint16_t* values_of(const Distribution2D& d, uint32_t row) {
  return d.cumulative[size_t{row} * d.row_lines].value;
}

/// Expects find_interval() to return the same result as a linear search of the row.
template <typename F>
void expect_intervals(const Distribution2D& d, uint32_t row, uint32_t n,
                      const std::vector<uint32_t>& counts) {
  using U = UInt<F>;
  const uint16_t* from = values_of(d, row);
  for (size_t i = 0; i < counts.size(); i += kWidth<F>) {
    // One lane in five is inactive.
    const Mask<F> active(not_(Mask<F>((lane_index<F>() + static_cast<uint32_t>(i)) % 5u == U(4u))));
    const auto found = detail::find_interval<F>(d, U(row), n, load<U>(&counts[i]), active);
    for (uint32_t k = 0; k < kWidth<F>; ++k) {
      if ((lane_bits<F>(active) >> k & 1u) == 0) continue;
      const uint32_t x = counts[i + k];
      const auto expected = static_cast<uint32_t>(std::upper_bound(from, from + n, x) - from - 1);
      const uint32_t end = expected + 1 == n ? Distribution2D::kCounts : from[expected + 1];
      ASSERT_EQ(lane(found.index, k), expected)
          << kWidth<F> << " lanes, " << n << " intervals, count " << x;
      ASSERT_EQ(lane(found.begin, k), from[expected]);
      ASSERT_EQ(lane(found.count, k), end - from[expected]);
    }
  }
}

/// Returns values to look up: cumulative values and their neighbours, and random values. Pads the
/// list to a multiple of 16.
std::vector<uint32_t> hard_counts(const uint16_t* cumulative, uint32_t n, std::mt19937& rng) {
  std::vector<uint32_t> x;
  const auto add = [&](uint32_t count) {
    for (const uint32_t y : {count - 1, count, count + 1})
      if (y < Distribution2D::kCounts) x.push_back(y);
  };
  for (uint32_t i = 0; i < n; i += 1 + n / 300) add(cumulative[i]);
  do x.push_back(rng() % Distribution2D::kCounts);
  while (x.size() < 500 || x.size() % 16 != 0);
  return x;
}

TEST(DomeDistribution, SearchByLinesEqualsSearchOfTheWholeRow) {
  // Images with constant areas, black rows, a single bright texel, steep ramps, and noise.
  using Image = float (*)(uint32_t x, uint32_t y, uint32_t w, uint32_t h, uint32_t noise);
  const Image images[] = {
      [](uint32_t, uint32_t, uint32_t, uint32_t, uint32_t) { return 1.f; },
      [](uint32_t, uint32_t, uint32_t, uint32_t, uint32_t noise) {
        return static_cast<float>(noise % 1000);
      },
      [](uint32_t x, uint32_t y, uint32_t w, uint32_t h, uint32_t) {
        return x == w / 3 && y == h / 2 ? 1e6f : 0.f;
      },
      [](uint32_t x, uint32_t y, uint32_t w, uint32_t h, uint32_t) {
        return x + 1 == w && y + 1 == h ? 1e30f : 1e-30f;
      },
      [](uint32_t x, uint32_t y, uint32_t, uint32_t, uint32_t noise) {
        return y / 4 % 2 == 0 || x / 8 % 2 == 0 ? 0.f : std::exp(static_cast<float>(noise % 40));
      },
      [](uint32_t x, uint32_t, uint32_t, uint32_t, uint32_t) {
        return std::exp2(-0.25f * static_cast<float>(x));
      }};
  std::mt19937 rng(29);
  for (const auto& [w, h] :
       {std::pair{1u, 1u}, {2u, 1u}, {3u, 5u}, {127u, 64u}, {129u, 7u}, {1500u, 33u}, {40u, 600u}})
    for (size_t image = 0; image < std::size(images); ++image) {
      std::vector<float> rgb;
      for (uint32_t y = 0; y < h; ++y)
        for (uint32_t x = 0; x < w; ++x)
          rgb.insert(rgb.end(), 3, images[image](x, y, w, h, static_cast<uint32_t>(rng())));
      Lights lights;
      const uint32_t texture = lights.add_texture(w, h, rgb);
      const Distribution2D d = build_dome_distribution(lights.views[texture], {1, 1, 1});
      if (*std::max_element(rgb.begin(), rgb.end()) == 0) {
        EXPECT_EQ(d.width, 0u);
        continue;
      }
      ASSERT_GT(d.width, 0u);
      ASSERT_EQ(d.coarse.size(), d.height + 1);
      SCOPED_TRACE(testing::Message() << w << " x " << h << ", image " << image);
      // Tests all rows of small images, or about twenty rows of large ones; the marginal
      // distribution is stored after the rows.
      for (uint32_t y = 0; y <= d.height;
           y += y == d.height ? 1 : std::min(d.height - y, 1 + d.height / 20)) {
        const uint32_t n = y == d.height ? d.height : d.width;
        const auto counts = hard_counts(values_of(d, y), n, rng);
        lane_testing::for_each_lane_type(
            [&]<typename F>() { expect_intervals<F>(d, y, n, counts); });
        if (HasFatalFailure()) return;
      }
    }
}

TEST(DomeDistribution, SolidAngleOfTheLight) {
  const auto of = [](float (*value)(uint32_t)) {
    Lights lights;
    std::vector<float> rgb;
    for (uint32_t y = 0; y < 64; ++y)
      for (uint32_t x = 0; x < 128 * 3; ++x) rgb.push_back(value(y));
    Light dome = make_light(LightKind::kDome);
    dome.texture = lights.add_texture(128, 64, rgb);
    lights.build({dome});
    return image_solid_angle(lights.set.distributions.at(0)) / kPiD;
  };
  EXPECT_NEAR(of([](uint32_t) { return 3.f; }), 4, 4e-3);
  EXPECT_NEAR(of([](uint32_t y) { return y < 32 ? 5.f : 0.f; }), 2, 0.06);
}

TEST(DomeDistribution, MeanAndBlack) {
  Lights lights;
  const uint32_t grey = lights.add_texture(5, 7, std::vector<float>(5 * 7 * 3, 0.25f));
  const uint32_t black = lights.add_texture(4, 2, std::vector<float>(4 * 2 * 3, -1.f));
  EXPECT_NEAR(build_dome_distribution(lights.views[grey], {2, 2, 2}).mean_luminance, 0.5, 1e-6);
  const Distribution2D nothing = build_dome_distribution(lights.views[black], {1, 1, 1});
  EXPECT_EQ(nothing.width, 0u);
  EXPECT_EQ(nothing.mean_luminance, 0);
  Light light = make_light(LightKind::kDome);
  light.texture = black;
  lights.build({light});
  EXPECT_EQ(lights.set.records[0].selection_pdf, 0);
  EXPECT_EQ(lights.set.records[0].texture, kNoTexture);
  EXPECT_EQ(lights.set.records[0].radiance[0], 0);
}

TEST(LightBuilder, DegenerateLightsHaveNoProbability) {
  std::vector<Light> lights;
  for (const LightKind kind : {LightKind::kRect, LightKind::kDisk, LightKind::kSphere}) {
    for (const Affine& m : {scale(0, 0, 0), scale(1, 0, 1), scale(1e-30f, 1e-30f, 1e-30f)}) {
      for (const bool normalize : {false, true}) {
        lights.push_back(make_light(kind, m));
        lights.back().normalize = normalize;
      }
    }
  }
  const Lights set(lights, {make_triangle({0, 0, 0}, {0, 0, 0}, {0, 0, 0}),
                            make_triangle({0, 0, 0}, {1, 1, 1}, {2, 2, 2})});
  for (const LightRecord& r : set.set.records) {
    for (const float x : {r.radiance[0], r.area, r.radius, r.selection_pdf, r.n[0], r.n[1], r.n[2]})
      EXPECT_TRUE(std::isfinite(x));
  }
  for (const TriangleLight& t : set.set.triangles) {
    for (const float x : {t.radiance[0], t.m[0], t.m[1], t.m[2]}) EXPECT_TRUE(std::isfinite(x));
    EXPECT_EQ(t.selection_pdf, 0);
  }
}

}  // namespace
}  // namespace wavecomb
