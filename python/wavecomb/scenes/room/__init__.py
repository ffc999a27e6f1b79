# SPDX-License-Identifier: Apache-2.0
"""A dining room that is lit through a door that stands ajar."""
