# SPDX-License-Identifier: Apache-2.0
"""Keeps the caller alive where a library crashes, or never ends, on a file that is broken.

``supervisor`` runs a command in a child process, ``sandbox`` builds the bubblewrap command for it,
and ``outputs`` moves its finished files to their names. ``trail`` records what the child was doing,
for the message after a crash. ``memory`` limits its memory, and ``patience`` ends it where USD
composes without end. docs/decisions/sandbox.md says what this costs.
"""
