// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/pass_loop.h"

#include <algorithm>
#include <numeric>

#include "wavecomb/core/error.h"
#include "wavecomb/render/passes/adaptive.h"
#include "wavecomb/render/passes/pixel_order.h"

namespace wavecomb {
namespace {

PassRules pass_rules(const RenderPlan& plan) {
  const Settings& settings = plan.settings;
  return {.spp = settings.spp,
          .min_spp = settings.min_spp,
          .adaptive = settings.is_adaptive(),
          .timed = settings.time_limit > 0,
          .step = plan.pass_samples,
          .progressive = settings.progressive,
          .pilot = pilot_samples(settings)};
}

}  // namespace

PassLoop::PassLoop(const RenderPlan& plan, PassState pass, Film& film, PassRunner& runner,
                   RenderCosts& costs, Watch& watch, JointPasses& joint)
    : settings_(plan.settings),
      rules_(pass_rules(plan)),
      pass_(std::move(pass)),
      film_(film),
      runner_(runner),
      costs_(costs),
      watch_(watch),
      joint_(joint),
      order_(morton_pixel_order(plan.settings.rendered())) {
  if (!pass_.allocation.counts.empty()) {
    const auto& counts = pass_.allocation.counts;
    const auto [least, most] = std::minmax_element(counts.begin(), counts.end());
    if (rules_.pilot == 0 || *least < rules_.pilot || counts.size() != film.pixel_count())
      throw Error("the counts of samples to resume from are not of such a render");
    allocation_ = {rules_.pilot, *least, *most, 0};
  }
  pass_.allocation.pilot = rules_.pilot;
  pass_.allocation.spp = rules_.spp;
  const std::vector<uint32_t> samples = film.samples();
  resumed_samples_ = std::accumulate(samples.begin(), samples.end(), uint64_t{0});
  const uint32_t target =
      rules_.adaptive ? std::max(pass_.target, next_check(0, rules_)) : rules_.spp;
  bool all_started = true;
  for (const uint32_t pixel : order_) {
    const size_t i = film.index(pixel & 0xffffu, pixel >> 16);
    const bool active = pass_.is_active(i);
    active_pixels_ += active ? 1 : 0;
    expected_samples_ += active ? std::max(samples[i], pass_.allocation.at(i, target)) : samples[i];
    all_started &= samples[i] > 0;
  }
  may_be_cut_ = all_started;
  // A checkpoint of a render without a time limit may contain a long unfinished pass. If a timed
  // render continues this pass, each pixel gets one sample first.
  if (rules_.timed && !all_started) pass_.target = std::min(pass_.target, 1u);
  if (!rules_.adaptive || pass_.light_target == 0)
    pass_.light_target = joint_.samples(pass_.target);
}

void PassLoop::run() {
  for (;;) {
    const std::vector<uint32_t> samples = film_.samples();
    const PassPlan plan = plan_pass(order_, film_.window(), samples, pass_);
    const PassPlan joint_plan = joint_.plan(film_, pass_.light_target);
    if (plan.batches.empty() && joint_plan.batches.empty()) {
      if (!begin_pass(samples)) return;
      continue;
    }
    const uint64_t before = runner_.samples_done();
    const double begin = seconds();
    const auto halted = [this] { return watch_.halted() || is_past_deadline(); };
    runner_.run(plan, halted);
    if (!joint_plan.batches.empty()) {
      joint_.begin(film_);
      runner_.run(joint_plan, halted, true);
    }
    film_.update_splat_aovs();
    samples_per_s_ =
        static_cast<double>(runner_.samples_done() - before) / std::max(1e-9, seconds() - begin);
    for (uint32_t i = 0; i < runner_.threads(); ++i)
      if (CostTracker* costs = runner_.integrator().worker(i).costs) costs_.take(*costs);
    costs_.merge();
    if (watch_.stopped() || is_past_deadline()) return;
    watch_.rest();
  }
}

bool PassLoop::begin_pass(std::span<const uint32_t> samples) {
  const uint32_t done = pass_.target, light_done = pass_.light_target;
  if (done > 0 && film_.has_error()) {
    const ErrorMap map = measure_error(film_);
    error_ = map.mean_relative;
    if (rules_.adaptive && is_check(done, rules_)) {
      AdaptiveCheck check = check_adaptive(map, film_.window(), samples, settings_, rules_);
      pass_.active = std::move(check.active);
      active_pixels_ = check.active_count;
      expected_samples_ = check.expected_samples;
    }
  }
  if (rules_.pilot > 0 && done == rules_.pilot && pass_.allocation.counts.empty())
    pass_.allocation = allocate_samples(film_, settings_, allocation_);
  const uint64_t active = active_pixels_;
  if (active == 0 || (done >= rules_.spp && !rules_.adaptive)) return false;
  const TimeLeft left{settings_.time_limit - seconds(), samples_per_s_};
  // If a pixel becomes active again, it gets enough samples to reach the sample count of the other
  // active pixels.
  pass_.target = done >= rules_.spp ? rules_.spp : next_target(done, rules_, left, active);
  pass_.light_target = rules_.adaptive && done > 0
                           ? joint_.adaptive_samples(film_, pass_, done, light_done, active)
                           : joint_.samples(pass_.target);
  may_be_cut_ = may_be_cut_ || done > 0;
  ++passes_;
  return true;
}

bool PassLoop::is_past_deadline() const {
  return rules_.timed && may_be_cut_ && seconds() >= settings_.time_limit;
}

double PassLoop::seconds() const {
  return seconds_since(start_);
}

RenderStatus PassLoop::status() const {
  RenderStatus s;
  s.resumed_samples = resumed_samples_;
  s.samples_done = resumed_samples_ + runner_.samples_done();
  s.samples_total = std::max(expected_samples_.load(), s.samples_done);
  s.rays = runner_.rays_done();
  s.passes = passes_;
  s.active_pixels = active_pixels_;
  s.seconds = seconds();
  s.error = error_;
  if (rules_.timed && s.seconds > 0) {
    const double left = std::max(0.0, settings_.time_limit - s.seconds);
    const double more = static_cast<double>(runner_.samples_done()) * left / s.seconds;
    s.samples_total = std::min(s.samples_total, s.samples_done + static_cast<uint64_t>(more));
  }
  return s;
}

}  // namespace wavecomb
