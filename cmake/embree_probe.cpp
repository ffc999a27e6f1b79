// SPDX-License-Identifier: Apache-2.0
// Checks that Embree's headers and library match. tools/setup_embree compiles and runs this program
// if headers and library come from different releases. Checks the version, the compile-time options
// that change the layout of RTCHit (instance levels, instance arrays) for single rays and packets
// of 16, filter functions and ray masks.
#include <embree4/rtcore.h>

#include <cmath>
#include <cstdio>
#include <cstring>

namespace {

int failures = 0;

void check(bool ok, const char* what) {
  if (ok) return;
  std::fprintf(stderr, "embree probe: failed: %s\n", what);
  ++failures;
}

void on_error(void*, RTCError, const char* message) {
  std::fprintf(stderr, "embree probe: Embree says: %s\n", message);
  ++failures;
}

int filter_calls = 0;

// Rejects hits with x < 0.25.
void filter(const RTCFilterFunctionNArguments* args) {
  ++filter_calls;
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const float x = RTCRayN_org_x(args->ray, args->N, i);
    if (x < 0.25f) args->valid[i] = 0;
  }
}

RTCGeometry triangle(RTCDevice device) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* v = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                        RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3));
  auto* t = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), 1));
  const float vertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::memcpy(v, vertices, sizeof(vertices));
  for (unsigned i = 0; i < 3; ++i) t[i] = i;
  rtcSetGeometryMask(geometry, 0x2u);
  rtcCommitGeometry(geometry);
  return geometry;
}

struct Guarded {
  RTCRayHit hit;
  alignas(16) unsigned char guard[256];
};

struct Guarded16 {
  RTCRayHit16 hit;
  alignas(64) unsigned char guard[1024];
};

template <typename T>
bool guard_intact(const T& value) {
  for (unsigned char byte : value.guard) {
    if (byte != 0xA5) return false;
  }
  return true;
}

RTCRayHit ray_at(float x, float y, unsigned mask) {
  RTCRayHit r{};
  r.ray.org_x = x, r.ray.org_y = y, r.ray.org_z = 2.0f;
  r.ray.dir_z = -1.0f;
  r.ray.tfar = 100.0f;
  r.ray.mask = mask;
  r.hit.geomID = r.hit.primID = RTC_INVALID_GEOMETRY_ID;
  for (unsigned& id : r.hit.instID) id = RTC_INVALID_GEOMETRY_ID;
#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
  for (unsigned& id : r.hit.instPrimID) id = RTC_INVALID_GEOMETRY_ID;
#endif
  return r;
}

struct Expected {
  unsigned geom, inst, inst_prim;
};

void trace(RTCScene scene, float x, float y, unsigned mask, Expected expected, const char* what) {
  char text[256];
  Guarded one;
  std::memset(one.guard, 0xA5, sizeof(one.guard));
  one.hit = ray_at(x, y, mask);
  rtcIntersect1(scene, &one.hit);
  bool ok = one.hit.hit.geomID == expected.geom;
  const bool is_hit = expected.geom != RTC_INVALID_GEOMETRY_ID;
  if (is_hit) {
    ok = ok && one.hit.hit.instID[0] == expected.inst && one.hit.hit.primID == 0 &&
         std::fabs(one.hit.ray.tfar - 2.0f) < 1e-4f &&
         std::fabs(std::fabs(one.hit.hit.Ng_z) - 1.0f) < 1e-4f;
#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
    ok = ok && one.hit.hit.instPrimID[0] == expected.inst_prim;
#endif
  }
  std::snprintf(text, sizeof(text), "%s, rtcIntersect1", what);
  check(ok && guard_intact(one), text);

  Guarded16 many;
  std::memset(many.guard, 0xA5, sizeof(many.guard));
  std::memset(&many.hit, 0, sizeof(many.hit));
  alignas(64) int valid[16];
  const RTCRayHit r = ray_at(x, y, mask);
  for (int i = 0; i < 16; ++i) {
    valid[i] = i % 3 == 0 ? 0 : -1;
    many.hit.ray.org_x[i] = x, many.hit.ray.org_y[i] = y, many.hit.ray.org_z[i] = r.ray.org_z;
    many.hit.ray.dir_z[i] = r.ray.dir_z;
    many.hit.ray.tfar[i] = r.ray.tfar;
    many.hit.ray.mask[i] = mask;
    many.hit.hit.geomID[i] = many.hit.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;
    many.hit.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
    many.hit.hit.instPrimID[0][i] = RTC_INVALID_GEOMETRY_ID;
#endif
  }
  rtcIntersect16(valid, scene, &many.hit);
  ok = true;
  for (int i = 0; i < 16; ++i) {
    const bool active = valid[i] != 0;
    ok = ok && many.hit.hit.geomID[i] == (active ? expected.geom : RTC_INVALID_GEOMETRY_ID);
    if (!active || !is_hit) continue;
    ok = ok && many.hit.hit.instID[0][i] == expected.inst &&
         std::fabs(many.hit.ray.tfar[i] - 2.0f) < 1e-4f;
#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
    ok = ok && many.hit.hit.instPrimID[0][i] == expected.inst_prim;
#endif
  }
  std::snprintf(text, sizeof(text), "%s, rtcIntersect16", what);
  check(ok && guard_intact(many), text);
}

}  // namespace

