#!/bin/sh
# Refuses a userparams.h that cannot work before anything is compiled with it: every mistake in one build, each in one line.
#
#   tools/make/userparams.sh STAMP COMPILER [FLAG ...]
#
# Only the compiler reads the header, so all that it accepts is accepted: comments, expressions, macros, #ifdef, #include. Four steps: names
# (defined twice, misspelt); texts (firmware/drive/param_text.c); numbers inside them (literals.awk); values (param_check.c). For the steps
# that follow, what is refused is replaced by what was meant, or by the least value of its range, so that it hides no other mistake; how values fit each
# other is told where it needs none of the latter. If nothing is wrong, writes STAMP, and to STAMP.d what it depends on.
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

# The messages of the last compilation as lines for a user; adds the parameters to $work/refused. Exit code: messages.awk
tell() {
    awk -F '\t' -v header="$header" -v compiler="$1" -v refused="$work/refused" -v near="$work/near" -v meant="$work/meant" -v as_read="$work/as_read" -f tools/make/messages.awk \
        "$work/places" "$work/needs" "$work/messages" >&2
}

# unreadable COMPILER: ends where the compiler could not read the header; a file that begins as UTF-16 does is called so.
unreadable() {
    file=$(tr -d '\000' <"$work/messages" | sed -n 's/\(userparams\.h\):[0-9].*/\1/p' | sed -n '/^In file/!{p;q;}')
    begin=$( (head -c 2 "$file" | od -An -tx1) 2>/dev/null)
    case $begin in
        *fe* | *ff* | *00*) echo "foc33: $file is UTF-16: save it as UTF-8" >&2 ;;
        *) tell "$1" ;;
    esac
    exit 2
}

# What each relation needs, in the order in which param_check.c counts them: a line of names each. They stay names in a header that gives each itself.
needs() {
    mkdir -p "$work/replaced"
    cut -f 1 "$work/places" | sed 's/.*/#define & &/' >"$work/replaced/userparams.h"
    echo "$relations" | "$@" -w -E -P -x c - 2>/dev/null | tr '\n@' ' \n' | sed '1d; s/"[^"]*"/ /g; s/[^A-Za-z0-9_]\{1,\}/ /g' >"$work/needs"
}

# A userparams.h that takes the user's and replaces what is refused; what is no parameter is left out.
replace() {
    mkdir -p "$work/replaced"
    {
        printf '#pragma GCC system_header\n#include_next <userparams.h>\n'
        sed -n 's/^[A-Z_0-9]*$/#undef &/p' "$work/refused"
        awk -F '\t' 'FILENAME ~ /refused$/ { refused[$1] = 1; next } $1 in refused { printf "#define %s %s\n", $1, $2; delete refused[$1] }' \
            "$work/refused" "$work/meant" "$work/least"
    } >"$work/replaced/userparams.h"
}

# checked SOURCE COMPILER FLAG ...: compiles one check, again where one value kept the compiler from looking at the others
checked() {
    source=$1
    shift
    until [ -s "$work/refused" ] && replace || rm -f "$work/replaced/userparams.h"
        compiler "$@" -w -MMD -MP -MF "$work/depends" -MT "$stamp" -c "$source" -o "$work/object.o"; do
        before=$(wc -l <"$work/refused")
        [ -s "$work/needs" ] || needs "$@"
        tell "$1"
        case $? in
            0) break ;;                                                    # the header's own checks have told all that they find
            3) [ "$(wc -l <"$work/refused")" -gt "$before" ] || exit 2 ;; # one value that is no C: the others come next
            *) exit 2 ;;
        esac
    done
}

: >"$work/places"
: >"$work/refused"
: >"$work/near"
: >"$work/foreign"
: >"$work/needs"
: >"$work/meant"
: >"$work/as_read"
: >"$work/optional"
header=userparams.h
known='#include "drive/param_limits.h"
#include "drive/modes/mode_table.h"
#define PARAMETER(name, unit, min, max, ...) @parameter@#name@#min .. #max unit@
#define OTHER(name, ...) @other@#name@@
PARAM_TABLE(PARAMETER) PARAM_OPTIONAL(OTHER) MODE_TABLE(OTHER)'
relations='#include "drive/modes/mode_table.h"
#include "drive/param_limits.h"
#include "drive/param_scaling.h"
#define NEEDS(condition, ...) @ condition
PARAM_RELATION_ALONE(NEEDS) PARAM_RELATION_SPEEDS(NEEDS) PARAM_RELATION_CURRENTS(NEEDS) PARAM_RELATION_BUS(NEEDS) MODE_RELATION_TABLE(NEEDS)
PARAM_RELATION_REST(NEEDS) PARAM_RELATION_ENTRIES(NEEDS)'
echo "$known" | compiler "$@" -w -E -P -x c - >"$work/known" || unreadable "$1"
echo '#include <userparams.h>' | compiler "$@" -w -E -dD -x c - >"$work/defined" || unreadable "$1"
# The file that the user knows: of a copy, the one that its #line names.
header=$(awk '/^# 1 ".*userparams\.h"/ {
    name = $0
    while ((getline) > 0 && $0 == "") continue
    if (/^# 1 ".*userparams\.h" *$/) name = $0
    sub(/^# 1 "(\.\/)?/, "", name)
    sub(/".*/, "", name)
    print name
    exit
}' "$work/defined")
command -v python3 >/dev/null || echo "foc33: no python3: a misspelt name in $header is not looked for" >&2
awk -v places="$work/places" -v refused="$work/refused" -v near="$work/near" -v least="$work/least" -v optional="$work/optional" -v foreign="$work/foreign" \
    -f tools/make/nearest.awk -f tools/make/userparams.awk \
    "$work/known" "$work/defined" >&2 || exit 2 # a header of AN1292

# The replaced header comes before the user's: in front of the compiler's first option.
first=yes
for word; do
    shift
    case $first$word in yes-*)
        set -- "$@" "-I$work/replaced"
        first=
        ;;
    esac
    set -- "$@" "$word"
done

checked firmware/drive/param_text.c "$@"
awk -F '\t' -v refused="$work/refused" 'FILENAME ~ /refused$/ { told[$1] = 1; next } !($1 in told) { print "foc33: " $2; print $1 >>refused }' \
    "$work/refused" "$work/foreign" >&2
{
    printf '#include <userparams.h>\n'
    cut -f 1 "$work/least" "$work/optional" | sed 's/.*/"&" &/'
} | compiler "$@" -w -E -P -x c - | awk -v refused="$work/refused" -v as_read="$work/as_read" -f tools/make/literals.awk >"$work/literals.c"
checked "$work/literals.c" "$@"
checked firmware/drive/param_check.c "$@" -DOR_ELSE=
[ ! -s "$work/refused" ] || checked firmware/drive/param_check.c "$@" -DOR_ELSE= # what a value out of its range has kept back
[ ! -s "$work/refused" ] || exit 2
cp "$work/depends" "$stamp.d" && : >"$stamp"
