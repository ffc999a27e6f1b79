// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/training_cache.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {
namespace {

/// Version of the packed format. Increase this version when the format changes.
constexpr uint32_t kCacheFormat = 5;

class ByteWriter {
 public:
  template <typename T>
  void value(const T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    append(&v, sizeof(T));
  }
  template <typename T>
  void row(const std::vector<T>& values) {
    value(uint64_t{values.size()});
    append(values.data(), values.size() * sizeof(T));
  }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  void append(const void* data, size_t size) {
    const auto* from = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), from, from + size);
  }

  std::vector<std::byte> bytes_;
};

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : left_(bytes) {}

  template <typename T>
  void value(T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    take(&v, sizeof(T));
  }
  template <typename T>
  void row(std::vector<T>& values) {
    uint64_t count = 0;
    value(count);
    check(count <= left_.size() / sizeof(T));
    values.resize(count);
    take(values.data(), count * sizeof(T));
  }
  /// Throws Error if any bytes have not been read.
  void end() const { check(left_.empty()); }

 private:
  static void check(bool is_symbol) {
    if (!is_symbol)
      throw Error("what was learned before is cut, or is of another build; start anew");
  }
  void take(void* to, size_t size) {
    check(size <= left_.size());
    if (size > 0) std::memcpy(to, left_.data(), size);
    left_ = left_.subspan(size);
  }

  std::span<const std::byte> left_;
};

/// Writes or reads the statistics.
template <typename Archive, typename Statistics>
void pass_statistics(Archive& archive, Statistics& s) {
  archive.value(s.facts.records);
  archive.value(s.facts.cells);
  archive.value(s.facts.regions);
  archive.value(s.facts.guided_regions);
  archive.value(s.facts.guided_share);
  archive.value(s.facts.moment_ratio);
  archive.value(s.paths);
  archive.value(s.rounds);
  archive.value(s.field_bytes);
  archive.value(s.gain);
  archive.value(s.survival);
}

template <typename Archive, typename Parts>
void pass_parts(Archive& archive, Parts& parts) {
  archive.row(parts.entries);
  archive.row(parts.cells);
  archive.row(parts.tables);
  archive.row(parts.spheres);
  archive.row(parts.bsdf_share);
  archive.row(parts.material_share);
  archive.row(parts.survival);
}

/// Serialized form of a TransportChoice.
struct PackedChoice {
  uint8_t is_there = 0, uses_light = 0, merges = 0;
  int32_t share = 0;  ///< exponent of LightPathShare
  CameraPathPart camera;
  double gain = 0;
};

template <typename Archive, typename Choice>
void pass_choice(Archive& archive, Choice& choice) {
  archive.value(choice.is_there);
  archive.value(choice.uses_light);
  archive.value(choice.merges);
  archive.value(choice.share);
  archive.value(choice.camera);
  archive.value(choice.gain);
}

/// Reads the format and the choice of the transport.
PackedChoice read_choice(ByteReader& reader) {
  uint32_t format = 0;
  reader.value(format);
  if (format != kCacheFormat)
    throw Error("what was learned before is of another version; resume with that, or start anew");
  PackedChoice choice;
  pass_choice(reader, choice);
  return choice;
}

/// Returns a copy of the settings in which all settings that do not affect training have their
/// defaults.
Settings training_settings(Settings settings) {
  const Settings fresh;
  settings.seed = fresh.seed;
  settings.region.reset();
  settings.crop = fresh.crop;
  settings.aovs = fresh.aovs;
  settings.light_groups.clear();
  settings.expressions.clear();
  settings.error = fresh.error;
  settings.wave_size = fresh.wave_size;
  settings.lanes = fresh.lanes;
  settings.policy = fresh.policy;
  settings.materialize = fresh.materialize;
  settings.ray_order = fresh.ray_order;
  settings.shadow_order = fresh.shadow_order;
  settings.traversal = fresh.traversal;
  settings.cost_weight = fresh.cost_weight;
  settings.progressive = fresh.progressive;
  // With a time limit, the number of training paths depends on the number of threads.
  if (!(settings.time_limit > 0)) settings.threads = fresh.threads;
  return settings;
}

/// Returns a copy of the settings in which all settings that do not affect the choice of the
/// transport have their defaults. AOVs, light path expressions and errors of pixels are not reset,
/// since some exclude light paths or merging.
Settings choice_settings(const Settings& settings) {
  Settings kept = training_settings(settings);
  kept.aovs = settings.aovs;
  kept.expressions = settings.expressions;
  kept.error = settings.error;
  return kept;
}

}  // namespace

