# SPDX-License-Identifier: Apache-2.0
"""Value graphs: expressions of typed operations, folded, shared and put into flat programs.

``node`` says what a value is, ``expressions`` makes values, ``linear`` knows sums among them,
``program`` gives them registers. ``surface``, ``attributes``, ``bind`` and ``colour`` are what
surfaces have of them.
"""
