# SPDX-License-Identifier: Apache-2.0
"""The live picture: what is shown, how, and from where."""
