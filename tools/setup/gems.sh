#!/bin/sh
# Installs Unity and CMock, as the pinned ceedling gem carries them, into build/gems; nothing outside the project's folder changes.
#
#   tools/setup/gems.sh <version> <stamp file to write>
set -u
. tools/setup/install.sh

version=$1
stamp=$2
log=build/gems/install.log

mkdir -p build/gems
[ "${INSTALL:-yes}" != no ] || \
    give_up "set-up, missing: the ceedling gem $version: leave INSTALL=no away, it goes into build/gems and needs no root"
echo "foc33: installing the ceedling gem $version (Unity and CMock) into build/gems; no root is needed"
: >"$log"
if ! logged "$log" "installing the gem" gem install --install-dir build/gems --no-user-install --ignore-dependencies --no-document \
    ceedling -v "$version"; then
    give_up "set-up, ceedling gem $version: cannot be installed ($(grep -m 1 ERROR "$log")); check the network, see $log"
fi
touch "$stamp"
