// SPDX-License-Identifier: Apache-2.0
/// Tracing of a task by the reference integrator: pixel by pixel, and sample by sample.
#pragma once

#include "wavecomb/reference/path_tracer.h"

namespace wavecomb {

/// Traces the camera paths of a task into the film, the samples of a pixel in sample order. `Joint`
/// has the members of NoJointTracer.
template <typename Joint = NoJointTracer, typename Media>
void trace_task(const WaveContext& context, ReferenceWorker& worker, const WaveTask& task,
                const Media& media) {
  PathTracer<Media, Joint> tracer(context, worker, media);
  Film& film = *context.film;
  worker.clock.start(Phase::kGenerate);
  for (uint32_t p = 0; p < task.pixel_count; ++p) {
    const uint32_t pixel = task.pixels[p], x = pixel & 0xffffu, y = pixel >> 16;
    if (context.discards) {
      for (uint32_t s = 0; s < task.samples; ++s)
        tracer.exposed_path({task.pixels + p, 1, task.first_sample + s, 1});
      continue;
    }
    Film::Pixel sum = film.pixel(x, y);
    for (uint32_t s = 0; s < task.samples; ++s) {
      worker.clock.enter(Phase::kGenerate);
      tracer.joint().begin(pixel, task.first_sample + s);
      const auto start = worker.aovs.start_time();
      const Color<float> radiance =
          tracer.exposed_path({task.pixels + p, 1, task.first_sample + s, 1});
      worker.aovs.spread_time(1, start, [](size_t) { return 0; });
      worker.clock.enter(Phase::kResolve);
      if (film.has_error())
        film.error(x, y).add(tracer.radiance(), sum.samples, {sum.r, sum.g, sum.b});
      sum.r += radiance.x;
      sum.g += radiance.y;
      sum.b += radiance.z;
      ++sum.samples;
      if (film.has_cascades()) film.cascades().add(film.index(x, y), &radiance.x);
      worker.aovs.resolve(film.aovs(), film.index(x, y), 0, 1, tracer.radiance());
      tracer.joint().end(film.index(x, y));
    }
    film.pixel(x, y) = sum;
  }
  tracer.joint().end_task(task);
  worker.clock.stop();
}

}  // namespace wavecomb
