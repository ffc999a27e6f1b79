// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/settings_table.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

#include "wavecomb/core/error.h"
#include "wavecomb/core/number_text.h"

namespace wavecomb {
namespace {

template <auto kMember>
using MemberType = std::remove_cvref_t<decltype(std::declval<Settings&>().*kMember)>;

template <typename T>
constexpr bool kIsOptional = false;
template <typename T>
constexpr bool kIsOptional<std::optional<T>> = true;

template <auto kMember>
SettingValue read(const Settings& settings) {
  using T = MemberType<kMember>;
  if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, std::string>)
    return settings.*kMember;
  else if constexpr (std::is_floating_point_v<T>)
    return double{settings.*kMember};
  else
    return static_cast<int64_t>(settings.*kMember);
}

template <auto kMember>
void write(Settings& settings, const SettingValue& value) {
  using T = MemberType<kMember>;
  if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, std::string>)
    settings.*kMember = std::get<T>(value);
  else if constexpr (kIsOptional<T>)
    settings.*kMember = std::holds_alternative<std::monostate>(value)
                            ? T()
                            : T(static_cast<typename T::value_type>(std::get<double>(value)));
  else if constexpr (std::is_floating_point_v<T>)
    settings.*kMember = static_cast<T>(std::get<double>(value));
  else
    settings.*kMember = static_cast<T>(std::get<int64_t>(value));
}

/// A row without limits.
template <auto kMember>
SettingInfo row(const char* name, const char* label, const char* help) {
  SettingInfo info;
  info.name = name;
  info.label = label;
  info.help = help;
  info.read = &read<kMember>;
  info.write = &write<kMember>;
  return info;
}
template <auto kMember>
SettingInfo number(const char* name, const char* label, double least, double most, const char* help,
                   const char* zero = "") {
  SettingInfo info = row<kMember>(name, label, help);
  info.least = least;
  info.most = most;
  info.zero = zero;
  return info;
}
/// A number that others decide where it is not given: `used` says by what.
template <auto kMember>
SettingInfo number_or_own(const char* name, const char* label, double least, double most,
                          const char* help, SettingValue (*used)(const Settings&)) {
  SettingInfo info;
  info.name = name;
  info.label = label;
  info.help = help;
  info.least = least;
  info.most = most;
  info.may_be_none = true;
  info.read = used;
  info.write = &write<kMember>;
  return info;
}
template <auto kMember>
SettingInfo choice(const char* name, const char* label, std::vector<SettingChoice> choices,
                   const char* help) {
  SettingInfo info = row<kMember>(name, label, help);
  info.choices = std::move(choices);
  return info;
}

std::vector<SettingChoice> ray_orders() {
  return {{"slot", "As generated: survivors keep their places."},
          {"morton", "By place of the origin."},
          {"morton-octant", "By octant of the direction, then by place of the origin."},
          {"direction", "By octant and long axes of the direction."},
          {"auto", "The quickest of the four, learned for each depth."}};
}

// Limits: a path has as many vertices at most, a pixel as many samples.
constexpr double kMostDepth = 4096, kMostSamples = 1 << 20;

SettingInfo with_steps(SettingInfo info, std::vector<double> steps, const char* zero) {
  info.steps = std::move(steps);
  info.zero = zero;
  return info;
}

/// The same setting, as one that changes the expectation.
SettingInfo in_expectation(SettingInfo info) {
  info.changes_expectation = true;
  return info;
}

