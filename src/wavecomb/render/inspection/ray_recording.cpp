// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/inspection/ray_recording.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cstring>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/denormals.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/task_order.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/ray_queue.h"

namespace wavecomb {
namespace {

void count(std::vector<uint64_t>& at, uint32_t depth, uint64_t n) {
  if (at.size() <= depth) at.resize(depth + 1);
  at[depth] += n;
}

}  // namespace

/// Output buffers of one thread that runs RayRecording::replay().
struct RayRecording::Buffers {
  HitBuffer hits;
  std::vector<uint32_t> occluded;
  size_t capacity = 0;
  ReplayTimes times;

  void reserve(size_t n) {
    if (n <= capacity) return;
    hits = HitBuffer(n);
    occluded.resize(n + SoaBlock::kPad);
    capacity = n;
  }
};

RayRecording::RayRecording(std::shared_ptr<const Scene> scene, uint64_t byte_limit)
    : scene_(std::move(scene)), byte_limit_(byte_limit) {
  if (scene_->view().has_presence)
    throw Error(
        "the scene has surfaces of opacity below 1, which Embree alone would take for opaque; "
        "record the rays of a stage without them");
}

RayRecording::~RayRecording() = default;

RaySpan RayRecording::Stage::rays() const {
  const auto column = [&](size_t c) { return columns.floats(c); };
  return {column(0),
          column(1),
          column(2),
          column(3),
          column(4),
          column(5),
          has_tfar ? column(6) : nullptr,
          nullptr,
          size,
          has_time ? column(has_tfar ? 7 : 6) : nullptr};
}

void RayRecording::closest(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) {
  keep(wave, rays, depth == 0 ? RayKind::kCamera : RayKind::kBounce, depth, coherent);
}

void RayRecording::occluded(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) {
  keep(wave, rays, RayKind::kShadow, depth, coherent);
}

void RayRecording::keep(const void* wave, const RaySpan& rays, RayKind kind, uint32_t depth,
                        bool coherent) {
  std::vector<const float*> from{rays.ox, rays.oy, rays.oz, rays.dx, rays.dy, rays.dz};
  if (rays.tfar) from.push_back(rays.tfar);
  if (rays.time) from.push_back(rays.time);
  Stage stage{kind,
              rays.tfar != nullptr,
              rays.time != nullptr,
              coherent,
              rays.size,
              SoaBlock(from.size(), rays.size)};
  for (size_t c = 0; c < from.size(); ++c)
    std::memcpy(stage.columns.floats(c), from[c], 4 * rays.size);

  const std::lock_guard lock(mutex_);
  bytes_ += stage.columns.bytes();
  if (bytes_ > byte_limit_)
    throw Error("the rays of this render need more than " + std::to_string(byte_limit_ >> 20) +
                " MiB; record fewer samples or pixels, or allow more memory");
  if (kind == RayKind::kCamera)
    current_[wave] = waves_.emplace_back(std::make_unique<RecordedWave>()).get();
  current_.at(wave)->push_back(std::move(stage));
  count(kind == RayKind::kShadow ? shadow_rays_at_ : rays_at_, depth, rays.size);
}

void RayRecording::trace(const Stage& stage, const Replay& how, Buffers& buffers,
                         ReplayTimes& times) const {
  const auto k = static_cast<size_t>(stage.kind);
  const RaySpan rays = stage.rays();
  const HitBuffer& h = buffers.hits;
  const bool shadow = stage.kind == RayKind::kShadow;
  const bool coherent = how.coherent[k].value_or(stage.coherent);
  uint64_t hits = 0;
  const Clock::time_point start = Clock::now();
  if (how.alone)
    hits = shadow ? bare_->occluded(rays, how.width[k], coherent)
                  : bare_->intersect(rays, how.width[k], coherent);
  else if (shadow)
    accel_->occluded(rays, buffers.occluded.data(), how.width[k], coherent, {});
  else
    accel_->intersect(rays, {h.t, h.u, h.v, h.prim, h.geom, h.inst}, how.width[k], coherent, {});
  times.thread_s[k] += seconds_since(start);
  if (!how.alone) {
    const uint32_t* found = shadow ? buffers.occluded.data() : h.inst;
    const uint32_t nothing = shadow ? 0 : kNoHit;
    hits = stage.size - static_cast<uint64_t>(std::count(found, found + stage.size, nothing));
  }
  times.rays[k] += stage.size;
  times.hits[k] += hits;
}

ReplayTimes RayRecording::replay(const Replay& how) {
  const uint32_t threads =
      how.threads != 0 ? how.threads : static_cast<uint32_t>(tbb::info::default_concurrency());
  if (how.alone && !bare_) bare_ = std::make_unique<BareTraversal>(scene_, threads);
  if (!how.alone && !accel_) accel_ = std::make_unique<EmbreeAccelerator>(scene_, threads);
  const uint32_t native = how.alone ? bare_->native_width() : accel_->native_width();
  for (const uint32_t width : how.width)
    if ((width != 1 && width != 4 && width != 8 && width != 16) || width > native)
      throw Error("packets of " + std::to_string(width) +
                  " rays cannot be traced here; choose 1, 4, 8 or 16, up to " +
                  std::to_string(native));

  size_t largest = 0;
  for (const auto& wave : waves_)
    for (const Stage& stage : *wave) largest = std::max(largest, stage.size);
  std::vector<Buffers> buffers(threads);
  for (Buffers& b : buffers) b.reserve(largest);

  const tbb::global_control parallelism(
      tbb::global_control::max_allowed_parallelism,
      std::max<size_t>(threads, static_cast<size_t>(tbb::info::default_concurrency())));
  tbb::task_arena arena(static_cast<int>(threads));
  ReplayTimes total;
  const Clock::time_point start = Clock::now();
  const auto trace_waves = [&](const tbb::blocked_range<size_t>& range) {
    const DenormalsOff denormals_off;
    Buffers& own = buffers[static_cast<size_t>(tbb::this_task_arena::current_thread_index())];
    const WorkerOrder in_order(&own);
    for (size_t w = range.begin(); w != range.end(); ++w)
      for (const Stage& stage : *waves_[w])
        if (how.wanted[static_cast<size_t>(stage.kind)]) trace(stage, how, own, own.times);
  };
  const TaskOrder order;
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<size_t>(0, waves_.size(), 1), order.around(trace_waves),
                      tbb::simple_partitioner());
  });
  order.join();
  total.wall_s = seconds_since(start);
  for (const Buffers& b : buffers)
    for (size_t k = 0; k < kRayKinds; ++k) {
      total.thread_s[k] += b.times.thread_s[k];
      total.rays[k] += b.times.rays[k];
      total.hits[k] += b.times.hits[k];
    }
  return total;
}

}  // namespace wavecomb
