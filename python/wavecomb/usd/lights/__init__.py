# SPDX-License-Identifier: Apache-2.0
"""UsdLux lights."""
