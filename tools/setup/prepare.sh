#!/bin/sh
# Finds what the named jobs need (compiler, python, ruby), installs what is missing from Debian's packages, and says what it installs.
#
#   tools/setup/prepare.sh run     compiler, Python 3.11 with numpy and matplotlib; if it can be had, dygraphs for the curves of a run's page
#   tools/setup/prepare.sh tune    the same, and openpyxl
#   tools/setup/prepare.sh target  the first, with pyelftools and intelhex
#   tools/setup/prepare.sh scope   the third, with pyserial
#   tools/setup/prepare.sh live    the same, aiohttp and tomlkit
#   tools/setup/prepare.sh test    all of that, pytest, and Ruby with gem
#
# Environment: CC (gcc), PYTHON (this interpreter and no other), RUBY (ruby), INSTALL=no (install nothing, say what is missing).
# Result: build/setup/python holds the interpreter's command. Without root, Python's modules may be
# in build/setup/venv: it is looked for first.
set -u
. tools/setup/install.sh

state=build/setup
log=$state/apt.log
venv=$state/venv
modules="numpy matplotlib"
python_packages="python3 python3-numpy python3-matplotlib python3-tqdm"

has_compiler() {
    echo '#include <stdio.h>' | ${CC:-gcc} -E - >/dev/null 2>&1 && command -v ar >/dev/null
}

# has_modules <python> <module>...: Python 3.11 or newer that can find all the modules
has_modules() {
    candidate=$1
    shift
    "$candidate" -c 'import sys
from importlib.util import find_spec
sys.exit(sys.version_info < (3, 11) or not all(map(find_spec, sys.argv[1:])))' "$@" >/dev/null 2>&1
}

# Prints the first interpreter with everything, else the first one that lacks only the progress bar.
find_python() {
    for extra in tqdm ""; do
        for candidate in ${PYTHON:-$venv/bin/python python3 /usr/bin/python3 python3.14 python3.13 python3.12 python3.11}; do
            # shellcheck disable=SC2086
            if has_modules "$candidate" $modules $extra; then
                echo "$candidate"
                return 0
            fi
        done
    done
    return 1
}

# As tools/bench/page.py looks for it.
has_dygraphs() {
    for file in /usr/share/javascript/dygraphs/dygraph.min.js $state/node_modules/dygraphs/dist/dygraph.min.js; do
        [ -f "$file" ] && return 0
    done
    return 1
}

has_ruby() {
    command -v "${RUBY:-ruby}" >/dev/null && command -v gem >/dev/null
}

# Sets `packages` to the Debian packages, `others` to those that only root can install, and `lacking` to the words for a reader.
look() {
    packages=""
    others=""
    lacking=""
    if ! has_compiler; then
        others="gcc libc6-dev binutils"
        lacking="a C compiler (${CC:-gcc})"
    fi
    if ! python=$(find_python); then
        packages="$python_packages"
        lacking="$lacking${lacking:+, }Python 3.11 or newer with $modules"
    fi
    if [ "$job" = test ] && ! has_ruby; then
        others="$others ruby"
        lacking="$lacking${lacking:+, }Ruby with gem"
    fi
    packages=$(echo $others $packages)
}

# How somebody who is not root gets what is missing; a compiler and Ruby are for the machine's owner to install.
without_root() {
    words=""
    [ "$packages" = "${others# }" ] || words="python3 -m venv $venv && $venv/bin/python -m pip install $pips tqdm"
    [ -z "$others" ] || words="${words:+$words; }ask whoever is root for ${others# }"
    echo "$words"
}

job=${1:-}
case $job in
    run) ;;
    tune | test)
        modules="$modules openpyxl"
        python_packages="$python_packages python3-openpyxl"
        ;;
    target | scope | live) ;;
    *) give_up "prepare.sh, '$job': name the job, run, live, scope, tune, target or test" ;;
esac

case $job in
    target | test | scope | live)
        modules="$modules elftools intelhex"
        python_packages="$python_packages python3-pyelftools python3-intelhex"
        ;;
esac
case $job in
    scope | live | test)
        modules="$modules serial"
        python_packages="$python_packages python3-serial"
        ;;
esac
case $job in
    live | test)
        modules="$modules aiohttp tomlkit"
        python_packages="$python_packages python3-aiohttp python3-tomlkit"
        ;;
esac

if [ "$job" = test ]; then
    modules="$modules pytest"
    python_packages="$python_packages python3-pytest"
fi

pips=$(echo "$modules" | sed 's/elftools/pyelftools/; s/serial/pyserial/') # names that pip knows

mkdir -p $state 2>/dev/null || give_up "set-up, $state: cannot be written, check the folder's permissions"
look
if [ -n "$packages" ]; then
    if [ -n "${PYTHON:-}" ] && ! find_python >/dev/null; then
        give_up "set-up, PYTHON=$PYTHON: is no Python 3.11 with $modules; install them for it (pip install $pips tqdm) or leave PYTHON away"
    fi
    debian "$log" "$lacking" "$packages" "$(without_root)"
    look
    [ -z "$packages" ] || give_up "set-up, still missing after the installation: $lacking: install it by hand and try again"
fi
# Tried once: without it a run's page has its tables only, and says what to do.
if ! has_dygraphs && [ ! -e $state/no-dygraphs ] && can_install; then
    echo "foc33: installing the Debian package libjs-dygraphs, for the curves of a run's page (log: $log)"
    logged "$log" "looking for packages" apt_get update
    logged "$log" "installing packages" apt_get install --no-install-recommends libjs-dygraphs || {
        touch $state/no-dygraphs
        echo "foc33: set-up, libjs-dygraphs: cannot be installed, see $log; pages show no curves" >&2
    }
fi
[ "$(cat $state/python 2>/dev/null)" = "$python" ] || echo "$python" >$state/python
