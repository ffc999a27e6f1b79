// SPDX-License-Identifier: Apache-2.0
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <tbb/version.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "bind.h"
#include "rendering.h"
#include "settings.h"
#include "statistics.h"
#include "watching.h"
#include "wavecomb/core/aov.h"
#include "wavecomb/core/error.h"
#include "wavecomb/film/cryptomatte.h"
#include "wavecomb/render/inspection/learned_lookup.h"
#include "wavecomb/render/inspection/picking.h"
#include "wavecomb/render/inspection/ray_recording.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/cost_profile.h"
#include "wavecomb/render/statistics/process_memory.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"
#include "wavecomb/wave/cost_calibration.h"
#include "wavecomb/wave/ray_recorder.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

/// Scheduling policy implemented in Python. The Python method order() gets copies of the queue's
/// arrays, which it may keep or modify, and fills `keys`. Exceptions of order() end the render and
/// propagate to the caller of render().
class PythonPolicy final : public SchedulingPolicy {
 public:
  PythonPolicy(nb::object object, const Scene& scene) : object_(std::move(object)) {
    name_ = nb::cast<std::string>(object_.attr("name"));
    for (nb::handle column : nb::cast<nb::tuple>(nb::tuple(object_.attr("columns"))))
      columns_ |= column_bit(nb::cast<std::string>(column));
    for (const MaterialTraits& m : material_traits(scene)) {
      texture_.push_back(m.texture);
      texture_bytes_.push_back(m.texture_bytes);
      graph_.push_back(m.graph);
    }
  }
  ~PythonPolicy() override {
    const nb::gil_scoped_acquire gil;
    object_.reset();
  }
  PythonPolicy(const PythonPolicy&) = delete;
  PythonPolicy& operator=(const PythonPolicy&) = delete;

  std::string_view name() const override { return name_; }
  uint32_t columns() const override { return columns_; }
  bool order(const ShadingQueueView& queue, const CostSnapshot& costs,
             std::span<uint64_t> keys) const override {
    const nb::gil_scoped_acquire gil;
    nb::dict view;
    view["program"] = copy(queue.program);
    view["material"] = copy(queue.material);
    view["depth"] = queue.depth;
    if (columns_ & kThroughputColumn) view["throughput"] = copy(queue.throughput);
    if (columns_ & kPositionColumn) view["position_key"] = copy(queue.position_key);
    if (columns_ & kTextureColumn) view["texture_key"] = copy(queue.texture_key);
    view["material_texture"] = copy(std::span<const uint32_t>(texture_));
    view["material_texture_bytes"] = copy(std::span<const uint64_t>(texture_bytes_));
    view["material_graph"] = copy(std::span<const uint32_t>(graph_));
    nb::dict cost;
    cost["material_ns"] = copy(std::span<const float>(costs.material_ns));
    cost["texture_ns"] = copy(std::span<const float>(costs.texture_ns));
    cost["mean_ns"] = costs.mean_ns;
    auto* written = new uint64_t[keys.size()]();
    const nb::object out = owned(written, keys.size());
    const nb::object keep = object_.attr("order")(view, cost, out);
    std::copy_n(written, keys.size(), keys.data());
    return keep.is_none() || truth(keep);
  }

 private:
  static uint32_t column_bit(const std::string& name) {
    if (name == "throughput") return kThroughputColumn;
    if (name == "position_key") return kPositionColumn;
    if (name == "texture_key") return kTextureColumn;
    throw Error("policy column '" + name +
                "' is not known; there are throughput, position_key, texture_key");
  }
  /// Returns a NumPy array that owns `values`, which must come from new[].
  template <typename T>
  static nb::object owned(T* values, size_t n) {
    const nb::capsule owner(const_cast<std::remove_const_t<T>*>(values), [](void* p) noexcept {
      delete[] static_cast<std::remove_const_t<T>*>(p);
    });
    return nb::cast(nb::ndarray<nb::numpy, T>(values, {n}, owner));
  }
  /// Returns a read-only NumPy array with a copy of `values`.
  template <typename T>
  static nb::object copy(std::span<const T> values) {
    auto* own = new T[values.size()];
    std::copy(values.begin(), values.end(), own);
    return owned<const T>(own, values.size());
  }
  /// Converts the result of the Python method order(). Throws `Error` unless the result is a Python
  /// or NumPy bool.
  bool truth(const nb::object& result) const {
    const auto type = nb::cast<std::string>(result.type().attr("__name__"));
    if (type != "bool" && type != "bool_")
      throw Error("policy " + name_ + ": order() returned a " + type +
                  "; it must fill keys and return None, True or False");
    return nb::bool_(result).operator bool();
  }

  nb::object object_;
  std::string name_;
  uint32_t columns_ = 0;
  std::vector<uint32_t> texture_;
  std::vector<uint64_t> texture_bytes_;
  std::vector<uint32_t> graph_;
};

