// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/guide_training.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "wavecomb/core/clock.h"
#include "wavecomb/learn/guide.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/pass_runner.h"
#include "wavecomb/render/picture_tiles.h"
#include "wavecomb/render/pixel_order.h"

namespace wavecomb {
namespace {

/// Share of a render's samples that training may take, and its most and least paths.
constexpr uint64_t kShare = 8, kMostPaths = 700'000, kLeastPaths = 16'384;
constexpr uint32_t kRounds = 3;
/// Vertices of a path that teach.
constexpr uint32_t kVertices = 6;

/// Gathers what the bounces of a round teach, each path's in its own place.
class BounceReader final : public HistoryReader {
 public:
  /// Paths of `pixels`, `samples` each from sample `first` on. `scale`: of the picture at a pixel.
  BounceReader(std::span<const uint32_t> pixels, uint32_t first, uint32_t samples,
               const GuideView& guide, const PictureTiles* tiles)
      : pixels_(pixels), first_(first), samples_(samples), guide_(guide), tiles_(tiles) {
    const size_t paths = pixels.size() * samples;
    records_.resize(paths * kVertices);
    counts_.assign(paths, 0);
    luminance_.assign(paths, 0.f);
  }

  uint32_t most() const override { return kVertices; }

  void ended(const PathHistory& history, const float* radiance, const WaveTask& task) override {
    for (uint32_t slot = 0; slot < task.path_count(); ++slot) {
      const auto pixel = static_cast<size_t>(task.pixels - pixels_.data()) + slot / task.samples;
      const size_t path = pixel * samples_ + (task.first_sample - first_) + slot % task.samples;
      const Color<float> end = load_row<RadianceRow, float>(radiance, slot, true).sum;
      luminance_[path] = luminance(end);
      const float inverse_scale = tiles_ && tiles_->is_lit()
                                      ? static_cast<float>(tiles_->inverse_scale(pixels_[pixel]))
                                      : 1.f;
      Color<float> throughput(1.f);
      for (uint32_t j = 0; j < history.count(slot); ++j) {
        const HistoryRow<float> v = history.vertex(slot, j);
        const float arrived = luminance(throughput);
        const float brought = luminance(end - v.radiance);
        throughput = v.throughput;
        const float value = brought / arrived;
        if (!(v.pdf > 0) || !(value > 0) || !std::isfinite(value)) continue;
        add(path, v, value, arrived * inverse_scale);
      }
    }
  }

  /// Appends the records, path by path.
  void append_to(std::vector<TrainingRecord>& all) const {
    for (size_t path = 0; path < counts_.size(); ++path) {
      const auto from = records_.begin() + static_cast<std::ptrdiff_t>(path * kVertices);
      all.insert(all.end(), from, from + counts_[path]);
    }
  }
  std::span<const float> luminances() const { return luminance_; }

 private:
  void add(size_t path, const HistoryRow<float>& v, float value, float weight) {
    TrainingRecord& r = records_[path * kVertices + counts_[path]++];
    const Vec2<float> at = octahedral_point<float>(v.wi);
    const auto bin = [](float x) {
      return std::min(static_cast<uint32_t>(x * kGuideSide), kGuideSide - 1);
    };
    r = {{v.p.x, v.p.y, v.p.z},
         v.material,
         static_cast<uint8_t>(v.axis),
         static_cast<uint8_t>(bin(at.y) * kGuideSide + bin(at.x)),
         value,
         v.pdf,
         v.bsdf_pdf,
         0.f,
         weight};
    const GuidePlace<float> place = find_guide<float>(guide_, v.p, v.axis, v.material, true);
    if (place.region != kNoGuideRegion) r.guide_pdf = guide_pdf<float>(guide_, place, v.wi, true);
  }

  std::span<const uint32_t> pixels_;
  uint32_t first_, samples_;
  const GuideView& guide_;
  const PictureTiles* tiles_;
  std::vector<TrainingRecord> records_;  ///< kVertices of each path
  std::vector<uint8_t> counts_;
  std::vector<float> luminance_;
};

/// `count` of the picture's pixels, evenly spread, in an order that keeps neighbours together.
std::vector<uint32_t> some_pixels(const std::vector<uint32_t>& order, uint64_t count) {
  if (count >= order.size()) return order;
  std::vector<uint32_t> pixels(count);
  for (uint64_t i = 0; i < count; ++i) pixels[i] = order[i * order.size() / count];
  return pixels;
}

}  // namespace

GuideTraining train_guide(const WaveContext& render, const Scene& scene, const TrainingMeans& means,
                          const std::function<bool()>& stopped) {
  const Clock::time_point start = Clock::now();
  GuideTraining out;
  Settings settings = *render.settings;
  const uint64_t pixel_count = uint64_t{settings.width} * settings.height;
  const uint64_t budget = std::min(pixel_count * settings.spp / kShare, kMostPaths);
  if (settings.guiding == Guiding::kOff || settings.max_depth == 0 || budget < kLeastPaths)
    return out;
  settings.region.reset();
  settings.crop = false;
  settings.aovs = {};
  settings.seed = 0x2545f491u;

  const AovTables aovs(scene, settings);
  Film film(1, 1, aovs.layout);
  WaveContext context = render;
  context.settings = &settings;
  context.film = &film;
  context.aovs = nullptr;
  context.recorder = nullptr;
  context.discards = true;
  const Bounds& b = scene.bounds();
  const GuideGrid grid({b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z});
  auto field = std::make_unique<const GuideField>(grid);
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, settings.width, settings.height});
  std::optional<PictureTiles> tiles;
  std::vector<TrainingRecord> records;
  uint32_t first_sample = 0;
  for (uint32_t round = 0; round < kRounds; ++round) {
    const uint64_t wanted = (budget << round) / ((1u << kRounds) - 1);
    const auto samples = static_cast<uint32_t>(std::max<uint64_t>(1, wanted / order.size()));
    PassPlan plan;
    plan.pixels = some_pixels(order, wanted);
    plan.batches.push_back({0, plan.pixels.size(), first_sample, samples});
    const GuideView view = field->view();
    BounceReader reader(plan.pixels, first_sample, samples, view, tiles ? &*tiles : nullptr);
    context.guide = &view;
    context.histories = &reader;
    const std::unique_ptr<Integrator> integrator =
        make_integrator(settings.integrator, context, means.lanes, means.threads, means.wave_size);
    PassRunner(*integrator, means.threads, means.wave_size).run(plan, stopped);
    if (stopped()) return {};
    first_sample += samples;
    out.paths += plan.samples();
    ++out.rounds;
    if (!tiles && samples == 1) tiles.emplace(settings, plan.pixels, reader.luminances());
    reader.append_to(records);
    field = std::make_unique<const GuideField>(grid, records, scene.materials().size(), round == 0,
                                               size_t{settings.learn_memory_mb} << 20);
    out.facts = field->facts();
    if (getenv("GDBG"))
      fprintf(stderr,
              "round %u paths %llu records %llu cells %u regions %u guided %u share %.3f moment "
              "%.3f bytes %zu s %.3f\n",
              round, (unsigned long long)plan.samples(), (unsigned long long)out.facts.records,
              out.facts.cells, out.facts.regions, out.facts.guided_regions, out.facts.guided_share,
              out.facts.moment_ratio, field->bytes(), seconds_since(start));
  }
  if (field->facts().guided_regions > 0) out.field = std::move(field);
  out.seconds = seconds_since(start);
  return out;
}

}  // namespace wavecomb
