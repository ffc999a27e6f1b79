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

/// Returns a row of the settings table for a setting without limits, whose value is `reader`'s.
template <auto kMember>
SettingInfo row(const char* name, const char* label, const char* help,
                SettingValue (*reader)(const Settings&) = &read<kMember>) {
  SettingInfo info;
  info.name = name;
  info.label = label;
  info.help = help;
  info.read = reader;
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
/// Returns the table row of a numeric setting whose default depends on other settings. The function
/// `used` returns the value that a render with given settings uses.
template <auto kMember>
SettingInfo number_or_unset(const char* name, const char* label, double least, double most,
                            const char* help, SettingValue (*used)(const Settings&)) {
  SettingInfo info = row<kMember>(name, label, help, used);
  info.least = least;
  info.most = most;
  info.may_be_none = true;
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
  return {
      {"slot", "Rays are not sorted; they keep the order of their paths."},
      {"morton", "Rays are sorted by the Morton code of their origin."},
      {"morton-octant", "Rays are sorted by octant of direction, then by Morton code of origin."},
      {"direction", "Rays are sorted by the octant and the major axes of their direction."},
      {"auto", "Wavecomb measures the other four orders at each path depth and uses the fastest."}};
}

// Upper limits of path depth and of samples per pixel.
constexpr double kMaxDepth = 4096, kMaxSamples = 1 << 20;

SettingInfo with_steps(SettingInfo info, std::vector<double> steps, const char* zero) {
  info.steps = std::move(steps);
  info.zero = zero;
  return info;
}

/// Marks a setting that changes the expected value of the image.
SettingInfo in_expectation(SettingInfo info) {
  info.changes_expectation = true;
  return info;
}

/// Marks a setting that does not change the image if all pixels have the same sample counts.
SettingInfo same_bits(SettingInfo info) {
  info.changes_bits = false;
  return info;
}

/// Returns the rows of the settings that define the image.
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
      choice<&S::sampler>(
          "sampler", "Sampler",
          {{"sobol", "Sample positions are points of an Owen-scrambled Sobol sequence."},
           {"independent", "Sample positions are independent random numbers."}},
          "Generator of sample positions: low-discrepancy points or independent random numbers."),
      in_expectation(choice<&S::filter>(
          "filter", "Filter",
          {{"box", "The box filter gives all samples within its width the same weight."},
           {"gaussian", "The Gaussian filter has a standard deviation of 1/6 of its width."},
           {"blackman-harris", "The filter is a Blackman-Harris window."}},
          "Pixel filter, which weights the samples around a pixel.")),
      in_expectation(number_or_unset<&S::filter_width>(
          "filter_width", "Filter width", 0.01f, 32,
          "Full width of the pixel filter in pixels; the default is 1 for box, 3 for other "
          "filters.",
          [](const S& s) -> SettingValue { return double{s.used_filter_width()}; })),
      in_expectation(number<&S::clamp_indirect>("clamp_indirect", "Clamp indirect", 0, 1e30f,
                                                "Clamps indirect contributions to this luminance, "
                                                "which reduces fireflies but darkens the image.",
                                                "off")),
      in_expectation(choice<&S::schlick_fresnel>(
          "fresnel", "Fresnel",
          {{"exact", "The reflectance of dielectrics follows Fresnel's equations."},
           {"schlick", "The reflectance of dielectrics follows Schlick's approximation."}},
          "Formula for the reflectance of dielectrics.")),
      in_expectation(
          choice<&S::texture_filter>("texture_filter", "Texture filter",
                                     {{"auto",
                                       "Directly visible points use full texture filtering; hits "
                                       "after a bounce read one random texel."},
                                      {"whole", "Textures are fully filtered at all hits."}},
                                     "Hits that use full texture filtering.")),
      row<&S::cosine_sampling>("cosine_sampling", "Cosine sampling",
                               "Samples non-specular bounces with a cosine-weighted density "
                               "instead of the BSDF, for comparisons."),
      in_expectation(row<&S::alpha>(
          "alpha", "Alpha",
          "Makes dome and distant lights transparent to the camera, and adds an alpha channel.")),
      same_bits(row<&S::error>("error", "Errors",
                               "Stores estimates of the error and variance of each pixel.")),
      in_expectation(number<&S::overscan>("overscan", "Overscan", 0, kMaxSize / 2,
                                          "Extra pixels to render beyond each edge of the image.")),
      number<&S::deep_samples>("deep_samples", "Deep samples", 1, kMaxDeepSamples,
                               "Maximum number of samples per pixel of a deep image."),
      number<&S::deep_tolerance>("deep_tolerance", "Deep tolerance", 0, 1,
                                 "Merges samples of a deep image whose depths differ by at most "
                                 "this fraction of the depth."),
      in_expectation(row<&S::crop>(
          "crop", "Crop", "Stores only the pixels of the render region, in memory and in files.")),
  };
}

