# SPDX-License-Identifier: Apache-2.0
"""Stages are read in a sandbox, and scenes are built here of what comes out of it.

``reader`` is the caller's side, ``child`` the process in the sandbox (``wavecomb.run.isolate``). It
opens a stage, composes and reads it, and tells ``record``'s builder; the calls go over a socket as
``wire`` has them, and ``replay`` makes them again, on a builder of the core, if they are as
``calls`` says. docs/decisions/reading-in-a-box.md says why, and what it costs.
"""
