// SPDX-License-Identifier: Apache-2.0
// Motion blur: compared with closed forms, and one image for all schedules.
#include "wavecomb/geometry/hit/motion.h"

#include "curve_testing.h"
#include "wave_testing.h"
#include "wavecomb/geometry/hit/surface.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;

/// Makes a mesh that deforms through the given shapes.
Mesh deforming(const std::vector<MeshData>& shapes, uint32_t material = 0) {
  MeshData all = shapes.front();
  for (size_t s = 1; s < shapes.size(); ++s) {
    all.positions.insert(all.positions.end(), shapes[s].positions.begin(),
                         shapes[s].positions.end());
    all.normals.insert(all.normals.end(), shapes[s].normals.begin(), shapes[s].normals.end());
  }
  Mesh mesh = make_mesh(std::move(all), material);
  mesh.steps = static_cast<uint32_t>(shapes.size());
  return mesh;
}

/// Makes curves or points that sway: each motion step moves them further to the right, in
/// proportion to their height.
Mesh swaying(Primitive primitive, uint32_t steps, uint32_t seed, uint32_t material) {
  curve_testing::CurveData data = curve_testing::strands(primitive, 12, 2, 0.8f, 0.06f, seed);
  const std::vector<float> still = data.positions, normals = data.normals;
  for (uint32_t s = 1; s < steps; ++s)
    for (size_t i = 0; i < still.size(); i += 3) {
      const float by = 0.3f * static_cast<float>(s) * still[i + 1];
      data.positions.insert(data.positions.end(), {still[i] + by, still[i + 1], still[i + 2]});
      data.normals.insert(data.normals.end(), {normals[i] + by, normals[i + 1], normals[i + 2]});
    }
  Mesh mesh = curve_testing::make_curves(std::move(data), material);
  mesh.steps = steps;
  return mesh;
}

Material glowing() {
  Material m;
  m.program = ProgramId::kEmissive;
  m.emission = {1, 1, 1};
  return m;
}

/// Settings for one pixel that covers the square [-0.5, 0.5]^2 of the plane z = 0.
Settings one_pixel(uint32_t spp) {
  Settings s;
  s.width = s.height = 1;
  s.spp = spp;
  s.filter = FilterKind::kBox;
  s.filter_width = 1;
  return s;
}

/// Mean radiance of one pixel with the reference integrator.
double mean(const ScenePtr& scene, uint32_t spp) {
  WaveRun run(scene, {one_pixel(spp), kReferenceLanes, 1});
  run.all(64);
  return run.image().beauty[0];
}

Camera camera_before_the_plane() {
  return make_camera({0, 0, 1}, {0, 0, 0}, 1);
}

/// An emissive half plane that covers the pixel from its left edge to x = `edge`.
MeshData half_plane(float edge) {
  return quad({-3, -1, 0}, {3 + edge, 0, 0}, {0, 2, 0});
}

TEST(Motion, MovingEdgeCoversAPixelForItsShareOfTheTime) {
  // The edge moves from -0.5 to 0.3: at time t it covers 0.8 t of the pixel, 0.4 on average.
  SceneBuilder builder;
  builder.add_material(glowing());
  builder.add_to_group(0, builder.add_mesh(deforming({half_plane(-0.5f), half_plane(0.3f)})));
  builder.set_camera(camera_before_the_plane());
  EXPECT_NEAR(mean(builder.build(), 1u << 18), 0.4, 2e-3);
}

TEST(Motion, MovingPointsAndCurvesCoverTheirShare) {
  // A disk of radius 0.3 in a pixel of side 1, seen from far away: inside the pixel from step 0 to
  // 1, moving out from step 1 to 2, outside from step 2 to 3.
  for (const bool tube : {false, true}) {
    curve_testing::CurveData data;
    data.primitive = tube ? Primitive::kLinearTube : Primitive::kSphere;
    for (const float x : {0.f, 0.f, 9.f, 9.f}) {
      data.point({x, 0, 0}, 0.3f);
      if (tube) data.point({x, 0, -1}, 0.3f);
    }
    data.radii.resize(tube ? 2 : 1);
    if (tube) data.segments = {0};
    Mesh mesh = curve_testing::make_curves(std::move(data), 0);
    mesh.steps = 4;
    SceneBuilder builder;
    builder.add_material(glowing());
    builder.add_to_group(0, builder.add_mesh(std::move(mesh)));
    Camera camera = make_camera({0, 0, 1000}, {0, 0, 0}, 0.001f);
    builder.set_camera(camera);
    // Of the disk's path of length 9, it is fully visible for 0.2, then half visible on average for
    // 0.6.
    const double seen = kPiD * 0.09, crossing = (0.2 + 0.5 * 0.6) / 9;
    EXPECT_NEAR(mean(builder.build(), 1u << 18), seen * (1 + crossing) / 3, 2e-3) << tube;
  }
}

