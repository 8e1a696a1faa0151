#!/usr/bin/env bash
# Sets up, builds with gcc, with clang and with sanitizers, and runs all tests through ctest. What
# ./setup.sh --platforms installs is used where it is installed.
#   ./test.sh [--long] [ARGUMENTS]
# --long: then also the long campaigns (an hour and a half), with a table of their figures at the end.
# ARGUMENTS go to the ctest that runs everything: ./test.sh -R instance
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # they may lead to other modules than those tested here
cd "$(dirname "${BASH_SOURCE[0]}")"

if [ "${1-}" = --help ] || [ "${1-}" = -h ]; then
  sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
  exit
fi
long=no
if [ "${1-}" = --long ]; then
  long=yes
  shift
fi

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

step "ThreadSanitizer; the test with many threads"
build tsan
ctest --preset tsan --progress

step "libFuzzer, ten seconds a target"
build fuzz
ctest --preset fuzz --progress -j 2

if command -v qemu-aarch64-static >/dev/null && command -v aarch64-linux-gnu-gcc >/dev/null; then
  step "64-bit Arm in qemu; C tests of src and models"
  build qemu
  ctest --preset qemu --progress -j 2
else
  step "64-bit Arm: skipped, ./setup.sh --platforms installs what it needs"
fi

step "other importers, each in its own environment"
# without network the tests of those that are missing are skipped; CI must have them
tests/importers/install.sh || [ -z "${CI-}" ]

step "gcc, optimized; all tests"
build default
if build/venv/bin/python -c 'import ziglang' 2>/dev/null; then
  cmake --build --preset default --target release >build/release.log 2>&1 || { cat build/release.log; exit 1; }
  cmake --build --preset default --target playground >build/playground.log 2>&1 || { cat build/playground.log; exit 1; }
else
  echo "release and playground: skipped, ./setup.sh --platforms installs what it needs"
fi
ctest --preset default -j 2 "$@"

if [ "$long" = yes ]; then
  step "long campaigns"
  failed=0
  ctest --preset tsan -C Long || failed=1
  ctest --preset fuzz -C Long -L long -j 2 || failed=1
  ctest --preset default -C Long -R '^(long_|test_faults_)' || failed=1
  python3 tests/robustness/figures.py build/{tsan/,fuzz/,}Testing/Temporary/LastTest.log
  exit "$failed"
fi
