#!/usr/bin/env bash
# Sets up, builds with gcc, with clang and with sanitizers, and runs all tests through ctest.
# Arguments go to the last ctest, the one that runs everything: ./test.sh -R slave
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

./setup.sh --dev

step() { printf '\n== %s\n' "$*"; }
build() { cmake --preset "$1" >build/"$1".log && cmake --build --preset "$1" >>build/"$1".log || {
  cat build/"$1".log; return 1; }; }

step "clang, all warnings are errors; C tests"
build clang
ctest --preset clang --progress -j 2

step "AddressSanitizer and UndefinedBehaviorSanitizer; C tests"
build asan
ctest --preset asan --progress -j 2

step "other importers, each in an environment of its own"
# without network the tests of those that are missing are skipped; CI must have them
tests/importers/install.sh || [ -z "${CI-}" ]

step "gcc, optimized; all tests"
build default
ctest --preset default -j 2 "$@"