TEST(Motion, EveryStepCounts) {
  // The edge moves from 0 to 0.8 and back to 0.
  SceneBuilder builder;
  builder.add_material(glowing());
  const MeshData out = half_plane(-0.5f), in = half_plane(0.3f);
  builder.add_to_group(0, builder.add_mesh(deforming({out, in, out, out, out})));
  builder.set_camera(camera_before_the_plane());
  EXPECT_NEAR(mean(builder.build(), 1u << 18), 0.2, 2e-3);
}

TEST(Motion, MovingInstanceAndNestedOnesCoverTheirShare) {
  SceneBuilder builder;
  builder.add_material(glowing());
  const uint32_t inner = builder.add_group("inner"), outer = builder.add_group("outer");
  builder.add_to_group(inner, builder.add_mesh(make_mesh(half_plane(-0.5f), 0)));
  // Nested motion moves the inner group by 0.2 and the outer one by 0.6 in three steps.
  const Affine by[2] = {translate(0, 0, 0), translate(0.2f, 0, 0)};
  const Affine on[4] = {translate(0, 0, 0), translate(0.2f, 0, 0), translate(0.4f, 0, 0),
                        translate(0.6f, 0, 0)};
  builder.add_instance(outer, inner, by[0], kInheritMaterial, kNoName, kNoName, by);
  builder.add_instance(0, outer, on[0], kInheritMaterial, kNoName, kNoName, on);
  builder.set_camera(camera_before_the_plane());
  const ScenePtr scene = builder.build();
  ASSERT_EQ(scene->instances().size(), 1u);
  EXPECT_EQ(scene->instances()[0].motion.segments, 3u);
  EXPECT_NEAR(scene->bounds().hi.x, 0.3f, 1e-6f);
  EXPECT_NEAR(mean(scene, 1u << 18), 0.4, 2e-3);
}

TEST(Motion, MovingCameraSeesStillThingsMove) {
  SceneBuilder builder;
  builder.add_material(glowing());
  builder.add_to_group(0, builder.add_mesh(make_mesh(half_plane(-0.5f), 0)));
  Camera camera = camera_before_the_plane();
  camera.steps = {camera.to_world, translate(-0.8f, 0, 0) * camera.to_world};
  builder.set_camera(camera);
  EXPECT_NEAR(mean(builder.build(), 1u << 18), 0.4, 2e-3);
}

TEST(Motion, TimesAreSpreadEvenlyAndDisturbNothing) {
  const SampleKey<float> key = make_sample_key<float>(1234, 0, 7);
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kIndependent}) {
    double sum = 0;
    std::array<int, 16> bins{};
    for (uint32_t i = 0; i < 4096; ++i) {
      const float t = path_time<float>(kind, {key.pixel_hash, i});
      ASSERT_TRUE(t >= 0 && t < 1);
      sum += t;
      ++bins[static_cast<size_t>(t * 16)];
    }
    EXPECT_NEAR(sum / 4096, 0.5, 0.02);
    // Time samples are stratified: each sixteenth of the shutter interval gets a sixteenth of the
    // samples.
    if (kind == SamplerKind::kSobol) {
      for (const int n : bins) EXPECT_EQ(n, 256);
    }
  }
}

