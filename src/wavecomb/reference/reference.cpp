// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/reference/reference.h"

#include "wavecomb/light_paths/reference/joint_tracer.h"
#include "wavecomb/medium/wave/volumes.h"
#include "wavecomb/reference/trace_task.h"
#include "wavecomb/wave/kernels/shared_kernels.h"

namespace wavecomb {

WAVECOMB_SHARED_KERNELS(extern, float);

ReferenceIntegrator::ReferenceIntegrator(const WaveContext& context, uint32_t threads)
    : context_(context) {
  for (uint32_t i = 0; i < threads; ++i)
    workers_.push_back(std::make_unique<ReferenceWorker>(context));
}
ReferenceIntegrator::~ReferenceIntegrator() = default;

WorkerView ReferenceIntegrator::worker(size_t i) const {
  return {&workers_[i]->clock, &workers_[i]->counts};
}

void ReferenceIntegrator::run(size_t i, const WaveTask& task) {
  ReferenceWorker& worker = *workers_[i];
  if (task.joint) return trace_light_task(context_, worker, task);
  if (context_.has_media())
    trace_task(context_, worker, task,
               Volumes(context_, worker.counts, worker.walks, worker.nested_media));
  else
    trace_task<LightJointTracer>(context_, worker, task, NoMedia());
}

void run_light_probes(const WaveContext& context, std::span<const uint32_t> pixels, size_t first,
                      size_t count, LightProbes& out) {
  ReferenceWorker worker(context);
  const NoMedia media;
  PathTracer tracer(context, worker, media);
  worker.clock.start(Phase::kGenerate);
  for (size_t i = first; i < first + count; ++i)
    tracer.probe(pixels[i], static_cast<uint32_t>(i), i, out);
  worker.clock.stop();
}

}  // namespace wavecomb