CostProfile to_profile(const nb::dict& d) {
  CostProfile profile;
  const auto read = [&](const char* key, auto& entries) {
    if (!d.contains(key)) return;
    for (const auto& [name, ns] : nb::cast<nb::dict>(d[key]))
      entries.emplace_back(nb::cast<std::string>(name), nb::cast<float>(ns));
  };
  read("materials", profile.materials);
  read("textures", profile.textures);
  return profile;
}

nb::dict from_profile(const CostProfile& profile) {
  nb::dict d, materials, textures;
  for (const auto& [name, ns] : profile.materials) materials[name.c_str()] = ns;
  for (const auto& [name, ns] : profile.textures) textures[name.c_str()] = ns;
  d["materials"] = materials;
  d["textures"] = textures;
  return d;
}

template <typename T>
auto image(nb::handle owner, const std::vector<T>& values, const RenderedImage& p,
           size_t channels) {
  const size_t shape[3] = {p.height, p.width, channels};
  return nb::ndarray<nb::numpy, const T>(values.data(), channels == 1 ? 2 : 3, shape, owner);
}

/// Returns a layer of the image, or None if the layer was not requested.
template <typename T>
nb::object layer(nb::handle owner, std::vector<T> RenderedImage::* values, size_t channels) {
  const RenderedImage& p = nb::cast<const Result&>(owner).image;
  if ((p.*values).empty()) return nb::none();
  return nb::cast(image(owner, p.*values, p, channels));
}

nb::dict aovs_dict(nb::handle owner) {
  const RenderedImage& p = nb::cast<const Result&>(owner).image;
  nb::dict d;
  for (const AovLayer& one : p.aovs)
    d[one.name.c_str()] = nb::cast(image(owner, one.values, p, one.channels));
  return d;
}

/// Returns the deep image as an array of sample counts (h, w) and an array of samples (n, 6).
/// Returns None if the render has no deep image.
nb::object deep_pair(nb::handle owner) {
  const RenderedImage& p = nb::cast<const Result&>(owner).image;
  if (p.deep.empty()) return nb::none();
  const size_t shape[2] = {p.deep.values.size() / DeepLayer::kChannels, DeepLayer::kChannels};
  return nb::make_tuple(image(owner, p.deep.counts, p, 1),
                        nb::ndarray<nb::numpy, const float>(p.deep.values.data(), 2, shape, owner));
}

/// Returns the table of AOVs (WAVECOMB_AOVS) as a list of dicts.
nb::list aov_table() {
  static constexpr const char* kKinds[] = {"mean",     "mean_of_hits", "nearest",
                                           "coverage", "groups",       "expressions",
                                           "sum",      "deep",         "median"};
  static_assert(std::size(kKinds) == static_cast<size_t>(AovKind::kMedian) + 1);
  static constexpr const char* kContents[] = {"light", "colour", "direction", "id",
                                              "exact", "value",  "magnitude"};
  static_assert(std::size(kContents) == static_cast<size_t>(AovContent::kMagnitude) + 1);
  static constexpr const char* kSources[] = {"hit",       "vertex", "guide", "light",
                                             "technique", "time",   "bounce"};
  static_assert(std::size(kSources) == static_cast<size_t>(AovSource::kBounce) + 1);
  nb::list rows;
  for (const AovRow& aov : kAovs) {
    // Skip light path expressions, which are requested by their text, and deep images, which are
    // separate files.
    if (aov.kind == AovKind::kExpressions || aov.kind == AovKind::kDeep) continue;
    nb::dict row;
    row["name"] = aov.name;
    row["channels"] = aov.channels;
    row["letters"] = aov.letters;
    row["content"] = kContents[static_cast<size_t>(aov.content)];
    row["kind"] = kKinds[static_cast<size_t>(aov.kind)];
    row["source"] = kSources[static_cast<size_t>(aov.source)];
    row["title"] = aov.title;
    rows.append(row);
  }
  return rows;
}

nb::dict manifests_dict(const Result& r) {
  nb::dict d;
  for (const CryptoManifest& manifest : r.image.manifests) {
    nb::dict names;
    for (const auto& [name, id] : manifest.names) names[name.c_str()] = id;
    d[manifest.level.c_str()] = names;
  }
  return d;
}

size_t image_bytes(const RenderedImage& p) {
  const auto bytes = [](const auto&... v) { return ((v.size() * sizeof(v[0])) + ...); };
  size_t sum = bytes(p.beauty, p.albedo, p.normal, p.depth, p.samples, p.error, p.variance);
  for (const AovLayer& layer : p.aovs) sum += bytes(layer.values);
  return sum + bytes(p.deep.counts, p.deep.values);
}

Result render(const std::shared_ptr<const Scene>& scene, nb::handle settings,
              const nb::object& progress, const nb::object& policy, const nb::object& costs,
              RayRecording* recorder, const nb::object& watcher, const nb::object& state,
              double interval, const nb::object& learned) {
  std::unique_ptr<WavefrontRenderer> renderer;
  return run_render(
      [&](const Settings& s) -> WavefrontRenderer& {
        renderer = std::make_unique<WavefrontRenderer>(scene, s.threads);
        return *renderer;
      },
      *scene,
      {settings, progress, policy, costs, recorder, watcher, state, interval, true, learned});
}

}  // namespace

