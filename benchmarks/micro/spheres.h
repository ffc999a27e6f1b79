// SPDX-License-Identifier: Apache-2.0
/// Test scene of the traversal benchmarks.
#pragma once

#include "scene_testing.h"

namespace wavecomb::micro {

/// A box, open towards the camera, that contains eight spheres with the given number of segments.
inline scene_testing::ScenePtr spheres(uint32_t segments) {
  using namespace scene_testing;
  SceneBuilder b;
  const uint32_t white = b.add_material(make_material(ProgramId::kDiffuse, {0.7f, 0.7f, 0.7f}));
  MeshData room = box({-1, -1, -1}, {1, 1, 1});
  room.indices.resize(30);  // open towards +z
  b.add_to_group(0, b.add_mesh(make_mesh(room, white)));
  for (int i = 0; i < 8; ++i) {
    const float x = i & 1 ? 0.45f : -0.45f, y = i & 2 ? 0.45f : -0.45f, z = i & 4 ? 0.4f : -0.5f;
    MeshData ball = sphere(segments, true);
    ball.transform(translate(x, y, z) * scale(0.35f, 0.35f, 0.35f));
    b.add_to_group(0, b.add_mesh(make_mesh(ball, white)));
  }
  Light light = make_light(LightKind::kRect, {12, 11, 9}, translate(0, 0.99f, 0) * rotate(0, -90));
  light.width = light.height = 0.5f;
  b.add_light(light);
  b.set_camera(make_camera({0, 0, 3.6}, {0, 0, 0}, 0.9f));
  return b.build();
}

}  // namespace wavecomb::micro
