#!/bin/sh
# Headless OpenGL needs libEGL, libGL and a Mesa driver. Installs what is missing (Debian, Ubuntu) when root,
# else prints the one line to run. PYTHON names the interpreter that is to be used (python3). A vendor's EGL
# driver, where present, is preferred at run time.
set -eu
PATH="$PATH:/usr/sbin:/sbin" # where ldconfig is, for users too

packages=""
have() { ldconfig -p 2>/dev/null | grep -q "$1"; }
have libEGL.so.1 || packages="$packages libegl1"
have libGL.so.1 || packages="$packages libgl1"
find /usr/lib /usr/lib64 -name 'swrast_dri.so' -o -name 'libgallium*.so' 2>/dev/null | grep -q . ||
    packages="$packages libegl-mesa0 libgl1-mesa-dri"
python="${PYTHON:-python3}"
"$python" -c 'import ensurepip' 2>/dev/null ||
    packages="$packages $("$python" -c 'import sys; print("python3.%d-venv" % sys.version_info[1])' || echo python3-venv)"
[ -n "$packages" ] || exit 0

if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "installing system packages:$packages"
    apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $packages >/dev/null
else
    echo "Missing system packages. Run this line, then the command again:" >&2
    echo "    sudo apt-get install -y$packages" >&2
    exit 2
fi
