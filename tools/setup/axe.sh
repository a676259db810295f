#!/bin/sh
# Installs axe-core, which looks for what keeps somebody from using a page, at a pinned version into build/setup; nothing outside the project's folder changes.
#
#   tools/setup/axe.sh <version> <file to write>
set -u
. tools/setup/install.sh

version=$1
file=$2
log=build/setup/axe.log
folder=build/setup/axe.$$

mkdir -p "$folder"
trap 'rm -rf "$folder"' EXIT
[ "${INSTALL:-yes}" != no ] || \
    give_up "set-up, missing: axe-core $version: leave INSTALL=no away, it goes into build/setup and needs no root"
echo "foc33: installing axe-core $version into build/setup; no root is needed"
: >"$log"
if ! logged "$log" "installing axe-core" npm install --prefix "$folder" --no-save --ignore-scripts --no-audit --no-fund "axe-core@$version"; then
    give_up "set-up, axe-core $version: cannot be installed ($(grep -m 1 'npm ERR!\|npm error' "$log")); check the network, see $log"
fi
rm -f build/setup/axe-core-*.js
mv -f "$folder/node_modules/axe-core/axe.min.js" "$file"
