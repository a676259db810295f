# Sourced by the scripts that install something: they say what and how to do without root before they do it, and that they still run.
# INSTALL=no installs nothing: what is missing is then told, and the command ends.

beat_s=${FOC33_BEAT_S:-5}
beat_quiet=${FOC33_QUIET:-}

give_up() {
    echo "foc33: $1" >&2
    exit 2
}

# logged <log> <what> <command>...: runs the command into the log, and says now and then what it does. Its exit status.
logged() {
    log_file=$1
    log_title=$2
    shift 2
    : >>"$log_file"
    (
        passed=0
        while sleep "$beat_s" </dev/null >/dev/null 2>&1; do
            passed=$((passed + beat_s))
            [ -n "$beat_quiet" ] || echo "  $log_title: $passed s, $(tail -n 1 "$log_file" | cut -c 1-80)" >&2
        done
    ) &
    beat=$!
    "$@" >>"$log_file" 2>&1
    log_status=$?
    kill "$beat" 2>/dev/null
    wait "$beat" 2>/dev/null
    return "$log_status"
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    else
        sudo "$@"
    fi
}

apt_get() {
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=300 "$@"
}

can_install() {
    [ "${INSTALL:-yes}" != no ] || return 1
    command -v apt-get >/dev/null || return 1
    [ "$(id -u)" -eq 0 ] && return 0
    command -v sudo >/dev/null || return 1
    [ -t 0 ] || sudo -n true 2>/dev/null
}

# debian <log> <lacking> <packages> <how to do without root>: installs Debian packages, as root; ends the script if that cannot be.
debian() {
    can_install || give_up "set-up, missing: $2: as root: apt-get install $3; without root: $4"
    echo "foc33: installing Debian packages as root, a minute or two: $3 (log: $1)"
    echo "  without root instead: stop here (Ctrl-C), then $4"
    : >"$1"
    logged "$1" "looking for packages" apt_get update
    # shellcheck disable=SC2086
    logged "$1" "installing packages" apt_get install --no-install-recommends $3 ||
        give_up "set-up, apt-get install $3: failed ($(grep '^E:' "$1" | tail -n 1)); see $1, or without root: $4"
}
