#!/usr/bin/env bash
# Installs importers other than fmpy for test_importers.py, each into its folder
# build/importers/TOOL. Quick when there is nothing to do. A tool that cannot be installed is named,
# the others are installed all the same, and the exit code is 1.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

ci_tools=(ecospy osp fmuloader fmu-manipulation-toolbox casadi)
heavy_tools=(fmi-sim) # minutes

usage() {
  cat >&2 <<USAGE
usage: tests/importers/install.sh [--all | TOOL ...]
       tests/importers/install.sh --check TOOL    installs nothing; exit code 0: it is installed
tools: ${ci_tools[*]} (these without an argument)
       ${heavy_tools[*]}
USAGE
  exit 2
}

fmi_sim=fmi-sim@0.7.0 # its dependencies are in its Cargo.lock

is_tool() { [[ " ${ci_tools[*]} ${heavy_tools[*]} " == *" $1 "* ]]; }

# A tool's packages, with their hashes. Its short list, NAME.in, has the tool and what its results or its
# working depend on.
lock() { echo "tests/importers/requirements/$1.txt"; }

# Python module that must load once the tool is installed
module() {
  case "$1" in
    osp) echo libcosimpy ;;
    fmu-manipulation-toolbox) echo fmu_manipulation_toolbox ;;
    *) echo "${1//-/_}" ;;
  esac
}

complain() { echo "install.sh: $*" >&2; }

# ---- system packages

# system_package NAME CHECK ...: NAME is installed where CHECK fails
system_package() {
  local name=$1
  "${@:2}" >/dev/null 2>&1 && return
  local install="apt-get install -y --no-install-recommends $name" sudo=""
  [ "$(id -u)" -eq 0 ] || sudo="sudo"
  command -v apt-get >/dev/null && { [ -z "$sudo" ] || command -v sudo >/dev/null; } || {
    complain "please install $name (on Debian or Ubuntu, as root: $install)"; return 1; }
  echo "install.sh: installing $name"
  $sudo env DEBIAN_FRONTEND=noninteractive sh -c "apt-get update -qq && $install -qq" >/dev/null ||
    { complain "this failed: $sudo $install"; return 1; }
}

has_libclang() { compgen -G '/usr/lib/llvm-*/lib/libclang.so'; }
has_libtbb() { compgen -G '/usr/lib/*/libtbb.so.12'; }

# ---- tools

# What the folder was made from: another lock or another Python makes it again.
stamp() {
  [ "$1" != fmi-sim ] || { echo "$fmi_sim"; return; }
  sha256sum "$(lock "$1")"
  python3 -c 'import sys; print("Python %d.%d" % sys.version_info[:2])'
}

is_installed() {
  local file=build/importers/$1/installed
  [ -e "$file" ] && [ "$(stamp "$1")" = "$(cat "$file")" ]
}

with_python() {
  local tool=$1 folder=build/importers/$1
  python3 -m venv --clear --without-pip "$folder" || return 1
  requirements/install.sh "$(lock "$tool")" "$folder/bin/python" || return 1
  if [ "$tool" = ecospy ]; then
    # its wheel has the programs without their run bits
    chmod +x "$folder"/lib/python3*/site-packages/ecospy/binaries/{ecos,proxyfmu} || return 1
  fi
  "$folder/bin/python" -c "import $(module "$tool")" >/dev/null
}

with_cargo() {
  local folder=$PWD/build/importers/$1
  command -v cargo >/dev/null || { echo "cargo, of Rust, is missing"; return 1; }
  system_package libclang-dev has_libclang || return 1
  rm -rf "$folder" && mkdir -p "$folder" || return 1
  CARGO_TARGET_DIR="$folder/target" \
    cargo install --quiet --locked --root "$folder" "$fmi_sim" || return 1
  rm -rf "$folder/target"
}

install_tool() {
  local tool=$1 log=build/importers/$1.log how=with_python
  [ "$tool" != fmi-sim ] || how=with_cargo
  # Ecos links to the first and unpacks FMUs by the command of the second
  [ "$tool" != ecospy ] || { system_package libtbb12 has_libtbb && system_package unzip command -v unzip; } || return 1
  is_installed "$tool" && return
  echo "install.sh: installing $tool into build/importers/$tool"
  rm -f "build/importers/$tool/installed"
  mkdir -p build/importers
  "$how" "$tool" >"$log" 2>&1 || { tail -n 20 "$log" >&2; return 1; }
  stamp "$tool" >"build/importers/$tool/installed"
}

tools=("${ci_tools[@]}")
case "${1-}" in
  "") ;;
  --all) [ $# -eq 1 ] || usage; tools+=("${heavy_tools[@]}") ;;
  --check) [ $# -eq 2 ] && is_tool "$2" || usage; is_installed "$2"; exit ;;
  *) tools=("$@") ;;
esac
for tool in "${tools[@]}"; do is_tool "$tool" || usage; done

failed=()
for tool in "${tools[@]}"; do
  install_tool "$tool" || failed+=("$tool")
done
if [ "${#failed[@]}" -gt 0 ]; then
  complain "could not be installed: ${failed[*]}"
  exit 1
fi
missing=()
for tool in "${ci_tools[@]}" "${heavy_tools[@]}"; do
  is_installed "$tool" || missing+=("$tool")
done
[ "${#missing[@]}" -eq 0 ] ||
  echo "install.sh: not installed, so their tests are skipped: ${missing[*]} (--all installs them)"
