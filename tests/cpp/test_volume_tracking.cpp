// SPDX-License-Identifier: Apache-2.0
// Grid lookups, and free flights, transmittance and emission along a ray, compared with closed
// forms.
#include "bsdf_testing.h"
#include "lane_testing.h"
#include "volume_testing.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/medium/volume/henyey_greenstein.h"
#include "wavecomb/medium/volume/tracking.h"
#include "wavecomb/medium/volume/volume_bsdf.h"
#include "wavecomb/medium/volume/volume_emission.h"

namespace wavecomb {
namespace {

using namespace volume_testing;

/// Records of volumes and the view that kernels need.
struct Records {
  explicit Records(const std::vector<Volume>& volumes) {
    for (const Volume& v : volumes) {
      check_volume(v);
      records.push_back(make_volume_record(v));
    }
    view = {records.data(), static_cast<uint32_t>(records.size()), 7,
            std::ranges::any_of(records, &VolumeRecord::emits)};
  }
  std::vector<VolumeRecord> records;
  VolumeView view;
};

float value_at(const VolumeField& field, const Vec3<float>& p) {
  Volume v;
  v.density = field;
  const VolumeRecord r = make_volume_record(v);
  return grid_value<float>(r.density.grid, bricks_point<float>(r.density.to_bricks, p), true);
}

TEST(VolumeGrid, InterpolatesLinearlyAndEndsAtItsVoxels) {
  const auto linear = [](int x, int y, int z) {
    return static_cast<float>(1 + x) + 0.5f * static_cast<float>(y) + 0.25f * static_cast<float>(z);
  };
  for (const bool is_half : {false, true}) {
    const auto grid = make_grid(20, linear, 1, is_half, -16);
    const VolumeField field{grid, Affine{}};
    std::mt19937 rng(3);
    std::uniform_real_distribution<float> at(-16.f, 3.f);
    for (int i = 0; i < 2000; ++i) {
      const Vec3<float> p{at(rng), at(rng), at(rng)};
      const float expected = 1 + (p.x + 16) + 0.5f * (p.y + 16) + 0.25f * (p.z + 16);
      EXPECT_NEAR(value_at(field, p), expected, 2e-5f * expected);
    }
    // Half a voxel beyond the last one the value is halved; one voxel beyond it is 0.
    EXPECT_NEAR(value_at(field, {3.5f, 0, 0}), 0.5f * (20 + 8 + 4), 1e-3f);
    EXPECT_NEAR(value_at(field, {-16.5f, 0, 0}), 0.5f * (1 + 8 + 4), 1e-3f);
    EXPECT_EQ(value_at(field, {4.f, 0, 0}), 0.f);
    EXPECT_EQ(value_at(field, {-17.f, 0, 0}), 0.f);
    EXPECT_EQ(value_at(field, {100, 0, 0}), 0.f);
    EXPECT_EQ(value_at(field, {kNan, 0, kInf}), 0.f);
  }
}

TEST(VolumeGrid, MajorantsAreNotLessThanAnythingBetween) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> value(0.f, 1.f);
  std::map<std::array<int, 3>, float> kept;
  const auto grid = make_grid(24, [&](int x, int y, int z) {
    return kept.try_emplace({x, y, z}, value(rng) < 0.7f ? 0.f : value(rng)).first->second;
  });
  const GridView view = grid->view();
  std::uniform_real_distribution<float> at(0.f, 1.f);
  for (int i = 0; i < 20000; ++i) {
    const Vec3<float> p{at(rng) * static_cast<float>(view.size[0]),
                        at(rng) * static_cast<float>(view.size[1]),
                        at(rng) * static_cast<float>(view.size[2])};
    const auto cell =
        static_cast<uint32_t>(p.x) +
        view.size[0] * (static_cast<uint32_t>(p.y) + view.size[1] * static_cast<uint32_t>(p.z));
    EXPECT_LE(grid_value<float>(view, p, true), view.most[cell] * 1.00001f);
  }
}

TEST(VolumeGrid, BadGridsAreRefused) {
  const std::vector<int32_t> one{0, 0, 0};
  const auto refuses = [&](const std::vector<int32_t>& origins, const std::vector<float>& voxels,
                           const std::string& words) {
    try {
      const VolumeGrid grid({"smoke", origins, voxels, {}, 1, 0.f});
      FAIL() << "taken: " << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("smoke"), std::string::npos) << error.what();
    }
  };
  const auto with = [](float x) {
    std::vector<float> voxels(512, 0.5f);
    voxels[100] = x;
    return voxels;
  };
  refuses(one, with(kNan), "not finite");
  refuses(one, with(kInf), "not finite");
  refuses(one, with(-0.1f), "negative");
  refuses({1, 0, 0}, with(0), "multiples of 8");
  refuses({}, {}, "no voxels");
  refuses(one, std::vector<float>(511, 0.f), "8 x 8 x 8");
  refuses({0, 0, 0, 0, 0, 0}, std::vector<float>(1024, 0.f), "two bricks");
  refuses({0, 0, 0, 16777216, 16777208, 16777208}, std::vector<float>(1024, 0.f), "resample");
  Volume v = make_box({0, 0, 0}, {1, 1, 1}, {1, 1, 1});
  v.anisotropy = 1;
  EXPECT_THROW(check_volume(v), Error);
  v.anisotropy = 0;
  v.albedo.y = 1.1f;
  EXPECT_THROW(check_volume(v), Error);
  EXPECT_THROW(check_volume(make_box({0, 0, 0}, {1, 0, 1}, {1, 1, 1})), Error);
  EXPECT_THROW(check_volume(make_box({0, 0, 0}, {1, 1, 1}, {1, -1, 1})), Error);
}