/// Returns the rows of the settings that control the work for each sample.
std::vector<SettingInfo> work_settings() {
  using S = Settings;
  return {
      choice<&S::roulette>(
          "roulette", "Roulette",
          {{"auto", "Same as `efficient` if paths are guided, otherwise same as `throughput`."},
           {"off", "Russian roulette is disabled, so paths continue up to the maximum depth."},
           {"throughput", "The survival probability of a path grows with its throughput."},
           {"cost-aware",
            "The survival probability of a path grows with its throughput / sqrt(shading cost)."},
           {"efficient",
            "The survival probability of a path depends on its expected contribution and cost, "
            "which are learned before the first pass."}},
          "Russian roulette, which terminates paths early without bias."),
      choice<&S::shadow_roulette>(
          "shadow_roulette", "Shadow roulette",
          {{"off", "Every light sample gets a shadow ray."},
           {"on", "Without bias, light samples of small contribution get a shadow ray at random."}},
          "Whether Russian roulette saves shadow rays."),
      choice<&S::quality>(
          "quality", "Quality",
          {{"auto", "Path guiding and light paths are used if short pilot renders predict a gain."},
           {"plain", "Without pilot renders, guiding and light paths are off unless requested."}},
          "Whether short pilot renders decide if path guiding and light paths are used."),
      choice<&S::transport>(
          "transport", "Transport",
          {{"path", "Paths start at the camera only."},
           {"light",
            "Paths start at the camera and at the lights, combined by multiple "
            "importance sampling, for caustics of small lights."},
           {"auto", "Same as `light` if a pilot render predicts a gain, otherwise same as `path`."},
           {"bdpt",
            "Vertices of camera and light paths are also connected, which is "
            "not more efficient than `light` in any measured scene."}},
          "Whether paths start at the camera only or also at the lights."),
      choice<&S::light_aim>(
          "light_aim", "Light path aiming",
          {{"off", "Light paths are emitted in proportion to the emission of the lights only."},
           {"on", "Light paths mostly start where earlier pilot paths contributed to the image."}},
          "How the starting points and directions of light paths are chosen."),
      choice<&S::light_splats>(
          "light_splats", "Light splats",
          {{"auto", "Same as `pixel` in renders that are denoised, otherwise same as `filtered`."},
           {"filtered", "Adds light to all pixels nearby, weighted by the pixel filter."},
           {"pixel", "Adds light to one random pixel, since denoisers need independent noise."}},
          "How light paths add light to the pixels around a point that the camera sees."),
      in_expectation(number<&S::merge_radius>(
          "merge_radius", "Merge radius", 0, 64,
          "Radius in pixels of path merging, which finds caustics in mirrors, but blurs them.")),
      choice<&S::auto_merge>("auto_merge", "Automatic merging",
                             {{"off", "Only a merge radius above 0 merges."},
                              {"on", "Transport auto may merge within one pixel."}},
                             "Whether light paths are merged if pilot renders predict a gain."),
      in_expectation(choice<&S::firefly>(
          "firefly", "Fireflies",
          {{"keep", "Very bright samples keep their weight, so the image has no bias."},
           {"reweight",
            "Rare bright samples get less weight, which darkens the image slightly; the layer "
            "named unbiased keeps their full weight."}},
          "Treatment of samples that are much brighter than their neighbours.")),
      number<&S::roulette_depth>(
          "roulette_depth", "From depth", 0, kMaxDepth,
          "First path vertex at which Russian roulette may terminate a path."),
  };
}

/// Returns the rows of the settings that control how lights and directions are sampled.
std::vector<SettingInfo> choice_settings() {
  using S = Settings;
  return {
      choice<&S::light_selection>(
          "light_selection", "Lights",
          {{"auto",
            "Lights are chosen with a light tree if many have similar power, otherwise by power."},
           {"tree",
            "A light tree chooses lights by their expected contribution at the shading point."},
           {"power", "Lights are chosen in proportion to their power, independent of position."}},
          "Method that chooses which light to sample at a shading point."),
      choice<&S::light_weights>("light_weights", "Light weights",
                                {{"calibrated",
                                  "The weight of a light is its contribution to the image, "
                                  "measured with a pilot render."},
                                 {"power", "The weight of a light is its power."}},
                                "Weights of the lights in light selection."),
      choice<&S::equiangular>(
          "equiangular", "Equiangular",
          {{"off", "Scattering distances are sampled by the density of the medium only."},
           {"on",
            "Scattering distances in homogeneous volumes are also sampled by distance to lights "
            "(equiangular sampling)."}},
          "How scattering distances in homogeneous volumes are sampled."),
      choice<&S::guiding>(
          "guiding", "Guiding",
          {{"auto", "Path guiding is used if a short pilot render predicts that it reduces noise."},
           {"on", "Path guiding is used wherever the guiding field has training data."},
           {"off", "Bounce directions are sampled by the BSDF only, without path guiding."}},
          "Path guiding, which samples some bounce directions by learned incident light."),
      number<&S::learn_memory_mb>("learn_memory", "Learning (MB)", 1, 1u << 16,
                                  "Memory limit of the path guiding field in MB."),
  };
}

