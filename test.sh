#!/usr/bin/env bash
# Sets up, builds and runs the tests, all by ctest.
#
#   ./test.sh               optimized, C and Python, and C with gcc's sanitizers
#   ./test.sh --all         then slow tests, clang's warnings, threads, analysers, other platforms, other importers, browsers
#   ./test.sh --long        all, then C tests by clang, on Arm and in valgrind, fuzzing, mutants and long campaigns: several hours, with a list of figures
#   ./test.sh ARGUMENTS     optimized only; of all tests those that ctest chooses by ARGUMENTS: ./test.sh -R instance
#
# Each installs what it needs. Tests for which something is missing nevertheless are skipped and named; in CI they fail.
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # they may lead to other modules than those tested here
cd "$(dirname "${BASH_SOURCE[0]}")"

step() { printf '\n== %s\n' "$*"; }
build() { # build PRESET [TARGET]
  local log="build/${2-$1}.log"
  { cmake --preset "$1" && cmake --build --preset "$1" ${2+--target "$2"}; } >"$log" 2>&1 || { cat "$log"; return 1; }
}

short() {
  ./setup.sh --dev

  step "AddressSanitizer and UndefinedBehaviorSanitizer; C tests"
  build asan
  ctest --preset asan --progress -j 2

  step "gcc, optimized; all tests but those that --all adds"
  build default
  ctest --preset default -j 2 -LE '^more$'
}

more() {
  ./setup.sh --platforms

  step "clang, all warnings are errors"
  build clang

  step "ThreadSanitizer; the test with many threads"
  build tsan
  ctest --preset tsan --progress

  step "other importers, each in its own environment"
  # without network the tests of those that are missing are skipped; CI must have them
  tests/importers/install.sh || [ -z "${CI-}" ]

  step "releases, playground, analysers, importers, browsers"
  build default
  build default release
  build default playground
  ctest --preset default -j 2 -L '^more$'
}

long() {
  local failed=0
  step "C tests: clang; 64-bit Arm in qemu, those of src and models"
  ctest --preset clang --progress -j 2 || failed=1
  build qemu
  ctest --preset qemu --progress -j 2 || failed=1

  step "long campaigns, fuzzing, mutants"
  build fuzz
  ctest --preset tsan -C Long || failed=1
  ctest --preset fuzz -C Long -j 2 || failed=1
  ctest --preset default -C Long -R '^(long_|test_faults_)' || failed=1
  grep -h '^figures: ' build/{tsan/,fuzz/,}Testing/Temporary/LastTest.log || failed=1
  return "$failed"
}

case "${1-}" in
  "") short ;;
  --all) short; more ;;
  --long) short; more; long ;;
  --help | -h) sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" ;;
  *)
    ./setup.sh --dev
    build default
    ctest --preset default -j 2 "$@" ;;
esac
