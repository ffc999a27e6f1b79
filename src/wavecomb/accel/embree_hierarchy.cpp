// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_hierarchy.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>

#include "wavecomb/accel/embree_filters.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/task_order.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Embree device with its memory statistics. Hierarchies of the same device may share geometries,
/// so only one hierarchy is built at a time. Meanwhile, rays can be traced in finished hierarchies.
struct EmbreeDevice {
  RTCDevice handle = rtcNewDevice(nullptr);
  std::atomic<int64_t> bytes{0};
  std::mutex building;
  /// Annotations that inform ThreadSanitizer about the order of Embree's tasks, which call the
  /// memory monitor.
  TaskOrder order;

  EmbreeDevice() {
    if (!handle) throw Error("the ray tracer could not start; is this CPU older than SSE2?");
    rtcSetDeviceMemoryMonitorFunction(
        handle,
        [](void* user, ssize_t n, bool) {
          auto& device = *static_cast<EmbreeDevice*>(user);
          const auto count = [&device, n] { device.bytes += n; };
          device.order.around(count)();
          return true;
        },
        this);
  }
  ~EmbreeDevice() { rtcReleaseDevice(handle); }
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;
};

namespace {

void run_in_parallel(const CurveBvhNodes::Task& a, const CurveBvhNodes::Task& b) {
  const TaskOrder order;
  const auto one = [&](size_t i) { i == 0 ? a() : b(); };
  tbb::parallel_for(size_t{0}, size_t{2}, order.around(one));
  order.join();
}

void set_transform(RTCGeometry g, uint32_t step, const Affine& m) {
  const float columns[12] = {m.row[0].x, m.row[1].x, m.row[2].x, m.row[0].y, m.row[1].y, m.row[2].y,
                             m.row[0].z, m.row[1].z, m.row[2].z, m.t.x,      m.t.y,      m.t.z};
  rtcSetGeometryTransform(g, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
}

}  // namespace

EmbreeHierarchy::EmbreeHierarchy(const Scene& scene, HitRule rule, const EmbreeHierarchy* origin,
                                 uint32_t threads)
    : geometry_(scene.geometry()),
      rule_(rule),
      device_(origin ? origin->device_ : std::make_shared<EmbreeDevice>()),
      filtered_(rule != HitRule::kEmbree ? filtered_meshes(scene)
                                         : std::vector<uint8_t>(geometry_->meshes.size(), 0)),
      fibres_(fibre_meshes(scene)),
      shapes_(light_shapes(scene)) {
  const std::lock_guard lock(device_->building);
  tbb::task_arena arena(threads == 0 ? tbb::task_arena::automatic : static_cast<int>(threads));
  try {
    const auto work = [&] { build(origin); };
    const TaskOrder order;
    arena.execute(order.around(work));
    order.join();
  } catch (...) {
    release();
    throw;
  }
}

EmbreeHierarchy::~EmbreeHierarchy() {
  release();
}

void EmbreeHierarchy::release() {
  for (RTCGeometry g : mesh_geometries_)
    if (g) rtcReleaseGeometry(g);
  for (RTCScene s : group_scenes_)
    if (s) rtcReleaseScene(s);
  if (top_) rtcReleaseScene(top_);
}

RTCDevice EmbreeHierarchy::device() const {
  return device_->handle;
}

size_t EmbreeHierarchy::bytes() const {
  size_t nodes = 0;
  for (const auto& [mesh, curves] : curves_)
    if (curves->nodes) nodes += curves->nodes->bytes();
  return static_cast<size_t>(std::max<int64_t>(0, device_->bytes)) + nodes;
}

bool EmbreeHierarchy::fits(const Scene& scene) const {
  return light_shapes(scene) == shapes_ &&
         (rule_ == HitRule::kEmbree || filtered_meshes(scene) == filtered_) &&
         fibre_meshes(scene) == fibres_;
}

void EmbreeHierarchy::check(const char* operation) const {
  const RTCError error = rtcGetDeviceError(device());
  if (error == RTC_ERROR_NONE) return;
  const char* why = error == RTC_ERROR_OUT_OF_MEMORY
                        ? "out of memory; use fewer triangles, curves or points"
                        : rtcGetDeviceLastErrorMessage(device());
  throw Error(std::string("the ray tracer failed while ") + operation + ": " +
              (why ? why : "unknown"));
}

RTCScene EmbreeHierarchy::new_scene() const {
  RTCScene s = rtcNewScene(device());
  const RTCSceneFlags filter =
      rule_ != HitRule::kEmbree ? RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS : RTC_SCENE_FLAG_NONE;
  rtcSetSceneFlags(s, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | filter));
  rtcSetSceneBuildQuality(s, RTC_BUILD_QUALITY_MEDIUM);
  return s;
}

