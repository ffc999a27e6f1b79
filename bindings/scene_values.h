// SPDX-License-Identifier: Apache-2.0
/// Values of a scene as Python writes them: to be read, and to be changed.
#pragma once

#include <nanobind/ndarray.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/scene/scene.h"

/// USD's row-vector matrix at `m` as a column-vector map.
template <typename T>
wavecomb::Affine affine(const T* m) {
  const auto at = [m](int row, int column) { return static_cast<float>(m[4 * row + column]); };
  wavecomb::Affine a;
  for (int i = 0; i < 3; ++i) a.row[i] = {at(0, i), at(1, i), at(2, i)};
  a.t = {at(3, 0), at(3, 1), at(3, 2)};
  return a;
}
/// Likewise of a 4 x 4 array; throws Error for any other.
wavecomb::Affine affine(
    const nanobind::ndarray<nanobind::c_contig, nanobind::device::cpu, nanobind::ro>& m);

/// The parameters of program "openpbr" by name; throws Error for others.
wavecomb::OpenPbr openpbr_of(const std::string& material, const nanobind::dict& values);

/// Throws Error unless i < count.
void check_index(const char* kind, uint32_t i, size_t count);

/// Which of the choices a name is; none where it is none of them, or no name.
std::optional<uint32_t> index_in(const std::vector<const char*>& choices, nanobind::handle value);
/// "a, b, c".
std::string listed(std::span<const char* const> choices);

/// A map as USD's row-vector matrix, and back: 4 x 4 numbers. Throws Error that begins with `what`
/// for anything else.
nanobind::list matrix(const wavecomb::Affine& m);
wavecomb::Affine matrix_of(const std::string& what, nanobind::handle value);

/// Parameters of material_table() by name into a material that has its name. Throws Error for
/// others, and for values of another kind.
void take_parameters(wavecomb::Material& material, const nanobind::kwargs& values);
/// material_table() as Python reads it.
nanobind::list material_rows();
/// What programs read, as Python reads it.
nanobind::list program_rows();

/// As add_material takes it. Throws Error for ids that are not there.
nanobind::dict material_dict(const wavecomb::Scene& scene, uint32_t material);

/// What Renderer.edit() is told. Values that are not given stay as they are. Throws Error that
/// names the object and the value.
wavecomb::SceneEdit scene_edit(const wavecomb::Scene& scene, const nanobind::object& camera,
                               const nanobind::dict& materials, const nanobind::dict& lights);
