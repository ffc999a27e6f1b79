# SPDX-License-Identifier: Apache-2.0
"""What this CPU runs. Only in a portable build."""

def isas() -> list[str]:
    """Instruction sets of wavecomb.isa.ISAS that this CPU and its system run, best first."""
