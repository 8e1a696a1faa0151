#!/usr/bin/env bash
# clang_tidy.sh SOURCE BUILD CHECKS PATTERN ...: checks the C files below SOURCE that BUILD compiles
# and that match a pattern (of grep). CHECKS changes those of .clang-tidy: "-clang-analyzer-*".
# Version 14: others know other checks. Needs a built tree, for the generated headers.
set -euo pipefail
source=$(realpath "$1")
build=$2
checks=$3
shift 3
files=()
for pattern in "$@"; do
  mapfile -t -O "${#files[@]}" files < <(
    sed -n "s#^ *\"file\": \"\($source/$pattern\.c\)\".*#\1#p" "$build/compile_commands.json" |
      sort -u)
done
[ "${#files[@]}" -gt 0 ] || { echo "no C files in $*" >&2; exit 1; }
echo "${#files[@]} files"
printf '%s\0' "${files[@]}" |
  xargs -0 -n 1 clang-tidy-14 --quiet --checks="$checks" -p "$build" 2>/dev/null
