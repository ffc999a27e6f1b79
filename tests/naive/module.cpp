// SPDX-License-Identifier: Apache-2.0
/// The Python module wavecomb_naive. The module imports wavecomb._core first, whose scenes it
/// renders.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>

#include "integrator.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

nb::object render(std::shared_ptr<const wavecomb::Scene> scene, uint32_t width, uint32_t height,
                  uint32_t samples, uint32_t max_depth, uint32_t directions, uint32_t delta_tries,
                  uint64_t seed, bool schlick_fresnel) {
  const wavecomb::NaiveSettings settings{width,      height,      samples, max_depth,
                                         directions, delta_tries, seed,    schlick_fresnel};
  auto* picture = new std::vector<double>;
  const nb::capsule owner(picture,
                          [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  {
    const nb::gil_scoped_release release;
    *picture = wavecomb::render_naively(scene, settings);
  }
  const size_t shape[3] = {height, width, 3};
  return nb::cast(nb::ndarray<nb::numpy, double>(picture->data(), 3, shape, owner));
}

}  // namespace

NB_MODULE(wavecomb_naive, m) {
  m.doc() = "Wavecomb's naive integrator, which tests compare the others with.";
  m.def("render", &render, "scene"_a, nb::kw_only(), "width"_a, "height"_a, "samples"_a,
        "max_depth"_a, "directions"_a, "delta_tries"_a, "seed"_a, "schlick_fresnel"_a);
}
