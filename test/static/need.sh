#!/bin/sh
# Installs the Debian packages of a check if its commands are missing, and says so.
#
#   test/static/need.sh <command>=<package>...
set -u

packages=""
for pair in "$@"; do
    command -v "${pair%%=*}" >/dev/null || packages="$packages ${pair#*=}"
done
[ -n "$packages" ] || exit 0

as_root=""
[ "$(id -u)" -eq 0 ] || as_root=sudo
log=build/setup/apt-checks.log
mkdir -p build/setup
echo "foc33: installing Debian packages:$packages (log: $log)"
install() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=300 "$@" >>"$log" 2>&1
}
# shellcheck disable=SC2086
if ! { install update && install install --no-install-recommends $packages; }; then
    echo "foc33: set-up, apt-get install$packages: failed; see $log, install them by hand" >&2
    exit 2
fi
