# SPDX-License-Identifier: Apache-2.0
"""Detects the instruction sets of this CPU; exists only in a portable build."""

def isas() -> list[str]:
    """Returns the members of wavecomb.isa.ISAS that this CPU and its system support, best first."""
