// SPDX-License-Identifier: Apache-2.0
// Tests of surface values: rays, lights and shading read the same values at a hit.
#include "curve_testing.h"
#include "lane_testing.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/material/inputs/graph_inputs.h"
#include "wavecomb/material/inputs/presence.h"

namespace wavecomb {
namespace {

using namespace curve_testing;
using lane_testing::same_bits;

/// Meshes with texture coordinates per vertex, per corner and without, and curves of all kinds with
/// and without them; untransformed, rotated and mirrored instances; materials of faces, meshes and
/// instances.
std::shared_ptr<const Scene> all_kinds() {
  SceneBuilder b;
  std::mt19937 rng(2);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (int i = 0; i < 5; ++i)
    b.add_material(make_material(ProgramId::kDiffuse, Vec3<float>(0.1f * static_cast<float>(i))));
  const uint32_t group = b.add_group("all");
  const auto add = [&](Mesh mesh) { b.add_to_group(group, b.add_mesh(std::move(mesh))); };
  for (const Attribute at : {Attribute::kNone, Attribute::kVertex, Attribute::kCorner})
    for (const bool by_face : {false, true}) {
      MeshData data = quad({-1, -1, 0}, {2, 0.5f, 0}, {0.3f, 2, 1});
      data.uvs_at = at;
      data.uvs.resize(at == Attribute::kNone ? 0 : (at == Attribute::kVertex ? 8 : 12));
      for (float& x : data.uvs) x = 3 * uniform(rng);
      if (by_face) data.face_materials = {3, kInheritMaterial};
      add(make_mesh(std::move(data), at == Attribute::kVertex ? 2 : kInheritMaterial));
    }
  for (const Primitive primitive : curved_primitives())
    for (const bool authored : {false, true}) {
      CurveData data = strands(primitive, 4, 3, 1.f, 0.1f, 7);
      const size_t count =
          primitive == Primitive::kSphere ? data.radii.size() : 2 * data.segments.size();
      if (authored) data.uvs.resize(2 * count);
      for (float& x : data.uvs) x = 3 * uniform(rng);
      add(make_curves(std::move(data)));
    }
  b.add_instance(0, group, translate(1, 2, 3), 1);
  b.add_instance(0, group, rotate(0, 40) * scale(-1, 2, 0.5f), 4);
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  return b.build();
}

/// Hits distributed over a scene.
struct Hits {
  static constexpr size_t kCount = 1024;
  uint32_t inst[kCount], mesh[kCount], prim[kCount];
  float u[kCount], v[kCount];

  explicit Hits(const Scene& scene) {
    std::mt19937 rng(5);
    std::uniform_real_distribution<float> uniform(0, 0.5f);
    const Group& group = scene.groups()[1];
    for (size_t i = 0; i < kCount; ++i) {
      inst[i] = 1 + static_cast<uint32_t>(rng() % 2);
      mesh[i] = group.meshes[rng() % group.meshes.size()];
      prim[i] = static_cast<uint32_t>(rng() % scene.meshes()[mesh[i]].primitive_count());
      u[i] = uniform(rng);
      v[i] = uniform(rng);
    }
  }
  template <typename F>
  MeshHit<F> at(size_t i) const {
    return {load<UInt<F>>(inst + i), load<UInt<F>>(mesh + i), load<UInt<F>>(prim + i),
            load<F>(u + i), load<F>(v + i)};
  }
};

template <typename F>
Vec2<F> uv_of(const SceneView& scene, const MeshHit<F>& hit) {
  return hit_uv<F>(scene.meshes, hit.mesh, hit.prim, hit.u, hit.v, Mask<F>(true));
}

TEST(SurfaceValues, TextureCoordinatesAreTheSameForRaysAndForShading) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  const SceneView view = scene->view();
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const MeshHit<float> hit = hits.at<float>(i);
    const Surface<float> s = setup_surface<float>(view, hit, {0, 0, -1}, true, false, true);
    const Vec2<float> uv = uv_of<float>(view, hit);
    ASSERT_TRUE(same_bits(uv.x, s.uv.x) && same_bits(uv.y, s.uv.y)) << "mesh " << hit.mesh;
  }
  lane_testing::for_each_packet([&]<typename F>() {
    for (size_t i = 0; i < Hits::kCount; i += kWidth<F>) {
      const Vec2<F> wide = uv_of<F>(view, hits.at<F>(i));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const Vec2<float> one = uv_of<float>(view, hits.at<float>(i + k));
        ASSERT_TRUE(same_bits(one.x, lane(wide.x, k)) && same_bits(one.y, lane(wide.y, k)));
      }
    }
  });
}