/// What the picture is.
std::vector<SettingInfo> picture_settings() {
  using S = Settings;
  return {
      in_expectation(
          number<&S::width>("width", "Width", 1, kMaxSize, "Pixels of a row of the picture.")),
      in_expectation(number<&S::height>("height", "Height", 1, kMaxSize, "Rows of pixels.")),
      in_expectation(number<&S::max_depth>("max_depth", "Max depth", 0, kMostDepth,
                                           "Longest path, in scatterings.")),
      number<&S::seed>("seed", "Seed", 0, 0xffffffffu, "Of all random numbers."),
      choice<&S::sampler>("sampler", "Sampler",
                          {{"sobol", "Owen-scrambled Sobol points."},
                           {"independent", "Independent random numbers."}},
                          "Where samples lie."),
      in_expectation(choice<&S::filter>("filter", "Filter",
                                        {{"box", "Even over its width."},
                                         {"gaussian", "A bell."},
                                         {"blackman-harris", "A bell that ends smoothly."}},
                                        "How samples count for the pixels around them.")),
      in_expectation(number_or_own<&S::filter_width>(
          "filter_width", "Filter width", 0.01f, 32,
          "Full width of the filter in pixels; its own: box 1, the others 3.",
          [](const S& s) -> SettingValue { return double{s.used_filter_width()}; })),
      in_expectation(number<&S::clamp_indirect>("clamp_indirect", "Clamp indirect", 0, 1e30f,
                                                "Limit of a sample's indirect light; biased.",
                                                "off")),
      in_expectation(choice<&S::schlick_fresnel>(
          "fresnel", "Fresnel",
          {{"exact", "Fresnel's equations."}, {"schlick", "Schlick's approximation."}},
          "Reflectance of dielectrics.")),
      in_expectation(choice<&S::texture_filter>(
          "texture_filter", "Texture filter",
          {{"auto",
            "Whole where the camera looks, by one texel, chosen by its weight, after a bounce."},
           {"whole", "Whole everywhere."}},
          "How textures are filtered.")),
      row<&S::cosine_sampling>("cosine_sampling", "Cosine sampling",
                               "Samples every bounce that is not a mirror's by cosine."),
      in_expectation(row<&S::alpha>(
          "alpha", "Alpha",
          "Where the camera sees a dome or a distant light the picture is clear, with "
          "an alpha channel.")),
      row<&S::error>("error", "Errors", "Keeps errors and variances where nothing else asks."),
      in_expectation(
          number<&S::overscan>("overscan", "Overscan", 0, kMaxSize / 2,
                               "Pixels that are rendered beyond each edge of the picture.")),
      number<&S::deep_samples>("deep_samples", "Deep samples", 1, kMostDeepSamples,
                               "The most samples that a deep picture has in a pixel."),
      number<&S::deep_tolerance>("deep_tolerance", "Deep tolerance", 0, 1,
                                 "Samples of a deep picture whose depths differ by no more than "
                                 "this share of the depth are one."),
      in_expectation(row<&S::crop>("crop", "Crop",
                                   "The picture is its region alone, in memory and in files.")),
  };
}

