#!/bin/sh
# Installs the Debian packages of a check if its commands, or modules of the set-up's Python, are missing, and says so.
#
#   test/static/need.sh <command>=<package>... module:<name>=<package>...
set -u
. tools/setup/install.sh

packages=""
for pair in "$@"; do
    name=${pair%%=*}
    case $name in
        module:*) "$(cat build/setup/python 2>/dev/null || echo python3)" -c "import ${name#module:}" 2>/dev/null ;;
        *) command -v "$name" >/dev/null ;;
    esac || packages="$packages ${pair#*=}"
done
[ -n "$packages" ] || exit 0

mkdir -p build/setup
packages=$(echo $packages)
debian build/setup/apt-checks.log "tools of the checks" "$packages" "make test-quick, which needs none of them"
