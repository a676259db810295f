#!/bin/sh
# Compiles an application, and refuses one that reaches into the drive: app.sh OBJECT SOURCE SHOWN NM COMPILE... It may include app/ and the compiler's
# own headers, and call what app.h has; long divisions and floats call the compiler's own helpers.
set -e
object=$1 source=$2 shown=$3 nm=$4
shift 4
helpers='^__(gcov|ubsan|asan|sanitizer|cyg)_|^_*(u?div|u?mod|mul|ashl|ashr|lshr|add|sub|neg|eq|ne|lt|le|gt|ge|cmp|ucmp|fix|fixuns|float|floatun|extend|trunc)[a-z]*[shdtq][if]+[shdtq]?[if]?[0-9]?$'
allowed='button_pressed app_rpm_of app_share app_may_pass app_between app_lights app_line_is_right app_line_is app_line_number app_line_put app_line_put_number app_line_put_fault app_line_end memcpy memset memmove _memcpy _memset _memmove GLOBAL_OFFSET_TABLE_'

if ! tr -d '\000' <"$source" | cmp -s - "$source"; then
    echo "foc33: $shown is UTF-16: save it as UTF-8" >&2
    exit 2
fi
first=$(grep -n '^ *# *include' "$source" | grep -vE '"app/[a-z_]+\.h"|<(stdint|stdbool|stddef|limits)\.h>' | head -n 1 || true)
if [ -n "$first" ]; then
    echo "foc33: ${first#*:} in $shown: an application sees app/ alone; what it may know and ask is in include/app/app.h" >&2
    exit 2
fi
for hook in app_init app_ms; do
    grep -qE "^ *void +$hook *\(" "$source" && continue
    line=$(grep -nE "^[ a-z0-9_]*[ *]$hook *\(" "$source" | head -n 1 || true)
    [ -z "$line" ] || { echo "foc33: ${line#*:} in $shown, line ${line%%:*}: write void $hook( as include/app/app.h has it" >&2; exit 2; }
    echo "foc33: no $hook() in $shown: an application has app_init() and app_ms() (include/app/app.h)" >&2
    exit 2
done
"$@" -Werror -c "$source" -o "$object" # as for the chip: what turns on the PC does not fail there
listed=${object%.o}.d
[ ! -f "$listed" ] || printf '%s:\n' "$source" >>"$listed" # an application that has another name now is no rule to miss
for name in $("$nm" -u "$object" | sed 's/.* //'); do
    case " $allowed " in
    *" ${name#_} "*) ;;
    *) printf '%s\n' "$name" | grep -qE "$helpers" && continue
       echo "foc33: ${name#_} in $shown: an application reaches nothing but what include/app/app.h has" >&2; rm -f "$object"; exit 2 ;;
    esac
done
