// SPDX-License-Identifier: Apache-2.0
/// Builds and traces a mesh with Embree for benchmarks/subdivision.py, as a subdivision surface or
/// as triangles.
///
///      subdivision_embree FILE RATE     RATE: subdivision level, or 0 for a triangle mesh
///
/// FILE contains the numbers of points, faces and corners (int32), the points (3 float each), the
/// number of corners of each face (int32), and the point index of each corner (int32).
#include <embree4/rtcore.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

namespace {

long long used_bytes = 0, most_bytes = 0;

bool monitor(void*, ssize_t bytes, bool) {
  const long long now = __atomic_add_fetch(&used_bytes, bytes, __ATOMIC_RELAXED);
  if (now > most_bytes) most_bytes = now;
  return true;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Makes 16 rays that start on a sphere around the scene and point to its centre region.
RTCRayHit16 make_rays(const RTCBounds& b, std::mt19937& random) {
  std::normal_distribution<float> normal;
  const float c[] = {0.5f * (b.lower_x + b.upper_x), 0.5f * (b.lower_y + b.upper_y),
                     0.5f * (b.lower_z + b.upper_z)};
  const float r =
      0.6f * std::hypot(b.upper_x - b.lower_x, b.upper_y - b.lower_y, b.upper_z - b.lower_z);
  RTCRayHit16 h{};
  for (int k = 0; k < 16; ++k) {
    float from[3], to[3];
    for (float& x : from) x = normal(random);
    const float scale = r / std::hypot(from[0], from[1], from[2]);
    for (int i = 0; i < 3; ++i) {
      from[i] = c[i] + from[i] * scale;
      to[i] = c[i] + 0.3f * r * normal(random);
    }
    h.ray.org_x[k] = from[0], h.ray.org_y[k] = from[1], h.ray.org_z[k] = from[2];
    h.ray.dir_x[k] = to[0] - from[0], h.ray.dir_y[k] = to[1] - from[1];
    h.ray.dir_z[k] = to[2] - from[2];
    h.ray.tfar[k] = 1e30f;
    h.ray.mask[k] = ~0u;
    h.hit.geomID[k] = h.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
  }
  return h;
}

RTCRayHit one_of(const RTCRayHit16& h, int k) {
  RTCRayHit one{};
  one.ray.org_x = h.ray.org_x[k], one.ray.org_y = h.ray.org_y[k], one.ray.org_z = h.ray.org_z[k];
  one.ray.dir_x = h.ray.dir_x[k], one.ray.dir_y = h.ray.dir_y[k], one.ray.dir_z = h.ray.dir_z[k];
  one.ray.tfar = h.ray.tfar[k];
  one.ray.mask = ~0u;
  one.hit.geomID = one.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return one;
}

}  // namespace

int main(int argc, char** argv) {
  std::FILE* file = argc == 3 ? std::fopen(argv[1], "rb") : nullptr;
  int sizes[3];
  if (file == nullptr || std::fread(sizes, 4, 3, file) != 3) return 2;
  const auto n = static_cast<size_t>(sizes[0]), faces = static_cast<size_t>(sizes[1]),
             corners = static_cast<size_t>(sizes[2]);
  std::vector<float> points(3 * n + 4);  // Embree reads 16 bytes at the last point
  std::vector<unsigned> counts(faces), indices(corners);
  if (std::fread(points.data(), 12, n, file) != n ||
      std::fread(counts.data(), 4, faces, file) != faces ||
      std::fread(indices.data(), 4, corners, file) != corners)
    return 2;
  const auto rate = static_cast<float>(std::atof(argv[2]));
  RTCDevice device = rtcNewDevice("threads=1");
  rtcSetDeviceMemoryMonitorFunction(device, monitor, nullptr);
  auto start = std::chrono::steady_clock::now();
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry =
      rtcNewGeometry(device, rate > 0 ? RTC_GEOMETRY_TYPE_SUBDIVISION : RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, points.data(),
                             0, 12, n);
  if (rate > 0) {
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_FACE, 0, RTC_FORMAT_UINT, counts.data(), 0,
                               4, faces);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, indices.data(),
                               0, 4, corners);
    rtcSetGeometryTessellationRate(geometry, rate);
    rtcSetGeometrySubdivisionMode(geometry, 0, RTC_SUBDIVISION_MODE_PIN_CORNERS);
  } else {
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices.data(),
                               0, 12, faces);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  const double commit = seconds_since(start);
  RTCBounds bounds;
  rtcGetSceneBounds(scene, &bounds);

  alignas(64) int valid[16];
  for (int& lane : valid) lane = -1;
  std::mt19937 random(1);
  double traced = 0;
  const int rays = 1 << 20, compared = 1 << 16;
  int differ = 0;
  for (int i = 0; i < rays; i += 16) {
    RTCRayHit16 packet = make_rays(bounds, random);
    const RTCRayHit16 before = packet;
    start = std::chrono::steady_clock::now();
    rtcIntersect16(valid, scene, &packet, nullptr);
    traced += seconds_since(start);
    for (int k = 0; i < compared && k < 16; ++k) {
      RTCRayHit one = one_of(before, k);
      rtcIntersect1(scene, &one, nullptr);
      const bool hit = one.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      differ += one.ray.tfar != packet.ray.tfar[k] ||
                (hit && (one.hit.primID != packet.hit.primID[k] || one.hit.u != packet.hit.u[k] ||
                         one.hit.v != packet.hit.v[k]));
    }
  }
  std::printf(
      "commit %.3f s, %.1f MB (peak %.1f), %.2f M rays/s, %d of %d rays hit otherwise alone\n",
      commit, static_cast<double>(used_bytes) / 1e6, static_cast<double>(most_bytes) / 1e6,
      rays / traced / 1e6, differ, compared);
  rtcReleaseScene(scene);
  rtcReleaseDevice(device);
}
