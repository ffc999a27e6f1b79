// SPDX-License-Identifier: Apache-2.0
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <tbb/version.h>

#include "bind.h"
#include "wavecomb/core/error.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/schedule/policy.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

/// The names of an enum's values, for attributes that are strings in Python.
template <typename Enum>
struct Names {
  const char* option;
  std::vector<std::pair<const char*, Enum>> values;

  const char* name(Enum e) const {
    for (const auto& [text, value] : values)
      if (value == e) return text;
    return "";
  }
  Enum parse(const std::string& text) const {
    std::string list;
    for (const auto& [name, value] : values) {
      if (text == name) return value;
      list += (list.empty() ? "" : ", ") + std::string(name);
    }
    throw Error(std::string(option) + " is '" + text + "'; it must be one of " + list);
  }
};

const Names<SamplerKind> kSamplers{
    "sampler", {{"sobol", SamplerKind::kSobol}, {"independent", SamplerKind::kIndependent}}};
const Names<FilterKind> kFilters{"filter",
                                 {{"box", FilterKind::kBox},
                                  {"gaussian", FilterKind::kGaussian},
                                  {"blackman-harris", FilterKind::kBlackmanHarris}}};
const Names<RouletteKind> kRoulettes{
    "roulette", {{"off", RouletteKind::kOff}, {"throughput", RouletteKind::kThroughput}}};
const Names<IntegratorKind> kIntegrators{
    "integrator",
    {{"wavefront", IntegratorKind::kWavefront}, {"reference", IntegratorKind::kReference}}};
const Names<Materialize> kMaterialize{
    "materialize",
    {{"auto", Materialize::kAuto}, {"on", Materialize::kOn}, {"off", Materialize::kOff}}};
const Names<Traversal> kTraversals{
    "traversal", {{"packets", Traversal::kPackets}, {"single", Traversal::kSingle}}};
const Names<bool> kFresnel{"fresnel", {{"exact", false}, {"schlick", true}}};

template <typename Class, typename Enum>
void def_enum(Class& c, const char* attribute, Enum Settings::* member, const Names<Enum>& names) {
  c.def_prop_rw(
      attribute, [member, &names](const Settings& s) { return std::string(names.name(s.*member)); },
      [member, &names](Settings& s, const std::string& text) { s.*member = names.parse(text); });
}

constexpr const char* kAttributes[] = {
    "width",           "height",       "spp",      "max_depth",      "seed",           "sampler",
    "filter",          "filter_width", "roulette", "roulette_depth", "clamp_indirect", "fresnel",
    "cosine_sampling", "integrator",   "threads",  "wave_size",      "lanes",          "traversal",
    "policy",          "materialize"};

nb::dict to_dict(nb::handle settings) {
  nb::dict d;
  for (const char* name : kAttributes) d[name] = nb::getattr(settings, name);
  return d;
}

/// A picture with the figures of its render.
struct Result {
  Picture picture;
  RenderStatistics statistics;
  nb::object settings;
};

template <typename T>
auto image(nb::handle owner, const std::vector<T>& values, const Picture& p, size_t channels) {
  const size_t shape[3] = {p.height, p.width, channels};
  return nb::ndarray<nb::numpy, const T>(values.data(), channels == 1 ? 2 : 3, shape, owner);
}

nb::dict statistics_dict(const Result& r) {
  const RenderStatistics& s = r.statistics;
  nb::dict d, seconds, phases, counts, memory;
  d["settings"] = r.settings;
  seconds["build"] = s.build_s;
  seconds["render"] = s.render_s;
  d["seconds"] = seconds;
  for (const auto& [name, value] : s.phases_s) phases[name.c_str()] = value;
  d["phases_s"] = phases;
  counts["samples"] = s.samples;
  counts["rays"] = s.rays;
  counts["shadow_rays"] = s.shadow_rays;
  counts["records"] = s.records;
  counts["packets"] = s.packets;
  counts["packet_lanes"] = s.packet_lanes;
  d["counts"] = counts;
  const auto rate = [&](uint64_t n) {
    return s.render_s > 0 ? static_cast<double>(n) / s.render_s : 0.0;
  };
  d["samples_per_s"] = rate(s.samples);
  d["rays_per_s"] = rate(s.rays + s.shadow_rays);
  d["lane_utilisation"] = s.packet_lanes > 0
                              ? static_cast<double>(s.records) / static_cast<double>(s.packet_lanes)
                              : 1.0;
  d["threads"] = s.threads;
  d["wave_size"] = s.wave_size;
  d["lanes"] = s.lanes;
  memory["accelerator"] = s.accelerator_bytes;
  memory["waves"] = s.wave_bytes;
  d["memory_bytes"] = memory;
  d["peak_rss_bytes"] = s.peak_rss_bytes;
  d["cancelled"] = s.cancelled;
  return d;
}

