#!/usr/bin/env bash
# clang_tidy.sh SOURCE BUILD --checks=CHANGES PATTERN ...: checks the C files below SOURCE that BUILD
# compiles and that match a pattern (of grep). CHANGES apply to the checks of .clang-tidy.
# Version 14: others know other checks. Needs a built tree, for the generated headers.
set -euo pipefail
source=$(realpath "$1")
build=$2
checks=$3
shift 3
[[ $checks == --checks=* ]] || { echo "expected --checks=, got $checks" >&2; exit 1; }
files=()
for pattern in "$@"; do
  mapfile -t -O "${#files[@]}" files < <(
    sed -n "s#^ *\"file\": \"\($source/$pattern\.c\)\".*#\1#p" "$build/compile_commands.json" |
      sort -u)
done
[ "${#files[@]}" -gt 0 ] || { echo "no C files in $*" >&2; exit 1; }
echo "${#files[@]} files"
commands=$(mktemp -d)
trap 'rm -r "$commands"' EXIT
# clang does not know these options of gcc
sed 's/ -m[a-z]*-strategy=[^ ]*//g' "$build/compile_commands.json" >"$commands/compile_commands.json"
printf '%s\0' "${files[@]}" |
  xargs -0 -n 1 clang-tidy-14 --quiet "$checks" -p "$commands" 2>/dev/null
