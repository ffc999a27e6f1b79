# SPDX-License-Identifier: Apache-2.0
"""Isolates the caller from libraries that crash or hang on invalid files.

``supervisor`` runs a command in a child process, ``sandbox`` builds the bubblewrap command for it,
and ``outputs`` moves finished files to their destinations. ``progress_notes`` records the current
activity of the child for crash messages. ``memory`` limits the child's memory, and ``time_limit``
ends the child if USD composition does not terminate. docs/decisions/sandbox.md describes the costs.
"""
