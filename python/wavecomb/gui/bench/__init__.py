# SPDX-License-Identifier: Apache-2.0
"""The panel that runs benchmark suites."""
