#!/bin/sh
# Installs Unity and CMock, as the pinned ceedling gem carries them, into build/gems; nothing outside the project's folder changes.
#
#   tools/setup/gems.sh <version> <stamp file to write>
set -u

version=$1
stamp=$2
log=build/gems/install.log

mkdir -p build/gems
echo "foc33: installing the ceedling gem $version (Unity and CMock) into build/gems"
if ! gem install --install-dir build/gems --no-user-install --ignore-dependencies --no-document \
    ceedling -v "$version" >"$log" 2>&1; then
    echo "foc33: set-up, ceedling gem $version: cannot be installed ($(grep -m 1 ERROR "$log")); check the network, see $log" >&2
    exit 2
fi
touch "$stamp"
