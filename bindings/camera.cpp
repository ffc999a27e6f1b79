// SPDX-License-Identifier: Apache-2.0
#include "camera.h"

#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "bind.h"
#include "scene_values.h"
#include "wavecomb/core/error.h"
#include "wavecomb/scene/camera/camera_table.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

/// Python names of the values of `CameraValueKind`.
constexpr const char* kKinds[] = {"number", "choice", "four", "planes"};

[[noreturn]] void fail(const std::string& name, const std::string& wanted) {
  throw Error("the camera: " + name + " must be " + wanted);
}

uint32_t choice_of(const CameraParameter& p, nb::handle value) {
  if (const auto chosen = index_in(p.choices, value)) return *chosen;
  std::string given;
  if (!nb::try_cast(value, given)) fail(p.name, "a name");
  throw Error("the camera has no " + std::string(p.name) + " '" + given + "'; there are " +
              listed(p.choices));
}

CameraValue from_python(const CameraParameter& p, nb::handle value) {
  switch (p.kind) {
    case CameraValueKind::kNumber:
      if (float number = 0; nb::try_cast(value, number)) return number;
      fail(p.name, "a number");
    case CameraValueKind::kChoice:
      return choice_of(p, value);
    case CameraValueKind::kFour: {
      std::vector<float> numbers;
      if (!nb::try_cast(value, numbers) || numbers.size() != 4) fail(p.name, "4 numbers");
      return FourNumbers{numbers[0], numbers[1], numbers[2], numbers[3]};
    }
    case CameraValueKind::kPlanes:
      break;
  }
  std::vector<FourNumbers> planes;
  if (!nb::try_cast(value, planes)) fail(p.name, "4 numbers for each plane");
  return planes;
}

nb::object to_python(const CameraParameter& p, const CameraValue& value) {
  if (const auto* chosen = std::get_if<uint32_t>(&value)) return nb::str(p.choices[*chosen]);
  if (const auto* number = std::get_if<float>(&value)) return nb::cast(*number);
  if (const auto* four = std::get_if<FourNumbers>(&value))
    return nb::make_tuple((*four)[0], (*four)[1], (*four)[2], (*four)[3]);
  return nb::cast(std::get<std::vector<FourNumbers>>(value));
}

/// Converts an array (k, 4, 4) of camera transforms at `k` times of the shutter interval. Returns
/// no transforms if `value` is None.
std::vector<Affine> motion_of(nb::handle value) {
  std::vector<Affine> steps;
  if (value.is_none()) return steps;
  try {
    const nb::object array =
        nb::module_::import_("numpy").attr("ascontiguousarray")(value, "float64");
    const auto transforms =
        nb::cast<nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>>(
            array);
    for (size_t k = 0; k < transforms.shape(0); ++k)
      steps.push_back(affine(transforms.data() + 16 * k));
  } catch (const std::exception&) {
    fail("motion", "4 x 4 numbers for each step");
  }
  return steps;
}

/// Sets camera parameters from a dict. The keys `transform` and `to_world` set the camera's
/// transform and remove its motion.
void take(Camera& camera, const nb::dict& values) {
  for (const char* name : {"transform", "to_world"})
    if (values.contains(name)) {
      camera.to_world = matrix_of("the camera: " + std::string(name), values[name]);
      camera.steps.clear();
    }
  for (const auto& [key, value] : values) {
    const auto name = nb::cast<std::string>(nb::str(key));
    std::string known = "'transform', 'to_world', 'motion'";
    const CameraParameter* found = nullptr;
    for (const CameraParameter& p : camera_table()) {
      if (name == p.name) found = &p;
      known += ", '" + std::string(p.name) + "'";
    }
    if (found)
      found->write(camera, from_python(*found, value));
    else if (name == "motion")
      camera.steps = motion_of(value);
    else if (name != "transform" && name != "to_world")
      throw Error("the camera has no parameter '" + name + "' that can be changed; there are " +
                  known);
  }
}

nb::dict row_dict(const CameraParameter& p) {
  nb::dict d;
  nb::list choices;
  for (const char* one : p.choices) choices.append(one);
  d["name"] = p.name;
  d["help"] = p.help;
  d["kind"] = kKinds[static_cast<size_t>(p.kind)];
  d["default"] = p.is_needed ? nb::none() : to_python(p, p.standard());
  d["least"] = std::isfinite(p.least) ? nb::cast(p.least) : nb::none();
  d["choices"] = nb::tuple(choices);
  return d;
}

}  // namespace

void set_camera(SceneBuilder& builder,
                const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& transform,
                const nb::kwargs& values) {
  for (const CameraParameter& p : camera_table())
    if (p.is_needed && !values.contains(p.name))
      throw Error("the camera has no " + std::string(p.name) + "; give one");
  Camera camera;
  camera.to_world = affine(transform);
  take(camera, values);
  builder.set_camera(camera);
}

nb::dict camera_dict(const Scene& scene) {
  const Camera& c = scene.camera();
  nb::dict d;
  d["to_world"] = matrix(c.to_world);
  for (const CameraParameter& p : camera_table()) d[p.name] = to_python(p, p.read(c));
  return d;
}

Camera edited_camera(const Scene& scene, const nb::dict& values) {
  Camera changed = scene.camera();
  take(changed, values);
  return changed;
}

void bind_camera(nb::module_& m) {
  m.def("camera_table", [] {
    nb::list rows;
    for (const CameraParameter& p : camera_table()) rows.append(row_dict(p));
    return rows;
  });
}
