#!/usr/bin/env bash
# gcc_analyzer.sh SOURCE BUILD: compiles the FMUs' sources with gcc -fanalyzer; a finding is
# an error, as any warning.
set -euo pipefail
cd "$1"
cmake --preset analyzer -B "$2" >/dev/null
cmake --build "$2" --clean-first -- -k
