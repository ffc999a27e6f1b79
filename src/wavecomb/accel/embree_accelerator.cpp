// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_accelerator.h"

#include <embree4/rtcore.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "wavecomb/accel/embree_curves.h"
#include "wavecomb/accel/embree_query.h"
#include "wavecomb/accel/light_shapes.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/lanes.h"

namespace wavecomb {
namespace {

/// What a geometry with partly present materials knows of itself.
struct GeometryUser {
  const SceneView* scene;
  uint32_t mesh;
};

template <uint32_t W>
struct PacketTypes;
template <>
struct PacketTypes<4> {
  using Ray = RTCRay4;
  using RayHit = RTCRayHit4;
};
template <>
struct PacketTypes<8> {
  using Ray = RTCRay8;
  using RayHit = RTCRayHit8;
};
template <>
struct PacketTypes<16> {
  using Ray = RTCRay16;
  using RayHit = RTCRayHit16;
};

void presence_filter(const RTCFilterFunctionNArguments* args) {
  const auto* user = static_cast<const GeometryUser*>(args->geometryUserPtr);
  const auto* context = reinterpret_cast<const QueryContext*>(args->context);
  const unsigned n = args->N;
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] != -1) continue;
    const unsigned inst = RTCHitN_instID(args->hit, n, i, 0);
    const bool present =
        is_present(*user->scene, inst == RTC_INVALID_GEOMETRY_ID ? 0 : inst, user->mesh,
                   RTCHitN_primID(args->hit, n, i), RTCHitN_u(args->hit, n, i),
                   RTCHitN_v(args->hit, n, i), RTCRayN_id(args->ray, n, i), *context->keys);
    if (!present) args->valid[i] = 0;
  }
}

/// Makes the closest hit independent of the order in which triangles are tried. Embree keeps
/// whichever of two hits it tries last when they are equally far up to rounding (on shared edges,
/// where surfaces cross or lie in one another), and in a packet that order depends on the other
/// rays. Here the smaller distance wins, and of equal ones the smaller id. So that no candidate is
/// missed, the search goes on a little beyond the closest hit: tfar is put back by `slack`.
template <unsigned N>
inline void keep_closest(const RTCFilterFunctionNArguments* args) {
  auto* best = reinterpret_cast<QueryContext*>(args->context);
  int* valid = args->valid;
  float* tfar = &RTCRayN_tfar(args->ray, N, 0);
  using F = Lanes<N>;
  using U = UInt<F>;
  const F t = load<F>(tfar), best_t = load<F>(best->t);
  Mask<F> take = t < best_t;
  const Mask<F> tie = t == best_t;
  if (any(tie)) {
    const U i = load<U>(&RTCHitN_instID(args->hit, N, 0, 0)), bi = load<U>(best->inst);
    const U g = load<U>(&RTCHitN_geomID(args->hit, N, 0)), bg = load<U>(best->geom);
    const U p = load<U>(&RTCHitN_primID(args->hit, N, 0)), bp = load<U>(best->prim);
    take = take | (tie & Mask<F>((i < bi) | ((i == bi) & ((g < bg) | ((g == bg) & (p < bp))))));
  }
  take = take & Mask<F>(load<U>(valid) != U(0u));
  store(best->t, select(take, t, best_t));
  store(tfar, select(take, F(t * kSlack), t));
  store(valid, select(Mask<U>(take), U(0xffffffffu), U(0u)));
}

void closest_filter(const RTCFilterFunctionNArguments* args) {
  switch (args->N) {
    case 16:
      return keep_closest<16>(args);
    case 8:
      return keep_closest<8>(args);
    case 4:
      return keep_closest<4>(args);
    default:
      return keep_closest<1>(args);
  }
}

/// Ray i of a packet against the round light that a geometry's user pointer names; 0: missed.
float meet_round_light(const void* user, RTCRayN* ray, unsigned n, unsigned i) {
  const float o[3] = {RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)};
  const float d[3] = {RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i)};
  const float t = intersect_round_light(*static_cast<const LightRecord*>(user), o, d);
  return t > 0.f && t <= RTCRayN_tfar(ray, n, i) ? t : 0.f;
}

