// SPDX-License-Identifier: Apache-2.0
/// Recording of the rays of a render, so that the same rays can be traced again. The rays can be
/// traced by Embree alone, to measure the greatest possible speed, or by the accelerator as in a
/// render.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "wavecomb/accel/bare_traversal.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/wave/ray_recorder.h"

namespace wavecomb {

enum class RayKind : uint8_t { kCamera, kBounce, kShadow };
inline constexpr size_t kRayKinds = 3;

/// Options of RayRecording::replay().
struct Replay {
  bool alone = true;     ///< trace the rays by Embree alone instead of by EmbreeAccelerator
  uint32_t threads = 0;  ///< 0 means all hardware threads
  /// Rays per packet and Embree's coherence flag, for each kind of ray. If no flag is given for a
  /// kind of ray, the flag of the recorded rays is used.
  std::array<uint32_t, kRayKinds> width{16, 16, 16};
  std::array<std::optional<bool>, kRayKinds> coherent{};
  std::array<bool, kRayKinds> wanted{true, true, true};  ///< kinds to trace
};

/// Result of a replay. `hits` counts the rays that hit something or are blocked.
struct ReplayTimes {
  double wall_s = 0;
  std::array<double, kRayKinds> thread_s{};
  std::array<uint64_t, kRayKinds> rays{}, hits{};
};

/// Recorded rays of one render of a scene.
///
/// Contract: while rays are recorded, the contract of RayRecorder applies. After the render, one
/// thread at a time may call replay().
class RayRecording final : public RayRecorder {
 public:
  /// Records up to `byte_limit` bytes of rays. Throws Error for scenes with partly present
  /// surfaces, which Embree alone would treat as opaque.
  RayRecording(std::shared_ptr<const Scene> scene, uint64_t byte_limit);
  ~RayRecording() override;

  void closest(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) override;
  void occluded(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) override;

  uint64_t bytes() const { return bytes_; }
  size_t waves() const { return waves_.size(); }
  /// Number of recorded closest-hit rays at each path depth; shadow_rays_at() counts shadow rays.
  const std::vector<uint64_t>& rays_at() const { return rays_at_; }
  const std::vector<uint64_t>& shadow_rays_at() const { return shadow_rays_at_; }

  /// Traces all rays again in recorded order. Threads process waves in the order in which the waves
  /// were started in the render. Builds the BVH on first use.
  ReplayTimes replay(const Replay& how);

 private:
  /// Rays of one wave stage.
  struct Stage {
    RayKind kind;
    bool has_tfar, has_time, coherent;
    size_t size;
    SoaBlock columns;
    RaySpan rays() const;
  };
  using RecordedWave = std::vector<Stage>;
  struct Buffers;

  void keep(const void* wave, const RaySpan& rays, RayKind kind, uint32_t depth, bool coherent);
  void trace(const Stage& stage, const Replay& how, Buffers& buffers, ReplayTimes& times) const;

  std::shared_ptr<const Scene> scene_;
  uint64_t byte_limit_, bytes_ = 0;
  std::mutex mutex_;
  std::map<const void*, RecordedWave*> current_;
  std::vector<std::unique_ptr<RecordedWave>> waves_;
  std::vector<uint64_t> rays_at_, shadow_rays_at_;
  std::unique_ptr<BareTraversal> bare_;
  std::unique_ptr<EmbreeAccelerator> accel_;
};

}  // namespace wavecomb
