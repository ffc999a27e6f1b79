# SPDX-License-Identifier: Apache-2.0
"""Two pictures beside each other."""
