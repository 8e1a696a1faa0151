#!/usr/bin/env bash
# Installs what a lock file names into the environment of a Python, by uv of build/venv: pip, which takes
# five times as long, does it where uv cannot be installed or does not reach the packages.
#   requirements/install.sh LOCK PYTHON
set -euo pipefail
lock=$(realpath "$1") python=$2
cd "$(dirname "${BASH_SOURCE[0]}")/.."
own=build/venv/bin/python

pip() {
  "$1" -c 'import pip' 2>/dev/null || "$1" -m ensurepip >/dev/null
  "$1" -m pip install --quiet --disable-pip-version-check --require-hashes -r "$2"
}

if [ ! -x build/venv/bin/uv ]; then
  sed -n '/^uv==/,/[^\\]$/p' requirements/dev.txt >build/venv/uv.txt
  pip "$own" build/venv/uv.txt 2>/dev/null || true
fi
# it does not read pip's settings
index=${PIP_INDEX_URL-$("$own" -m pip config get global.index-url 2>/dev/null || true)}
[ -x build/venv/bin/uv ] &&
  build/venv/bin/uv pip install --quiet --no-cache ${index:+--default-index "$index"} \
    --python "$python" --require-hashes -r "$lock" 2>build/venv/uv.log ||
  pip "$python" "$lock"
