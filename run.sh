#!/usr/bin/env bash
# Sets up, builds the FMUs, simulates scenarios, compares them with references.
#
#   ./run.sh                     all scenarios
#   ./run.sh NAME ...            these scenarios
#   ./run.sh FILE.toml           a scenario of your own, from anywhere
#   ./run.sh new NAME            write NAME.toml, a scenario to start from
#   ./run.sh list                names of the scenarios; also --list
#   ./run.sh system              all variants of all systems in Ecos
#   ./run.sh system NAME ...     these variants, or all of these systems
#   ./run.sh coupling            what the coupling of the closed loop costs
#   ./run.sh playground          make a page with the plant, for a browser
#   ./run.sh campaign FILE.toml  many runs over parameters, on all cores
#   ./run.sh federation          the closed loop, each FMU in its own process
#   ./run.sh federate            one of these processes, on another machine
#   ./run.sh help COMMAND        all options of a command; of scenarios: run
#
#   --open     then open the page in a browser: scenarios, system, playground
#   --fmi 3    only FMUs of FMI 3.0: scenarios, system, coupling, federation
#   --json     one JSON document on standard output, all else on standard error
#   --quiet    the last line only, and what is wrong
#
# Exit codes: 0 all well, 1 a result is bad, 2 wrong use or failure, 130 Ctrl-C.
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # may lead to other modules than those tested here
root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# the command, which --json and --quiet may precede, and what of the arguments matters here
command="" quiet=no help=no  # help: nothing is run
for argument; do
  case "$argument" in
    --) break ;;
    --quiet) quiet=yes ;;
    --json) ;;
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

# set_up OPTION ...: what is missing; nothing of it is a result
set_up() {
  if [ "$quiet" = yes ]; then "$root/setup.sh" "$@" >/dev/null; else "$root/setup.sh" "$@" >&2; fi
}

# build WHAT OPTION ...: with these options of cmake --build
build() {
  stage "configuring"
  : >"$log"
  cmake -S "$root" -B "$root/build" -DBUILD_TESTING=OFF 2>&1 | follow &&
    stage "building $1" &&
    cmake --build "$root/build" "${@:2}" 2>&1 | follow ||
    { cat "$log" >&2; echo "run.sh: the build failed" >&2; exit 1; }
}

# Whether it cannot be the name of a scenario: then nothing is built before Python says so.
is_unknown() {
  case "$1" in
    "" | -* | *.[Tt][Oo][Mm][Ll]) return 1 ;;
    run | new | system | coupling | campaign | federation) return 1 ;;
  esac
  ! compgen -G "$root/models/*/scenarios/$1.toml" >/dev/null
}

case "$command" in
  --help | -h) usage; exit ;;
  help)
    case "${*: -1}" in
      help | --json | --quiet) usage; exit ;;
      playground) command=playground help=yes ;;
    esac
    ;;
esac

if [ "$command" = playground ]; then
  [ "$help" = no ] || { echo "usage: ./run.sh playground [--open] [--quiet]"; exit; }
  for argument; do
    case "$argument" in
      playground | --open | --quiet) ;;
      *) echo "usage: ./run.sh playground [--open] [--quiet]" >&2; exit 2 ;;
    esac
  done
  set_up --release
  SECONDS=0
  page="$root/build/playground/index.html"
  log="$root/build/playground.log"
  build "the playground" --target playground
  echo "$page: $(wc -c <"$page") bytes, built in $SECONDS s"
  [[ " $* " != *" --open "* ]] || PYTHONPATH="$root" "$root/build/venv/bin/python" -P -c \
    "import pathlib, sys; from rparm.report import browser; browser.show(pathlib.Path(sys.argv[1]))" "$page"
  exit
fi

case "$command" in
  campaign) set_up --campaign ;;
  federation | federate) set_up --federation ;;
  *) set_up ;;
esac
log="$root/build/build.log"
case "$command" in
  help | list | --list | --version | federate) ;;
  *) [ "$help" = yes ] || is_unknown "$command" || build "the FMUs" --parallel 2 ;;
esac
[ -n "$command" ] || set -- run "$@"
export PYTHONPATH="$root"
exec "$root/build/venv/bin/python" -P -m rparm "$@"  # -P: no modules from the current folder