Result run_render(const std::function<WavefrontRenderer&(const Settings&)>& renderer,
                  const Scene& scene, const RenderArguments& a) {
  const Settings settings = nb::cast<Settings>(a.settings);
  Result result;
  result.settings = settings_dict(settings);
  std::unique_ptr<PythonPolicy> python_policy;
  if (!a.policy.is_none()) {
    python_policy = std::make_unique<PythonPolicy>(a.policy, scene);
    result.settings["policy"] = std::string(python_policy->name());
  }
  if (!(a.interval > 0) || !std::isfinite(a.interval))
    throw Error("interval, in seconds between snapshots, must be finite and above 0");
  RenderOptions options = watched_by(a.progress, a.watcher, result.settings);
  options.recorder = a.recorder;
  options.policy = python_policy.get();
  options.interval_s = a.interval;
  options.wants_picture = a.wants_picture;
  CostProfile profile;
  if (!a.costs.is_none()) {
    profile = to_profile(nb::cast<nb::dict>(a.costs));
    options.profile = &profile;
  }
  nb::dict resumed;
  if (!a.state.is_none()) {
    resumed = nb::cast<nb::dict>(a.state);
    options.resume = resumed_from(resumed);
    options.learned = learned_in(resumed);
  }
  if (!a.learned.is_none() && options.learned.empty()) {
    const auto learned_bytes = nb::cast<nb::bytes>(a.learned);
    const auto* first = reinterpret_cast<const std::byte*>(learned_bytes.c_str());
    options.learned.assign(first, first + learned_bytes.size());
  }
  {
    const nb::gil_scoped_release release;
    settings.check();
    WavefrontRenderer& ready = renderer(settings);
    result.image = ready.render(settings, options);
    result.statistics = ready.statistics();
    result.profile = ready.cost_profile();
    const std::optional<TransportChoice>& choice = result.statistics.transport;
    if (result.statistics.guiding.paths > 0 || (choice && choice->gain > 0))
      result.learned = ready.packed_learned();
  }
  return result;
}

void bind_render(nb::module_& m) {
  nb::class_<Result>(m, "Result")
      .def_prop_ro("beauty",
                   [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::beauty, 3); })
      .def_prop_ro("albedo",
                   [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::albedo, 3); })
      .def_prop_ro("normal",
                   [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::normal, 3); })
      .def_prop_ro("depth",
                   [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::depth, 1); })
      .def_prop_ro(
          "samples",
          [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::samples, 1); })
      .def_prop_ro("error",
                   [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::error, 1); })
      .def_prop_ro(
          "variance",
          [](nb::handle_t<Result> self) { return layer(self, &RenderedImage::variance, 3); })
      .def_prop_ro("aovs", [](nb::handle_t<Result> self) { return aovs_dict(self); })
      .def_prop_ro("manifests", &manifests_dict)
      .def_prop_ro("deep", [](nb::handle_t<Result> self) { return deep_pair(self); })
      .def_prop_ro("cancelled", [](const Result& r) { return r.statistics.cancelled; })
      .def_prop_ro("learned",
                   [](const Result& r) { return nb::bytes(r.learned.data(), r.learned.size()); })
      .def_prop_ro("costs", [](const Result& r) { return from_profile(r.profile); })
      .def_prop_ro("stats", [](const Result& r) {
        return statistics_dict(r.statistics, r.settings, image_bytes(r.image));
      });

  m.def("render", &render, "scene"_a, "settings"_a, "progress"_a = nb::none(),
        "policy"_a = nb::none(), "costs"_a = nb::none(), "recorder"_a = nb::none(),
        "watcher"_a = nb::none(), "state"_a = nb::none(), "interval"_a = 0.1,
        "learned"_a = nb::none());
  m.def("aov_table", &aov_table);
  m.def("crypto_id", [](const std::string& name) { return crypto_id(name); });
  m.def("lane_widths", &lane_widths);
  m.def("policies", &policy_names);
  m.def("peak_rss_bytes", &peak_rss_bytes);
  m.def("give_back_memory", &release_memory);
  m.def("build_info", [] {
    nb::dict d;
    d["version"] = WAVECOMB_VERSION;
    d["compiler"] = __VERSION__;
    d["library"] = library_name();
#if defined(__AVX512F__)
    d["isa"] = "avx512";
#elif defined(__AVX2__)
    d["isa"] = "avx2";
#elif defined(__SSE4_2__)
    d["isa"] = "sse4.2";
#elif defined(__ARM_NEON)
    d["isa"] = "neon";
#else
    d["isa"] = "scalar";
#endif
    d["tbb"] = std::to_string(TBB_VERSION_MAJOR) + "." + std::to_string(TBB_VERSION_MINOR);
    return d;
  });
}