/// A scene with many kinds of motion: deformation, smooth normals, and instances that rotate and
/// mirror.
ScenePtr moving_scene(bool moving_camera) {
  SceneBuilder builder;
  Material grey;
  grey.base_color = {0.6f, 0.5f, 0.4f};
  Material metal;
  metal.program = ProgramId::kMetal;
  metal.roughness = 0.3f;
  Material thin = grey;
  thin.opacity = 0.5f;
  thin.presence = true;
  builder.add_material(grey);
  builder.add_material(metal);
  builder.add_material(thin);
  builder.add_material(glowing());
  builder.add_to_group(0, builder.add_mesh(make_mesh(ground(6, -1), 0)));
  MeshData ball = sphere(12, true), egg = sphere(12, true);
  egg.transform(translate(0.4f, 0.2f, 0) * scale(1, 1.5f, 1));
  builder.add_to_group(0, builder.add_mesh(deforming({ball, egg, ball}, 1)));
  MeshData rag = soup(60, 3), blown = soup(60, 3);
  builder.add_to_group(
      0, builder.add_mesh(deforming(
             {rag.transform(translate(-2, 0.5f, 0)), blown.transform(translate(-2.2f, 0.9f, 0.3f))},
             2)));
  const uint32_t group = builder.add_group("things");
  builder.add_to_group(group,
                       builder.add_mesh(make_mesh(box({-.5f, -.5f, -.5f}, {.5f, .5f, .5f}))));
  builder.add_to_group(
      group, builder.add_mesh(make_mesh(
                 sphere(6, false).transform(translate(0, 1, 0) * scale(.4f, .4f, .4f)), 1)));
  for (int i = 0; i < 3; ++i) {
    const Affine at = translate(2, 0.6f * static_cast<float>(i), -1);
    const Affine turn[3] = {at, at * rotate(1, 40), at * rotate(1, 80) * translate(0, 0.3f, 0)};
    const Affine mirrored[2] = {translate(-1, 0, 1.5f) * scale(-1, 1, 1),
                                translate(-0.4f, 0.5f, 1.5f) * scale(-1, 1, 1)};
    if (i == 0)
      builder.add_instance(0, group, mirrored[0], 0, kNoName, kNoName, mirrored);
    else if (i == 1)
      builder.add_instance(0, group, at, 0, kNoName, kNoName, turn);
    else
      builder.add_instance(0, group, at * scale(0.5f, 0.5f, 0.5f), 2);
  }
  uint32_t seed = 7;
  for (const Primitive primitive : curve_testing::curved_primitives()) {
    builder.add_to_group(0, builder.add_mesh(swaying(primitive, 2 + seed % 2, seed, seed % 3)));
    builder.add_to_group(group, builder.add_mesh(swaying(primitive, 1, seed + 50, 1)));
    ++seed;
  }
  // The moving light is visible, but not sampled.
  const Affine fly[2] = {translate(0, 3, 0), translate(2, 3, 0)};
  const uint32_t lamp = builder.add_group("lamp");
  builder.add_to_group(lamp, builder.add_mesh(make_mesh(sphere(4, false), 3)));
  builder.add_instance(0, lamp, fly[0], kInheritMaterial, kNoName, kNoName, fly);
  Light sky;
  sky.kind = LightKind::kDome;
  sky.color = {0.7f, 0.8f, 1};
  builder.add_light(sky);
  Light sun;
  sun.kind = LightKind::kSphere;
  sun.radius = 0.4f;
  sun.color = {20, 20, 18};
  sun.to_world = translate(3, 4, 3);
  builder.add_light(sun);
  Camera camera = make_camera({0.5, 1.5, 7}, {0, 0.3, 0}, 0.9f);
  if (moving_camera)
    camera.steps = {camera.to_world, look_at({0.8, 1.6, 7}, {0, 0.3, 0}),
                    look_at({1.1, 1.5, 7.2}, {0.1, 0.3, 0})};
  builder.set_camera(camera);
  return builder.build();
}

TEST(Motion, OnePictureForEverySchedule) {
  for (const bool moving_camera : {false, true}) {
    const ScenePtr scene = moving_scene(moving_camera);
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
    Settings s;
    s.width = size_for_build(37, 3);
    s.height = size_for_build(29, 3);
    s.spp = 5;
    s.max_depth = 5;
    WaveRun reference(scene, {s, kReferenceLanes, 1}, accel);
    reference.all(64);
    const RenderedImage expected = reference.image();
    for (const uint32_t lanes : lane_widths())
      for (const uint32_t traversal : {1u, std::min(16u, accel->native_width())})
        for (const uint32_t wave_size : {64u, 1500u}) {
          WaveRun run(scene, {s, lanes, traversal}, accel);
          run.all(wave_size, wave_size == 64 ? 3 : 16);
          expect_same_image(expected, run.image(),
                            std::to_string(lanes) + " lanes, packets of " +
                                std::to_string(traversal) + ", waves of " +
                                std::to_string(wave_size));
          if (HasFailure()) return;
        }
    for (const std::string& policy : policy_names())
      for (const RayOrder order : {RayOrder::kSlot, RayOrder::kMortonOctant}) {
        s.policy = policy;
        s.ray_order = s.shadow_order = order;
        WaveRun run(scene, {s, lane_widths().back(), accel->native_width()}, accel);
        run.all(700);
        expect_same_image(expected, run.image(), "policy " + policy);
      }
  }
}

