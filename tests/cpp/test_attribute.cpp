// SPDX-License-Identifier: Apache-2.0
/// Tests of mesh attributes: all interpolation modes, packets with lanes on different meshes, and
/// missing attributes.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "lane_testing.h"
#include "wavecomb/geometry/mesh/attributes.h"
#include "wavecomb/texture/attribute.h"

namespace wavecomb {
namespace {

constexpr uint32_t kTint = 0, kDepth = 1, kOther = 2;

/// A quad of two triangles with attributes of every interpolation, a curve, and a mesh without
/// attributes.
struct AttributeScene {
  std::vector<float> positions = std::vector<float>(12, 0.f);
  std::vector<uint32_t> indices{0, 1, 2, 0, 2, 3};
  std::vector<float> per_vertex{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  std::vector<float> per_corner{0, 1, 2, 30, 40, 50}, per_face{-1, -2}, one{7, 8}, ends{2, 4};
  SceneGeometry geometry;

  AttributeScene() {
    geometry.attribute_names = {"tint", "depth", "other"};
    const auto add = [&](std::vector<MeshAttribute> attributes, Primitive primitive) {
      Mesh mesh;
      mesh.primitive = primitive;
      mesh.positions = positions;
      mesh.indices = primitive == Primitive::kTriangle
                         ? std::span<const uint32_t>(indices)
                         : std::span<const uint32_t>(indices).first(1);
      mesh.attributes = std::move(attributes);
      check_attributes(mesh, "mesh", geometry.attribute_names);
      geometry.meshes.push_back(mesh);
    };
    add({{kTint, AttributeRate::kVertex, 3, per_vertex},
         {kDepth, AttributeRate::kCorner, 1, per_corner}},
        Primitive::kTriangle);
    add({}, Primitive::kTriangle);
    add({{kDepth, AttributeRate::kPrimitive, 1, per_face},
         {kOther, AttributeRate::kConstant, 2, one}},
        Primitive::kTriangle);
    add({{kDepth, AttributeRate::kEnd, 1, ends}}, Primitive::kLinearTube);
    make_attribute_records(geometry);
  }
  /// Returns one component of the attribute, or -99 if it does not exist.
  float at(uint32_t id, uint32_t mesh, uint32_t prim, float u, float v, uint32_t width = 1,
           uint32_t component = 0) const {
    float out[4] = {-99, -99, -99, -99};
    read_attribute<float>(geometry.attributes(), id, width, {mesh, prim, u, v}, true, out);
    return out[component];
  }
};

TEST(Attribute, IsLinearBetweenCorners) {
  const AttributeScene s;
  EXPECT_EQ(s.at(kTint, 0, 0, 0.f, 0.f, 3, 1), 1.f);
  EXPECT_EQ(s.at(kTint, 0, 0, 0.f, 1.f, 3, 2), 8.f);
  EXPECT_FLOAT_EQ(s.at(kTint, 0, 1, 0.25f, 0.5f, 3, 0), 0.25f * 0 + 0.25f * 6 + 0.5f * 9);
  EXPECT_FLOAT_EQ(s.at(kDepth, 0, 1, 0.25f, 0.5f), 0.25f * 30 + 0.25f * 40 + 0.5f * 50);
  EXPECT_EQ(s.at(kDepth, 2, 1, 0.3f, 0.3f), -2.f);
  EXPECT_EQ(s.at(kOther, 2, 1, 0.3f, 0.3f, 2, 1), 8.f);
  EXPECT_EQ(s.at(kDepth, 3, 0, 0.25f, 0.9f), 2.5f);
  EXPECT_EQ(s.at(kDepth, 3, 0, -0.1f, 0.9f), 2.f);
  EXPECT_EQ(s.at(kDepth, 3, 0, 1.1f, 0.9f), 4.f);
}

TEST(Attribute, LeavesWhatIsThereWhereAMeshHasNone) {
  const AttributeScene s;
  EXPECT_EQ(s.at(kTint, 1, 0, 0.f, 0.f), -99.f);
  EXPECT_EQ(s.at(kTint, 2, 0, 0.f, 0.f), -99.f);
  EXPECT_EQ(s.at(kTint, kNoMesh, 0, 0.f, 0.f), -99.f);
  EXPECT_EQ(s.at(kDepth, 0, 0, 0.f, 0.f, 2), -99.f) << "too few components";
  float out = -99;
  read_attribute<float>({}, kTint, 1, {0u, 0u, 0.f, 0.f}, true, &out);
  EXPECT_EQ(out, -99.f) << "a scene without attributes";
}

TEST(Attribute, LanesAreScalars) {
  const AttributeScene s;
  std::mt19937 rng(3);
  using F = FloatP<16>;
  for (int round = 0; round < 20; ++round) {
    alignas(64) uint32_t mesh[16], prim[16];
    alignas(64) float u[16], v[16];
    for (size_t i = 0; i < 16; ++i) {
      mesh[i] = static_cast<uint32_t>(rng() % 5);
      if (mesh[i] == 4) mesh[i] = kNoMesh;
      prim[i] = mesh[i] == 3 ? 0 : static_cast<uint32_t>(rng() % 2);
      u[i] = static_cast<float>(rng() % 1000) * 0.001f;
      v[i] = (1.f - u[i]) * 0.7f;
    }
    const MeshPosition<F> place{load<UInt<F>>(mesh), load<UInt<F>>(prim), load<F>(u), load<F>(v)};
    for (const uint32_t id : {kTint, kDepth, kOther}) {
      const uint32_t width = id == kTint ? 3 : 1;
      F out[4] = {F(-99.f), F(-99.f), F(-99.f), F(-99.f)};
      read_attribute<F>(s.geometry.attributes(), id, width, place, Mask<F>(true), out);
      for (uint32_t c = 0; c < width; ++c) {
        alignas(64) float lanes[16];
        store(lanes, out[c]);
        for (size_t i = 0; i < 16; ++i)
          EXPECT_EQ(lanes[i], s.at(id, mesh[i], prim[i], u[i], v[i], width, c));
      }
    }
  }
}

TEST(Attribute, WhatDoesNotFitIsRefused) {
  AttributeScene s;
  Mesh mesh = s.geometry.meshes[0];
  const auto refused = [&](const MeshAttribute& attribute) {
    mesh.attributes = {attribute};
    EXPECT_THROW(check_attributes(mesh, "mesh", s.geometry.attribute_names), std::exception);
  };
  refused({9, AttributeRate::kConstant, 1, s.one});
  refused({kTint, AttributeRate::kVertex, 3, s.per_corner});
  refused({kTint, AttributeRate::kVertex, 0, {}});
  refused({kTint, AttributeRate::kVertex, 5, s.per_vertex});
  refused({kTint, AttributeRate::kEnd, 1, s.ends});
  s.one[0] = std::nanf("");
  refused({kOther, AttributeRate::kConstant, 2, s.one});
}

}  // namespace
}  // namespace wavecomb
