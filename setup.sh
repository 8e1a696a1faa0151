#!/usr/bin/env bash
# Installs what the project needs. Touches nothing outside this folder but the system's packages; quick when
# there is nothing to do.
#
#   ./setup.sh              for building and ./run.sh
#   ./setup.sh --LIST       what requirements/LIST.txt names, too: ./run.sh asks for what a command needs
#   ./setup.sh --control    so for ./run.sh linearize, identify
#   ./setup.sh --release    so for ./release.sh
#   ./setup.sh --dev        for ./test.sh too
#   ./setup.sh --platforms  for ./test.sh --all too: clang, analysers, other platforms, browsers
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

usage() { echo "usage: ./setup.sh [--LIST | --platforms], LIST.txt is in requirements/" >&2; exit 2; }
[ "$#" -le 1 ] || usage
lists=(run)
case "${1-}" in
  "") ;;
  --dev) lists+=(campaign federation control dev) ;;
  --platforms) lists+=(campaign federation control release dev) ;;
  --help | -h) sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; exit ;;
  --[a-z]*) lists+=("${1#--}"); [ -f "requirements/${1#--}.txt" ] || usage ;;
  *) usage ;;
esac
has() { [[ " ${lists[*]} " == *" $1 "* ]]; }

fail() { echo "setup.sh: $*" >&2; exit 1; }

# a folder that was moved or copied: what CMake and venv keep in build/ names the old place
home=$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' build/CMakeCache.txt 2>/dev/null || true)
if [ -n "$home" ] && [ ! "$home" -ef "$PWD" ]; then
  echo "setup.sh: build/ belongs to $home, making a new one"
  rm -rf build
fi
mkdir -p build 2>/dev/null && [ -w build ] || fail "the folder $PWD cannot be written"

# ---- system packages

has_libtbb() { compgen -G '/usr/lib/*/libtbb.so.12'; }
# libFuzzer and sanitizers of clang lie beside this one
has_clang_runtime() { test -e "$(clang --rtlib=compiler-rt -print-libgcc-file-name)"; }
has_venv() { python3 -c 'import ensurepip, venv' 2>/dev/null; }
missing=()
need() { "${@:2}" >/dev/null 2>&1 || missing+=("$1"); }

command -v python3 >/dev/null || fail "python3 (3.11 or later) is missing"
python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
  fail "Python 3.11 or later is needed, this is $(python3 --version)"
need cmake command -v cmake
need make command -v make
need gcc command -v gcc
need libc6-dev test -e /usr/include/math.h
need python3-venv has_venv
# Ecos links to the first and unpacks FMUs by the command of the second
need libtbb12 has_libtbb
need unzip command -v unzip
if has release; then
  need llvm command -v llvm-ar
fi
if [ "${1-}" = --platforms ]; then
  need clang command -v clang
  need libclang-rt-dev has_clang_runtime
  need clang-tidy-14 command -v clang-tidy-14
  need cppcheck command -v cppcheck
  need valgrind command -v valgrind
  need ninja-build command -v ninja  # of the mutants: make looks at 130 targets for seconds
  # what a user's own loop of CVODE links, to compare with: for the benchmark only
  need libsundials-dev test -e /usr/include/cvode/cvode.h
  need wine64 test -e /usr/lib/wine/wine64
  need wine command -v wine
  need qemu-user-static command -v qemu-aarch64-static
  need gcc-aarch64-linux-gnu command -v aarch64-linux-gnu-gcc
  need libc6-dev-arm64-cross test -e /usr/aarch64-linux-gnu/include/math.h
  need gcc-mingw-w64-x86-64 command -v x86_64-w64-mingw32-gcc
  # of the tests of campaigns on two hosts
  need iproute2 command -v ip
  # of the tests of pages
  need chromium command -v chromium
  need chromium-driver command -v chromedriver
  need firefox-esr command -v firefox-esr
fi

if [ "${#missing[@]}" -gt 0 ]; then
  install="apt-get install -y --no-install-recommends ${missing[*]}"
  sudo=""
  [ "$(id -u)" -eq 0 ] || sudo="sudo"
  command -v apt-get >/dev/null && { [ -z "$sudo" ] || command -v sudo >/dev/null; } ||
    fail "please install ${missing[*]} (on Debian or Ubuntu, as root: $install)"
  echo "setup.sh: installing ${missing[*]}"
  $sudo env DEBIAN_FRONTEND=noninteractive sh -c "apt-get update -qq && $install -qq" >/dev/null ||
    fail "this failed: $sudo $install"
fi

# ---- Python environment, filled again when what it must hold has changed