TEST(Motion, ScenesAtRestDoNotChange) {
  // Identical motion steps: the image equals that of a static scene, up to rounding.
  const auto build = [](bool steps) {
    SceneBuilder builder;
    builder.add_material(glowing());
    const uint32_t group = builder.add_group("g");
    builder.add_to_group(group, builder.add_mesh(make_mesh(half_plane(0.2f), 0)));
    const Affine same[2] = {translate(0, 0, 0), translate(0, 0, 0)};
    builder.add_instance(0, group, same[0], kInheritMaterial, kNoName, kNoName,
                         steps ? std::span<const Affine>(same) : std::span<const Affine>());
    builder.set_camera(camera_before_the_plane());
    return builder.build();
  };
  EXPECT_FALSE(build(false)->view().has_motion);
  EXPECT_TRUE(build(true)->view().has_motion);
  EXPECT_EQ(mean(build(false), 256), mean(build(true), 256));
}

TEST(Motion, SurfacesAreWhereRaysMeetThem) {
  const ScenePtr scene = moving_scene(false);
  const EmbreeAccelerator accel(scene, 1u);
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const uint32_t path = 0;
  size_t met = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vec3<float> o{8 * uniform(rng), 4 + 3 * uniform(rng), 8 * uniform(rng)};
    const Vec3<float> at{2.5f * uniform(rng), uniform(rng), 2 * uniform(rng)};
    const Vec3<float> d = normalize(at - o);
    const float time = 0.5f + 0.5f * uniform(rng), tfar = kInf;
    float t, u, v;
    uint32_t prim, geom, inst;
    accel.intersect({&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &tfar, nullptr, 1, &time},
                    {&t, &u, &v, &prim, &geom, &inst}, 1, false, {&path, &path, 1, 0});
    if (inst == kNoHit || inst == kLightShape) continue;
    ++met;
    const SceneView view = scene->view();
    const uint32_t mesh = view.geometry_mesh[view.instances[inst].geometry + geom];
    const Surface<float> s =
        setup_surface<float>(view, {inst, mesh, prim, u, v, time}, d, false, true, true);
    const Vec3<float> p = fma(d, t, o);
    ASSERT_LT(length(s.p - p), 2e-5f) << inst << ' ' << mesh;
    ASSERT_NEAR(length(s.ng), 1.f, 1e-5f);
    ASSERT_LT(s.offset, 1e-4f);
  }
  EXPECT_GT(met, 2000u);
}

/// Rays to vertices, edges and faces of a mesh at their positions at the time of the ray, many of
/// them parallel to an axis.
struct AimedRays {
  std::vector<float> column[8];

  AimedRays(const Mesh& mesh, size_t n, uint32_t seed) {
    std::mt19937 rng(seed);
    std::uniform_real_distribution<float> uniform(0, 1);
    for (auto& c : column) c.resize(n + 16, 0.f);
    for (size_t i = 0; i < n; ++i) {
      const float time = uniform(rng), place = time * static_cast<float>(mesh.steps - 1);
      const auto step = std::min(static_cast<uint32_t>(place), mesh.steps - 2);
      const size_t face = rng() % mesh.triangle_count();
      float b[3] = {1, 0, 0};
      if (i % 3 == 1) b[0] = 1 - (b[1] = uniform(rng));
      if (i % 3 == 2) b[0] = 1 - (b[1] = 0.5f * uniform(rng)) - (b[2] = 0.5f * uniform(rng));
      Vec3<float> at{0, 0, 0};
      for (size_t k = 0; k < 3; ++k) {
        const size_t vertex = mesh.indices[3 * face + k];
        const auto p = [&](uint32_t s) {
          const float* q = &mesh.positions[3 * (s * mesh.vertex_count() + vertex)];
          return Vec3<float>(q[0], q[1], q[2]);
        };
        const float part = place - static_cast<float>(step);
        at = at + (p(step) * (1 - part) + p(step + 1) * part) * b[k];
      }
      Vec3<float> d{0, 0, 0};
      if (i % 2 == 0)
        (i % 4 == 0 ? d.x : d.y) = i % 8 < 4 ? 1.f : -1.f;
      else
        d = normalize(Vec3<float>(uniform(rng) - 0.5f, uniform(rng) - 0.5f, uniform(rng) - 0.5f));
      const Vec3<float> o = at - d * (1 + 4 * uniform(rng));
      const float values[8] = {o.x, o.y, o.z, d.x, d.y, d.z, kInf, time};
      for (size_t c = 0; c < 8; ++c) column[c][i] = values[c];
    }
  }
  RaySpan span(size_t first, size_t n) const {
    const auto at = [&](size_t c) { return column[c].data() + first; };
    return {at(0), at(1), at(2), at(3), at(4), at(5), at(6), nullptr, n, at(7)};
  }
};

