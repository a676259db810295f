# The compiler's messages about userparams.h as lines for a user.
#
#   awk -F '\t' -v header=FILE -v compiler=NAME -v refused=FILE -v near=FILE -f messages.awk PLACES MESSAGES
#
# PLACES: name, file:line, range of each parameter that the header has; `refused`: the names that were told so far, to which new ones are added;
# `near`: missing names that were told with a misspelt one. Exit code: 0 the header's own checks have told what they found, 3 one parameter is
# no C and hides the others, 2 the header cannot be read.

function place_of(text,   word, count, words, i) {
    gsub(/[^A-Za-z0-9_]+/, " ", text)
    count = split(text, words, " ")
    for (i = 1; i <= count; i++)
        if (words[i] in place) return place[words[i]]
    return header
}

# Whether a relation may be told beside other mistakes: not if it needs the whole header, or names what is refused. An entry of 1/Kphi also needs what that
# is computed from.
function stands_alone(text,   count, words, i) {
    if (name ~ /relations_rest/) return 0
    if (name ~ /relations_entries/) text = text " NOPOLESPAIRS MOTOR_KPHI_V_PER_KRPM NOMINAL_BUS_V DEADTIME_SEC LOOPTIME_SEC MAXIMUM_SPEED_RPM INVKFI_SPEED0"
    gsub(/[^A-Za-z0-9_]+/, " ", text)
    count = split(text, words, " ")
    for (i = 1; i <= count; i++)
        if (words[i] in told) return 0
    return 1
}

BEGIN {
    while ((getline line < refused) > 0) told[line] = some = 1
    while ((getline line < near) > 0) told[line] = 1
    close(refused)
}
FILENAME ~ /places$/ { place[$1] = $2; range[$1] = $3; next }
match($0, /In function .(range|text|relations)_(of_)?[A-Za-z0-9_]+/) {
    name = substr($0, RSTART, RLENGTH)
    between = name ~ /relations_/
    sub(/.*_of_/, "", name)
}
match($0, /error: userparams\.h: /) {
    text = substr($0, RSTART + RLENGTH)
    first = text
    sub(/ .*/, "", first)
    checked = 1
    if (first in told || text in told || between && some && !stands_alone(text)) next
    lines[++count] = "foc33: " (first == name && !(first in place) ? header : place_of(text)) ": " text
    names[count] = between ? text : name
    next
}
/error: / && between && some { # a relation with a value that was told to be no number
    checked = 1
    next
}
/error: / && other == "" {
    other = $0
    other_name = name
}
END {
    if (other != "" && other_name in place && !(other_name in told)) {
        sub(/.*error: /, "", other)
        print "foc33: " place[other_name] ": " other_name " is no number (" other "): write one, " range[other_name]
        print other_name >>refused
        exit 3
    }
    if (other != "" || !checked) {
        print "foc33: " (other != "" ? other ": correct it" : "the compiler cannot read " header ", " compiler ": it ended without a message, try it by hand")
        exit 2
    }
    for (i = 1; i <= count; i++) {
        print lines[i]
        print names[i] >>refused
    }
}
