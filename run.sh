#!/usr/bin/env bash
# Sets up, builds the FMUs, simulates scenarios with fmpy and compares them with their references.
#
#   ./run.sh                       all scenarios
#   ./run.sh NAME ...              these scenarios
#   ./run.sh FILE.toml             a scenario of your own, from anywhere
#   ./run.sh new NAME              write NAME.toml, a scenario to start from
#   ./run.sh --open                then open the report in a browser; also after system
#   ./run.sh --list                names of the scenarios, without building
#   ./run.sh system                all variants of all systems in Ecos
#   ./run.sh system NAME ...       these variants, or all of these systems; --list names both
#   ./run.sh coupling              what the coupling of the closed loop costs
#   ./run.sh playground            builds build/playground/index.html, the plant in a browser; --open opens it
#   ./run.sh campaign FILE.toml    many runs over parameters, on all cores: cosim/campaign/README.md
#   ./run.sh federation            the closed loop with each FMU in its own process: models/closed_loop/federation.md
#   ./run.sh federate              one of these processes, on another machine; builds nothing
#   ./run.sh --fmi 3               only FMUs of FMI 3.0; also after system and coupling
#   ./run.sh run --help            all options; also after system and coupling
set -euo pipefail
unset PYTHONPATH PYTHONHOME  # may lead to other modules than those tested here
if [ "${1-}" = --help ] || [ "${1-}" = -h ]; then
  sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
  exit
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

if [ "${1-}" = playground ]; then
  case "${*:2}" in
    "" | --open) ;;
    *) echo "usage: ./run.sh playground [--open]" >&2; exit 2 ;;
  esac
  "$root/setup.sh" --release
  SECONDS=0
  page="$root/build/playground/index.html"
  log="$root/build/playground.log"
  { cmake -S "$root" -B "$root/build" -DBUILD_TESTING=OFF && cmake --build "$root/build" --target playground; } >"$log" 2>&1 ||
    { cat "$log" >&2; echo "run.sh: the build failed" >&2; exit 1; }
  echo "$page: $(wc -c <"$page") bytes, built in $SECONDS s"
  [ -z "${2-}" ] || PYTHONPATH="$root" "$root/build/venv/bin/python" -P -c \
    "import pathlib, sys; from cosim.report import browser; browser.show(pathlib.Path(sys.argv[1]))" "$page"
  exit
fi

case "${1-}" in
  campaign) "$root/setup.sh" --campaign ;;
  federation | federate) "$root/setup.sh" --federation ;;
  *) "$root/setup.sh" ;;
esac
python="$root/build/venv/bin/python"
log="$root/build/build.log"

build() {
  cmake -S "$root" -B "$root/build" -DBUILD_TESTING=OFF &&
    cmake --build "$root/build" --parallel 2
}

export PYTHONPATH="$root"
if [ "${1-}" = --list ]; then
  exec "$python" -P -m cosim list "${@:2}"
fi
if [ "${1-}" = federate ]; then
  exec "$python" -P -m cosim "$@"
fi
build >"$log" 2>&1 || { cat "$log" >&2; echo "run.sh: the build failed" >&2; exit 1; }
case "${1-}" in
  run | new | system | coupling | campaign | federation) exec "$python" -P -m cosim "$@" ;;  # -P: no modules from the current folder
  *) exec "$python" -P -m cosim run "$@" ;;
esac