TEST(Motion, PacketsMeetWhatRaysAloneDo) {
  // Shared edges, intersecting surfaces, and all kinds of motion, in two scenes.
  const size_t n = size_for_build(200000, 20);
  for (const bool instances : {false, true}) {
    SceneBuilder builder;
    builder.add_material(Material{});
    MeshData egg = sphere(8, false), bent = sphere(8, false);
    egg.transform(translate(0.3f, 0.2f, 0.1f) * scale(1, 1.5f, 0.8f));
    bent.transform(rotate(0, 30) * translate(0, 0.1f, 0));
    const Mesh mesh = deforming({sphere(8, false), egg, bent});
    builder.add_to_group(0, builder.add_mesh(mesh));
    builder.add_to_group(0, builder.add_mesh(deforming({soup(40, 7), soup(40, 8)})));
    if (instances) {
      const uint32_t group = builder.add_group("g");
      builder.add_to_group(group, builder.add_mesh(make_mesh(sphere(8, false), 0)));
      const Affine turn[3] = {translate(0.2f, 0, 0), translate(0.5f, 0, 0) * rotate(1, 20),
                              translate(1, 0, 0) * rotate(1, 40)};
      builder.add_instance(0, group, turn[0], 0, kNoName, kNoName, turn);
    }
    const ScenePtr scene = builder.build();
    const EmbreeAccelerator accel(scene, 1u);
    const AimedRays rays(mesh, n, 11);
    const uint32_t path = 0;
    const PresenceKeys keys{&path, &path, 0, 0};
    std::vector<HitBuffer> hits;
    std::vector<std::vector<uint32_t>> blocked;
    for (const uint32_t width : {1u, 4u, 8u, 16u}) {
      if (width > accel.native_width()) continue;
      HitBuffer& h = hits.emplace_back(n);
      auto& occluded = blocked.emplace_back(n + 16);
      // Traces in chunks, which changes the composition of packets.
      for (size_t first = 0; first < n; first += 16 * width + 5) {
        const size_t m = std::min<size_t>(16 * width + 5, n - first);
        accel.intersect(
            rays.span(first, m),
            {h.t + first, h.u + first, h.v + first, h.prim + first, h.geom + first, h.inst + first},
            width, width == 16, keys);
        accel.occluded(rays.span(first, m), occluded.data() + first, width, false, keys);
      }
    }
    size_t met = 0;
    for (size_t w = 1; w < hits.size(); ++w)
      for (size_t i = 0; i < n; ++i) {
        const HitBuffer &a = hits[0], &b = hits[w];
        ASSERT_EQ(a.inst[i], b.inst[i]) << i;
        ASSERT_EQ(blocked[0][i], blocked[w][i]) << i;
        if (a.inst[i] == kNoHit) continue;
        ++met;
        ASSERT_TRUE(a.t[i] == b.t[i] && a.u[i] == b.u[i] && a.v[i] == b.v[i] &&
                    a.prim[i] == b.prim[i] && a.geom[i] == b.geom[i])
            << i;
      }
    EXPECT_GT(met, n / 2);
  }
}

TEST(Motion, BadMotionIsRefused) {
  const auto expect_refused = [](const auto& build) { EXPECT_THROW(build(), Error); };
  expect_refused([] {
    SceneBuilder b;
    Mesh mesh = make_mesh(half_plane(0));
    mesh.steps = 3;
    b.add_mesh(mesh);
  });
  expect_refused([] {
    SceneBuilder b;
    b.add_mesh(deforming({sphere(4, true), half_plane(0)}));
  });
  expect_refused([] {
    SceneBuilder b;
    const Affine steps[2] = {translate(0, 0, 0), translate(kNan, 0, 0)};
    b.add_instance(0, b.add_group("g"), Affine{}, kInheritMaterial, kNoName, kNoName, steps);
  });
  expect_refused([] {
    SceneBuilder b;
    Camera camera = camera_before_the_plane();
    camera.steps = {camera.to_world, scale(0, 1, 1)};
    b.set_camera(camera);
  });
}

}  // namespace
}  // namespace wavecomb
