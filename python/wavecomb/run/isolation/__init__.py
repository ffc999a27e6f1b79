# SPDX-License-Identifier: Apache-2.0
"""Isolates the calling process from libraries that crash or hang on invalid files.

``supervisor`` runs a command in a child process. ``sandbox`` builds the bubblewrap command line of
the child, and ``outputs`` moves finished files to their destinations. ``progress_notes`` records
what the child is doing, for crash messages. ``memory`` limits the child's memory. ``time_limit``
ends the child if USD composition does not terminate. The costs are in docs/decisions/sandbox.md.
"""
