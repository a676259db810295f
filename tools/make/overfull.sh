#!/bin/sh
# Says in one line by how many bytes an image does not fit the chip, and which of its options cost how much: it is linked once more for a larger chip.
#
#   tools/make/overfull.sh SCRIPT TEMPORARY FLAGS LINK ...
#
# TEMPORARY: stem of files to make. With MEASURE=1 the line is what the image takes, whether it fits or not.
# SCRIPT: the linker script of the chip; FLAGS: the file with the options of this build; LINK: command that takes -T. Exit code 1 if it is something else that does not link.
export LC_ALL=C
script=$1
wide=$2
flags=$3
shift 3
sed 's/^\( *program .*LENGTH *= *\)0x[0-9A-Fa-f]*/\10xFC00/' "$script" >"$wide.gld" || exit 1
room=$(sed -n 's/^ *program .*LENGTH *= *\(0x[0-9A-Fa-f]*\).*/\1/p' "$script")
first=yes
for word; do # in front of the command's first option
    shift
    case $first$word in yes-*)
        set -- "$@" -T "$wide.gld"
        first=
        ;;
    esac
    set -- "$@" "$word"
done
"$@" -o "$wide.elf" >"$wide.memory" 2>&1
ram=$(sed -n 's/.*"data" memory used (bytes): .*(\([0-9]*\)).*/\1/p' "$wide.memory")
used=$(sed -n 's/.*"program" memory used (bytes): .*(\([0-9]*\)).*/\1/p' "$wide.memory")
rm -f "$wide.elf" "$wide.gld"
[ -n "$used" ] && [ -n "$room" ] || exit 1
room=$((room * 3 / 2))
if [ "${MEASURE:-}" ]; then
    echo "flash $used, RAM $ram"
    exit 0
fi
[ "$used" -gt "$room" ] || exit 1
# A row of two options is the second one's, on top of the first.
costs=$(sed -n 's/^| `\([A-Z_]*\)`[ 0-9.]*\( (of [0-9-]*)\)\{0,1\} | +\([0-9]*\) | .*/\1 \3/p; s/^| `\([A-Z_]*\)`, `\([A-Z_]*\)`[ 0-9.]*\( (of [0-9-]*)\)\{0,1\} | +\([0-9]*\) | .*/\2 \4 \1/p' docs/results.md |
    awk 'NF == 3 { $2 -= cost[$3] } { cost[$1] = $2; print $1, $2 }' | while read -r name cost; do
    grep -qE -- "-D$name(=[1-9][0-9.]*)?( |$)|^ *# *define +$name +[1-9]" "$flags" && printf '%s' "${comma:-}$name $cost" && comma=', '
done)
echo "foc33: the image does not fit the chip: $used bytes of flash, there are $room, $((used - room)) too many: leave out an option${costs:+, of these $costs bytes} (docs/results.md, What an option costs)"
