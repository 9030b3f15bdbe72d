#!/bin/sh
# make setup: system packages, then the Python environment in .venv. With nothing to do it takes no time.
set -eu
cd "$(dirname "$0")/.."
PATH=$PATH:/usr/sbin:/sbin

# What is missing, under its Debian name: GetDP, what the gmsh wheel links to, a fast BLAS for GetDP, venv.
missing=""
libraries=$(ldconfig -p 2>/dev/null || true)
library() { case $libraries in *"$2"*) ;; *) missing="$missing $1" ;; esac; }
if [ -n "${GETDP:-}" ]; then
  command -v "$GETDP" >/dev/null || { echo "setup: GETDP = $GETDP: no such program; correct or unset it." >&2; exit 1; }
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
[ -x .venv/bin/python ] || python3 -c "import ensurepip" 2>/dev/null || missing="$missing python3 python3-venv"

if [ -n "$missing" ]; then
  if [ "$(id -u)" = 0 ]; then as_root=""
  elif sudo -n true 2>/dev/null; then as_root="sudo"
  else as_root="none"
  fi
  if [ "$as_root" = none ] || ! command -v apt-get >/dev/null; then
    echo "setup: missing software. On Debian or Ubuntu type:  sudo apt-get install -y$missing" \
         " (elsewhere: the same libraries, and GetDP >= 3.2 on the PATH or in GETDP); then make setup again." >&2
    exit 1
  fi
  $as_root apt-get update -q
  $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $missing
fi

# The stamp is newer than all it depends on once everything below has succeeded.
if [ -n "$(find .venv/.stamp -newer pyproject.toml -newer scripts/setup.sh 2>/dev/null)" ]; then exit 0; fi
python3 -m venv .venv
.venv/bin/pip install -q --disable-pip-version-check -e ".[test]"
touch .venv/.stamp
