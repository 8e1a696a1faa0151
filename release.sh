#!/usr/bin/env bash
# Builds the FMUs and the closed loop for all platforms, with their sources, into build/release, with checksums
# and a bill of materials. ./run.sh and ./test.sh do not need it.
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # may lead to other modules than those tested here
cd "$(dirname "${BASH_SOURCE[0]}")"
case "$*" in
  "") ;;
  --help | -h) sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; exit ;;
  *) echo "usage: ./release.sh" >&2; exit 2 ;;
esac

./setup.sh --release

log=build/release.log
{ cmake -S . -B build -DBUILD_TESTING=OFF && cmake --build build --target release --parallel 2; } >"$log" 2>&1 ||
  { cat "$log" >&2; echo "release.sh: the build failed" >&2; exit 1; }
cd build/release
sha256sum --check --quiet SHA256SUMS
echo "in build/release, bytes:"
cut -c 67- SHA256SUMS | xargs wc -c
echo "install: pip install build/release/$(ls | grep '\.whl$'); import build/release/NAME.fmu: docs/use-in-your-tool.md"