if ! build/venv/bin/python -c 'import pip' 2>/dev/null; then
  echo "setup.sh: making a Python environment in build/venv"
  python3 -m venv --clear build/venv
fi
install_requirements() {
  local lock="requirements/$1.txt" stamp="build/venv/$1.installed" count
  cmp -s "$lock" "$stamp" && return
  count=$(grep -c '^[[:alnum:]].*==' "$lock")
  echo "setup.sh: installing the $count packages of $lock into build/venv"
  requirements/install.sh "$lock" build/venv/bin/python || return 1
  cp "$lock" "$stamp"
}
for list in "${lists[@]}"; do
  install_requirements "$list"
done
# the wheel of Ecos has its programs without their run bits
for program in build/venv/lib/python3*/site-packages/ecospy/binaries/{ecos,proxyfmu}; do
  [ -x "$program" ] || chmod +x "$program"
done

# ---- sources, by an apt of this folder's own: nothing of them is installed

# use_apt TYPE SUITE: makes build/deps/apt, with the packages of this type from the machine's own
# mirror of Debian
use_apt() {
  local root="$PWD/build/deps/apt" mirror
  rm -rf "$root"
  mkdir -p "$root"/{parts,lists/partial,cache/archives/partial,got}
  mirror=$(apt-get indextargets 'Created-By: Packages' \
             --format '$(LABEL) $(COMPONENT) $(REPO_URI)' | awk '/^Debian main / { print $3; exit }')
  [ -n "$mirror" ] || return 1
  cat >"$root/parts/debian.sources" <<SOURCES
Types: $1
URIs: $mirror
Suites: $2
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg
SOURCES
  cat >"$root/apt.conf" <<CONF
Dir::Etc::sourcelist "/dev/null";
Dir::Etc::sourceparts "$root/parts";
Dir::State::lists "$root/lists";
Dir::Cache "$root/cache";
APT::Sandbox::User "";
Acquire::Languages "none";
#clear APT::Update::Pre-Invoke;
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
CONF
  apt-get -c "$root/apt.conf" update -qq
}

# known ARCHIVE SHA256
known() {
  echo "$2  $1" | sha256sum --check --status || { echo "setup.sh: $1 is not the known one" >&2; return 1; }
}

# get_sources NAME PACKAGE ARCHIVE SHA256 FOLDER PART ...: parts of a source package, which unpacks
# to FOLDER, become build/deps/NAME
get_sources() (
  cd build/deps/apt/got
  apt-get -c ../apt.conf source -qq --download-only --tar-only "$2" || return 1
  known "$3" "$4" || return 1
  cmake -E tar xf "$3" -- "${@:6}" || return 1
  rm -rf "../../$1"
  mv "$5" "../../$1"
)

# Debian 13 has Unity in a package; before, that package is unpacked here
get_unity() (
  cd build/deps/apt/got
  apt-get -c ../apt.conf download -qq cmock || return 1
  known cmock_*.deb 166e45090937251892363d10860b5e7aa5353d5553fde2cbaba514760ba3785e || return 1
  dpkg-deb -x cmock_*.deb . || return 1
  mkdir -p ../../unity && cp -r usr/share/cmock/vendor/unity/src ../../unity/
)

get_all_sources() {
  use_apt deb-src bookworm || return 1
  get_sources sundials sundials sundials_6.4.1+dfsg1.orig.tar.xz \
    c61157f1d4be06c704bea40cb131eb63ba2dada161989071604d0a0959cdf04a \
    sundials-6.4.1 sundials-6.4.1/{CMakeLists.txt,LICENSE,include,src} || return 1
  get_sources musl musl musl_1.2.3.orig.tar.gz \
    7d5b0b6062521e4627e099e4c9dc8248d32a30285e959b7eecaa780cf8cfd4a4 \
    musl-1.2.3 musl-1.2.3/{COPYRIGHT,VERSION,arch/generic,src/internal,src/math}
}

if [ ! -e build/deps/sundials/LICENSE ] || [ ! -e build/deps/musl/COPYRIGHT ]; then
  echo "setup.sh: fetching the sources of SUNDIALS and musl"
  get_all_sources ||
    echo "setup.sh: no packages with them here, CMake will fetch them from upstream"
fi
if has dev && [ ! -e build/deps/unity/src/unity.c ] &&
   [ ! -e /usr/share/cmock/vendor/unity/src/unity.c ]; then
  echo "setup.sh: fetching the Unity test framework"
  { use_apt deb trixie && get_unity; } ||
    echo "setup.sh: no package with Unity here, CMake will fetch it from upstream"
fi
rm -rf build/deps/apt
