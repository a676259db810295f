#!/bin/sh
# Says in one line if nothing can be written where a build writes: build/, and the folder of the compiler's temporary files. Silent if all is well.
#
#   tools/make/room.sh
#
# A build takes some 10 MiB: with less than 8 free it ends in the words of a shell, a compiler or an assembler.
export LC_ALL=C
least_kb=8192

# probed FOLDER: whether a file can be made and filled there, whatever it is that forbids it
probed() {
    probe=$1/.room-$$
    reason=$( (: >"$probe") 2>&1) || return 1
    command -v head >/dev/null || return 0
    reason=$(head -c 65536 /dev/zero 2>&1 >"$probe") || {
        rm -f "$probe"
        return 1
    }
    rm -f "$probe"
}

for folder in build "${TMPDIR:-/tmp}"; do
    place=$folder
    [ -d "$place" ] || place=.
    if ! probed "$place"; then
        reason=${reason##*: }
        [ "$folder" = build ] && folder="build, $PWD" || folder="temporary files, TMPDIR=$folder"
        echo "foc33: cannot write $folder (${reason:-write error}): free some space or make the folder writable"
        exit 1
    fi
    free_kb=$(df -Pk "$place" 2>/dev/null | awk 'NR == 2 { print $4 }')
    if [ "${free_kb:-$least_kb}" -lt "$least_kb" ]; then
        [ "$folder" = build ] && folder="build, $PWD" || folder="temporary files, TMPDIR=$folder"
        echo "foc33: the disk of $folder has only $free_kb KiB free: free at least $((least_kb / 1024)) MiB"
        exit 1
    fi
done