/// Keeps the closest hit by the same rule as keep_closest.
void intersect_round_lights(const RTCIntersectFunctionNArguments* args) {
  auto* best = reinterpret_cast<QueryContext*>(args->context);
  const unsigned n = args->N;
  RTCRayN* ray = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* hit = RTCRayHitN_HitN(args->rayhit, n);
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0) continue;
    const float t = meet_round_light(args->geometryUserPtr, ray, n, i);
    if (t == 0.f || t > best->t[i]) continue;
    // A tie goes to the smaller instance, which the world's is not, then to the smaller geometry.
    if (t == best->t[i] && (RTCHitN_instID(hit, n, i, 0) != RTC_INVALID_GEOMETRY_ID ||
                            RTCHitN_geomID(hit, n, i) < args->geomID))
      continue;
    best->t[i] = t;
    RTCRayN_tfar(ray, n, i) = t * kSlack;
    RTCHitN_u(hit, n, i) = RTCHitN_v(hit, n, i) = 0.f;
    RTCHitN_primID(hit, n, i) = 0;
    RTCHitN_geomID(hit, n, i) = args->geomID;
    RTCHitN_instID(hit, n, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

/// The same where any closest hit will do.
void intersect_round_lights_bare(const RTCIntersectFunctionNArguments* args) {
  const unsigned n = args->N;
  RTCRayN* ray = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* hit = RTCRayHitN_HitN(args->rayhit, n);
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0) continue;
    const float t = meet_round_light(args->geometryUserPtr, ray, n, i);
    if (t == 0.f) continue;
    RTCRayN_tfar(ray, n, i) = t;
    RTCHitN_primID(hit, n, i) = 0;
    RTCHitN_geomID(hit, n, i) = args->geomID;
    RTCHitN_instID(hit, n, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

void occlude_round_lights(const RTCOccludedFunctionNArguments* args) {
  for (unsigned i = 0; i < args->N; ++i)
    if (args->valid[i] != 0 && meet_round_light(args->geometryUserPtr, args->ray, args->N, i) > 0.f)
      RTCRayN_tfar(args->ray, args->N, i) = -std::numeric_limits<float>::infinity();
}

void round_light_box(const RTCBoundsFunctionArguments* args) {
  const Bounds b = round_light_bounds(*static_cast<const LightRecord*>(args->geometryUserPtr));
  RTCBounds& out = *args->bounds_o;
  out.lower_x = b.lo.x;
  out.lower_y = b.lo.y;
  out.lower_z = b.lo.z;
  out.upper_x = b.hi.x;
  out.upper_y = b.hi.y;
  out.upper_z = b.hi.z;
}

/// How closest hits are asked for.
RTCIntersectArguments intersect_arguments(QueryContext& context, const SceneView& scene,
                                          const PresenceKeys& keys, bool coherent) {
  rtcInitRayQueryContext(&context.base);
  context.scene = &scene;
  context.keys = &keys;
  RTCIntersectArguments args;
  rtcInitIntersectArguments(&args);
  args.flags = static_cast<RTCRayQueryFlags>(
      (coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT) |
      RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
  args.filter = closest_filter;
  args.context = &context.base;
  return args;
}

bool mesh_has_presence(const Scene& scene, const Mesh& mesh) {
  const auto needs = [&](uint32_t m) {
    return m != kInheritMaterial && scene.materials()[m].needs_presence();
  };
  if (mesh.face_materials.empty()) return needs(mesh.material);
  for (uint32_t m : mesh.face_materials)
    if (m == kInheritMaterial || needs(m)) return true;
  return false;
}

}  // namespace

struct EmbreeAccelerator::Impl {
  std::shared_ptr<const Scene> scene;
  HitRule rule = HitRule::kCanonical;
  SceneView view;
  RTCDevice device = nullptr;
  RTCScene top = nullptr;
  std::vector<RTCScene> group_scenes;
  std::vector<RTCGeometry> mesh_geometries;
  std::vector<std::unique_ptr<GeometryUser>> users;
  std::vector<std::unique_ptr<CurveGeometry>> curves;
  std::vector<std::vector<float>> padded;  ///< copies of arrays that end at a page boundary
  uint32_t first_world = 0;                ///< geometry id of the world's first mesh
  uint32_t first_light = 0;                ///< geometry id of light record 0
  std::atomic<int64_t> bytes{0};
  bool presence = false;

  ~Impl() {
    for (RTCGeometry g : mesh_geometries)
      if (g) rtcReleaseGeometry(g);
    for (RTCScene s : group_scenes)
      if (s) rtcReleaseScene(s);
    if (top) rtcReleaseScene(top);
    if (device) rtcReleaseDevice(device);
  }

  void check(const char* doing) const {
    const RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_NONE) return;
    const char* why = error == RTC_ERROR_OUT_OF_MEMORY ? "out of memory; use fewer triangles"
                                                       : rtcGetDeviceLastErrorMessage(device);
    throw Error(std::string("the ray tracer failed while ") + doing + ": " +
                (why ? why : "unknown"));
  }

  RTCScene new_scene() const {
    RTCScene s = rtcNewScene(device);
    const RTCSceneFlags filter = rule == HitRule::kCanonical
                                     ? RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS
                                     : RTC_SCENE_FLAG_NONE;
    rtcSetSceneFlags(s, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | filter));
    rtcSetSceneBuildQuality(s, RTC_BUILD_QUALITY_MEDIUM);
    return s;
  }

  RTCGeometry make_mesh(uint32_t mesh_id, bool can_inherit_presence) {
    const Mesh& mesh = scene->meshes()[mesh_id];
    const bool is_filtered = rule == HitRule::kCanonical &&
                             (mesh_has_presence(*scene, mesh) ||
                              (can_inherit_presence && mesh.material == kInheritMaterial &&
                               mesh.face_materials.empty()));
    if (mesh.is_curved()) {
      curves.push_back(std::make_unique<CurveGeometry>(CurveGeometry{&mesh, mesh_id, is_filtered}));
      return make_curve_geometry(device, *curves.back(), rule);
    }
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const float* positions = mesh.positions.data();
    // Embree loads 16 bytes per vertex. A last vertex that ends at the end of a page is copied.
    const uint64_t end = reinterpret_cast<uint64_t>(positions + mesh.positions.size());
    if (((end + 3) & 4095) < 4) {
      std::vector<float>& copy = padded.emplace_back(mesh.positions.begin(), mesh.positions.end());
      copy.resize(copy.size() + 4);
      positions = copy.data();
    }
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions, 0, 12,
                               mesh.vertex_count());
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.indices.data(),
                               0, 12, mesh.triangle_count());
    if (is_filtered) {
      users.push_back(std::make_unique<GeometryUser>(GeometryUser{&view, mesh_id}));
      rtcSetGeometryUserData(g, users.back().get());
      rtcSetGeometryIntersectFilterFunction(g, presence_filter);
      rtcSetGeometryOccludedFilterFunction(g, presence_filter);
    }
    rtcCommitGeometry(g);
    return g;
  }

  void attach_light(uint32_t id, const LightRecord& light) {
    const auto kind = static_cast<LightKind>(light.kind);
    if (kind == LightKind::kRect) {
      RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* p = static_cast<float*>(
          rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 4));
      auto* index = static_cast<uint32_t*>(
          rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 2));
      for (int i = 0; i < 3; ++i) {
        p[i] = light.p[i];
        p[3 + i] = light.p[i] + light.u[i];
        p[6 + i] = light.p[i] + light.u[i] + light.v[i];
        p[9 + i] = light.p[i] + light.v[i];
      }
      constexpr uint32_t kIndex[6] = {0, 1, 2, 0, 2, 3};
      std::memcpy(index, kIndex, sizeof(kIndex));
      rtcCommitGeometry(g);
      rtcAttachGeometryByID(top, g, id);
      rtcReleaseGeometry(g);
    } else {
      RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
      rtcSetGeometryUserPrimitiveCount(g, 1);
      rtcSetGeometryUserData(g, const_cast<LightRecord*>(&light));  // only read
      rtcSetGeometryBoundsFunction(g, round_light_box, nullptr);
      rtcSetGeometryIntersectFunction(
          g, rule == HitRule::kCanonical ? intersect_round_lights : intersect_round_lights_bare);
      rtcSetGeometryOccludedFunction(g, occlude_round_lights);
      rtcCommitGeometry(g);
      rtcAttachGeometryByID(top, g, id);
      rtcReleaseGeometry(g);
    }
  }

  void build() {
    const auto& groups = scene->groups();
    const auto& instances = scene->instances();
    bool instance_presence = false;
    for (const Instance& i : instances)
      instance_presence = instance_presence || scene->materials()[i.material].needs_presence();

    mesh_geometries.resize(scene->meshes().size(), nullptr);
    for (const Group& group : groups)
      for (uint32_t mesh : group.meshes)
        if (!mesh_geometries[mesh]) mesh_geometries[mesh] = make_mesh(mesh, instance_presence);
    check("reading meshes");

    group_scenes.resize(groups.size(), nullptr);
    for (size_t g = 1; g < groups.size(); ++g) {
      group_scenes[g] = new_scene();
      uint32_t id = 0;
      for (uint32_t mesh : groups[g].meshes)
        rtcAttachGeometryByID(group_scenes[g], mesh_geometries[mesh], id++);
    }
    tbb::parallel_for(size_t{1}, std::max<size_t>(1, groups.size()),
                      [&](size_t g) { rtcCommitScene(group_scenes[g]); });
    check("building the hierarchy of a group");

    top = new_scene();
    for (size_t i = 0; i < instances.size(); ++i) {
      RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(g, group_scenes[instances[i].group]);
      const Affine& m = instances[i].to_world;
      const float columns[12] = {m.row[0].x, m.row[1].x, m.row[2].x, m.row[0].y,
                                 m.row[1].y, m.row[2].y, m.row[0].z, m.row[1].z,
                                 m.row[2].z, m.t.x,      m.t.y,      m.t.z};
      rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
      rtcCommitGeometry(g);
      rtcAttachGeometryByID(top, g, static_cast<unsigned>(i + 1));
      rtcReleaseGeometry(g);
    }
    first_world = static_cast<uint32_t>(instances.size() + 1);
    uint32_t id = first_world;
    for (uint32_t mesh : groups[0].meshes) rtcAttachGeometryByID(top, mesh_geometries[mesh], id++);
    first_light = id;
    const LightSet& lights = scene->light_set();
    for (uint32_t l = 0; l < lights.records.size(); ++l) {
      const LightRecord& record = lights.records[l];
      const auto kind = static_cast<LightKind>(record.kind);
      const bool has_shape = kind == LightKind::kRect || kind == LightKind::kDisk ||
                             (kind == LightKind::kSphere && record.radius > 0);
      if (has_shape && record.area > 0) attach_light(first_light + l, record);
    }
    rtcCommitScene(top);
    check("building the hierarchy");
  }

  /// Embree's ids to ours, for one packet; a plain loop over arrays that compilers vectorise.
  void store_hits(const float* t, const float* u, const float* v, const unsigned* prim,
                  const unsigned* geom, const unsigned* inst, const HitSpan& out, size_t base,
                  size_t n) const {
    for (size_t i = 0; i < n; ++i) {
      const bool instanced = inst[i] != RTC_INVALID_GEOMETRY_ID;
      const uint32_t top_id = instanced ? inst[i] : geom[i];
      const bool missed = geom[i] == RTC_INVALID_GEOMETRY_ID;
      const bool light = top_id >= first_light;
      out.t[base + i] = t[i];
      out.u[base + i] = u[i];
      out.v[base + i] = v[i];
      out.prim[base + i] = prim[i];
      out.geom[base + i] =
          light ? top_id - first_light : (instanced ? geom[i] : geom[i] - first_world);
      out.inst[base + i] = missed ? kNoHit : (light ? kLightShape : (instanced ? inst[i] : 0));
    }
  }

  void intersect_alone(const RaySpan& rays, const HitSpan& hits, bool coherent,
                       const PresenceKeys& keys) const {
    for (size_t i = 0; i < rays.size; ++i) {
      RTCRayHit rh{};
      QueryContext context;
      RTCIntersectArguments args = intersect_arguments(context, view, keys, coherent);
      rh.ray = load_ray(rays, i);
      rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      context.t[0] = std::numeric_limits<float>::infinity();
      context.inst = rh.hit.instID;
      context.geom = &rh.hit.geomID;
      context.prim = &rh.hit.primID;
      rtcIntersect1(top, &rh, &args);
      store_hits(context.t, &rh.hit.u, &rh.hit.v, &rh.hit.primID, &rh.hit.geomID, &rh.hit.instID[0],
                 hits, i, 1);
    }
  }

  template <uint32_t W, typename Ray>
  static void load_rays(Ray& ray, int* valid, const RaySpan& rays, size_t base, size_t n) {
    for (uint32_t i = 0; i < W; ++i) valid[i] = i < n ? -1 : 0;
    // Columns are padded: reading a whole packet past the end is fine.
    std::memcpy(ray.org_x, rays.ox + base, 4 * W);
    std::memcpy(ray.org_y, rays.oy + base, 4 * W);
    std::memcpy(ray.org_z, rays.oz + base, 4 * W);
    std::memcpy(ray.dir_x, rays.dx + base, 4 * W);
    std::memcpy(ray.dir_y, rays.dy + base, 4 * W);
    std::memcpy(ray.dir_z, rays.dz + base, 4 * W);
    for (uint32_t i = 0; i < W; ++i) {
      ray.tnear[i] = 0.f;
      ray.time[i] = 0.f;
      ray.mask[i] = 0xffffffffu;
      ray.flags[i] = 0;
    }
    if (rays.tfar)
      std::memcpy(ray.tfar, rays.tfar + base, 4 * W);
    else
      for (uint32_t i = 0; i < W; ++i) ray.tfar[i] = std::numeric_limits<float>::infinity();
    if (rays.slot)
      std::memcpy(ray.id, rays.slot + base, 4 * W);
    else
      for (uint32_t i = 0; i < W; ++i) ray.id[i] = static_cast<unsigned>(base + i);
  }

  template <uint32_t W>
  void intersect_packets(const RaySpan& rays, const HitSpan& hits, bool coherent,
                         const PresenceKeys& keys) const {
    alignas(64) typename PacketTypes<W>::RayHit rh;
    QueryContext context;
    RTCIntersectArguments args = intersect_arguments(context, view, keys, coherent);
    alignas(64) int valid[W];
    context.inst = rh.hit.instID[0];
    context.geom = rh.hit.geomID;
    context.prim = rh.hit.primID;
    for (size_t base = 0; base < rays.size; base += W) {
      const size_t n = std::min<size_t>(W, rays.size - base);
      load_rays<W>(rh.ray, valid, rays, base, n);
      for (uint32_t i = 0; i < W; ++i) {
        rh.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        rh.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        context.t[i] = std::numeric_limits<float>::infinity();
      }
      if constexpr (W == 16)
        rtcIntersect16(valid, top, &rh, &args);
      else if constexpr (W == 8)
        rtcIntersect8(valid, top, &rh, &args);
      else
        rtcIntersect4(valid, top, &rh, &args);
      store_hits(context.t, rh.hit.u, rh.hit.v, rh.hit.primID, rh.hit.geomID, rh.hit.instID[0],
                 hits, base, n);
    }
  }

  template <uint32_t W>
  void occluded_packets(const RaySpan& rays, uint32_t* out, RTCOccludedArguments& args) const {
    alignas(64) typename PacketTypes<W>::Ray ray;
    alignas(64) int valid[W];
    for (size_t base = 0; base < rays.size; base += W) {
      const size_t n = std::min<size_t>(W, rays.size - base);
      load_rays<W>(ray, valid, rays, base, n);
      if constexpr (W == 16)
        rtcOccluded16(valid, top, &ray, &args);
      else if constexpr (W == 8)
        rtcOccluded8(valid, top, &ray, &args);
      else
        rtcOccluded4(valid, top, &ray, &args);
      for (size_t i = 0; i < n; ++i) out[base + i] = ray.tfar[i] < 0.f ? 1 : 0;
    }
  }

  static RTCRay load_ray(const RaySpan& rays, size_t i) {
    RTCRay ray{};
    ray.org_x = rays.ox[i];
    ray.org_y = rays.oy[i];
    ray.org_z = rays.oz[i];
    ray.dir_x = rays.dx[i];
    ray.dir_y = rays.dy[i];
    ray.dir_z = rays.dz[i];
    ray.tfar = rays.tfar ? rays.tfar[i] : std::numeric_limits<float>::infinity();
    ray.mask = 0xffffffffu;
    ray.id = rays.slot ? rays.slot[i] : static_cast<unsigned>(i);
    return ray;
  }
};