/// How much is done for it.
std::vector<SettingInfo> work_settings() {
  using S = Settings;
  return {
      choice<&S::roulette>(
          "roulette", "Roulette",
          {{"auto", "By what is expected of it where bounces are guided, else by throughput."},
           {"off", "Paths end at the greatest depth only."},
           {"throughput", "By the light that the path still carries."},
           {"cost-aware", "By the light that it carries, over the root of what shading costs."},
           {"efficient",
            "By the light that it is expected to bring, as paths before the first pass find out."}},
          "How paths end early. Each is unbiased, but another estimate."),
      choice<&S::transport>("transport", "Transport",
                            {{"path", "From the camera alone."},
                             {"light",
                              "And as many from the lights, joined by their densities: for "
                              "caustics of small lights."},
                             {"auto",
                              "From the lights, too, where it pays, as some pixels before the "
                              "first pass find out."},
                             {"bdpt",
                              "From both, and their vertices are connected: another estimate, "
                              "not yet found to pay."}},
                            "Where paths begin."),
      choice<&S::light_aim>(
          "light_aim", "Light paths go",
          {{"off", "As lights shine, wherever that is."},
           {"on", "Mostly where some before the first pass brought light to the picture."}},
          "Where paths from lights are aimed."),
      in_expectation(
          number<&S::merge_radius>("merge_radius", "Merge within", 0, 64,
                                   "Pixels, by which caustics that are seen in mirrors or through "
                                   "glass may be blurred so that light paths find them.",
                                   "never")),
      in_expectation(choice<&S::firefly>(
          "firefly", "Fireflies",
          {{"keep", "They stay: nothing is biased."},
           {"reweight",
            "Samples count as far as others are as bright: darker where they are few. The "
            "layer unbiased has them all."}},
          "What becomes of samples much brighter than others.")),
      number<&S::roulette_depth>("roulette_depth", "From depth", 0, kMostDepth,
                                 "The first vertex at which a path may end early."),
      choice<&S::light_selection>(
          "light_selection", "Lights",
          {{"auto", "By tree where there are several to choose among, else by power."},
           {"tree", "For the place that it lights, by a tree of lights."},
           {"power", "By its power, wherever it is."}},
          "How a light is chosen to sample: for the place that it lights, or by power."),
      choice<&S::light_weights>(
          "light_weights", "Light shares",
          {{"calibrated",
            "By what it brings to the picture, as some paths before the first pass find out."},
           {"power", "By its power, wherever it is."}},
          "How often each light is chosen."),
      choice<&S::equiangular>(
          "equiangular", "Lamps in fog",
          {{"off", "Light is scattered where it is by density alone."},
           {"on",
            "And where lamps are near, in volumes that are even, as often as they are near."}},
          "How distances in even volumes are chosen."),
      choice<&S::guiding>(
          "guiding", "Guiding",
          {{"auto", "By the field where it pays, as some paths before the first pass find out."},
           {"on", "By the field wherever it knows something."},
           {"off", "By the materials alone."}},
          "How bounces choose directions: by materials, or also by where light comes from."),
      number<&S::learn_memory_mb>("learn_memory", "Learning (MB)", 1, 1u << 16,
                                  "Memory that what is learned may take, in MB."),
      number<&S::adaptive>("adaptive", "Pixel error", 0, 1e6f,
                           "Error that a pixel may have, as a share of its brightness.", "off"),
      number<&S::noise>("noise", "Noise", 0, 1, "Mean relative error that the picture may have.",
                        "off"),
      number<&S::min_spp>("min_spp", "Min samples", 1, kMostSamples,
                          "Samples of each pixel before the first look at errors."),
      number<&S::spp>("spp", "Samples", 1, kMostSamples,
                      "Samples of each pixel; with adaptive sampling, the most."),
      choice<&S::allocate>("allocate", "Samples go",
                           {{"even", "To all pixels alike."},
                            {"error", "Where the relative error is: by deviation over brightness."},
                            {"efficiency", "Likewise, and to cheap pixels rather than dear ones."}},
                           "How the samples of a render are allotted to its pixels."),
      number<&S::time_limit>("time_limit", "Time limit", 0, 1e9f, "Seconds of rendering.", "none"),
  };
}

/// What computes it, and in which order.
std::vector<SettingInfo> order_settings() {
  using S = Settings;
  std::vector<SettingInfo> settings = {
      choice<&S::integrator>(
          "integrator", "Integrator",
          {{"wavefront", "Waves of paths, stage by stage."},
           {"reference", "One path at a time, depth first: the oracle. Slow; has no queues."}},
          "How paths are followed."),
      choice<&S::costs>("costs", "Costs",
                        {{"auto", "Calibrated, then measured; roulette uses the model."},
                         {"measured",
                          "Calibrated, then measured, for roulette too: with cost-aware roulette "
                          "the picture then varies within its noise."},
                         {"model", "Fixed numbers by program and texture reads: reproducible."}},
                        "Where the estimated costs of materials come from."),
      row<&S::policy>("policy", "Policy", "The order in which hits are shaded."),
      choice<&S::ray_order>("ray_order", "Ray order", ray_orders(),
                            "The order in which bounce rays are traced."),
      choice<&S::shadow_order>("shadow_order", "Shadow order", ray_orders(),
                               "The order in which shadow rays are traced."),
      with_steps(row<&S::lanes>("lanes", "Lanes", "How many records are shaded at once."),
                 {1, 4, 8, 16}, "auto"),
      number<&S::wave_size>("wave_size", "Wave size", 64, 1 << 20,
                            "Paths that are followed together by one thread.", "automatic"),
      choice<&S::materialize>("materialize", "Materialize",
                              {{"auto", "Off, since that measures faster."},
                               {"on", "Records are moved into their order before they are shaded."},
                               {"off", "Shading gathers its inputs through indices."}},
                              "Whether records are moved into their order."),
      choice<&S::traversal>("traversal", "Traversal",
                            {{"packets", "In packets."}, {"single", "One by one."}},
                            "How rays are handed to Embree; the picture is the same."),
      number<&S::threads>("threads", "Threads", 0, 1024, "Threads that render.", "all"),
      number<&S::cost_weight>("cost_weight", "Cost weight", 0, 1,
                              "Weight of a pass in the moving average of costs."),
      row<&S::progressive>("progressive", "Progressive",
                           "Passes of 1, 1, 2, 4 ... samples: the whole picture is "
                           "there soon."),
  };
  for (SettingInfo& setting : settings)
    setting.changes_picture =
        setting.name == std::string_view("costs") || setting.name == std::string_view("integrator");
  return settings;
}

