// SPDX-License-Identifier: Apache-2.0
// Tests of the search for objects and lights inside glass.
#include "scene_testing.h"
#include "wavecomb/geometry/mesh/triangle_columns.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

/// Returns whether glass of shape `shape`, placed by `to_world`, holds a small box around the
/// origin.
bool holds(const MeshData& shape, const Affine& to_world) {
  SceneBuilder b;
  Material m = make_material(ProgramId::kOpenPbr);
  m.openpbr.transmission_weight = 1;
  m.openpbr.transmission_color = {0.5f, 0.5f, 0.5f};
  m.openpbr.transmission_depth = 1;
  const uint32_t glass = b.add_material(m);
  const uint32_t grey = b.add_material(make_material(ProgramId::kDiffuse, Vec3<float>(0.5f)));
  const uint32_t group = b.add_group("glass");
  b.add_to_group(group, b.add_mesh(make_mesh(MeshData(shape), glass)));
  b.add_instance(0, group, to_world, glass);
  b.add_to_group(0, b.add_mesh(make_mesh(box({-0.1f, -0.1f, -0.1f}, {0.1f, 0.1f, 0.1f}), grey)));
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  return b.build()->material_part()->in_glass;
}

TEST(GlassContents, ClosedGlassHoldsWhatIsInIt) {
  for (const auto& turned : {rotate(0, 0), rotate(0, 40), rotate(1, 130), rotate(2, 250)}) {
    EXPECT_TRUE(holds(box({-1, -1, -1}, {1, 1, 1}), turned));
    EXPECT_TRUE(holds(sphere(8, true), turned));
    EXPECT_TRUE(holds(sphere(8, true), translate(0.5f, 0, 0) * turned));
    EXPECT_FALSE(holds(box({-1, -1, -1}, {1, 1, 1}), translate(3, 0, 0) * turned));
  }
}

TEST(GlassContents, OpenSurfacesHoldNothing) {
  // The box around the origin is in front of the panes or behind them, within their bounds.
  for (int axis = 0; axis < 3; ++axis)
    for (int degrees = 15; degrees < 360; degrees += 30)
      for (const float y : {-0.3f, 0.f, 0.3f})
        EXPECT_FALSE(holds(ground(1, y), rotate(axis, degrees) * rotate((axis + 1) % 3, 35)))
            << axis << " " << degrees << " " << y;
}

TEST(GlassContents, LinesLeaveClosedMeshesInBothDirections) {
  const Mesh closed = make_mesh(sphere(8, false)), open = make_mesh(ground(1));
  const TriangleColumns in_closed(closed), in_open(open);
  size_t tests = 0;
  FacesLeft left = in_closed.faces_left({0.1f, 0.2f, 0.3f}, tests);
  EXPECT_EQ(left.ahead, 1);
  EXPECT_EQ(left.behind, 1);
  for (const Vec3<float>& outside : {Vec3<float>(0, 0, 2), Vec3<float>(0, 0, -2)}) {
    left = in_closed.faces_left(outside, tests);
    EXPECT_EQ(left.ahead, 0);
    EXPECT_EQ(left.behind, 0);
  }
  left = in_open.faces_left({0, -0.05f, -0.1f}, tests);
  EXPECT_EQ(left.ahead, 1);
  EXPECT_EQ(left.behind, 0);
  EXPECT_GT(tests, 0u);
}

}  // namespace
}  // namespace wavecomb