RTCGeometry EmbreeHierarchy::make_mesh(uint32_t mesh_id) {
  const Mesh& mesh = geometry_->meshes[mesh_id];
  if (mesh.is_curved()) {
    auto& curves = curves_[mesh_id];
    curves = std::make_shared<const CurveGeometry>(CurveGeometry{
        &mesh, mesh_id, filtered_[mesh_id] != 0, fibres_[mesh_id] != 0,
        CurveBvhNodes::supports(mesh) ? std::make_unique<const CurveBvhNodes>(mesh, run_in_parallel)
                                      : nullptr});
    return make_curve_geometry(device(), *curves, rule_);
  }
  RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
  const float* positions = mesh.positions.data();
  // Embree loads 16 bytes per vertex, so an array that ends at a page boundary must be copied.
  const uint64_t end = reinterpret_cast<uint64_t>(positions + mesh.positions.size());
  if (((end + 3) & 4095) < 4) {
    auto copy = std::make_shared<std::vector<float>>(mesh.positions.begin(), mesh.positions.end());
    copy->resize(copy->size() + 4);
    positions = copy->data();
    padded_[mesh_id] = std::move(copy);
  }
  rtcSetGeometryTimeStepCount(g, mesh.steps);
  for (uint32_t step = 0; step < mesh.steps; ++step)
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3, positions,
                               step * mesh.vertex_count() * 12, 12, mesh.vertex_count());
  rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.indices.data(), 0,
                             12, mesh.triangle_count());
  if (filtered_[mesh_id]) {
    rtcSetGeometryUserData(g, reinterpret_cast<void*>(uintptr_t{mesh_id}));
    rtcSetGeometryIntersectFilterFunction(g, presence_filter);
    rtcSetGeometryOccludedFilterFunction(g, presence_filter);
  }
  rtcCommitGeometry(g);
  return g;
}

void EmbreeHierarchy::attach_light(uint32_t id, const LightGeometry& shape) const {
  if (shape.shape == LightShape::kParallelogram) {
    const LightRecord& light = shape.light;
    RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
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
    rtcAttachGeometryByID(top_, g, id);
    rtcReleaseGeometry(g);
  } else {
    RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(g, 1);
    // Embree's callbacks only read the user data.
    rtcSetGeometryUserData(g, const_cast<LightGeometry*>(&shape));
    rtcSetGeometryBoundsFunction(g, light_box, nullptr);
    rtcSetGeometryIntersectFunction(
        g, rule_ != HitRule::kEmbree ? intersect_lights : intersect_lights_bare);
    rtcSetGeometryOccludedFunction(g, occlude_lights);
    rtcCommitGeometry(g);
    rtcAttachGeometryByID(top_, g, id);
    rtcReleaseGeometry(g);
  }
}

void EmbreeHierarchy::build(const EmbreeHierarchy* origin) {
  const auto& groups = geometry_->groups;
  const auto& instances = geometry_->instances;
  const auto is_reused = [&](uint32_t mesh) {
    return origin && origin->filtered_[mesh] == filtered_[mesh] &&
           origin->fibres_[mesh] == fibres_[mesh];
  };
  if (origin) {
    padded_ = origin->padded_;
    curves_ = origin->curves_;
  }
  mesh_geometries_.resize(geometry_->meshes.size(), nullptr);
  for (const Group& group : groups)
    for (uint32_t mesh : group.meshes) {
      if (mesh_geometries_[mesh]) continue;
      if (is_reused(mesh)) {
        mesh_geometries_[mesh] = origin->mesh_geometries_[mesh];
        rtcRetainGeometry(mesh_geometries_[mesh]);
      } else {
        mesh_geometries_[mesh] = make_mesh(mesh);
      }
    }
  check("reading meshes");

  group_scenes_.resize(groups.size(), nullptr);
  std::vector<size_t> built;
  for (size_t g = 1; g < groups.size(); ++g) {
    const auto& meshes = groups[g].meshes;
    const bool is_known = origin && g < origin->geometry_->groups.size() &&
                          origin->geometry_->groups[g].meshes == meshes;
    if (is_known && std::all_of(meshes.begin(), meshes.end(), is_reused)) {
      group_scenes_[g] = origin->group_scenes_[g];
      rtcRetainScene(group_scenes_[g]);
      continue;
    }
    built.push_back(g);
    group_scenes_[g] = new_scene();
    uint32_t id = 0;
    for (uint32_t mesh : meshes)
      rtcAttachGeometryByID(group_scenes_[g], mesh_geometries_[mesh], id++);
  }
  const auto commit = [&](size_t i) { rtcCommitScene(group_scenes_[built[i]]); };
  const TaskOrder order;
  tbb::parallel_for(size_t{0}, built.size(), order.around(commit));
  order.join();
  check("building the hierarchy of a group");

  top_ = new_scene();
  for (size_t i = 0; i < instances.size(); ++i) {
    RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(g, group_scenes_[instances[i].group]);
    const StepRange& motion = instances[i].motion;
    if (!motion.moves()) set_transform(g, 0, instances[i].to_world);
    if (motion.moves()) rtcSetGeometryTimeStepCount(g, motion.segments + 1);
    for (uint32_t k = 0; motion.moves() && k <= motion.segments; ++k)
      set_transform(g, k, geometry_->steps[motion.first + k].affine());
    rtcCommitGeometry(g);
    rtcAttachGeometryByID(top_, g, static_cast<unsigned>(i + 1));
    rtcReleaseGeometry(g);
  }
  first_world_ = static_cast<uint32_t>(instances.size() + 1);
  uint32_t id = first_world_;
  for (uint32_t mesh : groups[0].meshes) rtcAttachGeometryByID(top_, mesh_geometries_[mesh], id++);
  first_light_ = id;
  for (uint32_t l = 0; l < shapes_.size(); ++l)
    if (shapes_[l].shape != LightShape::kNone) attach_light(first_light_ + l, shapes_[l]);
  rtcCommitScene(top_);
  check("building the hierarchy");
}

}  // namespace wavecomb
