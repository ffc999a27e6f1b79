// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/settings_table.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

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

/// Returns a row without limits.
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
/// Returns a row of a number whose default depends on other settings; `used` returns the value in
/// use.
template <auto kMember>
SettingInfo number_or_unset(const char* name, const char* label, double least, double most,
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
  return {{"slot", "Not sorted: in the order of the paths."},
          {"morton", "Sorted by position of the origin (Morton code)."},
          {"morton-octant", "Sorted by octant of the direction, then by position of the origin."},
          {"direction", "Sorted by octant and major axes of the direction."},
          {"auto", "The fastest of the four, learned for each depth."}};
}

// Upper limits of path depth and of samples per pixel.
constexpr double kMaxDepth = 4096, kMaxSamples = 1 << 20;

SettingInfo with_steps(SettingInfo info, std::vector<double> steps, const char* zero) {
  info.steps = std::move(steps);
  info.zero = zero;
  return info;
}

/// Marks a setting as one that changes the expectation of the image.
SettingInfo in_expectation(SettingInfo info) {
  info.changes_expectation = true;
  return info;
}

/// Marks a setting that leaves the bits of the image unchanged at equal samples.
SettingInfo same_bits(SettingInfo info) {
  info.changes_bits = false;
  return info;
}

/// Returns the settings that define the image.
std::vector<SettingInfo> image_settings() {
  using S = Settings;
  return {
      in_expectation(
          number<&S::width>("width", "Width", 1, kMaxSize, "Width of the image in pixels.")),
      in_expectation(
          number<&S::height>("height", "Height", 1, kMaxSize, "Height of the image in pixels.")),
      in_expectation(number<&S::max_depth>("max_depth", "Max depth", 0, kMaxDepth,
                                           "Maximum number of scattering events of a path.")),
      number<&S::seed>("seed", "Seed", 0, 0xffffffffu, "Seed of all random numbers."),
      choice<&S::sampler>("sampler", "Sampler",
                          {{"sobol", "Owen-scrambled Sobol points."},
                           {"independent", "Independent random numbers."}},
                          "Pattern of the sample positions."),
      in_expectation(choice<&S::filter>("filter", "Filter",
                                        {{"box", "Constant weight over its width."},
                                         {"gaussian", "Gaussian with sigma of 1/6 of its width."},
                                         {"blackman-harris", "Blackman-Harris window."}},
                                        "Pixel filter: weights of samples around a pixel.")),
      in_expectation(number_or_unset<&S::filter_width>(
          "filter_width", "Filter width", 0.01f, 32,
          "Full filter width in pixels; its own is 1 for the box, else 3.",
          [](const S& s) -> SettingValue { return double{s.used_filter_width()}; })),
      in_expectation(number<&S::clamp_indirect>("clamp_indirect", "Clamp indirect", 0, 1e30f,
                                                "Maximum luminance of an indirect contribution. "
                                                "Reduces fireflies but darkens the image.",
                                                "off")),
      in_expectation(choice<&S::schlick_fresnel>(
          "fresnel", "Fresnel",
          {{"exact", "Fresnel's equations."}, {"schlick", "Schlick's approximation."}},
          "Formula for the reflectance of dielectrics.")),
      in_expectation(choice<&S::texture_filter>(
          "texture_filter", "Texture filter",
          {{"auto", "Full filtering at directly visible points, one random texel after a bounce."},
           {"whole", "Full filtering everywhere."}},
          "How textures are filtered.")),
      row<&S::cosine_sampling>("cosine_sampling", "Cosine sampling",
                               "Samples every non-specular bounce by cosine, for comparisons."),
      in_expectation(row<&S::alpha>(
          "alpha", "Alpha",
          "Makes domes and distant lights transparent to the camera, with an alpha channel.")),
      same_bits(
          row<&S::error>("error", "Errors", "Stores error and variance estimates of each pixel.")),
      in_expectation(number<&S::overscan>("overscan", "Overscan", 0, kMaxSize / 2,
                                          "Extra pixels to render beyond each edge of the image.")),
      number<&S::deep_samples>("deep_samples", "Deep samples", 1, kMaxDeepSamples,
                               "Maximum number of samples per pixel of a deep image."),
      number<&S::deep_tolerance>("deep_tolerance", "Deep tolerance", 0, 1,
                                 "Merges samples of a deep image whose depths differ by at most "
                                 "this fraction of the depth."),
      in_expectation(row<&S::crop>("crop", "Crop",
                                   "Limits the image, in memory and in files, to the region.")),
  };
}

