#!/usr/bin/env bash
# Writes the lock files: for each short list NAME.in here and in tests/importers/requirements, NAME.txt with the
# versions and hashes of all that it needs, on every system. Call it when a list has changed.
#   requirements/lock.sh [--upgrade]
# Versions that are locked stay where the lists let them; with --upgrade, dependencies become the newest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
case "$*" in
  "" | --upgrade) upgrade=("$@") ;;
  *) sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
esac
work=build/requirements
mkdir -p "$work"

# solve LOCK OPTION ...: versions that LOCK has already are kept
solve() {
  build/venv/bin/python -m uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
    --fork-strategy fewest --emit-build-options --no-header --no-annotate --output-file "$@"
}

# write LOCK [LINE ...]: the solution, below these lines
write() {
  printf '%s\n' "# Made by requirements/lock.sh from $(basename "${1%.txt}").in." "${@:2}" |
    cat - "$work/solution.txt" >"$1"
}

# These go into one environment: all are solved at once, and run.txt is a part of the others.
cat requirements/*.txt 2>/dev/null | grep -v '^-' >"$work/all.txt" || true
solve "$work/all.txt" "${upgrade[@]}" requirements/*.in
for name in run campaign federation control release dev; do
  above=() others=()
  if [ "$name" != run ]; then
    above=("-r run.txt")
    # not those that run.txt has for some systems only: the others may need them everywhere
    mapfile -t others < <(sed -n 's/^\([a-z0-9-]*\)==[^;]*$/--no-emit-package=\1/p' requirements/run.txt)
  fi
  rm -f "$work/solution.txt"
  solve "$work/solution.txt" --constraints "$work/all.txt" "${others[@]}" "requirements/$name.in"
  write "requirements/$name.txt" "${above[@]}"
done

for list in tests/importers/requirements/*.in; do
  lock=${list%.in}.txt
  cp "$lock" "$work/solution.txt" 2>/dev/null || rm -f "$work/solution.txt"
  solve "$work/solution.txt" "${upgrade[@]}" "$list"
  write "$lock"
done
