# SPDX-License-Identifier: Apache-2.0
"""Isolates the caller from libraries that crash or hang on invalid files.

``supervisor`` runs a command in a child process, ``sandbox`` builds the bubblewrap command for it,
and ``outputs`` moves its finished files to their names. ``progress_notes`` records the current
activity of the child for crash messages. ``memory`` limits its memory, and ``time_limit`` ends it
if USD composition does not terminate. docs/decisions/sandbox.md describes the costs.
"""
