#!/usr/bin/env bash
# Sets up, builds the FMUs, simulates scenarios, compares them with references.
#
#   ./run.sh                     all scenarios
#   ./run.sh NAME ...            these scenarios
#   ./run.sh FILE.toml           a scenario of your own, from anywhere
#   ./run.sh new NAME            write NAME.toml, a scenario to start from
#   ./run.sh build FILE.toml     make FMUs of a file with equations
#   ./run.sh new-model NAME      write such a file to start from
#   ./run.sh list                names of the scenarios; also --list
#   ./run.sh system              all variants of all systems in Ecos
#   ./run.sh system NAME ...     these variants, or all of these systems
#   ./run.sh coupling            what the coupling of the closed loop costs
#   ./run.sh playground          make a page with the plant, for a browser
#   ./run.sh campaign FILE.toml  many runs over parameters, on all cores
#   ./run.sh linearize NAME      linear model of an FMU or a system, margins
#   ./run.sh identify FMU LOG    parameters that fit a log of a machine
#   ./run.sh prove NAME          how far a run is from the exact motion at most
#   ./run.sh federation          the closed loop, each FMU in its own process
#   ./run.sh federate            one of these processes, on another machine
#   ./run.sh fmu NAME            copy an FMU, for another tool
#   ./run.sh completion SHELL    what makes bash, zsh or tcsh complete all this
#   ./run.sh help COMMAND        all options of a command; of scenarios: run
#
#   --open         then show what was written in a browser
#   --output DIR   write into this folder
#   --fmi 3        only FMUs of FMI 3.0: scenarios, system, coupling, federation
#   --json         print one JSON document, and all else on standard error
#   --quiet        print the last line only, and what is wrong
#
# Exit codes: 0 all well, 1 a result is bad, 2 wrong use or failure, 130 Ctrl-C,
# 141 whoever read the output has left, as head does.
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # may lead to other modules than those tested here
root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# the command, which --json and --quiet may precede, and what of the arguments matters here
command="" quiet=no json=no help=no  # help: nothing is run
for argument; do
  case "$argument" in
    --) break ;;
    --quiet) quiet=yes ;;
    --json) json=yes ;;
    *)
      [ -n "$command" ] || command=$argument
      case "$command $argument" in *" --help" | *" -h" | "run --list") help=yes ;; esac
      ;;
  esac
done

usage() { sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }
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

# fail TEXT: end because nothing can be run
fail() {
  echo "run.sh: $*" >&2
  [ "$json" = no ] || printf '{"exit_code": 2, "error": "%s"}\n' "$*"
  exit 2
}

# set_up OPTION ...: what is missing; nothing of it is a result
set_up() {
  if [ "$quiet" = yes ]; then "$root/setup.sh" "$@" >/dev/null; else "$root/setup.sh" "$@" >&2; fi ||
    fail "the set-up failed"
}

# build WHAT OPTION ...: with these options of cmake --build
build() {
  log="$root/build/build.log"
  stage "configuring"
  : >"$log"
  cmake -S "$root" -B "$root/build" -DBUILD_TESTING=OFF 2>&1 | follow &&
    stage "building $1" &&
    cmake --build "$root/build" "${@:2}" 2>&1 | follow ||
    { cat "$log" >&2; fail "the build failed, build/build.log says why"; }
}

# Whether it cannot be the name of a scenario: then nothing is built before Python says so.
is_unknown() {
  case "$1" in
    "" | -* | *.[Tt][Oo][Mm][Ll]) return 1 ;;
    run | new | system | coupling | campaign | federation | fmu | linearize | identify | prove | build) return 1 ;;
  esac
  ! compgen -G "$root/models/*/scenarios/$1.toml" >/dev/null
}

if [ "$json" = no ]; then
  case "$command ${*: -1}" in
    --help\ * | -h\ * | "help help" | "help --quiet") usage; exit ;;
  esac
fi
[ "$command" != help ] || help=yes

case "$command" in
  campaign) set_up --campaign ;;
  federation | federate) set_up --federation ;;
  linearize | identify) set_up --control ;;
  playground) if [ "$help" = yes ]; then set_up; else set_up --release; fi ;;
  *) set_up ;;
esac
case "$command" in
  list | --list | --version | --help | -h | federate | completion) ;;
  playground) [ "$help" = yes ] || build "the playground" --target playground ;;
  *) [ "$help" = yes ] || is_unknown "$command" || build "the FMUs" --parallel 2 ;;
esac
[ -n "$command" ] || set -- run "$@"
export PYTHONPATH="$root"
exec "$root/build/venv/bin/python" -P -m rparm "$@"  # -P: no modules from the current folder