int main() {
  constexpr unsigned kNone = RTC_INVALID_GEOMETRY_ID;
  RTCDevice device = rtcNewDevice("threads=1");
  if (device == nullptr) {
    std::fprintf(stderr, "embree probe: no device\n");
    return 1;
  }
  rtcSetDeviceErrorFunction(device, on_error, nullptr);
  const long version = static_cast<long>(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION));
  check(version / 10000 == RTC_VERSION_MAJOR, "the library's major version is the headers'");
  check(version >= RTC_VERSION, "the library is at least as new as the headers");
  check(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) == 1,
        "ray masks are supported");
  check(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED) == 1,
        "filter functions are supported");
  check(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_CURVE_GEOMETRY_SUPPORTED) == 1,
        "curves are supported");
  check(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_TASKING_SYSTEM) == 1,
        "tasks run on oneTBB");

  // Scene with one triangle, which has a filter function.
  RTCScene object = rtcNewScene(device);
  RTCGeometry mesh = triangle(device);
  rtcSetGeometryIntersectFilterFunction(mesh, filter);
  rtcCommitGeometry(mesh);
  rtcAttachGeometryByID(object, mesh, 5);
  rtcReleaseGeometry(mesh);
  rtcCommitScene(object);
  trace(object, 0.5f, 0.25f, ~0u, {5, kNone, kNone}, "triangle");
  trace(object, 0.1f, 0.25f, ~0u, {kNone, kNone, kNone}, "triangle, rejected by the filter");
  trace(object, 0.5f, 0.25f, 0x1u, {kNone, kNone, kNone}, "triangle, masked out");
  check(filter_calls >= 4, "the filter function is called");

  // One instance at x = 10, and an instance array with elements at x = 20 and x = 30.
  RTCScene world = rtcNewScene(device);
  RTCGeometry instance = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(instance, object);
  const float transform[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 10, 0, 0};
  rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform);
  rtcCommitGeometry(instance);
  rtcAttachGeometryByID(world, instance, 3);
  rtcReleaseGeometry(instance);
#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
  RTCGeometry array = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE_ARRAY);
  rtcSetGeometryInstancedScene(array, object);
  auto* transforms = static_cast<float*>(
      rtcSetNewGeometryBuffer(array, RTC_BUFFER_TYPE_TRANSFORM, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                              12 * sizeof(float), 2));
  for (int i = 0; i < 2; ++i) {
    std::memcpy(transforms + 12 * i, transform, sizeof(transform));
    transforms[12 * i + 9] = i == 0 ? 20.0f : 30.0f;
  }
  rtcCommitGeometry(array);
  rtcAttachGeometryByID(world, array, 7);
  rtcReleaseGeometry(array);
#endif
  rtcCommitScene(world);
  // A single instance has the instance index 0.
  trace(world, 10.5f, 0.25f, ~0u, {5, 3, 0}, "instance");
#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
  trace(world, 20.5f, 0.25f, ~0u, {5, 7, 0}, "instance array, first");
  trace(world, 30.5f, 0.25f, ~0u, {5, 7, 1}, "instance array, second");
#endif
  trace(world, 15.0f, 0.25f, ~0u, {kNone, kNone, kNone}, "nothing there");

  rtcReleaseScene(world);
  rtcReleaseScene(object);
  rtcReleaseDevice(device);
  if (failures != 0) return 1;
  std::printf("embree probe: headers %s and library %ld.%ld.%ld agree\n", RTC_VERSION_STRING,
              version / 10000, version / 100 % 100, version % 100);
  return 0;
}
