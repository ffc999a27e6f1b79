# SPDX-License-Identifier: Apache-2.0
"""Why pictures differ from their references, and what is not compared."""

WHY: dict[str, str] = {}
LISTED: dict[str, str] = {}
