#!/usr/bin/env bash
# Sets up, builds and runs the tests, all by ctest.
#
#   ./test.sh               optimized, C and Python
#   ./test.sh --all         then slow tests, gcc's sanitizers, analysers, other platforms, other importers, browsers
#   ./test.sh --long        all, then C tests by clang, on Arm and in valgrind, fuzzing, mutants and long campaigns: several hours, with a list of figures
#   ./test.sh ARGUMENTS     optimized only; of all tests those that ctest chooses by ARGUMENTS: ./test.sh -R instance
#
# Each installs what it needs. Tests for which something is missing nevertheless are skipped and named; in CI they fail.
# Then build/venv/bin/python -m tests.support.times shows where the time went.
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # they may lead to other modules than those tested here
cd "$(dirname "${BASH_SOURCE[0]}")"

# timed NAME COMMAND ...: runs it; build/times.csv gets the name, seconds, and seconds of processors (user, system)
timed() {
  local TIMEFORMAT="$1,%R,%U,%S"
  printf '\n== %s\n' "$1"
  mkdir -p build/times
  { time "${@:2}" 2>&3; } 3>&2 2>>build/times.csv
}
build() { # build PRESET [TARGET]
  local log="build/${2-$1}.log"
  { cmake --preset "$1" && cmake --build --preset "$1" ${2+--target "$2"}; } >"$log" 2>&1 || { cat "$log"; return 1; }
}
tests() { # tests NAME PRESET [OPTION ...]: of ctest; its times go to build/times/NAME.xml
  ctest --preset "$2" -j 2 --output-junit "$PWD/build/times/$1.xml" "${@:3}"
}

short() {
  timed "set-up" ./setup.sh --dev
  timed "build: gcc, optimized" build default
  timed "tests: all but those that --all adds" tests default default -LE '^more$'
}

more() {
  timed "set-up: platforms" ./setup.sh --platforms
  timed "build: AddressSanitizer and UndefinedBehaviorSanitizer" build asan
  timed "tests: sanitizers, C" tests asan asan --progress
  timed "build: ThreadSanitizer" build tsan
  timed "tests: ThreadSanitizer, many threads" tests tsan tsan --progress
  # without network the tests of those that are missing are skipped; CI must have them
  timed "set-up: other importers" tests/importers/install.sh || [ -z "${CI-}" ]
  timed "build: gcc, what needs other programs" build default
  timed "build: releases" build default release
  timed "build: playground" build default playground
  # three at once: browsers and federations wait
  timed "tests: releases, playground, analysers, importers, browsers" tests more default -L '^more$' -j 3
}

long() {
  local failed=0
  timed "build: clang" build clang
  timed "tests: clang, C" tests clang clang --progress || failed=1
  timed "build: 64-bit Arm" build qemu
  timed "tests: C of src and models in qemu" tests qemu qemu --progress || failed=1
  timed "build: fuzzing" build fuzz
  timed "tests: threads, long" tests long_threads tsan -C Long || failed=1
  timed "tests: fuzzing" tests long_fuzz fuzz -C Long || failed=1
  timed "tests: long campaigns, mutants" tests long default -C Long -R '^(long_|test_faults_)' || failed=1
  grep -h '^figures: ' build/{tsan/,fuzz/,}Testing/Temporary/LastTest.log | tee build/times/figures.txt || failed=1
  return "$failed"
}

[[ "${1-}" != "" && "${1-}" != --all && "${1-}" != --long ]] || rm -rf build/times build/times.csv
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