EmbreeAccelerator::EmbreeAccelerator(std::shared_ptr<const Scene> scene, uint32_t threads,
                                     HitRule rule)
    : impl_(std::make_unique<Impl>()) {
  impl_->scene = std::move(scene);
  impl_->rule = rule;
  impl_->view = impl_->scene->view();
  impl_->device = rtcNewDevice(nullptr);
  if (!impl_->device) throw Error("the ray tracer could not start; is this CPU older than SSE2?");
  rtcSetDeviceMemoryMonitorFunction(
      impl_->device,
      [](void* user, ssize_t bytes, bool) {
        static_cast<Impl*>(user)->bytes += bytes;
        return true;
      },
      impl_.get());
  tbb::task_arena arena(threads == 0 ? tbb::task_arena::automatic : static_cast<int>(threads));
  arena.execute([&] { impl_->build(); });
}

EmbreeAccelerator::~EmbreeAccelerator() = default;

void EmbreeAccelerator::intersect(const RaySpan& rays, const HitSpan& hits, uint32_t width,
                                  bool coherent, const PresenceKeys& keys) const {
  switch (width) {
    case 16:
      return impl_->intersect_packets<16>(rays, hits, coherent, keys);
    case 8:
      return impl_->intersect_packets<8>(rays, hits, coherent, keys);
    case 4:
      return impl_->intersect_packets<4>(rays, hits, coherent, keys);
    default:
      break;
  }
  impl_->intersect_alone(rays, hits, coherent, keys);
}

