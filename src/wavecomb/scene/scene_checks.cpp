// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/scene_checks.h"

#include <span>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/motion.h"

namespace wavecomb {

std::string quoted(const std::string& kind, const std::string& name) {
  return kind + (name.empty() ? "" : " '" + name + "'");
}

void check_material(const Material& material, size_t texture_count) {
  const auto name = quoted("material", material.name);
  for (uint32_t s = 0; s < kSlotCount; ++s) {
    const TextureUse& use = material.textures[s];
    if (use.texture == kNoTexture) continue;
    if (use.texture >= texture_count)
      throw Error(name + " reads texture " + std::to_string(use.texture) +
                  ", which was never added; add textures before materials");
    for (const std::span<const float> values :
         {std::span<const float>(use.scale), std::span<const float>(use.bias),
          std::span<const float>(use.uv)})
      for (float x : values)
        if (!std::isfinite(x))
          throw Error(name +
                      " reads a texture through a number that is not finite; mend its scale, bias "
                      "or transform");
    if (use.channel > 4)
      throw Error(name + " reads a texture channel that is not r, g, b, a or rgb");
  }
  const OpenPbr& o = material.openpbr;
  for (const Vec3<float>& v :
       {material.base_color, material.specular_color, material.emission, material.conductor_eta,
        material.conductor_k, o.transmission_color, o.subsurface_color, o.fuzz_color, o.coat_color})
    if (!finite(v)) throw Error(name + " has a colour that is not finite; give finite numbers");
  for (float x : {material.roughness,
                  material.metallic,
                  material.clearcoat,
                  material.clearcoat_roughness,
                  material.opacity,
                  material.ior,
                  material.opacity_threshold,
                  o.diffuse_roughness,
                  o.specular_weight,
                  o.anisotropy,
                  o.rotation,
                  o.transmission_weight,
                  o.transmission_depth,
                  o.subsurface_weight,
                  o.subsurface_anisotropy,
                  o.fuzz_weight,
                  o.fuzz_roughness,
                  o.coat_ior,
                  o.coat_darkening,
                  o.film_weight,
                  o.film_thickness,
                  o.film_ior})
    if (!std::isfinite(x))
      throw Error(name + " has a parameter that is not finite; give finite numbers");
  if (material.ior <= 0) throw Error(name + " has an ior of 0 or less; give a positive one");
  if (material.evaluations < 1 || material.evaluations > kMaxEvaluations)
    throw Error(name + " has " + std::to_string(material.evaluations) + " evaluations; from 1 to " +
                std::to_string(kMaxEvaluations) + " are possible");
}

void check_light(const Light& light, size_t texture_count) {
  const auto name = quoted("light", light.name);
  if (!finite(light.to_world)) throw Error(name + " has a transform that is not finite; mend it");
  if (!finite(light.color) || light.color.x < 0 || light.color.y < 0 || light.color.z < 0)
    throw Error(name + " has a colour that is negative or not finite; give one of 0 or more");
  for (float x : {light.width, light.height, light.radius, light.angle})
    if (!std::isfinite(x) || x < 0)
      throw Error(name + " has a size that is negative or not finite; give one of 0 or more");
  if (light.texture != kNoTexture && light.texture >= texture_count)
    throw Error(name + " reads a texture that was never added; add textures before lights");
}

void check_camera(const Camera& camera) {
  const float* w = camera.window;
  if (!finite(camera.to_world) || std::abs(camera.to_world.determinant()) < 1e-30f)
    throw Error("the camera's transform is singular or not finite; mend it");
  if (camera.steps.size() == 1 || camera.steps.size() > kMostSteps)
    throw Error("the camera's motion needs 2 to " + std::to_string(kMostSteps) + " steps");
  for (const Affine& step : camera.steps)
    if (!finite(step) || std::abs(step.determinant()) < 1e-30f)
      throw Error("the camera's motion is singular or not finite; mend it");
  for (int i = 0; i < 4; ++i)
    if (!std::isfinite(w[i])) throw Error("the camera's window is not finite; check its aperture");
  if (!(w[0] < w[1]) || !(w[2] < w[3]))
    throw Error("the camera's window is empty; check its aperture and focal length");
  if (!(camera.lens_radius >= 0) || !std::isfinite(camera.lens_radius) ||
      (camera.lens_radius > 0 && !(camera.focus_distance > 0)))
    throw Error("the camera's lens needs a radius of 0 or more and a focus distance above 0");
  if (!(camera.near_clip >= 0) || !(camera.far_clip > camera.near_clip))
    throw Error("the camera's clipping range must start at 0 or more and end beyond its start");
}

}  // namespace wavecomb
