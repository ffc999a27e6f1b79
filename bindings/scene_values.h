// SPDX-License-Identifier: Apache-2.0
/// Conversion of scene values between Python and C++, for reading and editing.
#pragma once

#include <nanobind/ndarray.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/scene/scene.h"

/// Converts the row-major row-vector matrix (USD convention) at `m` to a column-vector transform.
template <typename T>
wavecomb::Affine affine(const T* m) {
  const auto at = [m](int row, int column) { return static_cast<float>(m[4 * row + column]); };
  wavecomb::Affine a;
  for (int i = 0; i < 3; ++i) a.row[i] = {at(0, i), at(1, i), at(2, i)};
  a.t = {at(3, 0), at(3, 1), at(3, 2)};
  return a;
}
/// Converts a 4 x 4 array of float32 or float64 in USD convention. Throws Error for arrays of
/// another shape or type.
wavecomb::Affine affine(
    const nanobind::ndarray<nanobind::c_contig, nanobind::device::cpu, nanobind::ro>& m);

/// Reads the parameters of program "openpbr" by name. Throws Error for unknown names.
wavecomb::OpenPbr openpbr_of(const std::string& material, const nanobind::dict& values);

/// Throws `Error` unless the index `i` is less than `count`. The message names `kind`, such as
/// "material".
void check_index(const char* kind, uint32_t i, size_t count);

/// Returns the index of a name among `choices`. Returns nullopt if the value is not a string or not
/// among `choices`.
std::optional<uint32_t> index_in(const std::vector<const char*>& choices, nanobind::handle value);
/// Joins the names with commas, such as "a, b, c".
std::string listed(std::span<const char* const> choices);

/// Convert a transform to a row-vector matrix of 4 x 4 numbers (USD convention), and back.
/// `matrix_of` throws an `Error` whose message begins with `what` if the value is not a 4 x 4
/// matrix.
nanobind::list matrix(const wavecomb::Affine& m);
wavecomb::Affine matrix_of(const std::string& what, nanobind::handle value);

/// Sets parameters of material_table() by name in a material, whose name must be set. Throws Error
/// for unknown names and values of a wrong type.
void read_parameters(wavecomb::Material& material, const nanobind::kwargs& values);
/// Returns material_table() as a list of dicts.
nanobind::list material_rows();
/// Returns a list of dicts that state which inputs each shading program reads.
nanobind::list program_rows();

/// Returns a material as a dict in the format of add_material. Throws Error if the index is out of
/// range.
nanobind::dict material_dict(const wavecomb::Scene& scene, uint32_t material);

/// Converts the arguments of the Python method Renderer.edit(). Parameters that the dicts do not
/// contain stay unchanged. Throws an `Error` that names the object and the parameter if a value is
/// invalid.
wavecomb::SceneEdit scene_edit(const wavecomb::Scene& scene, const nanobind::object& camera,
                               const nanobind::dict& materials, const nanobind::dict& lights,
                               const nanobind::dict& moves);
