// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <new>

#include "wave_testing.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define WAVECOMB_COUNTS_ALLOCATIONS 1

namespace {
/// Number of malloc calls of this thread; operator new also calls malloc.
thread_local uint64_t allocations = 0;
}  // namespace

// glibc's original allocation functions, whose public names this program overrides.
extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);

void* malloc(size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* p, size_t size) {
  ++allocations;
  return __libc_realloc(p, size);
}
void* memalign(size_t alignment, size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** p, size_t alignment, size_t size) {
  ++allocations;
  *p = __libc_memalign(alignment, size);
  return *p ? 0 : ENOMEM;
}
void free(void* p) {
  __libc_free(p);
}
}
#endif

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;

#if defined(WAVECOMB_COUNTS_ALLOCATIONS)

TEST(Allocation, IsCounted) {
  // Calls operator new by name, because compilers may omit allocations of new-expressions and
  // containers.
  const uint64_t before = allocations;
  void* volatile made = ::operator new(400);
  EXPECT_GE(allocations, before + 1);
  void* volatile p = std::aligned_alloc(64, 640);
  EXPECT_GE(allocations, before + 2);
  std::free(p);
  ::operator delete(made);
}

/// Expects that a wave which has run once does not allocate in its second run.
void expect_no_allocation(const ScenePtr& scene, WaveCase c, const std::string& what,
                          HistoryReader* histories = nullptr) {
  c.settings.width = c.settings.height = 16;
  c.settings.spp = 4;
  WaveRun run(scene, c, nullptr, histories);
  run.all(1024);  // warm-up
  const uint64_t before = allocations;
  run.all(1024);
  EXPECT_EQ(allocations - before, 0u) << c.lanes << " lanes, " << what;
}

TEST(Allocation, NoneInAWave) {
  for (const auto& scene : {cornell(), mixed(), emissive_meshes(), presence()}) {
    for (const uint32_t lanes : lane_widths()) {
      for (const std::string& policy : policy_names()) {
        for (const Materialize materialize : {Materialize::kOff, Materialize::kOn}) {
          WaveCase c;
          c.settings.policy = policy;
          c.settings.materialize = materialize;
          if (materialize == Materialize::kOn)
            c.settings.ray_order = c.settings.shadow_order = RayOrder::kAuto;
          c.lanes = lanes;
          expect_no_allocation(scene, c, "policy " + policy);
        }
      }
    }
  }
}

TEST(Allocation, NoneForAovs) {
  for (const auto& scene : {mixed(), emissive_meshes()})
    for (const uint32_t lanes : lane_widths()) {
      WaveCase c;
      c.settings.aovs.bits = AovSet::kAll;
      c.lanes = lanes;
      expect_no_allocation(scene, c, "all AOVs");
    }
}

TEST(Allocation, NoneForHistories) {
  struct Counter final : HistoryReader {
    uint64_t vertices = 0;
    uint32_t most() const override { return 5; }
    void ended(const PathHistory& history, const float* /*radiance*/,
               const WaveTask& task) override {
      for (uint32_t slot = 0; slot < task.path_count(); ++slot) vertices += history.count(slot);
    }
  };
  for (const uint32_t lanes : lane_widths()) {
    Counter counter;
    WaveCase c;
    c.lanes = lanes;
    expect_no_allocation(mixed(), c, "histories", &counter);
    EXPECT_GT(counter.vertices, 0u);
  }
}

TEST(Allocation, NoneToOrderRays) {
  const ScenePtr scene = mixed();
  for (const uint32_t lanes : lane_widths())
    for (const RayOrder order :
         {RayOrder::kSlot, RayOrder::kMorton, RayOrder::kMortonOctant, RayOrder::kDirection}) {
      WaveCase c;
      c.settings.ray_order = c.settings.shadow_order = order;
      c.lanes = lanes;
      expect_no_allocation(scene, c, "ray order " + std::to_string(static_cast<int>(order)));
    }
}

#endif

}  // namespace
}  // namespace wavecomb