VolumeCounts counts;  ///< not evaluated

/// Returns the means of one(key) per channel, with standard errors.
struct Means {
  double mean[3], error[3];
};
template <typename One>
Means means_of(uint32_t n, const One& one) {
  double sum[3] = {}, squares[3] = {};
  for (uint32_t i = 0; i < n; ++i) {
    const Color<float> c = one(make_sample_key<float>(i * 2654435761u, i, 17));
    const double x[3] = {c.x, c.y, c.z};
    for (int k = 0; k < 3; ++k) {
      sum[k] += x[k];
      squares[k] += x[k] * x[k];
    }
  }
  Means m{};
  for (int k = 0; k < 3; ++k) {
    m.mean[k] = sum[k] / n;
    m.error[k] = std::sqrt(std::max(0.0, squares[k] / n - m.mean[k] * m.mean[k]) / n);
  }
  return m;
}
/// With a tolerance of 4.2 standard errors, one comparison in 37,000 fails with other random
/// numbers; this file makes about 50 comparisons.
void expect_means(const Means& m, const std::array<double, 3>& expected, const std::string& what) {
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(m.mean[k], expected[k], 4.2 * m.error[k] + 1e-5) << what << ", channel " << k;
    EXPECT_LT(m.error[k], 0.03 * std::max(expected[k], 0.05)) << what << ": too noisy to tell";
  }
}

/// Volumes, and the optical depth of the first `t` of a ray along x from (-1, 0.3, 0.4) in each.
struct Case {
  std::string name;
  std::vector<Volume> volumes;
  std::function<std::array<double, 3>(double)> depth;
};

std::vector<Case> cases() {
  const auto overlap = [](double t, double lo, double hi) {
    return std::max(0.0, std::min(t - 1, hi) - lo);
  };
  std::vector<Case> out;
  out.push_back({"box", {make_box({0, -1, -1}, {1, 1, 1}, {0.5f, 1, 2})}, [=](double t) {
                   const double x = overlap(t, 0, 1);
                   return std::array{0.5 * x, x, 2 * x};
                 }});
  // Two volumes that overlap, one of them grey.
  out.push_back({"two boxes",
                 {make_box({0, -1, -1}, {1, 1, 1}, {0.3f, 1, 1.5f}),
                  make_box({0.5f, -1, -1}, {2, 1, 1}, {0.4f, 0.4f, 0.4f})},
                 [=](double t) {
                   const double a = overlap(t, 0, 1), b = 0.4 * overlap(t, 0.5, 2);
                   return std::array{0.3 * a + b, a + b, 1.5 * a + b};
                 }});
  // Density 3 x from 0 to 1 on 33 voxels, then falling to 0 within one voxel.
  Volume wedge;
  wedge.density = between(
      make_grid(33, [](int x, int, int) { return 3.f * static_cast<float>(x) / 32; }), 33, 0, 1);
  wedge.extinction = {1, 0.5f, 0.25f};
  out.push_back({"wedge", {wedge}, [=](double t) {
                   const double x = std::clamp(t - 1, 0.0, 1.0),
                                y = std::clamp(t - 2, 0.0, 1 / 32.);
                   const double d = 1.5 * x * x + 3 * (y - 16 * y * y);
                   return std::array{d, 0.5 * d, 0.25 * d};
                 }});
  return out;
}

