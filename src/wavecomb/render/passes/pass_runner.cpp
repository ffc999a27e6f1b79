// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/pass_runner.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "wavecomb/core/denormals.h"
#include "wavecomb/core/task_order.h"
#include "wavecomb/path/statistics.h"

namespace wavecomb {

std::vector<WaveGroup> wave_groups(const PassPlan& plan, uint32_t wave_size, uint32_t threads) {
  std::vector<WaveGroup> groups;
  // Near the end of a render, a few pixels may remain that still need many samples. Distribute
  // these pixels over all workers.
  const size_t most = (plan.pixels.size() + size_t{threads} * 4 - 1) / (size_t{threads} * 4);
  for (const PassBatch& batch : plan.batches) {
    const size_t fill = std::max(1u, wave_size / std::min(batch.samples, wave_size));
    const auto count = static_cast<uint32_t>(std::max<size_t>(1, std::min(fill, most)));
    const uint32_t wave_samples = std::min(batch.samples, wave_size / count);
    for (size_t p = batch.begin; p < batch.end; p += count)
      groups.push_back({plan.pixels.data() + p,
                        static_cast<uint32_t>(std::min<size_t>(count, batch.end - p)),
                        batch.first_sample, batch.samples, wave_samples});
  }
  return groups;
}

PassRunner::PassRunner(Integrator& integrator, uint32_t threads, uint32_t wave_size)
    : integrator_(integrator), wave_size_(wave_size), workers_(threads) {}

void PassRunner::run(const PassPlan& plan, const std::function<bool()>& halted, bool joint) {
  const std::vector<WaveGroup> groups = wave_groups(plan, wave_size_, threads());
  std::vector<float> group_s(groups.size());
  const auto run_groups = [&](const tbb::blocked_range<size_t>& range) {
    for (size_t g = range.begin(); g != range.end(); ++g) {
      const WaveGroup& group = groups[g];
      const Clock::time_point start = Clock::now();
      for (uint32_t done = 0; done < group.samples && !halted(); done += group.wave_samples)
        run_wave({group.pixels, group.pixel_count, group.first_sample + done,
                  std::min(group.wave_samples, group.samples - done), joint});
      group_s[g] = static_cast<float>(seconds_since(start));
    }
  };
  integrator_.begin_pass();
  const TaskOrder order;
  tbb::parallel_for(tbb::blocked_range<size_t>(0, groups.size(), 1), order.around(run_groups),
                    tbb::simple_partitioner());
  order.join();
  work_distribution_.add_pass(group_s);
  integrator_.end_pass();
}

void PassRunner::run_wave(const WaveTask& task) {
  const auto worker = static_cast<size_t>(tbb::this_task_arena::current_thread_index());
  const WorkerOrder in_order(&workers_[worker]);
  const DenormalsOff denormals_off;
  const auto rays = [&]() -> uint64_t {
    const Counts* counts = integrator_.worker(worker).counts;
    return counts ? counts->rays + counts->shadow_rays : 0;
  };
  const uint64_t before = rays();
  integrator_.run(worker, task);
  rays_ += rays() - before;
  if (task.joint) return;
  if (samples_.fetch_add(task.path_count()) == 0) first_samples_s_ = seconds_since(start_);
}

}  // namespace wavecomb
