#!/usr/bin/env bash
# clang_tidy.sh SOURCE BUILD PATTERN ...: checks the C files below SOURCE that BUILD compiles and that
# match a pattern (of grep).
# Version 14: others know other checks. Needs a built tree, for the generated headers.
set -euo pipefail
source=$(realpath "$1")
build=$2
shift 2
files=()
for pattern in "$@"; do
  mapfile -t -O "${#files[@]}" files < <(
    sed -n "s#^ *\"file\": \"\($source/$pattern\.c\)\".*#\1#p" "$build/compile_commands.json" |
      sort -u)
done
[ "${#files[@]}" -gt 0 ] || { echo "no C files in $*" >&2; exit 1; }
echo "${#files[@]} files"
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P 2 clang-tidy-14 --quiet -p "$build" 2>/dev/null
