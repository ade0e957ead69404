# The inner loop: `just --list` says what there is; CONTRIBUTING.md how long each takes.

# what I changed: style and types of the changed files, and the fast tests of their rooms
changed since="HEAD":
    .ci/changed {{since}}

# the fast tests, of all rooms or of those named: `just fast simulate online`
fast *rooms:
    .ci/fast {{rooms}}

# all that a clean clone must pass, in this environment: style, types, imports, every test but the slow trials
all:
    .ci/check