TEST(VolumeTracking, TransmittanceIsTheExponential) {
  const Vec3<float> o{-1, 0.3f, 0.4f}, d{1, 0, 0};
  for (const Case& c : cases()) {
    const Records r(c.volumes);
    for (const float t : {1.7f, 2.2f, kInf}) {
      const auto depth = c.depth(std::min(double{t}, 10.0));
      expect_means(means_of(40000,
                            [&](const SampleKey<float>& key) {
                              const MediumQuery<float> p{
                                  SamplerKind::kIndependent, key, 2, o, d, t};
                              const SegmentRandom<float> distribution(p, VertexSet::kShadow);
                              return transmittance_through<float>(r.view, distribution, {o, d, t},
                                                                  true, counts);
                            }),
                   {std::exp(-depth[0]), std::exp(-depth[1]), std::exp(-depth[2])}, c.name);
    }
  }
}

/// One light is beside the rays of the cases, and one beyond their end.
std::shared_ptr<const Scene> two_lamps() {
  SceneBuilder b;
  for (const float x : {0.6f, 2.5f}) {
    Light lamp = make_light(LightKind::kSphere, {1, 1, 1}, translate(x, 0.3f, 0.6f));
    lamp.radius = x < 1 ? 0.1f : 0.f;
    b.add_light(lamp);
  }
  b.set_camera(make_camera({0, 0, 9}, {0, 0, 0}));
  return b.build();
}

TEST(Equiangular, DrawsByItsDensity) {
  const auto scene = two_lamps();
  const Vec3<float> o{-1, 0.3f, 0.4f}, d{1, 0, 0};
  for (const float u : {0.1f, 0.9f}) {
    const auto distribution = equiangular_distribution<float>(
        scene->view().lights, {o, d, 1, 3.4f, 0.5f}, {u, 0.3f, 0.8f, 0.f}, true);
    ASSERT_GT(distribution.share, 0.f);
    double sum = 0;
    for (int i = 0; i < 4000; ++i)
      sum += double{distribution.density(1 + 2.4f * (static_cast<float>(i) + 0.5f) / 4000)} * 2.4 /
             4000;
    EXPECT_NEAR(sum, 1, 1e-3);
    for (const float v : {0.f, 0.2f, 0.5f, 0.99f})
      EXPECT_NEAR(distribution.before(distribution.sample_distance(v)), v, 1e-4f);
    EXPECT_NEAR(distribution.sample_distance(0), 1, 1e-4f);
  }
  const auto none =
      equiangular_distribution<float>(scene->view().lights, {o, d, 2, 1, 0.5f}, {}, true);
  EXPECT_EQ(none.share, 0.f);
  // Where the medium absorbs most of the light, distances are sampled in proportion to the
  // extinction.
  const auto thick = equiangular_distribution<float>(scene->view().lights, {o, d, 1, 2.4f, 50.f},
                                                     {0.9f, 0.3f, 0.8f, 0.f}, true);
  EXPECT_EQ(thick.share, 0.f);
}

TEST(VolumeTracking, FlightsPassAndStopAsOftenAsTheySay) {
  const Vec3<float> o{-1, 0.3f, 0.4f}, d{1, 0, 0};
  const auto scene = two_lamps();
  const LightView distance_lights = scene->view().lights;
  for (const LightView* lights : {static_cast<const LightView*>(nullptr), &distance_lights})
    for (Case c : cases()) {
      if (lights) c.name += " by lamps";
      const Records r(c.volumes);
      const auto flight = [&](const SampleKey<float>& key, float t) {
        return sample_flights<float>(r.view,
                                     MediumQuery<float>{SamplerKind::kIndependent, key, 1, o, d, t},
                                     {0.5f, 0.2f, 0.3f}, true, lights, counts);
      };
      for (const float t : {1.7f, 2.2f, kInf}) {
        const auto depth = c.depth(std::min(double{t}, 10.0));
        const auto pass = [&](size_t k) { return std::exp(-depth[k]); };
        expect_means(means_of(40000,
                              [&](const SampleKey<float>& key) {
                                const Flight<float> f = flight(key, t);
                                return f.stopped ? Color<float>(0.f) : f.weight;
                              }),
                     {pass(0), pass(1), pass(2)}, c.name + ", passes");
        expect_means(means_of(40000,
                              [&](const SampleKey<float>& key) {
                                const Flight<float> f = flight(key, t);
                                EXPECT_FALSE(f.stopped && !(f.t <= t));
                                return f.stopped ? f.weight : Color<float>(0.f);
                              }),
                     {1 - pass(0), 1 - pass(1), 1 - pass(2)}, c.name + ", stops");
      }
      // The expected position is the mean of exp(-x), integrated on a fine grid.
      std::array<double, 3> expected{};
      constexpr int n = 20000;
      for (int i = 0; i < n; ++i) {
        const double a = 3.0 * i / n, b = 3.0 * (i + 1) / n;
        for (size_t k = 0; k < 3; ++k)
          expected[k] +=
              std::exp(-(a + b) / 2) * (std::exp(-c.depth(a)[k]) - std::exp(-c.depth(b)[k]));
      }
      expect_means(means_of(80000,
                            [&](const SampleKey<float>& key) {
                              const Flight<float> f = flight(key, kInf);
                              return f.stopped ? f.weight * std::exp(-f.t) : Color<float>(0.f);
                            }),
                   expected, c.name + ", where");
    }
}