TEST(SurfaceValues, MaterialsAreOfTheFaceTheMeshOrTheInstance) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  const SceneView view = scene->view();
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const Mesh& mesh = scene->meshes()[hits.mesh[i]];
    uint32_t expected =
        mesh.face_materials.empty() ? mesh.material : mesh.face_materials[hits.prim[i]];
    const uint32_t inherited = hits.inst[i] == 1 ? 1 : 4;
    if (expected == kInheritMaterial) expected = inherited;
    ASSERT_EQ(hit_material<float>(view, inherited, hits.mesh[i], hits.prim[i], true), expected);
  }
  lane_testing::for_each_packet([&]<typename F>() {
    using U = UInt<F>;
    for (size_t i = 0; i < Hits::kCount; i += kWidth<F>) {
      const MeshHit<F> hit = hits.at<F>(i);
      const U wide = hit_material<F>(view, U(4u), hit.mesh, hit.prim, Mask<F>(true));
      for (size_t k = 0; k < kWidth<F>; ++k)
        ASSERT_EQ(hit_material<float>(view, 4, hits.mesh[i + k], hits.prim[i + k], true),
                  (lane(wide, k)));
    }
  });
}

/// All inputs that a graph can read at a point.
template <typename F>
std::array<F, 15> values_of(const GraphPoint<F>& at) {
  return {at.uv.x,
          at.uv.y,
          at.footprint.width,
          at.position.x,
          at.position.y,
          at.position.z,
          at.normal.x,
          at.normal.y,
          at.normal.z,
          at.local_position.x,
          at.local_position.y,
          at.local_position.z,
          at.local_normal.x,
          at.local_normal.y,
          at.local_normal.z};
}
template <typename F>
GraphPoint<F> rest_of(const SceneView& scene, const MeshHit<F>& hit) {
  return point_at_rest<F>(scene.meshes, scene.instances, hit.inst,
                          {hit.mesh, hit.prim, hit.u, hit.v}, uv_of<F>(scene, hit), Mask<F>(true));
}

TEST(SurfaceValues, PointsAtRestAreThoseOfShading) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  SceneView view = scene->view();
  view.materials.graphs.inputs = ~0u;  // request all inputs
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const MeshHit<float> hit = hits.at<float>(i);
    const auto rest = values_of<float>(rest_of<float>(view, hit));
    const Vec3<float> dir(0, 0, -1);
    Surface<float> s = setup_surface<float>(view, hit, dir, true, false, true);
    if (scene->meshes()[hit.mesh].is_curved()) {
      ASSERT_TRUE(same_bits(rest[0], s.uv.x) && same_bits(rest[1], s.uv.y));
      continue;
    }
    s.ns = s.ng;
    const auto shaded = values_of<float>(graph_point<float>(view, hit, s, dir, 0.f, true));
    for (size_t k = 0; k < rest.size(); ++k) ASSERT_NEAR(rest[k], shaded[k], 1e-5f) << k;
  }
  lane_testing::for_each_packet([&]<typename F>() {
    for (size_t i = 0; i < Hits::kCount; i += kWidth<F>) {
      const auto wide = values_of<F>(rest_of<F>(view, hits.at<F>(i)));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const auto one = values_of<float>(rest_of<float>(view, hits.at<float>(i + k)));
        for (size_t c = 0; c < one.size(); ++c)
          ASSERT_TRUE(same_bits(one[c], lane(wide[c], k))) << "value " << c;
      }
    }
  });
}

}  // namespace
}  // namespace wavecomb
