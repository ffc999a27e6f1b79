# SPDX-License-Identifier: Apache-2.0
"""Reasons why images differ from their references, and scenes that are not compared.

These complement the notes of the translators. Each sentence says how it was verified.
"""

_LAMP = "Ours are black from the front, too: with a black lamp Mitsuba gives our picture (as ours)"
_BECKMANN = "Given GGX in place of Beckmann, Mitsuba gives our picture within noise (as ours)"
_ROUGH_PLASTIC = (
    "Under a rough coat Mitsuba loses light: of a white base in a white furnace it gives back "
    "0.91, 0.61 and 0.33 at alphas of 0.1, 0.4 and 1, ours 1.00, 0.99 and 0.97; the coats alone "
    "agree within 1.5 %"
)
_INSTANCES = (
    "What is missing is the reflection: the reference adds 5 % (median) of what a white surface "
    "would give more, and an index of 1.5 reflects 4 % at normal incidence"
)

WHY = {
    "arnold test_0000": "One sample a pixel there: edges. With the cage as polygons we cover "
    "0.3403 of the picture, the reference 0.3402, the limit surface 0.3338",
    "arnold test_0025": "Edges of the cells: 9 samples a pixel there, and our checkerboard is an "
    "image",
    "arnold test_0026": "The outlines' samples are left. Bilinear, the absolute difference is 17 %",
    "arnold test_0037": "Shaded as smooth, some facets face away from a light that their normals "
    "face: they are dark here, and lit by Arnold",
    "arnold test_0132": "As Rec.709 its red would be 41 % too dark; 1.705 x 0.549, ACEScg's red in "
    "Rec.709, is the reference's 0.93",
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
    "mitsuba bsdf_spheres/test_normalmap_identity_roughconductor_path": "Brushed and "
    "rough: ours gives back what is scattered between facets, Mitsuba loses it",
    "mitsuba veach_mis/veach_mis": _BECKMANN,
    "mitsuba bsdf_spheres/test_roughplastic_linear_path": _ROUGH_PLASTIC,
    "mitsuba bsdf_spheres/test_roughplastic_nonlinear_path": _ROUGH_PLASTIC,
}

_NO_PICTURE = "no reference picture is among the assets, and no Tungsten that would render one"

LISTED = {
    "tungsten materialtest": f"{_NO_PICTURE}; its coat over a rough conductor absorbs by thickness",
    "tungsten example-scenes/cornell-box": _NO_PICTURE,
    "tungsten example-scenes/water-caustic": _NO_PICTURE,
    "mitsuba volprim_rf_basic": "ellipsoids of a radiance field, whose scene is not there",
}