/// Returns the rows of the settings that control the number of samples.
std::vector<SettingInfo> sample_settings() {
  using S = Settings;
  return {
      number<&S::adaptive>("adaptive", "Pixel error", 0, 1e6f,
                           "Samples each pixel until its relative error is below this value.",
                           "off"),
      number<&S::noise>("noise", "Noise", 0, 1,
                        "Renders until the image's mean relative error is below this value.",
                        "off"),
      number<&S::min_spp>(
          "min_spp", "Min samples", 1, kMaxSamples,
          "Samples per pixel before adaptive sampling estimates errors for the first time."),
      same_bits(
          number<&S::spp>("spp", "Samples", 1, kMaxSamples,
                          "Number of samples per pixel, or the maximum with adaptive sampling.")),
      choice<&S::allocate>(
          "allocate", "Sample allocation",
          {{"even", "All pixels get the same number of samples."},
           {"error",
            "Pixels with larger relative error (standard deviation / brightness) get more "
            "samples."},
           {"efficiency",
            "Pixels whose error falls most per unit of rendering cost get more samples."}},
          "How samples are distributed over pixels."),
      number<&S::time_limit>("time_limit", "Time limit", 0, 1e9f,
                             "Stops rendering after this many seconds.", "none"),
  };
}

/// Returns the rows of the settings that control the order and the method of computation, but not
/// the image.
std::vector<SettingInfo> order_settings() {
  using S = Settings;
  std::vector<SettingInfo> settings = {
      choice<&S::integrator>(
          "integrator", "Integrator",
          {{"wavefront", "The wavefront integrator advances waves of thousands of paths together."},
           {"reference",
            "The reference integrator traces one path at a time; it is slow, and serves to verify "
            "the wavefront integrator."}},
          "Integrator that traces the paths."),
      choice<&S::costs>("costs", "Costs",
                        {{"auto",
                          "Shading costs are calibrated, then measured during the render; "
                          "roulette uses the reproducible cost model."},
                         {"measured",
                          "Shading costs are calibrated, then measured during the render, also "
                          "for cost-aware roulette; images then vary within their noise."},
                         {"model",
                          "Shading costs are fixed, reproducible estimates from the material's "
                          "program and texture reads."}},
                        "Source of the estimated shading costs of materials."),
      row<&S::policy>("policy", "Policy", "The order in which hits are shaded."),
      choice<&S::ray_order>("ray_order", "Ray order", ray_orders(),
                            "The order in which bounce rays are traced."),
      choice<&S::shadow_order>("shadow_order", "Shadow order", ray_orders(),
                               "The order in which shadow rays are traced."),
      with_steps(
          row<&S::lanes>("lanes", "Lanes", "Number of SIMD lanes, each of which shades one hit."),
          {1, 4, 8, 16}, "auto"),
      number<&S::wave_size>("wave_size", "Wave size", 64, 1 << 20,
                            "Number of paths in a wave, which one thread processes together.",
                            "automatic"),
      choice<&S::materialize>("materialize", "Materialize",
                              {{"auto", "Same as `off`, which is faster."},
                               {"on", "Shading inputs are first copied into the order of shading."},
                               {"off", "Shading inputs are read through indices, without copies."}},
                              "Whether shading inputs are copied into the order of shading."),
      choice<&S::traversal>(
          "traversal", "Traversal",
          {{"packets", "Embree traces rays in packets."},
           {"single", "Embree traces rays one by one."}},
          "Whether Embree traces rays in packets or one by one, which does not change the image."),
      number<&S::threads>("threads", "Threads", 0, 1024, "Number of render threads.", "all"),
      number<&S::cost_weight>("cost_weight", "Cost weight", 0, 1,
                              "Weight of the latest pass in the moving average of shading costs."),
      row<&S::progressive>("progressive", "Progressive",
                           "Renders passes of 1, 1, 2, 4, ... samples per pixel, so that the whole "
                           "image appears soon."),
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
  add(SettingGroup::kWork, choice_settings());
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
