#!/bin/sh
# Refuses a userparams.h that cannot work before anything is compiled with it, each mistake in one line.
#
#   tools/make/userparams.sh STAMP COMPILER [FLAG ...]
#
# Only the compiler reads the header, so all that it accepts is accepted: comments, expressions, macros, #ifdef, #include. Three steps, and
# the first that finds something ends it: names (defined twice, misspelt); then texts and values, which are the compiler's own messages of
# firmware/drive/param_text.c and param_check.c. If nothing is wrong, writes STAMP, and to STAMP.d what it depends on.
set -u
export LC_ALL=C

stamp=$1
shift
work=$(mktemp -d) || exit 2
trap 'rm -rf "$work"' EXIT

# compiler COMPILER FLAG ... <source: its messages go to a file
compiler() {
    "$@" 2>"$work/messages"
}

# Ends with the messages of the header's own checks; without one, with the compiler's first error and the parameter that it was met in.
refuse() {
    awk -F '\t' -v header="$header" -v compiler="$1" '
        FILENAME ~ /places$/ { place[$1] = $2; range[$1] = $3; next }
        match($0, /In function .(range|text)_of_[A-Z0-9_]+/) {
            name = substr($0, RSTART, RLENGTH)
            sub(/.*_of_/, "", name)
        }
        match($0, /error: userparams\.h: /) {
            text = substr($0, RSTART + RLENGTH)
            first = text
            sub(/ .*/, "", first)
            print "foc33: " (first in place ? place[first] : header) ": " text
            checked = 1
        }
        /error: / && other == "" {
            other = $0
            if (name in place) {
                sub(/.*error: /, "", other)
                other = place[name] ": " name " is no number (" other "): write one, " range[name]
            } else
                other = other ": correct it"
        }
        END {
            if (!checked)
                print "foc33: " (other != "" ? other : "the compiler cannot read " header ", " compiler ": it ended without a message, try it by hand")
        }' "$work/places" "$work/messages" >&2
    exit 2
}

: >"$work/places"
header=userparams.h
known='#include "drive/param_limits.h"
#include "drive/modes/mode_table.h"
#define PARAMETER(name, unit, min, max, ...) @parameter@#name@#min .. #max unit@
#define OTHER(name, ...) @other@#name@@
PARAM_TABLE(PARAMETER) PARAM_OPTIONAL(OTHER) MODE_TABLE(OTHER)'
echo "$known" | compiler "$@" -w -E -P -x c - >"$work/known" || refuse "$1"
echo '#include <userparams.h>' | compiler "$@" -w -E -dD -x c - >"$work/defined" || refuse "$1"
header=$(sed -n 's|^# 1 "\(\./\)\{0,1\}\(.*userparams\.h\)".*|\2|p' "$work/defined" | head -n 1)
command -v python3 >/dev/null || echo "foc33: no python3: a misspelt name in $header is not looked for" >&2
awk -v places="$work/places" -f tools/make/nearest.awk -f tools/make/userparams.awk "$work/known" "$work/defined" >&2 || exit 2

for source in param_text param_check; do
    compiler "$@" -w -MMD -MP -MF "$work/depends" -MT "$stamp" -c "firmware/drive/$source.c" -o "$work/object.o" || refuse "$1"
done
cp "$work/depends" "$stamp.d" && : >"$stamp"
