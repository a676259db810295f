#!/bin/sh
# Installs the Debian packages of a check if its commands are missing, and says so.
#
#   test/static/need.sh <command>=<package>...
set -u
. tools/setup/install.sh

packages=""
for pair in "$@"; do
    command -v "${pair%%=*}" >/dev/null || packages="$packages ${pair#*=}"
done
[ -n "$packages" ] || exit 0

mkdir -p build/setup
packages=$(echo $packages)
debian build/setup/apt-checks.log "tools of the checks" "$packages" "make test-quick, which needs none of them"