/// Returns the settings that control the work for each sample.
std::vector<SettingInfo> work_settings() {
  using S = Settings;
  return {
      choice<&S::roulette>(
          "roulette", "Roulette",
          {{"auto", "`efficient` with path guiding, otherwise `throughput`."},
           {"off", "Paths end at the maximum depth only."},
           {"throughput", "Survival probability by the path's throughput."},
           {"cost-aware", "Survival by throughput over the square root of the shading cost."},
           {"efficient",
            "Survival by expected contribution and cost, learned before the first pass."}},
          "Russian roulette: how paths are terminated early, without bias."),
      choice<&S::quality>(
          "quality", "Quality",
          {{"auto", "Path guiding and light paths where short pilot renders predict a gain."},
           {"plain", "No pilot renders: `auto` means no path guiding and no light paths."}},
          "Whether pilot renders decide about `guiding` and `transport`."),
      choice<&S::transport>("transport", "Transport",
                            {{"path", "Paths start at the camera only."},
                             {"light",
                              "Paths also start at the lights, combined by multiple importance "
                              "sampling: for caustics of small lights."},
                             {"auto",
                              "Also at the lights if a short pilot render predicts that it reduces "
                              "noise."},
                             {"bdpt",
                              "At both, with connections between their vertices. No measured "
                              "benefit over light so far."}},
                            "Where paths start."),
      choice<&S::light_aim>("light_aim", "Light path aiming",
                            {{"off", "By the emission of the lights alone."},
                             {"on", "Mostly where pilot paths contributed to the image."}},
                            "Where light paths are aimed."),
      in_expectation(
          number<&S::merge_radius>("merge_radius", "Merge radius", 0, 64,
                                   "Radius in pixels within which caustics seen in mirrors or "
                                   "through glass are blurred to find them.",
                                   "never")),
      in_expectation(choice<&S::firefly>(
          "firefly", "Fireflies",
          {{"keep", "Unchanged, without bias."},
           {"reweight",
            "Reduces the weight of rare bright samples, which darkens the image slightly. The "
            "layer unbiased keeps them."}},
          "Treatment of samples much brighter than others.")),
      number<&S::roulette_depth>("roulette_depth", "From depth", 0, kMaxDepth,
                                 "First vertex at which roulette may terminate a path."),
      choice<&S::light_selection>(
          "light_selection", "Lights",
          {{"auto", "Light tree if there are several lights, otherwise power."},
           {"tree", "Probability by expected contribution at the shaded point, with a light tree."},
           {"power", "Probability by power, independent of position."}},
          "How shading chooses the light to sample."),
      choice<&S::light_weights>(
          "light_weights", "Light weights",
          {{"calibrated", "By contribution to the image, measured with a pilot render."},
           {"power", "Probability by power, independent of position."}},
          "How often each light is chosen."),
      choice<&S::equiangular>(
          "equiangular", "Equiangular",
          {{"off", "By density only."},
           {"on", "Also by distance to lights, in homogeneous volumes (equiangular sampling)."}},
          "How scattering distances in homogeneous volumes are sampled."),
      choice<&S::guiding>(
          "guiding", "Guiding",
          {{"auto", "Use guiding if a short pilot render predicts that it reduces noise."},
           {"on", "Use the guiding field wherever it has data."},
           {"off", "Sample by material only."}},
          "Path guiding: bounces also follow the learned incident light."),
      number<&S::learn_memory_mb>("learn_memory", "Learning (MB)", 1, 1u << 16,
                                  "Memory limit of learned data in MB."),
  };
}

