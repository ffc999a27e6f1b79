# SPDX-License-Identifier: Apache-2.0
"""Keeps the caller alive where a library crashes, or never ends, on a file that is broken.

``supervisor`` runs a command in a child; ``probe`` reads a stage in a process of its own before
``wavecomb.load`` does; ``trail`` says what such a process was at when it died; ``patience`` ends it
where USD composes without end. docs/decisions/isolation.md says what each costs.
"""