std::vector<SettingInfo> make_settings() {
  std::vector<SettingInfo> table;
  const auto add = [&](SettingGroup group, std::vector<SettingInfo> settings) {
    for (SettingInfo& setting : settings) {
      setting.group = group;
      table.push_back(std::move(setting));
    }
  };
  add(SettingGroup::kPicture, picture_settings());
  add(SettingGroup::kWork, work_settings());
  add(SettingGroup::kOrder, order_settings());
  return table;
}

}  // namespace

SettingValue SettingInfo::get(const Settings& settings) const {
  const SettingValue value = read(settings);
  if (choices.empty()) return value;
  const size_t index = std::holds_alternative<bool>(value)
                           ? static_cast<size_t>(std::get<bool>(value))
                           : static_cast<size_t>(std::get<int64_t>(value));
  return choices[index].name;
}

void SettingInfo::set(Settings& settings, const SettingValue& value) const {
  const SettingValue now = read(settings);
  const auto wrong = [&](const std::string& must) { return Error(std::string(name) + " " + must); };
  if (std::holds_alternative<std::monostate>(value)) {
    if (may_be_none) return write(settings, value);
    throw wrong("must not be None");
  }
  if (!choices.empty()) {
    const auto* chosen = std::get_if<std::string>(&value);
    std::string list;
    for (size_t i = 0; i < choices.size(); ++i) {
      if (chosen && *chosen == choices[i].name) {
        if (std::holds_alternative<bool>(now))
          write(settings, i != 0);
        else
          write(settings, static_cast<int64_t>(i));
        return;
      }
      list += (list.empty() ? "" : ", ") + choices[i].name;
    }
    throw wrong((chosen ? "is '" + *chosen + "'; it " : std::string()) + "must be one of " + list);
  }
  if (std::holds_alternative<double>(now)) {
    if (const auto* whole = std::get_if<int64_t>(&value))
      return write(settings, static_cast<double>(*whole));
    if (!std::holds_alternative<double>(value)) throw wrong("must be a number");
  } else if (std::holds_alternative<int64_t>(now)) {
    const auto* whole = std::get_if<int64_t>(&value);
    if (!whole) throw wrong("must be a whole number");
    if (*whole < 0 || *whole > int64_t{0xffffffff})
      throw wrong("is " + std::to_string(*whole) + "; it must be from 0 to 4294967295");
  } else if (now.index() != value.index()) {
    throw wrong(std::holds_alternative<bool>(now) ? "must be True or False" : "must be a text");
  }
  write(settings, value);
}

void SettingInfo::check(const Settings& settings) const {
  const SettingValue value = read(settings);
  double v = 0;
  if (const auto* whole = std::get_if<int64_t>(&value))
    v = static_cast<double>(*whole);
  else if (const auto* real = std::get_if<double>(&value))
    v = *real;
  else
    return;
  if (!choices.empty() || (v == 0 && *zero != 0)) return;
  if (!steps.empty()) {
    if (std::find(steps.begin(), steps.end(), v) != steps.end()) return;
    std::string list;
    for (const double step : steps) list += (list.empty() ? "" : ", ") + text(step);
    throw Error(std::string(name) + " is " + text(v) + "; it must be " + list + " or " + zero +
                " (0)");
  }
  if (least > most || (v >= least && v <= most)) return;
  throw Error(std::string(name) + " is " + text(v) + "; it must be from " + text(least) + " to " +
              text(most));
}

std::span<const SettingInfo> setting_table() {
  static const std::vector<SettingInfo> table = make_settings();
  return table;
}

const SettingInfo* find_setting(std::string_view name) {
  for (const SettingInfo& info : setting_table())
    if (name == info.name) return &info;
  return nullptr;
}

}  // namespace wavecomb