std::vector<std::byte> packed_training(const GuidingTraining& training,
                                       const std::optional<TransportChoice>& transport) {
  if (training.statistics.paths == 0 && !transport) return {};
  ByteWriter writer;
  writer.value(kCacheFormat);
  PackedChoice choice;
  if (transport)
    choice = {1,
              uint8_t{transport->transport == Transport::kLight},
              uint8_t{transport->merges},
              transport->share.exponent,
              transport->camera,
              transport->gain};
  pass_choice(writer, choice);
  writer.value(uint8_t{training.statistics.paths > 0});
  if (training.statistics.paths == 0) return writer.take();
  pass_statistics(writer, training.statistics);
  writer.value(static_cast<uint8_t>(training.field ? 1 : 0));
  if (training.field) {
    pass_parts(writer, training.field->parts());
    writer.row(training.tiles ? training.tiles->inverse_scales() : std::vector<double>());
  }
  return writer.take();
}

GuidingTraining unpacked_training(std::span<const std::byte> bytes, const Scene& scene,
                                  const Settings& settings) {
  ByteReader reader(bytes);
  read_choice(reader);
  GuidingTraining out;
  uint8_t is_trained = 0;
  reader.value(is_trained);
  if (is_trained == 0) {
    reader.end();
    return out;
  }
  pass_statistics(reader, out.statistics);
  uint8_t has_field = 0;
  reader.value(has_field);
  if (has_field != 0) {
    GuidingFieldArrays parts;
    std::vector<double> inverse_scales;
    pass_parts(reader, parts);
    reader.row(inverse_scales);
    out.field = std::make_shared<const GuidingField>(
        grid_of(scene), std::move(parts), out.statistics.facts, scene.materials().size());
    out.tiles.emplace(settings, std::move(inverse_scales));
  }
  reader.end();
  out.statistics.used = out.field != nullptr;
  out.statistics.is_reused = true;
  return out;
}

TransportChoice unpacked_transport(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  const PackedChoice packed = read_choice(reader);
  TransportChoice choice;
  choice.why = packed.is_there != 0 ? "by an earlier render" : "as in an earlier render";
  if (packed.is_there == 0) return choice;
  if (packed.uses_light != 0) {
    choice.transport = Transport::kLight;
    choice.share.exponent = std::clamp(packed.share, -8, 8);
    choice.merges = packed.merges != 0;
    const auto part = [](double x) { return x >= 0 && x <= 1 ? x : 1; };
    choice.camera = {part(packed.camera.error), part(packed.camera.cost)};
  }
  choice.gain = std::isfinite(packed.gain) ? std::max(0.0, packed.gain) : 0;
  return choice;
}

std::optional<TransportChoice> TransportChoiceCache::find(const std::shared_ptr<const Scene>& scene,
                                                          const Settings& settings) const {
  if (!last_ || scene_.lock() != scene || settings_ != choice_settings(settings)) return {};
  TransportChoice choice = *last_;
  choice.seconds = 0;
  return choice;
}

void TransportChoiceCache::keep(const std::shared_ptr<const Scene>& scene, const Settings& settings,
                                const TransportChoice& choice) {
  last_ = choice;
  settings_ = choice_settings(settings);
  scene_ = scene;
}

std::shared_ptr<const GuidingTraining> GuidingTrainingCache::get(
    const std::shared_ptr<const Scene>& scene, const TrainingInput& render,
    const std::function<bool()>& stopped) {
  const Settings settings = training_settings(*render.context.settings);
  const float light_share = render.context.joint.share;
  if (last_ && scene_.lock() == scene && settings_ == settings && camera_ == render.camera &&
      light_share_ == light_share) {
    if (!last_->statistics.is_reused) {
      auto reused = std::make_shared<GuidingTraining>(*last_);
      reused->statistics.is_reused = true;
      reused->statistics.seconds = 0;
      last_ = std::move(reused);
    }
    return last_;
  }
  auto trained = std::make_shared<const GuidingTraining>(train_guiding(render, stopped));
  if (trained->statistics.paths > 0 && !stopped()) {
    last_ = trained;
    settings_ = settings;
    camera_ = render.camera;
    light_share_ = light_share;
    scene_ = scene;
  }
  return trained;
}

}  // namespace wavecomb
