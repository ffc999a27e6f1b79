# SPDX-License-Identifier: Apache-2.0
"""The way in: a USD file to a scene."""
