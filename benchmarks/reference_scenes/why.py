# SPDX-License-Identifier: Apache-2.0
"""Reasons why images differ from their references, and scenes that are not compared.

The reasons complement the notes of the translators. Each reason also states how it was verified.
"""

_LAMP = "Wavecomb's light reflects nothing; with a black light Mitsuba renders our image (as ours)"
_BECKMANN = "With GGX instead of Beckmann, Mitsuba renders our image within noise (as ours)"
_ROUGH_PLASTIC = (
    "Mitsuba loses light under a rough coat: the albedo of a white base in a white furnace is "
    "0.91, 0.61 and 0.33 at alphas of 0.1, 0.4 and 1, ours is 1.00, 0.99 and 0.97; the coats alone "
    "agree within 1.5 %"
)
_INSTANCES = (
    "Our specular reflection is missing: the reference is brighter by 5 % (median) of the "
    "difference to a white surface, and an index of 1.5 reflects 4 % at normal incidence"
)

WHY = {
    "arnold test_0000": "The reference has one sample per pixel: edges. With the cage as polygons "
    "we cover 0.3403 of the image, the reference 0.3402, the limit surface 0.3338",
    "arnold test_0025": "Edges of the cells: the reference has 9 samples per pixel, and our "
    "checkerboard is an image",
    "arnold test_0026": "Only samples at outlines differ. With bilinear filtering the absolute "
    "difference is 17 %",
    "arnold test_0037": "With smooth shading, some facets face away from a light that their "
    "shading normals face: they are dark in Wavecomb and lit in Arnold",
    "arnold test_0132": "Read as Rec.709, its red would be 41 % too dark; 1.705 x 0.549, ACEScg's "
    "red in Rec.709, is the reference's 0.93",
    "arnold test_0186": _INSTANCES,
    "arnold test_0194": _INSTANCES,
    "mitsuba cbox/cbox-rgb": _LAMP,
    "mitsuba cbox/cbox-spectral": _LAMP,
    "mitsuba cbox/cbox": _LAMP,
    "mitsuba bsdf_spheres/test_arealight_path": _BECKMANN,
    "mitsuba bsdf_spheres/test_pointlight_path": _BECKMANN,
    "mitsuba bsdf_spheres/test_constant_path": _BECKMANN,
    "mitsuba bsdf_spheres/test_envmap_path": _BECKMANN,
    "mitsuba bsdf_spheres/test_roughdielectric_path": _BECKMANN,
    "mitsuba bsdf_spheres/test_normalmap_identity_roughconductor_path": "Anisotropic "
    "and rough: Wavecomb compensates for multiple scattering, Mitsuba does not",
    "mitsuba veach_mis/veach_mis": _BECKMANN,
    "mitsuba bsdf_spheres/test_roughplastic_linear_path": _ROUGH_PLASTIC,
    "mitsuba bsdf_spheres/test_roughplastic_nonlinear_path": _ROUGH_PLASTIC,
}

_NO_PICTURE = "the assets have no reference image, and Tungsten is not available to render one"

LISTED = {
    "tungsten materialtest": f"{_NO_PICTURE}; its coat over a rough conductor absorbs by thickness",
    "tungsten example-scenes/cornell-box": _NO_PICTURE,
    "tungsten example-scenes/water-caustic": _NO_PICTURE,
    "mitsuba volprim_rf_basic": "ellipsoids of a radiance field; the scene file is missing",
}