Result render(const std::shared_ptr<const Scene>& scene, nb::handle settings_object,
              const nb::object& progress) {
  const Settings settings = nb::cast<Settings>(settings_object);
  Result result;
  result.settings = to_dict(settings_object);
  ProgressCallback callback = [&](uint64_t done, uint64_t total) {
    const nb::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
    if (progress.is_none()) return true;
    const nb::object go_on = progress(done, total);
    return go_on.is_none() || nb::cast<bool>(go_on);
  };
  {
    const nb::gil_scoped_release release;
    settings.check();
    WavefrontRenderer renderer(scene, settings.threads);
    result.picture = renderer.render(settings, callback);
    result.statistics = renderer.statistics();
  }
  return result;
}

}  // namespace

void bind_render(nb::module_& m) {
  nb::class_<Settings> c(m, "Settings");
  c.def("__init__", [](nb::handle_t<Settings> self, const nb::kwargs& kwargs) {
    new (nb::inst_ptr<Settings>(self)) Settings();
    nb::inst_mark_ready(self);
    for (const auto& [key, value] : kwargs) {
      const auto name = nb::cast<std::string>(key);
      if (std::find_if(std::begin(kAttributes), std::end(kAttributes),
                       [&](const char* a) { return name == a; }) == std::end(kAttributes))
        throw Error("setting '" + name + "' is not known");
      nb::setattr(self, name.c_str(), value);
    }
  });
  c.def_rw("width", &Settings::width)
      .def_rw("height", &Settings::height)
      .def_rw("spp", &Settings::spp)
      .def_rw("max_depth", &Settings::max_depth)
      .def_rw("seed", &Settings::seed)
      .def_rw("filter_width", &Settings::filter_width)
      .def_rw("roulette_depth", &Settings::roulette_depth)
      .def_rw("clamp_indirect", &Settings::clamp_indirect)
      .def_rw("cosine_sampling", &Settings::cosine_sampling)
      .def_rw("threads", &Settings::threads)
      .def_rw("wave_size", &Settings::wave_size)
      .def_rw("lanes", &Settings::lanes)
      .def_rw("policy", &Settings::policy)
      .def("check", &Settings::check)
      .def("to_dict", [](nb::handle_t<Settings> self) { return to_dict(self); });
  def_enum(c, "sampler", &Settings::sampler, kSamplers);
  def_enum(c, "filter", &Settings::filter, kFilters);
  def_enum(c, "roulette", &Settings::roulette, kRoulettes);
  def_enum(c, "integrator", &Settings::integrator, kIntegrators);
  def_enum(c, "materialize", &Settings::materialize, kMaterialize);
  def_enum(c, "traversal", &Settings::traversal, kTraversals);
  def_enum(c, "fresnel", &Settings::schlick_fresnel, kFresnel);

  nb::class_<Result>(m, "Result")
      .def_prop_ro("beauty",
                   [](nb::handle_t<Result> self) {
                     const Picture& p = nb::cast<const Result&>(self).picture;
                     return image(self, p.beauty, p, 3);
                   })
      .def_prop_ro("albedo",
                   [](nb::handle_t<Result> self) {
                     const Picture& p = nb::cast<const Result&>(self).picture;
                     return image(self, p.albedo, p, 3);
                   })
      .def_prop_ro("normal",
                   [](nb::handle_t<Result> self) {
                     const Picture& p = nb::cast<const Result&>(self).picture;
                     return image(self, p.normal, p, 3);
                   })
      .def_prop_ro("depth",
                   [](nb::handle_t<Result> self) {
                     const Picture& p = nb::cast<const Result&>(self).picture;
                     return image(self, p.depth, p, 1);
                   })
      .def_prop_ro("samples",
                   [](nb::handle_t<Result> self) {
                     const Picture& p = nb::cast<const Result&>(self).picture;
                     return image(self, p.samples, p, 1);
                   })
      .def_prop_ro("cancelled", [](const Result& r) { return r.statistics.cancelled; })
      .def_prop_ro("stats", &statistics_dict);

  m.def("render", &render, "scene"_a, "settings"_a, "progress"_a = nb::none());
  m.def("lane_widths", &lane_widths);
  m.def("policies", &policy_names);
  m.def("peak_rss_bytes", &peak_rss_bytes);
  m.def("build_info", [] {
    nb::dict d;
    d["version"] = WAVECOMB_VERSION;
    d["compiler"] = __VERSION__;
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