void EmbreeAccelerator::occluded(const RaySpan& rays, uint32_t* occluded, uint32_t width,
                                 bool coherent, const PresenceKeys& keys) const {
  QueryContext context;
  rtcInitRayQueryContext(&context.base);
  context.scene = &impl_->view;
  context.keys = &keys;
  RTCOccludedArguments args;
  rtcInitOccludedArguments(&args);
  args.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  args.context = &context.base;
  switch (width) {
    case 16:
      return impl_->occluded_packets<16>(rays, occluded, args);
    case 8:
      return impl_->occluded_packets<8>(rays, occluded, args);
    case 4:
      return impl_->occluded_packets<4>(rays, occluded, args);
    default:
      break;
  }
  for (size_t i = 0; i < rays.size; ++i) {
    RTCRay ray = Impl::load_ray(rays, i);
    rtcOccluded1(impl_->top, &ray, &args);
    occluded[i] = ray.tfar < 0.f ? 1 : 0;
  }
}

size_t EmbreeAccelerator::bytes() const {
  const int64_t b = impl_->bytes.load();
  return b > 0 ? static_cast<size_t>(b) : 0;
}

uint32_t EmbreeAccelerator::native_width() const {
  if (rtcGetDeviceProperty(impl_->device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
  if (rtcGetDeviceProperty(impl_->device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) return 8;
  if (rtcGetDeviceProperty(impl_->device, RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED)) return 4;
  return 1;
}

RTCSceneTy* EmbreeAccelerator::embree_scene() const {
  return impl_->top;
}

}  // namespace wavecomb
