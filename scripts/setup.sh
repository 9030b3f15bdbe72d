#!/bin/sh
# make setup: installs system packages, then the Python environment in .venv with the interpreter
# $PYTHON (default: that of .venv, or python3). Returns at once if everything is installed.
set -eu
cd "$(dirname "$0")/.."
PATH=$PATH:/usr/sbin:/sbin

fail() { echo "setup: $*" >&2; exit 1; }

if [ -n "${PYTHON:-}" ]; then python=$PYTHON
elif [ -x .venv/bin/python ]; then python=.venv/bin/python
else python=python3
fi
if command -v "$python" >/dev/null; then
  version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' ||
    fail "PYTHON = $python: must be Python 3.10 or newer, and is $version (PYTHON=python3.12 make setup)."
  # .venv made by another Python, or by one that the system has replaced since
  [ -d ".venv/lib/python$version" ] || rm -rf .venv
elif [ -n "${PYTHON:-}" ]; then fail "PYTHON = $PYTHON: must be a program that exists, or unset."
fi
debian=python${version:-3}  # the interpreter's Debian package: python3.12

# Missing software by its Debian packages: GetDP, libraries of the gmsh wheel, a fast BLAS for
# GetDP, venv.
missing=""
libraries=$(ldconfig -p 2>/dev/null || true)
has() { case $libraries in *"$1"*) ;; *) return 1 ;; esac; }
library() { has "$2" || missing="$missing $1"; }
if [ -n "${GETDP:-}" ]; then
  command -v "$GETDP" >/dev/null || fail "GETDP = $GETDP: must be a program that exists, or unset."
else
  command -v getdp >/dev/null || missing="$missing getdp"
  library libopenblas0-pthread libopenblas.so.0
fi
library libglu1-mesa libGLU.so.1
library libgl1 libGL.so.1
library libgomp1 libgomp.so.1
library libxcursor1 libXcursor.so.1
library libxinerama1 libXinerama.so.1
library libxft2 libXft.so.2
[ -x .venv/bin/python ] || "$python" -c "import ensurepip" 2>/dev/null ||
  missing="$missing $debian $debian-venv"

if [ "$(id -u)" = 0 ]; then as_root=""
elif sudo -n true 2>/dev/null; then as_root="sudo"
else as_root="none"
fi
command -v apt-get >/dev/null || as_root="none"
install() {
  [ "$as_root" != none ] && $as_root apt-get update -q &&
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$@"
}

if [ -n "$missing" ]; then
  [ "$as_root" != none ] ||
    fail "software is missing. On Debian or Ubuntu type:  sudo apt-get install -y$missing" \
         " (elsewhere install the same libraries, and GetDP >= 3.2 on the PATH or in GETDP);" \
         "then make setup again."
  install $missing
fi

# Packages that are missing to compile python-mumps, and OpenBLAS: MUMPS uses the BLAS of the
# system, whose reference version is slow.
mumps_packages() {
  [ -x .venv/bin/python ] && python=.venv/bin/python
  echo '#include <dmumps_c.h>
        int main(void) { return 0; }' | cc -x c - -ldmumps_seq -o /dev/null 2>/dev/null ||
    printf ' gcc libc6-dev libmumps-seq-dev'
  "$python" -c 'import os, sys, sysconfig
sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))' ||
    printf " $debian-dev"
  has libopenblas.so.0 || printf ' libopenblas0-pthread'
}
has_mumps() { .venv/bin/python -c "import mumps" 2>/dev/null; }

# The stamp is newer than its sources if everything below has succeeded, except MUMPS.
if [ -x .venv/bin/python ] &&
   [ -n "$(find .venv/.stamp -newer pyproject.toml -newer scripts/setup.sh 2>/dev/null)" ]; then
  # without MUMPS: try again once its packages are installed
  if [ -d .venv/lib/python*/site-packages/mumps ] || [ -e .venv/mumps.log ] ||
     [ -n "$(mumps_packages)" ]; then exit 0; fi
else
  [ -x .venv/bin/python ] || "$python" -m venv .venv
  .venv/bin/pip install -q --disable-pip-version-check -e ".[test,docs]"
fi

# MUMPS, the fast factorisation. Not from pip's cache: a build for another libmumps does not load.
# The build starts a script by `env python`, which Debian lacks and .venv has.
build() {
  PATH=$PWD/.venv/bin:$PATH \
    pip install -q --disable-pip-version-check "$@" >.venv/mumps.log 2>&1 && has_mumps
}
if ! has_mumps; then
  lacking=$(mumps_packages)
  if [ -n "$lacking" ] && install $lacking >/dev/null 2>&1; then lacking=""; fi
  if [ -z "$lacking" ] && build --no-cache-dir -e ".[fast]"; then :
  # the only wheel there is, for numpy 1
  elif [ -d .venv/lib/python3.11 ] &&
       build --only-binary python-mumps "python-mumps==0.0.2" "numpy<2"; then :
  else
    .venv/bin/pip uninstall -q -y python-mumps 2>/dev/null || true
    help="The error is in .venv/mumps.log; to try again, delete it and make setup."
    if [ -n "$lacking" ]; then
      help="On Debian or Ubuntu type:  sudo apt-get install -y$lacking  and make setup."
      rm -f .venv/mumps.log
    fi
    echo "setup: MUMPS is not installed; 3D runs take several times longer with SuperLU. $help" >&2
  fi
fi
touch .venv/.stamp
