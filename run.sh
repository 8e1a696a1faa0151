#!/usr/bin/env bash
# Sets up, builds the FMUs and runs a command of rparm, from any folder: `./run.sh --help` names the
# commands, `./run.sh` alone runs all scenarios. rparm/needs.py says what each command needs.
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # may lead to other modules than those tested here
root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

stage() { [ "$quiet" = yes ] || echo "run.sh: $*" >&2; }

# Keeps what a build prints in the log; shows on a terminal how far it is, by the percentages of make.
follow() {
  local line filled bar=no
  [ "$quiet" = yes ] || [ ! -t 2 ] || bar=yes
  while IFS= read -r line; do
    printf '%s\n' "$line" >>"$log"
    if [ "$bar" = yes ] && [[ $line =~ ^\[\ *([0-9]+)%\] ]]; then
      printf -v filled '%*s' $((BASH_REMATCH[1] * 40 / 100)) ''
      printf '\rbuilding %3d %% |%-40s|' "${BASH_REMATCH[1]}" "${filled// /#}" >&2
    fi
  done
  [ "$bar" = no ] || printf '\r%60s\r' '' >&2
}

# fail TEXT: ends because nothing can be run
fail() {
  echo "run.sh: $*" >&2
  [ "$json" = no ] || printf '{"exit_code": 2, "error": "%s"}\n' "$*"
  exit 2
}

# set_up OPTION ...: installs what is missing; prints nothing on standard output
set_up() {
  if [ "$quiet" = yes ]; then "$root/setup.sh" "$@" >/dev/null; else "$root/setup.sh" "$@" >&2; fi ||
    fail "the set-up failed"
}

# build TARGET: configures, and builds this target of CMake
build() {
  local name="the FMUs"
  [ "$1" = all ] || name="the $1"
  log="$root/build/build.log"
  stage "configuring"
  : >"$log"
  cmake -S "$root" -B "$root/build" -DBUILD_TESTING=OFF 2>&1 | follow &&
    stage "building $name" &&
    cmake --build "$root/build" --target "$1" --parallel 2 2>&1 | follow ||
    { cat "$log" >&2; fail "the build failed, build/build.log says why"; }
}

# the environment's Python starts quicker than some that find one; without any, the set-up says which is needed
python="$root/build/venv/bin/python"
[ -x "$python" ] || python=python3
plan=$("$python" -P "$root/rparm/needs.py" "$@") || plan="- - no no - - -"
read -r lock target quiet json default sources made <<<"$plan"
if [ "$target" = overview ]; then
  echo "${plan#*$'\n'}"
  exit
fi
# what there was after the last time: nothing is asked where nothing has changed since
ready="$root/build/ready$lock.$target"
if [ ! -f "$ready" ] || [ "$(<"$ready")" != "$sources $made" ]; then
  if [ "$lock" = - ]; then set_up; else set_up "--$lock"; fi
  [ "$target" = - ] || build "$target"
  plan=$("$python" -P "$root/rparm/needs.py" "$@") && read -r _ _ _ _ _ _ made <<<"$plan" &&
    echo "$sources $made" >"$ready" || true
fi
[ "$default" = - ] || set -- "$default" "$@"
export PYTHONPATH="$root"
exec "$root/build/venv/bin/python" -P -m rparm "$@"  # -P: no modules from the current folder
