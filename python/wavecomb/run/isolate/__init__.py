# SPDX-License-Identifier: Apache-2.0
"""Keeps the caller alive where a library crashes, or never ends, on a file that is broken.

``supervisor`` runs a command in a child; ``wavecomb.run.boxed`` reads stages for ``wavecomb.load``
in a process of its own; ``box`` is the sandbox of both; ``trail`` says what such a process was at
when it died; ``patience`` ends it where USD composes without end. docs/decisions/isolation.md says
what each costs.
"""