TEST(VolumeTracking, EmissionIsTheIntegral) {
  const Vec3<float> o{-1, 0.3f, 0.4f}, d{1, 0, 0};
  for (Case& c : cases()) {
    c.volumes[0].emission = {1, 2, 0.5f};
    const Records r(c.volumes);
    // The expected emission is int_0^t eps(x) exp(-depth(x)) dx; the first volume emits in
    // proportion to its density.
    const auto density = [&](double t) {
      if (c.name != "wedge") return t > 1 && t < 2 ? 1.0 : 0.0;
      if (t < 1 || t > 2 + 1 / 32.) return 0.0;
      return t < 2 ? 3 * (t - 1) : 3 * (1 - 32 * (t - 2));
    };
    for (const float t : {1.7f, 3.f}) {
      std::array<double, 3> expected{};
      const double e[3] = {1, 2, 0.5};
      constexpr int n = 20000;
      for (int i = 0; i < n; ++i) {
        const double x = (i + 0.5) * double{t} / n;
        for (size_t k = 0; k < 3; ++k)
          expected[k] += e[k] * density(x) * std::exp(-c.depth(x)[k]) * double{t} / n;
      }
      expect_means(means_of(60000,
                            [&](const SampleKey<float>& key) {
                              return emission_of<float>(
                                  r.view, 0,
                                  SegmentRandom<float>({SamplerKind::kIndependent, key, 1, o, d, t},
                                                       VertexSet::kFlight),
                                  {o, d, t}, true, counts);
                            }),
                   expected, c.name);
    }
  }
}

TEST(HenyeyGreenstein, SamplesFollowTheDensity) {
  chi_square::Battery battery("phase functions");
  for (const float g : {-0.85f, -0.2f, 0.f, 5e-4f, 0.3f, 0.9f}) {
    const VolumeBsdf<float> phase(Color<float>(0.7f), g);
    // The phase function integrates to 1 over the sphere, its mean cosine is g.
    double sum = 0, mean = 0;
    constexpr int n = 200000;
    for (int i = 0; i < n; ++i) {
      const double c = -1 + (i + 0.5) * 2 / n;
      const double p =
          double{henyey_greenstein<float>(g, static_cast<float>(c))} * 2 * kPiD * 2 / n;
      sum += p;
      mean += p * c;
    }
    EXPECT_NEAR(sum, 1, 1e-4);
    EXPECT_NEAR(mean, double{g}, 1e-4);
    for (const Vec3<float>& wo :
         {Vec3<float>(0, 0, 1), normalize(Vec3<float>(0.3f, -0.5f, -0.7f))}) {
      chi_square::Case c;
      c.name = "g " + std::to_string(g).substr(0, 5) + ", z " + std::to_string(wo.z).substr(0, 4);
      c.charts = bsdf_testing::direction_charts();
      c.density = [=](const chi_square::Place& p) {
        return double{phase.eval(wo, bsdf_testing::direction_at(p)).pdf};
      };
      c.draw = [=](chi_square::Random& random, bool check) {
        const float u = random(), v = random();
        const BsdfSample<float> s = phase.sample(wo, 0.5f, u, v);
        const bool agrees = !check || std::abs(s.pdf - phase.eval(wo, s.wi).pdf) < 5e-3f * s.pdf;
        return chi_square::Draw::at(bsdf_testing::place_of(s.wi), agrees);
      };
      battery.run(c);
    }
  }
  battery.judge();
}

}  // namespace
}  // namespace wavecomb
