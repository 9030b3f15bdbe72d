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

# MUMPS, the fast factorisation, for scripts/damjoint/fem/mumps.c. It uses the BLAS of the system,
# whose reference version is slow.
mumps_packages() {
  echo '#include <dmumps_c.h>
        int main(void) { return 0; }' | cc -x c - -ldmumps_seq -o /dev/null 2>/dev/null ||
    printf ' gcc libc6-dev libmumps-seq-dev'
  has libopenblas.so.0 || printf ' libopenblas0-pthread'
}
lacking=$(mumps_packages)
if [ -n "$lacking" ] && ! install $lacking >/dev/null 2>&1; then
  echo "setup: MUMPS is not installed; 3D runs take several times longer with SuperLU. On Debian or" \
       "Ubuntu type:  sudo apt-get install -y$lacking" >&2
fi

# The stamp is newer than its sources if everything below has succeeded.
if [ ! -x .venv/bin/python ] ||
   [ -z "$(find .venv/.stamp -newer pyproject.toml -newer scripts/setup.sh \
           -newer scripts/damjoint/fem/mumps.c 2>/dev/null)" ]; then
  # for weasyprint, which writes reports as PDF; not required
  has libpangoft2-1.0.so.0 || install libpangoft2-1.0-0 >/dev/null 2>&1 || true
  [ -x .venv/bin/python ] || "$python" -m venv .venv
  .venv/bin/pip install -q --disable-pip-version-check -e ".[test,docs,fast]"
  .venv/bin/python -c "from damjoint.fem import factor; factor.compile_into(factor.INSTALLED)"
  touch .venv/.stamp
fi