/// Returns the settings that control the number of samples.
std::vector<SettingInfo> sample_settings() {
  using S = Settings;
  return {
      number<&S::adaptive>("adaptive", "Pixel error", 0, 1e6f,
                           "Samples each pixel until its relative error is below this value.",
                           "off"),
      number<&S::noise>("noise", "Noise", 0, 1,
                        "Renders until the image's mean relative error is below this value.",
                        "off"),
      number<&S::min_spp>("min_spp", "Min samples", 1, kMaxSamples,
                          "Samples per pixel before the first error estimate."),
      same_bits(number<&S::spp>("spp", "Samples", 1, kMaxSamples,
                                "Samples per pixel; the maximum with adaptive sampling.")),
      choice<&S::allocate>(
          "allocate", "Sample allocation",
          {{"even", "The same number of samples for all pixels."},
           {"error",
            "More samples for pixels of larger relative error (standard deviation / brightness)."},
           {"efficiency", "More samples where they reduce the error most for their cost."}},
          "How samples are distributed over pixels."),
      number<&S::time_limit>("time_limit", "Time limit", 0, 1e9f,
                             "Stops rendering after this many seconds.", "none"),
  };
}

/// Returns the settings that control how the image is computed, and in which order.
std::vector<SettingInfo> order_settings() {
  using S = Settings;
  std::vector<SettingInfo> settings = {
      choice<&S::integrator>(
          "integrator", "Integrator",
          {{"wavefront", "Processes waves of paths stage by stage."},
           {"reference", "Traces one path at a time. Slow; for checking the wavefront."}},
          "How paths are traced."),
      choice<&S::costs>(
          "costs", "Costs",
          {{"auto", "Calibrated, then measured; roulette uses the model."},
           {"measured",
            "Calibrated, then measured, also for roulette: the image then varies "
            "within its noise if roulette is cost-aware."},
           {"model", "Fixed estimates from the program and its texture reads; reproducible."}},
          "Source of the estimated costs of materials."),
      row<&S::policy>("policy", "Policy", "The order in which hits are shaded."),
      choice<&S::ray_order>("ray_order", "Ray order", ray_orders(),
                            "The order in which bounce rays are traced."),
      choice<&S::shadow_order>("shadow_order", "Shadow order", ray_orders(),
                               "The order in which shadow rays are traced."),
      with_steps(row<&S::lanes>("lanes", "Lanes", "Number of records that are shaded at once."),
                 {1, 4, 8, 16}, "auto"),
      number<&S::wave_size>("wave_size", "Wave size", 64, 1 << 20,
                            "Number of paths that a thread processes together.", "automatic"),
      choice<&S::materialize>("materialize", "Materialize",
                              {{"auto", "Off, since that is faster."},
                               {"on", "Copy records into sorted order before shading."},
                               {"off", "Gather the inputs of shading through indices."}},
                              "Whether records are moved into their order."),
      choice<&S::traversal>("traversal", "Traversal",
                            {{"packets", "In packets."}, {"single", "One by one."}},
                            "How rays are passed to Embree; the image is the same."),
      number<&S::threads>("threads", "Threads", 0, 1024, "Number of render threads.", "all"),
      number<&S::cost_weight>("cost_weight", "Cost weight", 0, 1,
                              "Weight of a pass in the moving average of costs."),
      row<&S::progressive>("progressive", "Progressive",
                           "Renders passes of 1, 1, 2, 4, ... samples, so that the whole image "
                           "appears soon."),
  };
  for (SettingInfo& setting : settings) {
    setting.changes_image =
        setting.name == std::string_view("costs") || setting.name == std::string_view("integrator");
    setting.changes_bits = false;
  }
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
  add(SettingGroup::kImage, image_settings());
  add(SettingGroup::kWork, work_settings());
  add(SettingGroup::kWork, sample_settings());
  add(SettingGroup::kOrder, order_settings());
  return table;
}

}  // namespace

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
